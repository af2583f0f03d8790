# SPDX-License-Identifier: MIT
"""The named faults of docs/reference/safety.md at this board's pins: how soon the bridges are off, what it says.

Also the way back.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from emulated_teensy.machine import Snapshot
from hil_sim.fault_bench import BACK_S, CIRCLE_START
from hil_sim.fault_cases import CASES, CIRCLE, EMERGENCY_STOP, FAULT_S, FaultCase, Kind
from hil_sim.scenario import Scenario
from image_check.bench import Bench, CheckError, Context
from image_check.check import Check
from image_check.fault_drive import FINE_S, STEP_S, Drive, begin_fixes, install, shown_s
from omniwheel._core import lib

TICK_S = 0.001
READY_S = 0.01
SETTLE_S = 0.02
STOPPED_S = 0.15
WATCH_S = 0.05
"""Bridges that have gone off must stay so for at least this long."""
EXTRA = (FaultCase("i2c_scl", "SCL held low", (Kind("i2c_stuck", value=float(lib.HIL_STUCK_SCL)),), "driver", "0.012"),)
"""What only wires can show; the bus stuck low of the other cases is SDA."""
SHORT = ("encoder_stuck", "encoder_reversed", "i2c_stuck")
_INSIDE = "inside the chip: no wire shows it"
NOT_AT_THE_PINS = {
    "encoder_dead": "no wire says so; a storm of edges makes the board say it",
    "encoder_bit": _INSIDE,
    "clock_forward": _INSIDE,
    "clock_back": _INSIDE,
    "clock_stuck": _INSIDE,
    "ticks_late": _INSIDE,
}
"""Cases that no wire can show, and why; host-in-the-loop they can be shown."""
BATTERY = ("battery_low", "battery_dip")
BUTTON = "stop_button"
BUS = "driver"
"""What the robot says of a chip or a bus that fails."""
THREE = 3


def faults_at_the_pins(context: Context) -> list[str]:
    """Every case that the wires can show; the others are named."""
    reasons = dict(NOT_AT_THE_PINS)
    if context.scenario.robot.board.battery_pin is None:
        reasons.update(dict.fromkeys(BATTERY, "this robot does not measure it"))
    if context.scenario.robot.wheels > THREE:
        reasons["motor_dead"] = "with more than three wheels the others drag that wheel along: it does not stand still"
    if context.scenario.robot.board.stop_button_pin is None:
        reasons[BUTTON] = "this robot has none"
    if context.scenario.robot.board.motor_pins:
        buses = [case.name for case in (*CASES, *EXTRA) if case.stops == BUS]
        reasons.update(dict.fromkeys(buses, "this robot has no PWM chip"))
    gyros = [case.name for case in CASES if "gyro_rate_Hz" in case.world]
    reasons.update(dict.fromkeys(gyros, "the check gyro is about it"))
    flows = [case.name for case in CASES if "flow_rate_Hz" in case.world]
    reasons.update(dict.fromkeys(flows, "the check flow is about it"))
    values = context.scenario.parameter_values()
    figures = []
    with context.booted(scenario=on_the_floor(context.scenario)) as bench:
        starts = Starts(bench)
        for case in (*CASES, *EXTRA):
            if case.name not in reasons and (context.depth != "short" or case.name in SHORT):
                figures.append(run_case(bench, starts, case, values))
    return figures + _left_out(reasons)


def _left_out(reasons: Mapping[str, str]) -> list[str]:
    """Say what was not tried, and why."""
    what = {case.name: case.what for case in (*CASES, *EXTRA)}
    return [
        f"not tried: {', '.join(what[name] for name in reasons if reasons[name] == reason)} ({reason})"
        for reason in dict.fromkeys(reasons.values())
    ]


def on_the_floor(scenario: Scenario) -> Scenario:
    """Return the scenario with its robot on the floor, at the start of the circle."""
    return replace(scenario, world={}, start_pose=CIRCLE_START)


class Starts:
    """Snapshots of the robot under way, one for each way to drive."""

    def __init__(self, bench: Bench) -> None:
        self._bench = bench
        first = Drive(bench, "")
        first.robot.pump(0.1)
        first.show_reason()
        self._ready = bench.machine.snapshot()
        self._driving: dict[tuple[str, bool], Snapshot] = {}

    def begin(self, case: FaultCase) -> Drive:
        """Return a robot that drives as the case wants it."""
        fixes = "fix_rate_Hz" in case.world
        start = self._driving.get((case.drive, fixes))
        if start is None:
            self._recover(self._ready)
            drive = Drive(self._bench, case.drive)
            drive.prepare()
            if fixes:
                begin_fixes(self._bench, case)
            drive.start()
            drive.run(FAULT_S)
            start = self._driving[case.drive, fixes] = self._bench.machine.snapshot()
        self._recover(start)
        drive = Drive(self._bench, case.drive)
        drive.steer()
        return drive

    def _recover(self, snapshot: Snapshot) -> None:
        """Going back forgets what the chip objected to, and leaves bytes in the links."""
        _objections(self._bench)
        self._bench.machine.restore(snapshot)
        self._bench.drain()


def _objections(bench: Bench) -> None:
    """Raise CheckError if the chip objected to something."""
    if bench.findings():
        raise CheckError("; ".join(str(finding) for finding in bench.findings()[:3]))


def run_case(bench: Bench, starts: Starts, case: FaultCase, values: Mapping[str, float]) -> str:
    """Run one case; return what it showed. Raises CheckError."""
    values = {**values, **case.parameters}
    drive = _under_way(bench, starts, case)
    lasts_s = case.lasts_s
    if case.stops is not None:
        lasts_s = max(lasts_s, case.bound_s(values) + WATCH_S)
    start_s = float(bench.world.c.time_us) * 1e-6 + STEP_S
    install(bench, case.faults, start_s, lasts_s)
    drive.run(start_s - bench.clock_s() + lasts_s, FINE_S if case.stops is not None else STEP_S)
    figure = _stopped(drive, case, start_s, values) if case.stops is not None else _drove_on(drive, case)
    drive.run(SETTLE_S)
    _said(drive, case)
    _recovery(drive, case)
    return figure


def _under_way(bench: Bench, starts: Starts, case: FaultCase) -> Drive:
    drive = starts.begin(case)
    if case.parameters:
        drive.robot.parameters.set_many(dict(case.parameters))
    if case.world.get("output_enable_wired") == 0.0:
        bench.world.c.config.output_enable_wired = False
    drive.run(READY_S)
    if not bench.powered:
        raise CheckError(f"{case.name}: the robot does not drive before the fault")
    return drive


def _stopped(drive: Drive, case: FaultCase, start_s: float, values: Mapping[str, float]) -> str:
    off_s = drive.seen.off_since_s
    if not case.coasts:
        if off_s is not None:
            raise CheckError(f"{case.name}: without the output-enable pin nothing can stop it, and it stopped")
        return f"{case.what}: keeps its voltage"
    if off_s is None:
        raise CheckError(f"{case.name}: a bridge input stays high")
    latency_s = off_s - start_s - shown_s(case.faults)
    late_s = TICK_S + drive.seen.bus_us * 1e-6 + FINE_S
    bound_s = case.bound_s(values)
    if latency_s > bound_s + late_s:
        raise CheckError(
            f"{case.name}: bridges off after {1e3 * latency_s:.2f} ms; limits are {1e3 * bound_s:.1f} ms and "
            f"{1e3 * late_s:.2f} ms for tick and bus"
        )
    return f"{case.what}: {1e3 * latency_s:.1f} ms (at most {1e3 * bound_s:.0f} ms)"


def _drove_on(drive: Drive, case: FaultCase) -> str:
    texts = [text for text in drive.seen.texts if text.startswith("failsafe")]
    if texts or not drive.bench.powered:
        raise CheckError(f"{case.name}: the robot must drive on, and stopped: {', '.join(texts)}")
    if case.drive == CIRCLE and drive.seen.error_m > case.error_m:
        raise CheckError(f"{case.name}: {1e3 * drive.seen.error_m:.0f} mm off its path")
    off = f", {1e3 * drive.seen.error_m:.0f} mm off its path" if case.drive == CIRCLE else ""
    return f"{case.what}: drives on{off}"


def _said(drive: Drive, case: FaultCase) -> None:
    seen = drive.seen
    fault = case.failsafe
    if fault is not None and (f"failsafe: {fault}" not in seen.texts or fault not in seen.faults):
        raise CheckError(f"{case.name}: no message of {fault}; texts {seen.texts}, faults {sorted(seen.faults)}")
    if case.warns is not None and case.warns not in seen.faults:
        raise CheckError(f"{case.name}: no warning {case.warns}; faults {sorted(seen.faults)}")
    if case.says is not None and not any(case.says in text for text in seen.texts):
        raise CheckError(f"{case.name}: '{case.says}' was not sent; texts {seen.texts}")


def _recovery(drive: Drive, case: FaultCase) -> None:
    """Disarm and arm a robot that stopped; it must drive again."""
    if case.stops is not None:
        drive.stop()
        drive.run(STOPPED_S)
        if case.stops == EMERGENCY_STOP:
            drive.robot.estop_clear()
            drive.run(READY_S)
        drive.start()
    drive.run(BACK_S)
    if not drive.bench.powered or not any(abs(duty) > 0.05 for duty in drive.bench.duties):
        raise CheckError(f"{case.name}: the robot does not drive again; texts {drive.seen.texts}")


CHECKS = (Check("faults-at-the-pins", "each fault that wires can show: stop, word, way back", faults_at_the_pins),)
