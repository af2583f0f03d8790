# SPDX-License-Identifier: MIT
"""Encoders at their limits: noise on one wire, and every wheel as fast as its edges may come."""

from __future__ import annotations

import math

from emulated_teensy.machine import PROGRAM_COUNTER, Stop
from hil_sim.fault_cases import TURN, Kind
from image_check.bench import Bench, CheckError, Context
from image_check.check import CI, NIGHTLY, Check
from image_check.drive import COUNT_TOLERANCE, read_counts
from image_check.fault_drive import FINE_S, Drive, install
from image_check.faults import on_the_floor
from omni_schema.encoder_plan import plan_encoders
from omniwheel.robot import Robot
from omniwheel.telemetry import Status

NOISE_HZ = 2_000_000
DRIVE_S = 0.4
OFF_S = 0.05
"""How long the noise goes on after the bridges must be off."""
REST_S = 0.8
BACK_S = 0.3
TICK_S = 0.001
SAID_S = 0.02
INTERRUPT_LIMIT_S = 0.006
"""Three ticks in a row with lost edges; the first may have begun before the noise, and all has to be written."""
EDGES_HZ = 40_000
"""25 rad/s at 10000 counts per revolution: the most that docs/checks/performance.md reckons with."""
FAST_S = 0.5
SAMPLES = 50
INTERRUPT = "_ZN4omni12_GLOBAL__N_115on_pins_changedEv"
STACK_POINTER, STACKED_PC = 13, 0x18
PROCESSOR_HZ = 600e6


def noise(context: Context) -> list[str]:
    """A loose wire at a wheel that interrupts count, and at one that hardware counts."""
    units = plan_encoders(context.scenario.robot.board).units
    figures = []
    with context.booted(scenario=on_the_floor(context.scenario)) as bench:
        drive = Drive(bench, TURN)
        drive.robot.pump(0.1)
        drive.show_reason()
        drive.start()
        drive.run(DRIVE_S)
        driving = bench.machine.snapshot()
        for way, wheels in _wheels(units).items():
            bench.machine.restore(driving)
            bench.drain()
            figures.append(_storm(bench, way, wheels[0]) if wheels else f"no wheel is counted by {way}")
    return figures


def _wheels(units: tuple[int | None, ...]) -> dict[str, list[int]]:
    return {
        "interrupts": [wheel for wheel, unit in enumerate(units) if unit is None],
        "hardware": [wheel for wheel, unit in enumerate(units) if unit is not None],
    }


def _storm(bench: Bench, way: str, wheel: int) -> str:
    """The decoders' filter lets none of these short pulses through: their counter stands still, which is a stall."""
    values = bench.scenario.parameter_values()
    fault, limit_s = ("encoder", INTERRUPT_LIMIT_S) if way == "interrupts" else ("stall", 2 * values["SAFE_STALL_T"])
    pin = bench.scenario.robot.board.encoder_pins[wheel][0]
    drive = Drive(bench, TURN)
    drive.steer()
    drive.run(SAID_S)
    before = _told(drive.robot)
    begin_s = bench.clock_s()
    bench.machine.noise(pin, NOISE_HZ)
    while drive.seen.off_since_s is None and bench.clock_s() < begin_s + limit_s + OFF_S:
        drive.run(OFF_S, FINE_S)
    drive.run(OFF_S, FINE_S)
    off_s = math.inf if drive.seen.off_since_s is None else drive.seen.off_since_s - begin_s
    name = f"noise on wheel {wheel + 1}, counted by {way}"
    if off_s > limit_s + TICK_S + FINE_S:
        raise CheckError(f"{name}: bridges off after {1e3 * off_s:.1f} ms, {1e3 * limit_s:.0f} ms are allowed")
    _said(drive, name, fault)
    _ticks_came(bench, drive.robot, before, begin_s, name)
    bench.machine.noise(pin, 0)
    _others_count(bench, drive, wheel, name)
    drive.start()
    drive.run(BACK_S)
    if not bench.powered:
        raise CheckError(f"{name}: the robot does not drive again")
    return f"{name}: {fault}, bridges off after {1e3 * off_s:.1f} ms ({1e3 * limit_s:.0f} ms)"


def _told(robot: Robot) -> tuple[float, int, int]:
    """Return the robot's time, its ticks and how many of them overran."""
    robot.commands.request_message(Status.message, SAID_S)
    status = robot.status.safety
    assert status is not None
    return status.time_s, status.ticks, status.overruns


def _said(drive: Drive, name: str, fault: str) -> None:
    if f"failsafe: {fault}" not in drive.seen.texts or fault not in drive.seen.faults:
        raise CheckError(f"{name}: no message of {fault}; texts {drive.seen.texts}, faults {sorted(drive.seen.faults)}")


def _ticks_came(bench: Bench, robot: Robot, before: tuple[float, int, int], begin_s: float, name: str) -> None:
    """A tick in every millisecond of the robot's time, and of the bench's."""
    time_s, ticks, overruns = (now - then for now, then in zip(_told(robot), before, strict=True))
    if overruns != 0 or abs(time_s - TICK_S * ticks) > 2 * TICK_S or time_s < bench.clock_s() - begin_s - SAID_S:
        raise CheckError(f"{name}: {ticks} ticks in {1e3 * time_s:.0f} ms, {overruns} of them overran")


def _others_count(bench: Bench, drive: Drive, noisy: int, name: str) -> None:
    drive.stop()
    drive.run(REST_S)
    wrong = [wheel for wheel, error in enumerate(_count_errors(bench)) if wheel != noisy and error > COUNT_TOLERANCE]
    if wrong:
        raise CheckError(f"{name}: wheel {wrong[0] + 1} miscounted, too")


def _count_errors(bench: Bench) -> list[int]:
    """Return by how much each counter differs from the edges that have passed."""
    world = bench.world.c
    told = read_counts(bench)
    passed = [
        round(float(world.encoder_edges[wheel])) * int(world.config.encoder_direction[wheel])
        for wheel in range(len(told))
    ]
    return [abs(a - b) for a, b in zip(passed, told, strict=True)]


def fast_wheels(context: Context) -> list[str]:
    """Every wheel turned by hand at 40 000 edges per second."""
    wheels = context.scenario.robot.wheels
    by_interrupt = _wheels(plan_encoders(context.scenario.robot.board).units)["interrupts"]
    with context.booted() as bench:
        robot = bench.connect()
        robot.pump(0.1)
        before = _told(robot)
        begin_s = bench.clock_s()
        speed = 2.0 * math.pi * EDGES_HZ / float(bench.world.c.config.counts_per_revolution)
        hands = [Kind("wheel_turned", wheel + 1, speed) for wheel in range(wheels)]
        install(bench, hands, float(bench.world.c.time_us) * 1e-6, FAST_S)
        robot.pump(SAID_S)
        cost = _interrupt_cost(bench) if by_interrupt else 0.0
        robot.pump(FAST_S)
        _ticks_came(bench, robot, before, begin_s, "fast wheels")
        robot.pump(REST_S)
        worst = max(_count_errors(bench))
        turned = min(abs(float(bench.world.c.encoder_edges[wheel])) for wheel in range(wheels))
    if worst > COUNT_TOLERANCE or turned < 0.9 * EDGES_HZ * FAST_S:
        raise CheckError(f"{EDGES_HZ} edges/s on every wheel: a counter is {worst} counts off, of {turned:.0f}")
    share = cost * EDGES_HZ * len(by_interrupt) / PROCESSOR_HZ
    return [
        f"{EDGES_HZ} edges/s on every wheel: {turned:.0f} edges each, counters within {worst}, no tick overran",
        f"{len(by_interrupt)} wheels by interrupts: {cost:.0f} instructions per edge, "
        f"{100.0 * share:.1f} % of {PROCESSOR_HZ / 1e6:.0f} million instructions/s",
    ]


def _interrupt_cost(bench: Bench) -> float:
    """Return the mean number of instructions of the encoders' interrupt."""
    machine = bench.machine
    total = 0
    for _ in range(SAMPLES):
        machine.break_at(INTERRUPT)
        _stopped_at_break(machine.run(TICK_S))
        begin = machine.instructions
        stack = machine.register(STACK_POINTER)
        back = int.from_bytes(machine.read(stack + STACKED_PC, 4), "little")
        machine.clear_breaks()
        machine.break_at(back)
        _stopped_at_break(machine.run(TICK_S))
        assert machine.register(PROGRAM_COUNTER) == back & ~1
        total += machine.instructions - begin
        machine.clear_breaks()
    return total / SAMPLES


def _stopped_at_break(stop: Stop) -> None:
    if stop != Stop.BREAK:
        raise CheckError(f"no interrupt of the encoders in {1e3 * TICK_S:g} ms of fast wheels ({stop.name})")


CHECKS = (
    Check("encoder-noise", f"{NOISE_HZ / 1e6:g} million edges/s of noise on an encoder's wire", noise, (CI, NIGHTLY)),
    Check("encoder-speed", f"{EDGES_HZ} edges/s on every wheel", fast_wheels, (CI, NIGHTLY)),
)
