# SPDX-License-Identifier: MIT
"""The links by themselves: the radio's bit times at every speed, and what a closed USB port leaves behind."""

from __future__ import annotations

from itertools import pairwise
from statistics import median

from emulated_teensy.machine import Channel, Options, Stop
from image_check.bench import Bench, CheckError, Context, boot
from image_check.check import CI, NIGHTLY, Check
from omniwheel.dialect import mavlink
from omniwheel.robot import FORCE, Robot
from omniwheel.telemetry import Status

BAUD_TOLERANCE = 0.015
"""A modem's own clock may be off by as much again: ten bits bear 5 % in all."""
BITS = 10
"""Of a byte on the line: start bit, eight of data, stop bit."""
BYTES = 60
BYTES_S = 3.0
SETTLE_S = 0.3
QUIET_S = 0.05
READ_RADIO = "_ZN4omni9RadioPort4readEPhj"
SLOW = 40
"""Time of an instruction [ns]: from the radio's turn to that of USB takes longer than a frame and the closing do."""
ARRIVES_S = 20e-6
"""A frame's way over USB."""
HEARTBEAT_S = 1.1
SPEEDS = (115200.0, 57600.0, 9600.0)


def radio_speeds(context: Context) -> list[str]:
    """Bytes in a row on the radio's line, at the speed of the start and at each that it is told afterwards."""
    with context.booted() as bench:
        robot = bench.connect()
        robot.pump(SETTLE_S)
        told = float(robot.parameters.read("LINK2_BAUD"))
        figures = [_bit_time(bench, told)]
        for baud in SPEEDS[:: context.pick(3, 1, 1)]:
            robot.parameters.set_many({"LINK2_BAUD": baud, "LINK2_BUDGET": baud / 20.0})
            robot.pump(SETTLE_S)
            figures.append(_bit_time(bench, baud))
    return figures


def _bit_time(bench: Bench, baud: float) -> str:
    """Compare the time between bytes of a frame with the asked speed. Raises CheckError."""
    times_ns = _byte_times(bench)
    between_ns = median(later - earlier for earlier, later in pairwise(times_ns))
    off = BITS * 1e9 / (between_ns * baud) - 1.0
    if abs(off) > BAUD_TOLERANCE:
        raise CheckError(f"the radio's line is {100 * off:+.1f} % off {baud:.0f} baud")
    return f"{baud:.0f} baud: {100 * off:+.2f} %"


def _byte_times(bench: Bench) -> list[int]:
    """Return when each of some bytes was through the line."""
    bench.drain()
    machine = bench.machine
    machine.stop_on(Stop.OUTPUT)
    end_ns = machine.time_ns + round(BYTES_S * 1e9)
    times_ns: list[int] = []
    while len(times_ns) < BYTES and machine.time_ns < end_ns:
        stop = machine.run_until_ns(end_ns)
        if stop not in (Stop.OUTPUT, Stop.TIME):
            raise CheckError(f"the emulated chip stopped ({stop.name}): {machine.why}")
        bench.take(Channel.USB)
        times_ns += [machine.time_ns] * len(bench.take(Channel.UART))
    machine.stop_on()
    if len(times_ns) < BYTES:
        raise CheckError(f"{len(times_ns)} bytes on the radio's line in {BYTES_S:g} s")
    return times_ns


def closed_port(context: Context) -> list[str]:
    """An arm command, whole or half, has come, unread, when the port is closed; the next session begins clean."""
    with context.bench(options=Options(instruction_ns=SLOW, pause_ns=0, seed=context.seed)) as bench:
        boot(bench)
        robot = bench.connect()
        radio = bench.connect(Channel.UART, heartbeat=False)
        robot.pump(SETTLE_S)
        for kept in (1.0, 0.5):
            _send_and_close(bench, robot, kept)
            radio.pump(HEARTBEAT_S)
            if radio.status.armed:
                raise CheckError("an arm command that came right before the port was closed is executed after it")
            begin_s = bench.clock_s()
            robot = bench.connect()
            robot.pump(0.5)
            _is_served(robot, bench.clock_s() - begin_s)
            if bench.powered or robot.status.armed:
                raise CheckError("an arm command left in a port that was closed is executed")
    return ["what is left in a closed port is not executed", "who opens it is served from the first frame on"]


def _send_and_close(bench: Bench, robot: Robot, share: float) -> None:
    """Give the port this share of an arm command's frame, and close it while the main loop looks after the radio."""
    target = (robot.connection.target_system, robot.connection.target_component)
    numbers = (1.0, FORCE, 0.0, 0.0, 0.0, 0.0, 0.0)
    arm = mavlink.MAVLink_command_long_message(*target, mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 0, *numbers)
    frame = bytes(arm.pack(mavlink.MAVLink(None, srcSystem=251)))
    bench.machine.break_at(READ_RADIO)
    if bench.machine.run(QUIET_S) != Stop.BREAK:
        raise CheckError(f"the main loop does not read the radio: {bench.machine.why}")
    bench.machine.clear_breaks()
    bench.machine.send(Channel.USB, frame[: round(share * len(frame))])
    bench.advance(ARRIVES_S)
    bench.machine.usb_open(False)
    bench.advance(QUIET_S)
    bench.drain()


def _is_served(robot: Robot, passed_s: float) -> None:
    if robot.status.safety is None or robot.connection.rx_bad_bytes != 0:
        raise CheckError(
            f"who opens the port again gets no {Status.message} in {passed_s:.1f} s, "
            f"and {robot.connection.rx_bad_bytes} bytes that are no MAVLink"
        )


CHECKS = (
    Check("radio-speeds", "bit times on the radio's line at each speed it is told", radio_speeds, (CI, NIGHTLY)),
    Check("closed-port", "what is left in a closed USB port is not executed", closed_port, (CI, NIGHTLY)),
)
