# SPDX-License-Identifier: MIT
"""What the classes of telemetry are made of: their base, and how numbers of a message become names."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import ClassVar, TypeVar

from omniwheel._core import ffi, lib
from omniwheel.dialect import Message
from omniwheel.errors import SetpointError

_FAULT_BITS = 32

TelemetryT = TypeVar("TelemetryT", bound="Telemetry")


@dataclass(frozen=True)
class Telemetry(ABC):
    """Base of everything :meth:`omniwheel.Robot.telemetry` yields; ``message`` is the MAVLink message it comes from."""

    message: ClassVar[str]

    @classmethod
    @abstractmethod
    def decoded(cls: type[TelemetryT], m: Message) -> TelemetryT:
        """Return the values of this message, which is one of ``message``."""


def decode(kind: type[TelemetryT], message: Message) -> TelemetryT | None:
    """Decode ``message`` as ``kind``, or return None if it is another message."""
    return kind.decoded(message) if message.get_type() == kind.message else None


def require_kinds(*kinds: object) -> None:
    """Raise SetpointError for what is no class of telemetry."""
    for kind in kinds:
        if not (isinstance(kind, type) and issubclass(kind, Telemetry)):
            raise SetpointError(
                f"{kind!r} is no kind of telemetry", hint="give a class, for example omniwheel.telemetry.Battery"
            )


def fault_names(bits: int) -> tuple[str, ...]:
    """Return the names of the fault and warning bits set in ``bits``, lowest bit first."""
    present = (1 << shift for shift in range(_FAULT_BITS) if bits >> shift & 1)
    return tuple(ffi.string(lib.omni_fault_name(bit)).decode() for bit in present)


def state_name(state: int) -> str:
    """Return the name of a safety state: init, disarmed, armed, failsafe, estop."""
    return str(ffi.string(lib.omni_safety_state_name(state)).decode())


def named(names: tuple[str, ...], number: int) -> str:
    """Return the name with this number, or the number as text: a newer firmware may know more of them."""
    return names[number] if number < len(names) else str(number)
