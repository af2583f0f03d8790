# SPDX-License-Identifier: MIT
"""The image's parameter memory, called from outside."""

from __future__ import annotations

import struct

from emulated_teensy.machine import Machine, Stop

_DATA, _DATA_SIZE = 0x20000000, 0x40000
_BYTES_IN, _BYTES_OUT = 0x20250000, 0x20258000
"""In the 512 KB that the image leaves to its heap, which it does not use."""
_BACKGROUND_s = 0.002
"""Between two calls the background runs, else nobody feeds the watchdog."""


class ImageLog:
    """The FlashLog inside a running image."""

    def __init__(self, machine: Machine) -> None:
        self._machine = machine
        table = machine.address_of("_ZTVN4omni8FlashLogE") + 8
        words = struct.unpack(f"<{_DATA_SIZE // 4}I", machine.read(_DATA, _DATA_SIZE))
        (self._log,) = (_DATA + 4 * at for at, word in enumerate(words) if word == table)

    def save(self, offset: int, data: bytes) -> bool:
        """Store bytes; return whether the image says it worked."""
        self._machine.write(_BYTES_IN, data)
        return bool(self._call("_ZN4omni8FlashLog5writeEjPKhj", offset, _BYTES_IN, len(data)) & 1)

    def load(self, offset: int, count: int) -> bytes:
        """Return stored bytes as the image keeps them in RAM."""
        self._call("_ZN4omni8FlashLog4readEjPhj", offset, _BYTES_OUT, count)
        return self._machine.read(_BYTES_OUT, count)

    def find_again(self) -> None:
        """Read everything from flash memory as after a start."""
        self._call("_ZN4omni8FlashLog5beginEv")

    def _call(self, function: str, *arguments: int) -> int:
        result = self._machine.call(function, (self._log, *arguments), limit_s=20)
        if self._machine.run(_BACKGROUND_s) != Stop.TIME:
            raise AssertionError(self._machine.why)
        return result
