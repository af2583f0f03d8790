# SPDX-License-Identifier: MIT
"""The emulated Teensy 4.0: a machine that runs the very image which is flashed (``emulated_teensy/rt1062.h``).

::

    image = read_image(".pio/build/three_wheel/firmware.elf")
    with Machine(image, wiring=wiring_of(robot), world=World(world_config(robot))) as machine:
        machine.power_on()
        machine.run(1.0)
        print(machine.findings())
"""

from __future__ import annotations

import importlib.util
from collections.abc import Sequence
from dataclasses import dataclass
from enum import IntEnum
from pathlib import Path
from types import TracebackType
from typing import Any, Protocol, TypeVar

from emulated_teensy.i2c_wave import Edge, edges_of
from emulated_teensy.image_file import EXTRA_HINT, FLASH_SIZE, Image, Place
from omniwheel._core import ffi, lib
from omniwheel.errors import FirmwareImageError, MissingPackageError

NS_PER_S = 1_000_000_000
PROGRAM_COUNTER = 15
MAIN_LOOP = "_ZN4omni3App10backgroundEv"
STACK_END = "_ebss"
"""The stack grows down to the end of the variables (Teensyduino's linker script)."""
STORAGE_BEGIN = 0x1F0000
STORAGE_SIZE = 60 * 1024
"""Where flash memory keeps parameters: the part that Teensyduino reserves for its EEPROM emulation."""
_NO_PIN = lib.RT1062_NO_PIN


class Channel(IntEnum):
    """A link of the board."""

    USB = lib.RT1062_USB
    UART = lib.RT1062_UART


class Stop(IntEnum):
    """Why a run ended; ``rt1062_stop_t`` says what each means."""

    TIME = lib.RT1062_STOP_TIME
    BREAK = lib.RT1062_STOP_BREAK
    OUTPUT = lib.RT1062_STOP_OUTPUT
    RESET = lib.RT1062_STOP_RESET
    POWER = lib.RT1062_STOP_POWER
    UPLOAD = lib.RT1062_STOP_UPLOAD
    REFUSED = lib.RT1062_STOP_REFUSED


class FindingKind(IntEnum):
    """What a finding is about; ``rt1062_finding_kind_t`` says what each means."""

    FAULT = lib.RT1062_FINDING_FAULT
    DEVICE_WIDTH = lib.RT1062_FINDING_DEVICE_WIDTH
    FLASH = lib.RT1062_FINDING_FLASH
    WATCHDOG = lib.RT1062_FINDING_WATCHDOG
    STORM = lib.RT1062_FINDING_STORM
    PINS = lib.RT1062_FINDING_PINS
    CLOCK = lib.RT1062_FINDING_CLOCK
    STACK = lib.RT1062_FINDING_STACK


@dataclass(frozen=True)
class Finding:
    """Something that a robot's program must not do, with the first place and time at which it did."""

    kind: FindingKind
    text: str
    pc: int
    address: int
    count: int
    time_s: float
    place: Place | None

    def __str__(self) -> str:
        where = f"{self.place}" if self.place is not None else f"{self.pc:#010x}"
        times = f", {self.count} times" if self.count > 1 else ""
        return f"{self.text}, in {where}, {self.time_s:.6f} s after power-on{times}"


@dataclass(frozen=True)
class Wiring:
    """Which Teensy pins are connected to what in the circuit; None: nothing."""

    encoder_pins: tuple[tuple[int, int], ...] = ()
    """A and B of each encoder, at most ``RT1062_ENCODERS``."""
    output_enable_pin: int | None = None
    stop_button_pin: int | None = None
    battery_pin: int | None = None
    battery_divider: float = 1.0
    """V of the battery per V at the pin."""
    pwm_pins: tuple[int, ...] = ()
    """Pins whose duty the circuit gets, at most ``RT1062_PWM_PINS``."""


NOTHING_WIRED = Wiring()


class Circuit(Protocol):
    """What is around the chip (``rt1062_circuit_t``)."""

    def attach(self, machine_c: Any) -> None:
        """Connect it to a machine by ``rt1062_attach``; it must live as long as that."""


@dataclass(frozen=True)
class Options:
    """How the machine runs: see ``rt1062_config_t``."""

    instruction_ns: int = 10
    exact: bool = False
    strict: bool = True
    words: bool = False
    seed: int = 1
    pause_ns: int = 200_000
    """Added to each pass of the program's main loop, so that waiting costs few instructions; 0: none."""


def unicorn_library() -> Path:
    """Return the shared library of the package ``unicorn``. Raises MissingPackageError."""
    spec = importlib.util.find_spec("unicorn")
    if spec is None or spec.origin is None:
        raise MissingPackageError("running a firmware image needs the processor emulator unicorn", hint=EXTRA_HINT)
    folder = Path(spec.origin).parent
    for pattern in ("lib/libunicorn*.so*", "lib/libunicorn*.dylib", "lib/unicorn*.dll"):
        for path in sorted(folder.glob(pattern)):
            return path
    raise MissingPackageError(f"the package unicorn in {folder} brings no shared library", hint=EXTRA_HINT)


DEFAULT_OPTIONS = Options()
MachineT = TypeVar("MachineT", bound="Machine")


class Machine:
    """An i.MX RT1062 as on a Teensy 4.0, with one image in its flash memory; a context manager that frees it.

    ``wiring`` gives the pins of the circuit, which is stepped with the chip's time. Times are seconds since power-on.
    Raises FirmwareImageError and MissingPackageError.
    """

    def __init__(
        self,
        image: Image,
        *,
        wiring: Wiring = NOTHING_WIRED,
        circuit: Circuit | None = None,
        options: Options = DEFAULT_OPTIONS,
    ) -> None:
        self.image = image
        why = ffi.new("char[]", lib.RT1062_TEXT)
        self._c = lib.rt1062_new(str(unicorn_library()).encode(), chip_config(wiring, options), why, len(why))
        if self._c == ffi.NULL:
            raise FirmwareImageError(f"the emulated chip cannot be made: {_text(why)}")
        self._before: list[Finding] = []
        self._chunk = ffi.new("uint8_t[]", lib.RT1062_OUTPUT_SIZE)
        self.flash[: len(image.flash)] = image.flash
        if MAIN_LOOP in image.symbols:
            lib.rt1062_pace(self._c, image.symbols[MAIN_LOOP], options.pause_ns)
        if STACK_END in image.symbols:
            lib.rt1062_stack_end(self._c, image.symbols[STACK_END])
        self._circuit = circuit
        if circuit is not None:
            circuit.attach(self._c)

    def __enter__(self: MachineT) -> MachineT:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        self.close()

    def close(self) -> None:
        """Free it; harmless when it is."""
        if self._c != ffi.NULL:
            lib.rt1062_free(self._c)
            self._c = ffi.NULL

    @property
    def flash(self) -> Any:
        """Flash memory, a buffer to read and write at will."""
        return ffi.buffer(lib.rt1062_flash(self._c), FLASH_SIZE)

    @property
    def storage(self) -> bytes:
        """The part of flash memory that keeps parameters over restarts."""
        return bytes(self.flash[STORAGE_BEGIN : STORAGE_BEGIN + STORAGE_SIZE])

    @storage.setter
    def storage(self, content: bytes) -> None:
        if len(content) != STORAGE_SIZE:
            raise ValueError(f"{len(content)} bytes do not fit the parameter memory of {STORAGE_SIZE}")
        self.flash[STORAGE_BEGIN : STORAGE_BEGIN + STORAGE_SIZE] = content

    # ---- running

    def power_on(self) -> None:
        """Switch the power on: RAM is noise, the boot ROM starts the image. Raises FirmwareImageError."""
        if not lib.rt1062_power_on(self._c):
            raise FirmwareImageError(f"{self.image.path}: {self.why}")

    def run(self, duration_s: float) -> Stop:
        """Run for some time, or until something else stops it."""
        return self.run_until_ns(int(lib.rt1062_time_ns(self._c)) + round(duration_s * NS_PER_S))

    def run_until_ns(self, until_ns: int) -> Stop:
        """Run until this many nanoseconds after power-on, or until something else stops it."""
        return Stop(lib.rt1062_run(self._c, until_ns))

    @property
    def powered(self) -> bool:
        """Whether the power is on."""
        return bool(lib.rt1062_powered(self._c))

    @property
    def time_s(self) -> float:
        """Time since power-on."""
        return self.time_ns / NS_PER_S

    @property
    def time_ns(self) -> int:
        """Nanoseconds since power-on."""
        return int(lib.rt1062_time_ns(self._c))

    @property
    def instructions(self) -> int:
        """Instructions executed since power-on."""
        return int(lib.rt1062_instructions(self._c))

    @property
    def why(self) -> str:
        """Why the last run ended, with the place in the program it ended at."""
        said = _text(lib.rt1062_why(self._c))
        place = self.place
        return f"{said} (in {place})" if said and place is not None else said

    @property
    def stack_left(self) -> int:
        """Least bytes that were left of the stack whenever an interrupt came; larger than the stack if unknown."""
        return int(lib.rt1062_stack_left(self._c))

    def stop_on(self, *stops: Stop) -> None:
        """Choose which of BREAK, OUTPUT and RESET end a run; the others always do."""
        lib.rt1062_stop_on(self._c, sum(1 << stop for stop in stops))

    def break_at(self, function: str | int) -> None:
        """Stop before a function's first instruction, or before the one at an address. Raises FirmwareImageError."""
        if not lib.rt1062_break(self._c, self.address_of(function)):
            raise FirmwareImageError("too many break points: clear_breaks() forgets them")

    def clear_breaks(self) -> None:
        """Forget all break points."""
        lib.rt1062_break(self._c, 0)

    # ---- looking inside

    def address_of(self, symbol: str | int) -> int:
        """Return a symbol's address, without the bit that says Thumb. Raises FirmwareImageError."""
        if isinstance(symbol, int):
            return symbol & ~1
        if symbol not in self.image.symbols:
            raise FirmwareImageError(f"{self.image.path} has no symbol {symbol}: must be an ELF file with symbols")
        address = self.image.symbols[symbol]
        return address & ~1 if any(name == symbol for _, _, name in self.image.functions) else address

    def register(self, number: int) -> int:
        """Return r0 to r15; 16 is xPSR."""
        return int(lib.rt1062_register(self._c, number))

    @property
    def place(self) -> Place | None:
        """Where in the program the processor is."""
        return self.image.place(self.register(PROGRAM_COUNTER))

    def read(self, address: int, count: int) -> bytes:
        """Read memory, not registers. Raises ValueError."""
        data = ffi.new("uint8_t[]", count)
        if not lib.rt1062_read(self._c, address, data, count):
            raise ValueError(f"{count} bytes at {address:#010x} are partly outside memory")
        return bytes(data)

    def write(self, address: int, data: bytes) -> None:
        """Write memory, not registers. Raises ValueError."""
        if not lib.rt1062_write(self._c, address, data, len(data)):
            raise ValueError(f"{len(data)} bytes at {address:#010x} are partly outside memory")

    def write_register(self, address: int, value: int) -> None:
        """Write a 32-bit register as the processor does. Raises ValueError."""
        if not lib.rt1062_bus_write(self._c, address, 4, value):
            raise ValueError(f"the register at {address:#010x} is not modelled: {self.why}")

    def read_register(self, address: int, size: int = 4) -> int:
        """Return a peripheral's or the processor's register of 1, 2 or 4 bytes as the program would read it."""
        return int(lib.rt1062_bus_read(self._c, address, size))

    def call(self, function: str | int, arguments: Sequence[int] = (), *, limit_s: float = 1.0) -> int:
        """Call a function of the image from its background, with at most four integers; return its result.

        Interrupts go on meanwhile. Raises FirmwareImageError if it does not return within ``limit_s``.
        """
        result = self.attempt(function, arguments, limit_s=limit_s)
        if isinstance(result, Stop):
            raise FirmwareImageError(f"{function} did not return: {result.name} {self.why}")
        return result

    def attempt(self, function: str | int, arguments: Sequence[int] = (), *, limit_s: float = 1.0) -> int | Stop:
        """Call a function as :meth:`call` does; return its result, or why it did not return."""
        result = ffi.new("uint32_t *")
        words = ffi.new("uint32_t[4]", [argument & 0xFFFFFFFF for argument in arguments])
        limit_ns = round(limit_s * NS_PER_S)
        stop = Stop(lib.rt1062_call(self._c, self.address_of(function), words, limit_ns, result))
        return int(result[0]) if stop == Stop.TIME else stop

    def findings(self) -> list[Finding]:
        """Return what was seen that a robot's program must not do, in the order of the first time."""
        return [self._finding(lib.rt1062_finding(self._c, number)) for number in range(lib.rt1062_findings(self._c))]

    def _finding(self, c: Any) -> Finding:
        place = self.image.place(int(c.pc))
        time_s = int(c.time_ns) / NS_PER_S
        return Finding(FindingKind(c.kind), _text(c.text), int(c.pc), int(c.address), int(c.count), time_s, place)

    def all_findings(self) -> list[Finding]:
        """Return the same with what was seen before the machine was set back."""
        now = self.findings()
        known = {(finding.kind, finding.pc, finding.text) for finding in now}
        return [finding for finding in self._before if (finding.kind, finding.pc, finding.text) not in known] + now

    def forget_findings(self) -> None:
        """Begin a new list."""
        lib.rt1062_forget_findings(self._c)
        self._before = []

    def snapshot(self) -> Snapshot:
        """Copy the whole machine with the state of its circuit. Raises MemoryError."""
        return Snapshot(self._c)

    def restore(self, snapshot: Snapshot) -> None:
        """Go back to a snapshot of this machine; :meth:`all_findings` remembers."""
        self._before = self.all_findings()
        lib.rt1062_restore(self._c, snapshot.c)

    # ---- links and pins

    def send(self, channel: Channel, data: bytes) -> int:
        """Give bytes to a link; return how many it took."""
        return int(lib.rt1062_send(self._c, channel, data, len(data)))

    def receive(self, channel: Channel) -> bytes:
        """Return the bytes that came from a link since the last call."""
        count = lib.rt1062_receive(self._c, channel, self._chunk, len(self._chunk))
        return bytes(ffi.buffer(self._chunk, count))

    def usb_cable(self, connected: bool) -> None:
        """Put the USB cable in or pull it."""
        lib.rt1062_usb_cable(self._c, connected)

    def usb_open(self, wanted: bool, baud: int = 115200) -> None:
        """Open or close the serial port at the host, as a program there does."""
        lib.rt1062_usb_open(self._c, wanted, baud)

    def usb_deaf(self, deaf: bool) -> None:
        """Let the program that has the port open stop reading, with all buffers of its computer full; or go on."""
        lib.rt1062_usb_deaf(self._c, deaf)

    @property
    def usb_ready(self) -> bool:
        """Whether the host has configured the device: there is a serial port."""
        return bool(lib.rt1062_usb_ready(self._c))

    def pin(self, teensy_pin: int) -> int | None:
        """Return a pin's level, 0 or 1; None if nothing drives or pulls it."""
        level = int(lib.rt1062_pin(self._c, teensy_pin))
        return None if level < 0 else level

    def drive_pin(self, teensy_pin: int, level: int | None) -> None:
        """Drive a pin from outside, or let it go (None)."""
        lib.rt1062_drive_pin(self._c, teensy_pin, -1 if level is None else level)

    def reset(self, flags: int) -> None:
        """Reset the chip from outside, for the reason that these bits of SRC_SRSR tell (``rt1062_reset``)."""
        lib.rt1062_reset(self._c, flags)

    def set_temperature(self, celsius: float) -> None:
        """Set the chip's temperature; 40 at power-on."""
        lib.rt1062_set_temperature(self._c, celsius)

    def i2c_edges(self) -> list[Edge]:
        """Return the edges at the I2C lines since the last call; of very many the last are lost."""
        return edges_of(self._c)

    def noise(self, teensy_pin: int, edges_per_s: int) -> None:
        """Put noise in place of what comes over an encoder's wire; 0: the wire is mended. Raises ValueError."""
        if not lib.rt1062_noise(self._c, teensy_pin, edges_per_s):
            raise ValueError(
                f"no noise of {edges_per_s} edges per second on pin {teensy_pin}: unknown wire, or too many"
            )

    def cut_power_at(self, flash_commands: int, share: float) -> None:
        """Cut the power when this share (0 to 1) of the n-th flash command from now that changes memory is done."""
        lib.rt1062_cut_power_at(self._c, flash_commands, share)


class Snapshot:
    """A copy of a machine, freed with the object."""

    def __init__(self, machine_c: Any) -> None:
        self.c = lib.rt1062_snapshot(machine_c)
        if self.c == ffi.NULL:
            raise MemoryError("no memory for a snapshot of the emulated chip")
        self.c = ffi.gc(self.c, lib.rt1062_snapshot_free)


def not_modelled() -> list[str]:
    """Return sentences about what the emulated chip leaves out."""
    sentences = lib.rt1062_not_modelled()
    texts: list[str] = []
    while sentences[len(texts)] != ffi.NULL:
        texts.append(_text(sentences[len(texts)]))
    return texts


def chip_config(wiring: Wiring, options: Options) -> Any:
    """Return a new ``rt1062_config_t *``."""
    config = ffi.new("rt1062_config_t *")
    config.instruction_ns, config.exact, config.strict = options.instruction_ns, options.exact, options.strict
    config.words = options.words
    config.seed = options.seed
    for number, pins in enumerate(config.encoder_pin):
        pins[0], pins[1] = wiring.encoder_pins[number] if number < len(wiring.encoder_pins) else (_NO_PIN, _NO_PIN)
    for number in range(len(config.pwm_pin)):
        config.pwm_pin[number] = wiring.pwm_pins[number] if number < len(wiring.pwm_pins) else _NO_PIN
    config.output_enable_pin = _NO_PIN if wiring.output_enable_pin is None else wiring.output_enable_pin
    config.stop_button_pin = _NO_PIN if wiring.stop_button_pin is None else wiring.stop_button_pin
    config.battery_pin = _NO_PIN if wiring.battery_pin is None else wiring.battery_pin
    config.battery_divider = wiring.battery_divider
    return config


def _text(c: Any) -> str:
    return bytes(ffi.string(c)).decode(errors="replace")
