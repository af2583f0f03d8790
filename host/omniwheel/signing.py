# SPDX-License-Identifier: MIT
"""Message signing: keys in files, and what a connection signs with and accepts.

A key is 32 random bytes, kept as one line of hexadecimal digits in a file that only its owner can read. Who has it can
command the robot by radio; see docs/reference/protocol.md.
"""

from __future__ import annotations

import hashlib
import os
import secrets
import stat
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, Protocol

from omniwheel import files
from omniwheel.dialect import mavlink
from omniwheel.errors import SigningKeyError

KEY_BYTES = 32
UNITS_PER_S = 100_000
"""MAVLink's signing clock counts 10 µs."""
EPOCH_S = 1_420_070_400
"""... since 2015-01-01 00:00 UTC."""
_SIGNED_FLAG = 1
_FLAGS_AT = 2
_RADIO_STATUS = 109
_NO_KEY = "00000000"
_TRIES = 3


def fingerprint(key: bytes) -> str:
    """Return eight digits to compare keys by, as the robot says them."""
    return hashlib.sha256(key).hexdigest()[:8]


def timestamp(now_s: float) -> int:
    """Return a Unix time on the signing clock."""
    return max(0, round((now_s - EPOCH_S) * UNITS_PER_S))


def new_key_file(path: Path) -> bytes:
    """Make a random key and write it to a new file that only its owner can read.

    Once this returns, the key is on the disk. Raises SigningKeyError if there is a file, OutputFileError.
    """
    key = secrets.token_bytes(KEY_BYTES)
    try:
        files.create(path, f"{key.hex()}\n".encode("ascii"), 0o600)
    except FileExistsError:
        problem = f"{path} exists already"
        raise SigningKeyError(problem, hint="an old key may still be in a robot: choose another name") from None
    return key


def read_key_file(path: Path) -> bytes:
    """Read a key. Raises SigningKeyError if it is none, or if others can read the file."""
    try:
        mode = path.stat().st_mode
        text = path.read_text(encoding="ascii").strip()
        key = bytes.fromhex(text)
    except OSError as error:
        hint = "`omni radio --new-key FILE` makes a key"
        raise SigningKeyError(f"cannot read the signing key {path}: {error.strerror}", hint=hint) from error
    except ValueError:
        key = b""
    if len(key) != KEY_BYTES or not any(key):
        hint = "`omni radio --new-key FILE` makes one"
        raise SigningKeyError(f"{path} is not a signing key of {2 * KEY_BYTES} hexadecimal digits", hint=hint)
    if os.name == "posix" and mode & (stat.S_IRWXG | stat.S_IRWXO):
        raise SigningKeyError(f"other users can read the signing key {path}", hint=f"chmod 600 {path}")
    return key


def is_signed(frame: bytes | bytearray) -> bool:
    """Return whether a MAVLink 2 frame says that it is signed."""
    return bool(frame[_FLAGS_AT] & _SIGNED_FLAG)


class Signer:
    """Makes a pymavlink codec sign what it sends and refuse what is signed wrongly.

    Frames without a signature are taken until the first good signature has come: on a USB link the robot does
    not sign. ``clock`` gives Unix time; ``link_id`` tells programs apart that use the same key.
    """

    def __init__(self, key: bytes, *, clock: Callable[[], float] = time.time, link_id: int | None = None) -> None:
        self.key = key
        self.clock = clock
        self.link_id = secrets.randbelow(256) if link_id is None else link_id
        self._bad = 0

    def attach(self, codec: Any) -> None:
        """Set up the codec's signing."""
        codec.signing.secret_key = self.key
        codec.signing.sign_outgoing = True
        codec.signing.link_id = self.link_id
        codec.signing.timestamp = timestamp(self.clock())
        codec.signing.allow_unsigned_callback = self._allow
        codec.check_signature = _careful(codec)

    def before_sending(self, codec: Any) -> None:
        """Set the codec's clock on: pymavlink's stands still between frames."""
        codec.signing.timestamp = max(codec.signing.timestamp, timestamp(self.clock()))

    def _allow(self, codec: Any, message_id: int) -> bool:
        wrongly_signed = codec.signing.badsig_count != self._bad
        self._bad = codec.signing.badsig_count
        if wrongly_signed:
            return False
        return bool(codec.signing.goodsig_count == 0 or message_id == _RADIO_STATUS)


def _careful(codec: Any) -> Callable[[bytearray, int, int], bool]:
    """Return pymavlink's check without its flaw: it keeps the time stamp of a frame whose signature is wrong.

    The signature is not under the checksum, so a lost packet can leave a frame with a stranger's bytes for a signature.
    With a time stamp far ahead, all that the robot says later would be refused.
    """
    check = codec.check_signature

    def check_and_restore(frame: bytearray, system: int, component: int) -> bool:
        before = dict(codec.signing.stream_timestamps)
        good = bool(check(frame, system, component))
        if not good:
            codec.signing.stream_timestamps = before
        return good

    return check_and_restore


def setup_message(system: int, component: int, key: bytes | None, now_s: float) -> Any:
    """Return SETUP_SIGNING with this key, or the one that removes the robot's."""
    if key is None:
        return mavlink.MAVLink_setup_signing_message(system, component, list(bytes(KEY_BYTES)), 0)
    return mavlink.MAVLink_setup_signing_message(system, component, list(key), timestamp(now_s))


class SigningState(Protocol):
    """What a robot tells of its key: its fingerprint, and on or off."""

    @property
    def fingerprint(self) -> str:
        """Of the key that is installed."""
        ...

    @property
    def state(self) -> str:
        """On, off or damaged."""
        ...


def install_key(
    target: tuple[int, int], key: bytes | None, send: Callable[[Any], None], ask: Callable[[], SigningState]
) -> bool:
    """Send a robot (system, component) its key, or None to remove it, until it has it; return whether it does."""
    wanted = (_NO_KEY, "off") if key is None else (fingerprint(key), "on")
    for _ in range(_TRIES):
        send(setup_message(*target, key, time.time()))
        status = ask()
        if (status.fingerprint, status.state) == wanted:
            return True
    return False
