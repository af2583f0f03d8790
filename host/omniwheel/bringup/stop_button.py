# SPDX-License-Identifier: MIT
"""The stop button, pressed by hand on a stand while the wheels turn: it stops them, holds them, and needs a release."""

from __future__ import annotations

from collections.abc import Callable

from omni_schema import Robot as RobotFile
from omniwheel.bringup.bench import (
    Layout,
    Samples,
    layout_of,
    left_disarmed,
    rest_time_s,
    spin,
    stream_duty,
)
from omniwheel.bringup.other_stops import OPENED, OtherStopError, OtherStops, safety_of
from omniwheel.bringup.person import STAND, HandMotion, Person, require
from omniwheel.bringup.result import Findings, Result
from omniwheel.errors import CommandRefusedError
from omniwheel.robot import Robot

DUTY = 0.15
STOP_LIMIT_S = 0.5
"""From the robot's word until the last count."""
WAIT_S = 30.0
"""Time limit for a press or a release."""
PRESS = "The wheels turn. Press the stop button and keep it pressed"
LET_GO = "Release the stop button"
NO_PIN = "none: the robot file has no stop_button_pin"
STILL_OPEN = "stop button is still open"
STOP_FIRST = "a stop came first"  # the firmware's text
"""How the robot refuses a release because another sender has stopped it since."""
_STEP_S = 0.2
_WATCH_S = 1.0
_WIRE = (
    "check that the button is normally closed, between stop_button_pin and ground, and that the firmware was "
    "built from the file with that pin (docs/guides/robot-file.md, Stop button)"
)


def check_stop_button(
    robot: Robot, person: Person, *, duty: float = DUTY, file: RobotFile | None = None, wait_s: float = WAIT_S
) -> Result:
    """Turn the wheels slowly until the operator presses the button. Needs a stand.

    A robot whose ``file`` has no such pin passes, with a word. ``wait_s``: how long the person may take. Raises
    OtherStopError if another stop than the button's is on or comes meanwhile; it stays on.
    """
    findings = Findings("button")
    if file is not None and file.board.stop_button_pin is None:
        findings.good("stop button", NO_PIN)
        return findings.result()
    require(person, STAND)
    if not _closed(robot, findings):
        return findings.result()
    with left_disarmed(robot) as others:
        robot.disarm()  # from now on the robot knows a stop of another sender as a later one
        if _press(robot, others, person, findings, duty, wait_s) and _held(others, findings):
            _release_button(robot, others, person, findings, wait_s)
    return findings.result()


def _closed(robot: Robot, findings: Findings) -> bool:
    """Return whether no press of the button holds the robot already."""
    if safety_of(robot).state != "estop" or not any(OPENED in text.text for text in robot.texts.all):
        return True
    findings.bad(
        "at rest",
        "the button holds the robot stopped, open or pressed before",
        "release the button and the stop (`omni stop --release`), then repeat the check. If it was not pressed: "
        f"{_WIRE}",
    )
    return False


def _until(robot: Robot, condition: Callable[[], bool], wait_s: float, act: Callable[[], None]) -> bool:
    """Do something again and again until a condition holds; return whether it came to hold in time."""
    end_s = robot.connection.clock() + wait_s
    while not condition() and robot.connection.clock() < end_s:
        act()
    return condition()


def _press(robot: Robot, others: OtherStops, person: Person, findings: Findings, duty: float, wait_s: float) -> bool:
    layout = layout_of(robot)
    with Samples(robot) as samples:
        if not spin(robot, others, findings, samples, layout, duty, "press"):
            return False
        mark = robot.texts.mark()

        def said() -> bool:
            return any(OPENED in text.text for text in robot.texts.since(mark))

        person.move_by_hand(HandMotion.PRESS_BUTTON, PRESS)
        pressed = _until(robot, said, wait_s, lambda: _turn(robot, others, layout, duty, said))
        if not pressed:
            findings.bad("press", f"no message of it within {wait_s:g} s", _WIRE)
            return False
        since_s = samples.all[-1].time_s
        stream_duty(robot, [duty] * layout.wheels, _WATCH_S)
        time_s = rest_time_s(samples, layout, since_s)
    findings.measured["rest_s"] = time_s
    seen = "the wheels kept turning" if time_s is None else f"wheels at rest after {time_s:.2f} s"
    advice = "do not drive: switch the motor supply off by hand and look for a defective bridge"
    stopped = time_s is not None and time_s <= STOP_LIMIT_S and safety_of(robot).state == "estop"
    return findings.judge("press", stopped, f"{seen} (limit {STOP_LIMIT_S:.2f} s)", advice)


def _turn(robot: Robot, others: OtherStops, layout: Layout, duty: float, pressed: Callable[[], bool]) -> None:
    stream_duty(robot, [duty] * layout.wheels, _STEP_S)
    others.require_none()
    if robot.status.state == "estop" and not pressed():
        robot.pump(_STEP_S)  # the robot's state may come before its text
        if not pressed():
            others.require_no_estop()


def _held(others: OtherStops, findings: Findings) -> bool:
    refusal = _refusal_of_release(others)
    if refusal is not None:
        held = any(STILL_OPEN in reason for reason in refusal.reasons)
        return findings.judge("held", held, "the release is rejected", _WIRE)
    findings.bad(
        "held",
        "released while the button was pressed",
        f"keep it pressed until you are prompted; if it was pressed: {_WIRE}",
    )
    return False


def _refusal_of_release(others: OtherStops) -> CommandRefusedError | None:
    """Try to release the button's stop; return why not. Raises OtherStopError if there is another stop, too."""
    try:
        others.release_own()
    except OtherStopError as error:
        refusal = error.__cause__
        if isinstance(refusal, CommandRefusedError) and not any(STOP_FIRST in reason for reason in refusal.reasons):
            return refusal
        raise
    return None


def _release_button(robot: Robot, others: OtherStops, person: Person, findings: Findings, wait_s: float) -> None:
    """Only a release leads out: until one is accepted the robot stays stopped."""
    released = False
    stayed = True

    def try_release() -> None:
        nonlocal released, stayed
        robot.pump(_STEP_S)
        stayed = stayed and safety_of(robot).state == "estop"
        released = _refusal_of_release(others) is None

    person.move_by_hand(HandMotion.RELEASE_BUTTON, LET_GO)
    _until(robot, lambda: released, wait_s, try_release)
    robot.pump(_STEP_S)
    state = safety_of(robot).state
    findings.judge("latch", stayed, "stopped until the release", "do not drive: flash the firmware again")
    findings.judge("release", released and state == "disarmed", f"state {state}", f"the contact stays open: {_WIRE}")
