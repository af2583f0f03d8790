# SPDX-License-Identifier: MIT
"""Telemetry as typed, immutable values in our frame and SI units, decoded from MAVLink.

Wheel arrays have four entries; a three-wheel robot's last one is zero. ``time_s`` is the robot's clock.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import ClassVar, TypeVar

from omniwheel._core import ffi, lib
from omniwheel.dialect import Message, enum_name, mavlink
from omniwheel.frames import Pose, Twist, flip

SIGNING_STATES = ("off", "on", "damaged")
RESET_CAUSES = ("power", "watchdog", "software", "crash", "over-temperature")
PHASES = ("none", "lead-in", "path", "done")
_MS = 1e-3
_FAULT_BITS = 32

Wheels4 = tuple[float, float, float, float]
Axes3 = tuple[float, float, float]


@dataclass(frozen=True)
class Telemetry:
    """Base of everything :meth:`omniwheel.Robot.telemetry` yields; ``message`` is the MAVLink message it comes from."""

    message: ClassVar[str]


@dataclass(frozen=True)
class Heartbeat(Telemetry):
    """What the robot is doing: ``mode`` is hold, pose, velocity, trajectory or duty."""

    message = "HEARTBEAT"
    armed: bool
    hil: bool
    mode: str
    system_status: str


@dataclass(frozen=True)
class Tracking(Telemetry):
    """Reference and estimate of the pose (world); ``pose_sd`` are standard deviations."""

    message = "OMNI_TRACKING"
    time_s: float
    reference: Pose
    reference_rate: Twist
    pose: Pose
    pose_sd: Axes3
    path_time_s: float
    phase: str


@dataclass(frozen=True)
class Wheels(Telemetry):
    """The wheel loops; ``wheel_scale`` and ``duty_scale`` below 1 say by how much demands were cut."""

    message = "OMNI_WHEELS"
    time_s: float
    speed_rad_s: Wheels4
    reference_rad_s: Wheels4
    duty: Wheels4
    current_A: Wheels4
    slip_m_s: Wheels4
    wheel_scale: float
    duty_scale: float


@dataclass(frozen=True)
class Control(Telemetry):
    """Internal terms of the position controller, x, y, theta; ``config_sequence`` rises with every parameter change.

    ``ismc_margin`` is k minus the slip error that may be there (condition 44; m/s, m/s, rad/s), 0 unless the ISMC
    tracks.
    """

    message = "OMNI_CONTROL"
    time_s: float
    error: Axes3
    integral: Axes3
    surface: Axes3
    equivalent: Axes3
    switching: Axes3
    ismc_margin: Axes3
    nis: float
    fixes_accepted: int
    fixes_refused: int
    config_sequence: int
    controller: int


@dataclass(frozen=True)
class Sample(Telemetry):
    """What identification needs of one tick; comes only if asked for with ``set_message_interval("OMNI_SAMPLE", hz)``.

    ``counts`` are the encoders' counters in their own direction, ``volt_seconds`` the integral of the motor voltages in
    the wheels' direction [V s]. Both are sums: the difference of two samples says what happened between them, messages
    lost or not. ``counts`` wrap at 2^32, ``volt_seconds`` at 4294.967296 V s.
    """

    message = "OMNI_SAMPLE"
    time_s: float
    counts: tuple[int, int, int, int]
    volt_seconds: Wheels4
    supply_V: float
    pose: Pose
    phase: str


@dataclass(frozen=True)
class Status(Telemetry):
    """Safety state, names of the present faults and warnings, loop and link statistics."""

    message = "OMNI_STATUS"
    time_s: float
    state: str
    faults: tuple[str, ...]
    fault_history: tuple[str, ...]
    hil: bool
    ticks: int
    overruns: int
    i2c_errors: int
    rx_errors: int
    tx_dropped: int
    tick_us_mean: float
    tick_us_max: float


@dataclass(frozen=True)
class Health(Telemetry):
    """What should stay as it is: counters since the processor started, reserves, why it started.

    ``encoder_errors`` are illegal transitions per wheel; ``link_rx_errors`` and ``link_tx_dropped`` have an entry per
    link. Where 0 may mean "not known" (stack, heap, jitter, bus time) the message's description says so.
    """

    message = "OMNI_HEALTH"
    time_s: float
    encoder_errors: tuple[int, ...]
    i2c_nacks: int
    i2c_timeouts: int
    i2c_recoveries: int
    i2c_us: int
    signing_refused: int
    stack_free: int
    heap_free: int
    tick_jitter_us_max: float
    link_rx_errors: tuple[int, ...]
    link_tx_dropped: tuple[int, ...]
    reset_cause: str


@dataclass(frozen=True)
class LocalPosition(Telemetry):
    """Pose estimate's position and world velocity, from the standard LOCAL_POSITION_NED."""

    message = "LOCAL_POSITION_NED"
    time_s: float
    x_m: float
    y_m: float
    vx_m_s: float
    vy_m_s: float


@dataclass(frozen=True)
class Battery(Telemetry):
    """Supply voltage, nan if it is not measured."""

    message = "SYS_STATUS"
    voltage_V: float


@dataclass(frozen=True)
class SigningStatus(Telemetry):
    """Message signing: ``state`` off, on or damaged; ``time_s`` since 2015; what the radio refused since boot."""

    message = "OMNI_SIGNING"
    state: str
    fingerprint: str
    time_s: float
    refused_unsigned: int
    refused_wrong: int
    refused_replayed: int
    refused_keys: int
    refused_lines: int


@dataclass(frozen=True)
class StatusText(Telemetry):
    """A line of text from the robot; ``severity`` as in syslog: 0 emergency ... 7 debug."""

    message = "STATUSTEXT"
    severity: int
    text: str


TelemetryT = TypeVar("TelemetryT", bound=Telemetry)


def fault_names(bits: int) -> tuple[str, ...]:
    """Return the names of the fault and warning bits set in ``bits``, lowest bit first."""
    present = (1 << shift for shift in range(_FAULT_BITS) if bits >> shift & 1)
    return tuple(ffi.string(lib.omni_fault_name(bit)).decode() for bit in present)


def state_name(state: int) -> str:
    """Return the name of a safety state: init, disarmed, armed, failsafe, estop."""
    return str(ffi.string(lib.omni_safety_state_name(state)).decode())


def _wheels(values: list[float]) -> Wheels4:
    return values[0], values[1], values[2], values[3]


def _axes(values: list[float]) -> Axes3:
    return values[0], values[1], values[2]


def _heartbeat(m: Message) -> Heartbeat:
    return Heartbeat(
        armed=bool(m.base_mode & mavlink.MAV_MODE_FLAG_SAFETY_ARMED),
        hil=bool(m.base_mode & mavlink.MAV_MODE_FLAG_HIL_ENABLED),
        mode=enum_name("OMNI_MODE", m.custom_mode, "OMNI_MODE_").lower(),
        system_status=enum_name("MAV_STATE", m.system_status, "MAV_STATE_").lower(),
    )


def _tracking(m: Message) -> Tracking:
    return Tracking(
        time_s=m.time_boot_ms * _MS,
        reference=Pose(*m.reference),
        reference_rate=Twist(*m.reference_rate),
        pose=Pose(*m.pose),
        pose_sd=_axes(m.pose_sd),
        path_time_s=m.path_time,
        phase=_phase(m.phase),
    )


def _wheel_loops(m: Message) -> Wheels:
    return Wheels(
        time_s=m.time_boot_ms * _MS,
        speed_rad_s=_wheels(m.speed),
        reference_rad_s=_wheels(m.reference),
        duty=_wheels(m.duty),
        current_A=_wheels(m.current),
        slip_m_s=_wheels(m.slip),
        wheel_scale=m.wheel_scale,
        duty_scale=m.duty_scale,
    )


def _control(m: Message) -> Control:
    return Control(
        time_s=m.time_boot_ms * _MS,
        error=_axes(m.error),
        integral=_axes(m.integral),
        surface=_axes(m.surface),
        equivalent=_axes(m.equivalent),
        switching=_axes(m.switching),
        ismc_margin=_axes(m.ismc_margin),
        nis=m.nis,
        fixes_accepted=m.fixes_accepted,
        fixes_refused=m.fixes_refused,
        config_sequence=m.config_sequence,
        controller=m.controller,
    )


def _sample(m: Message) -> Sample:
    counts = m.counts
    return Sample(
        time_s=m.time_us * 1e-6,
        counts=(counts[0], counts[1], counts[2], counts[3]),
        volt_seconds=_wheels([value * 1e-6 for value in m.volt_seconds]),
        supply_V=m.supply,
        pose=Pose(*m.pose),
        phase=_phase(m.phase),
    )


def _signing(m: Message) -> SigningStatus:
    return SigningStatus(
        state=SIGNING_STATES[m.state] if m.state < len(SIGNING_STATES) else str(m.state),
        fingerprint=f"{m.fingerprint:08x}",
        time_s=m.time * 1e-6,
        refused_unsigned=m.refused_unsigned,
        refused_wrong=m.refused_wrong,
        refused_replayed=m.refused_replayed,
        refused_keys=m.refused_keys,
        refused_lines=m.refused_lines,
    )


def _phase(number: int) -> str:
    return PHASES[number] if number < len(PHASES) else str(number)


def _status(m: Message) -> Status:
    return Status(
        time_s=m.time_boot_ms * _MS,
        state=state_name(m.state),
        faults=fault_names(m.faults),
        fault_history=fault_names(m.fault_history),
        hil=bool(m.hil),
        ticks=m.ticks,
        overruns=m.overruns,
        i2c_errors=m.i2c_errors,
        rx_errors=m.rx_errors,
        tx_dropped=m.tx_dropped,
        tick_us_mean=m.tick_us_mean,
        tick_us_max=m.tick_us_max,
    )


def _local_position(m: Message) -> LocalPosition:
    x, y, _ = flip(m.x, m.y, 0.0)
    vx, vy, _ = flip(m.vx, m.vy, 0.0)
    return LocalPosition(m.time_boot_ms * _MS, x, y, vx, vy)


def _health(m: Message) -> Health:
    return Health(
        time_s=m.time_boot_ms * _MS,
        encoder_errors=tuple(m.encoder_errors),
        i2c_nacks=m.i2c_nacks,
        i2c_timeouts=m.i2c_timeouts,
        i2c_recoveries=m.i2c_recoveries,
        i2c_us=m.i2c_us,
        signing_refused=m.signing_refused,
        stack_free=m.stack_free,
        heap_free=m.heap_free,
        tick_jitter_us_max=m.tick_jitter_us_max,
        link_rx_errors=tuple(m.link_rx_errors),
        link_tx_dropped=tuple(m.link_tx_dropped),
        reset_cause=RESET_CAUSES[m.reset_cause] if m.reset_cause < len(RESET_CAUSES) else "?",
    )


def _battery(m: Message) -> Battery:
    measured = m.voltage_battery not in (0, 0xFFFF)
    return Battery(m.voltage_battery * _MS if measured else math.nan)


def _status_text(m: Message) -> StatusText:
    text = m.text.decode(errors="replace") if isinstance(m.text, bytes) else str(m.text)
    return StatusText(m.severity, text.rstrip("\0"))


_DECODERS: dict[type[Telemetry], Callable[[Message], Telemetry]] = {
    Heartbeat: _heartbeat,
    Tracking: _tracking,
    Wheels: _wheel_loops,
    Control: _control,
    Sample: _sample,
    Status: _status,
    Health: _health,
    LocalPosition: _local_position,
    Battery: _battery,
    StatusText: _status_text,
    SigningStatus: _signing,
}


def decode(kind: type[TelemetryT], message: Message) -> TelemetryT | None:
    """Decode ``message`` as ``kind``, or return None if it is another message."""
    if message.get_type() != kind.message:
        return None
    decoded = _DECODERS[kind](message)
    return decoded if isinstance(decoded, kind) else None
