# SPDX-License-Identifier: MIT
"""What stops an armed robot stops this image, from every link, as soon as docs/reference/safety.md promises."""

from __future__ import annotations

from collections.abc import Callable

from emulated_teensy.machine import Channel
from image_check.bench import Bench, CheckError, Context
from image_check.check import CI, NIGHTLY, Check
from omniwheel.dialect import mavlink
from omniwheel.robot import FORCE, Robot

DUTY = 0.2
SPIN_S = 0.3
TICK_S = 0.001
COMMAND_LIMIT_S = 3 * TICK_S
"""Last byte of the command to bridges off: two ticks, and the bus update of the second."""
LATE_S = 0.010
"""How much later than its parameter says a time-out may act."""
BURST = 40
"""More than fit the queue that stops once shared with fixes and heartbeats."""
BURST_READ_S = TICK_S
"""The USB port passes such a burst on within a tick."""
RADIO_BYTE_S = 10 / 9600
TURN_RAD_S = 0.5


def driving(bench: Bench) -> Robot:
    """Connect over USB, arm, and turn the robot on the spot; its setpoints end with the call. Raises CheckError."""
    robot = bench.connect()
    robot.pump(1.2)
    robot.arm()
    robot.repeat(lambda: robot.set_velocity(0.0, 0.0, TURN_RAD_S), SPIN_S)
    if not bench.powered:
        raise CheckError("the robot is armed and has a setpoint, but its motors get no voltage")
    return robot


def _time_to_off(bench: Bench, act: Callable[[], float], limit_s: float, what: str) -> float:
    """Return the time from the last byte that ``act`` sends to bridges off for good; it returns the bytes' time."""
    line_s = act()
    begin_s = bench.clock_s() + line_s
    bench.until(lambda: not bench.powered, line_s + limit_s, f"{what}: bridges off")
    off_s = bench.clock_s() - begin_s
    for _ in range(50):
        bench.advance(TICK_S)
        if bench.powered:
            raise CheckError(f"{what}: the bridges were switched on again")
    return off_s


def _send(robot: Robot, channel: Channel, command: int, *parameters: float) -> Callable[[], float]:
    def act() -> float:
        numbers = [*parameters, *([0.0] * (7 - len(parameters)))]
        target = (robot.connection.target_system, robot.connection.target_component)
        message = mavlink.MAVLink_command_long_message(*target, command, 0, *numbers)
        robot.send(message)
        return 0.0 if channel == Channel.USB else len(message.get_msgbuf()) * RADIO_BYTE_S

    return act


COMMANDS = (
    ("emergency stop", mavlink.MAV_CMD_OMNI_ESTOP, (1.0,)),
    ("disarm", mavlink.MAV_CMD_COMPONENT_ARM_DISARM, (0.0, FORCE)),
)


def commands(context: Context) -> list[str]:
    """Emergency stop and disarm over USB and over the radio, each from a driving robot."""
    figures = []
    with context.booted() as bench:
        driving(bench)
        moving = bench.machine.snapshot()
        for name, command, parameters in COMMANDS:
            for channel in Channel:
                bench.machine.restore(moving)
                robot = bench.connect(channel, heartbeat=False)
                off_s = _time_to_off(
                    bench, _send(robot, channel, command, *parameters), 0.1, f"{name} over {channel.name}"
                )
                if off_s > COMMAND_LIMIT_S:
                    raise CheckError(f"{name} over {channel.name}: bridges off after {1e3 * off_s:.1f} ms")
                figures.append(f"{name} over {channel.name}: {1e3 * off_s:.1f} ms")
    return figures


def backlog(context: Context) -> list[str]:
    """The same over USB, behind what a link delivers in one burst after a pause."""
    figures = []
    floods = {
        "pose fixes": [mavlink.MAVLink_omni_pose_fix_message(0, number % 5, 0, 0) for number in range(BURST)],
        "heartbeats": [mavlink.MAVLink_heartbeat_message(6, 8, 0, 0, 0, 3) for _ in range(BURST)],
    }
    with context.booted() as bench:
        driving(bench)
        moving = bench.machine.snapshot()
        for before, frames in floods.items():
            for name, command, parameters in COMMANDS:
                bench.machine.restore(moving)
                robot = bench.connect(heartbeat=False)
                for message in frames:
                    robot.send(message)
                what = f"{name} behind {BURST} {before}"
                off_s = _time_to_off(bench, _send(robot, Channel.USB, command, *parameters), 0.1, what)
                if off_s > COMMAND_LIMIT_S + BURST_READ_S:
                    raise CheckError(f"{what}: bridges off after {1e3 * off_s:.1f} ms")
                figures.append(f"{what}: {1e3 * off_s:.1f} ms")
    return figures


def silence(context: Context) -> list[str]:
    """Setpoints stop coming; then, in a robot that needs none, the ground station's heartbeats."""
    values = context.scenario.parameter_values()
    with context.booted() as bench:
        robot = driving(bench)
        command_s = _time_to_off(bench, lambda: 0.0, 2 * values["SAFE_CMD_TO"], "setpoints stop")
        _within(command_s, values["SAFE_CMD_TO"], "setpoints stop")
        robot.pump(0.2)
        robot.disarm()
        robot.start_trajectory("circle")
        robot.arm()
        robot.pump(1.0)
        with robot.connection.without_heartbeats():
            link_s = _time_to_off(bench, lambda: 0.0, 2 * values["SAFE_LINK_TO"], "heartbeats stop")
        _within(link_s, values["SAFE_LINK_TO"], "heartbeats stop")
    return [f"setpoints stop: {1e3 * command_s:.0f} ms", f"heartbeats stop: {1e3 * link_s:.0f} ms"]


def _within(measured_s: float, promised_s: float, what: str) -> None:
    if measured_s > promised_s + LATE_S:
        raise CheckError(
            f"{what}: bridges off after {1e3 * measured_s:.0f} ms, {1e3 * promised_s:.0f} ms are the limit"
        )


CHECKS = (
    Check("stop-commands", "emergency stop and disarm, from both links", commands),
    Check("stop-backlog", "emergency stop and disarm behind a burst of fixes or heartbeats", backlog),
    Check("silence", "setpoints or heartbeats stop coming", silence, (CI, NIGHTLY)),
)
