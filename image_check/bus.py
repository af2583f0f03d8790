# SPDX-License-Identifier: MIT
"""The image's I2C bus as an oscilloscope shows it, its defaults, and the radio's line."""

from __future__ import annotations

from emulated_teensy.i2c_wave import LIMITS, START, STOP, Edge, Wave, read_wave, violations
from emulated_teensy.machine import Channel, Options
from hil_sim.world import TICK_US
from image_check.bench import Bench, CheckError, Context, boot
from image_check.check import CI, NIGHTLY, Check

ALL_LED_OFF = [0xFD, 0x10]
"""The first bytes after the address: register ALL_LED_OFF_H, bit "full off"."""
OFF_LIMIT_S = 0.45
"""docs/guides/bring-up.md promises about 0.3 s after a reset; the boot ROM's time at power-on comes on top."""
REAL_INSTRUCTION_ns = 2
"""Two thirds of the real processor's speed at one instruction per cycle: here the bus must keep up with every tick."""
WATCHED_S = 0.03
SINGLE = 1e-6
"""A share of a value that single precision may take."""


def motors_off_first(context: Context) -> list[str]:
    """The first thing on the bus is the byte that stops all motors."""
    with context.bench() as bench:
        bench.machine.power_on()
        edges: list[Edge] = []
        while STOP not in read_wave(edges).events and bench.machine.time_s < 2 * OFF_LIMIT_S:
            bench.advance(0.005)
            edges += bench.machine.i2c_edges()
        wave = read_wave(edges)
        if wave.bytes[1:3] != ALL_LED_OFF:
            raise CheckError(f"the first bytes on the bus are {wave.bytes[:3]}, not ALL_LED_OFF")
        stopped_s = edges[-1].time_ns * 1e-9
        if stopped_s > OFF_LIMIT_S:
            raise CheckError(
                f"ALL_LED_OFF comes {stopped_s:.3f} s after power-on, at most {OFF_LIMIT_S:g} s are promised"
            )
    return [f"ALL_LED_OFF first, {stopped_s:.3f} s after power-on"]


def timing(context: Context) -> list[str]:
    """Bit times within the specification, everything acknowledged, one update in every tick."""
    speed_Hz = int(context.scenario.robot.board.i2c_speed_Hz)
    with context.bench(options=Options(instruction_ns=REAL_INSTRUCTION_ns, seed=context.seed)) as bench:
        boot(bench, usb=False)
        bench.advance(0.1)
        bench.machine.i2c_edges()
        wave = _watch(bench, WATCHED_S)
    found = violations(wave, LIMITS[speed_Hz])
    if found:
        raise CheckError(f"the bus at {speed_Hz} Hz breaks the I2C specification: {'; '.join(found)}")
    refused = [event for event in wave.events if isinstance(event, tuple) and event[1] is False]
    if len(refused) > wave.events.count(START):  # a master that reads does not acknowledge the last byte
        raise CheckError(f"{len(refused)} bytes were not acknowledged")
    updates = wave.events.count(STOP)
    ticks = round(WATCHED_S * 1e6 / TICK_US)
    if updates < ticks - 1:
        raise CheckError(f"{updates} updates of the PWM chip in {ticks} ticks")
    return [f"{speed_Hz // 1000} kHz within UM10204, {updates} updates in {ticks} ticks"]


def _watch(bench: Bench, duration_s: float) -> Wave:
    edges: list[Edge] = []
    for _ in range(round(duration_s / 0.002)):
        bench.advance(0.002)
        edges += bench.machine.i2c_edges()
    return read_wave(edges)


def defaults(context: Context) -> list[str]:
    """What it answers for every parameter is what the robot file says."""
    wanted = context.scenario.robot.parameter_values()
    with context.bench(options=context.options(words=True)) as bench:
        boot(bench)
        robot = bench.connect()
        robot.require_same_parameters()
        robot.parameters.download()
        said = {name: float(robot.parameters[name]) for name in wanted}
    wrong = [name for name, value in wanted.items() if abs(said[name] - value) > SINGLE * abs(value)]
    if wrong:
        raise CheckError(f"{len(wrong)} parameters are not the robot file's: {', '.join(wrong[:5])}")
    return [f"{len(wanted)} parameters as in the robot file"]


def radio(context: Context) -> list[str]:
    """A ground station behind the radio, at 9600 baud, reads a parameter and is seen."""
    with context.bench(options=context.options(words=context.depth == NIGHTLY)) as bench:
        boot(bench, usb=False)
        robot = bench.connect(Channel.UART)
        robot.pump(1.0)  # it joined in the middle of a frame
        joined = robot.connection.rx_bad_bytes
        robot.pump(2.0)
        baud = robot.parameters.read("LINK2_BAUD")
        errors = robot.connection.rx_bad_bytes - joined
    if errors:
        raise CheckError(f"{errors} bytes from the radio's line are no MAVLink")
    return [f"answers at {baud:g} baud, no byte wrong"]


CHECKS = (
    Check("off-first", "the first thing on the bus stops all motors", motors_off_first, chip=True),
    Check(
        "bus", "I2C bit times, one update per tick at two thirds of the chip's speed", timing, (CI, NIGHTLY), chip=True
    ),
    Check("defaults", "every parameter is the robot file's", defaults, (CI, NIGHTLY)),
    Check("radio", "a ground station on the radio's line", radio, (CI, NIGHTLY)),
)
