# SPDX-License-Identifier: MIT
"""The three ways to stop, tried on a stand while the wheels turn slowly: emergency stop, silence, lost link."""

from __future__ import annotations

from collections.abc import Callable

from omniwheel.bringup.bench import Layout, Samples, layout_of, left_disarmed, rest_time_s, spin, stream_duty
from omniwheel.bringup.other_stops import OtherStops, safety_of
from omniwheel.bringup.person import STAND, Person, require
from omniwheel.bringup.result import Findings, Result
from omniwheel.errors import ArmingRefusedError
from omniwheel.robot import Robot

DUTY = 0.15
STOP_LIMIT_S = 0.5
"""From the moment the motors should stop until the last count."""
LONGEST_TIMEOUT_S = 30.0
_WATCH_S = 1.0
_HEARTBEAT_S = 1.0


def check_stops(robot: Robot, person: Person, *, duty: float = DUTY) -> Result:
    """Try the emergency stop, the stop after the last setpoint and the stop after the last heartbeat.

    Raises OtherStopError if another station has stopped the robot or does so meanwhile; that stop is not released.
    """
    require(person, STAND)
    layout = layout_of(robot)
    findings = Findings("estop")
    with left_disarmed(robot) as others, Samples(robot) as samples:
        for trial in (_emergency_stop, _command_loss, _link_loss):
            trial(robot, others, findings, samples, layout, duty)
    return findings.result()


def _judge_time(findings: Findings, name: str, time_s: float | None, limit_s: float, advice: str) -> bool:
    findings.measured[f"{name.replace(' ', '_')}_s"] = time_s
    seen = "the wheels kept turning" if time_s is None else f"wheels at rest after {time_s:.2f} s"
    ok = time_s is not None and time_s <= limit_s
    return findings.judge(name, ok, f"{seen} (limit {limit_s:.2f} s)", advice)


def _emergency_stop(
    robot: Robot, others: OtherStops, findings: Findings, samples: Samples, layout: Layout, duty: float
) -> None:
    name = "emergency stop"
    if not spin(robot, others, findings, samples, layout, duty, name):
        return
    since_s = samples.all[-1].time_s
    robot.estop()
    robot.pump(_WATCH_S)
    advice = "do not drive: switch the motor supply off by hand and look for a defective bridge"
    _judge_time(findings, name, rest_time_s(samples, layout, since_s), STOP_LIMIT_S, advice)
    try:
        robot.arm()
    except ArmingRefusedError:
        findings.good("latch", "arming is rejected until the e-stop is released")
    else:
        robot.disarm()
        findings.bad(
            "latch", "the robot armed during an e-stop", "do not drive: the firmware is damaged, flash it again"
        )
    others.release_own()


def _command_loss(
    robot: Robot, others: OtherStops, findings: Findings, samples: Samples, layout: Layout, duty: float
) -> None:
    name = "setpoint loss"
    limit_s = robot.parameters["SAFE_CMD_TO"]
    _timed_stop(
        robot,
        others,
        findings,
        samples,
        layout,
        duty,
        name,
        limit_s,
        "SAFE_CMD_TO",
        lambda: robot.pump(limit_s + _WATCH_S),
    )


def _link_loss(
    robot: Robot, others: OtherStops, findings: Findings, samples: Samples, layout: Layout, duty: float
) -> None:
    name = "link loss"
    limit_s = robot.parameters["SAFE_LINK_TO"]

    def fall_silent() -> None:
        with robot.connection.without_heartbeats():
            stream_duty(robot, [duty] * layout.wheels, limit_s + _HEARTBEAT_S + _WATCH_S)

    _timed_stop(robot, others, findings, samples, layout, duty, name, limit_s, "SAFE_LINK_TO", fall_silent)


def _timed_stop(
    robot: Robot,
    others: OtherStops,
    findings: Findings,
    samples: Samples,
    layout: Layout,
    duty: float,
    name: str,
    limit_s: float,
    parameter: str,
    silence: Callable[[], None],
) -> None:
    """Turn the wheels, fall silent in some way, and see that the robot goes to failsafe in time."""
    if limit_s > LONGEST_TIMEOUT_S:
        advice = f"omni params set {parameter}=3 (at most {LONGEST_TIMEOUT_S:g}), store it, repeat the check"
        findings.bad(name, f"{parameter} is {limit_s:g} s: too long to stop a robot", advice)
        return
    if not spin(robot, others, findings, samples, layout, duty, name):
        return
    since_s = samples.all[-1].time_s
    silence()
    others.require_no_estop()
    time_s = rest_time_s(samples, layout, since_s)
    advice = (
        f"check {parameter}; close other ground stations with equal system and component ids, as their "
        "heartbeats count too; repeat the check"
    )
    _judge_time(findings, name, time_s, limit_s + STOP_LIMIT_S, advice)
    status = safety_of(robot)
    findings.judge(
        f"{name}: failsafe",
        status.state == "failsafe",
        f"state {status.state}, {', '.join(status.fault_history) or 'no fault'}",
        advice,
    )
    robot.disarm()
