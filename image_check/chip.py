# SPDX-License-Identifier: MIT
"""The PWM chip and its bus: how the image sets the chip up, waits for it, and frees a bus that is held low."""

from __future__ import annotations

from itertools import dropwhile

from emulated_teensy.i2c_wave import START, STOP, Edge, read_wave
from emulated_teensy.machine import Options
from hil_sim.fault_cases import Kind
from image_check.bench import Bench, CheckError, Context, boot
from image_check.check import CI, NIGHTLY, SHORT, Check
from image_check.fault_drive import install
from omniwheel.dialect import Message, mavlink
from omniwheel.robot import FORCE, Robot

QUICK = 20
"""Time of an instruction [ns]: a tick still ends within its millisecond."""
WANTED = {"MODE1": (0x00, 0x20), "MODE2": (0x01, 0x04), "PRE_SCALE": (0xFE, 3)}
"""Auto-increment and awake; outputs drive both ways; 25 MHz / 4096 / (3 + 1) is 1526 Hz (PCA9685 data sheet)."""
READY_S = 0.7
DIP_S = 0.003
AGAIN_S = 0.1
FOREVER_S = 1000.0
TICK_S = 0.001
ARM_S = 0.3
"""Arm commands come for so long, the robot's first ticks among it."""
SDA = 18
HELD_S = 0.004
LOOK_S = 2e-6
QUIET_ns = 50_000
CLOCKS_LIMIT_S = 0.05
LATER_us, CLOCKS_us = 7, 80
"""SDA is released at moments so far apart, within the nine clocks of 10 us that are to free the bus."""
FREED_S = 0.01
SETTLED_S = 0.05
BYTES = 20
"""At least so many are acknowledged in the 10 ms after the bus is free again: two updates at 100 kHz."""


def set_up(context: Context) -> list[str]:
    """The registers after the start, and again after the chip was without power."""
    with context.bench(options=Options(instruction_ns=QUICK, seed=context.seed)) as bench:
        bench.machine.power_on()
        bench.advance(READY_S)
        _compare(bench, "after the start")
        install(bench, [Kind("chip_power")], float(bench.world.c.time_us) * 1e-6, DIP_S)
        bench.advance(DIP_S + AGAIN_S)
        _compare(bench, "after it was without power")
    return [f"{', '.join(WANTED)} as wanted, also after {1e3 * DIP_S:g} ms without power"]


def _compare(bench: Bench, when: str) -> None:
    for name, (register, wanted) in WANTED.items():
        value = int(bench.world.c.chip.registers[register])
        if value != wanted:
            raise CheckError(f"the PWM chip's {name} is 0x{value:02X} {when}, not 0x{wanted:02X}")


def missing(context: Context) -> list[str]:
    """A chip that has no power since power-on: arming is rejected from before the first tick."""
    with context.bench(options=Options(instruction_ns=QUICK, seed=context.seed)) as bench:
        install(bench, [Kind("chip_power")], 0.0, FOREVER_S)
        boot(bench)
        robot = bench.connect(heartbeat=False)
        results = _ask_to_arm(bench, robot)
        pin = context.scenario.robot.board.output_enable_pin
    if not results:
        raise CheckError("no arm command was answered")
    if mavlink.MAV_RESULT_ACCEPTED in results:
        raise CheckError(f"armed without an acknowledging PWM chip, by arm command {_first(results)} of {len(results)}")
    if pin is not None and bench.powered:
        raise CheckError("the output-enable pin is on without an acknowledging PWM chip")
    return [f"{len(results)} arm commands without an acknowledging PWM chip: all rejected"]


def _first(results: list[int]) -> int:
    return results.index(mavlink.MAV_RESULT_ACCEPTED) + 1


def _ask_to_arm(bench: Bench, robot: Robot) -> list[int]:
    """Send an arm command in each millisecond; return how they were answered."""
    results: list[int] = []

    def listen(message: Message) -> None:
        if message.get_type() == "COMMAND_ACK":
            results.append(int(message.result))

    robot.connection.add_listener(listen)
    target = (robot.connection.target_system, robot.connection.target_component)
    numbers = (1.0, FORCE, 0.0, 0.0, 0.0, 0.0, 0.0)
    end_s = bench.clock_s() + ARM_S
    while bench.clock_s() < end_s:
        robot.send(mavlink.MAVLink_command_long_message(*target, mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 0, *numbers))
        robot.pump(TICK_S)
    robot.pump(READY_S)
    return results


def freed(context: Context) -> list[str]:
    """SDA is held low and released: a STOP ends the interrupted transfer, then the updates resume."""
    turns = context.pick(3, 8, 60)
    latest_s = 0.0
    with context.bench(options=Options(instruction_ns=QUICK, seed=context.seed)) as bench:
        boot(bench, usb=False)
        bench.advance(SETTLED_S)
        before = bench.machine.snapshot()
        for turn in range(turns):
            bench.machine.restore(before)
            latest_s = max(latest_s, _hold_and_release(bench, turn * LATER_us % CLOCKS_us))
    return [f"SDA held low and released at {turns} moments: STOP, then updates, at most {1e3 * latest_s:.2f} ms later"]


def _hold_and_release(bench: Bench, clocks_us: int) -> float:
    """Let SDA go so long after the first clock that is to free it; return when an update begins. Raises CheckError."""
    machine = bench.machine
    machine.drive_pin(SDA, 0)
    bench.advance(HELD_S)
    _wait_for_clocks(bench)
    bench.advance(clocks_us * 1e-6)
    machine.drive_pin(SDA, None)
    freed_ns = machine.time_ns
    machine.i2c_edges()
    bench.advance(FREED_S)
    edges = list(dropwhile(lambda edge: not edge.sda, machine.i2c_edges()))
    what = f"SDA is released {clocks_us} us after the first clock pulse of the bus recovery"
    events = read_wave(edges).events
    taken = sum(isinstance(event, tuple) and event[1] for event in events)
    if taken < BYTES:
        raise CheckError(f"{what}: the PWM chip gets {taken} bytes in the {1e3 * FREED_S:g} ms after it")
    if STOP not in events[: events.index(START)]:
        raise CheckError(f"{what}: the next update begins without a STOP before it")
    return _first_update_s(edges) - freed_ns * 1e-9


def _wait_for_clocks(bench: Bench) -> None:
    """Run until the first clock that is to free the bus: the one after some time without any. Raises CheckError."""
    bench.machine.i2c_edges()
    last_ns = begin_ns = bench.machine.time_ns
    while bench.machine.time_ns - begin_ns < CLOCKS_LIMIT_S * 1e9:
        for edge in bench.machine.i2c_edges():
            if not edge.scl and edge.time_ns - last_ns > QUIET_ns:
                return
            last_ns = round(edge.time_ns)
        bench.advance(LOOK_S)
    raise CheckError(f"SDA is held low: no recovery clock pulses within {1e3 * CLOCKS_LIMIT_S:g} ms")


def _first_update_s(edges: list[Edge]) -> float:
    """Return when the first START comes."""
    for number in range(1, len(edges)):
        if START in read_wave(edges[: number + 1]).events:
            return edges[number].time_ns * 1e-9
    return edges[-1].time_ns * 1e-9


CHECKS = (
    Check(
        "pwm-chip", "the PWM chip's registers, also after it was without power", set_up, (SHORT, CI, NIGHTLY), chip=True
    ),
    Check("chip-missing", "no arming before the PWM chip has answered", missing, (CI, NIGHTLY), chip=True),
    Check("bus-clear", "a bus that was held is freed with a STOP, and goes on", freed, (CI, NIGHTLY), chip=True),
)
