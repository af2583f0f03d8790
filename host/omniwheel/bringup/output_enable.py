# SPDX-License-Identifier: MIT
"""The output-enable pin alone must stop the motors: driven to off, and let go of as in a reset.

The firmware leaves the PWM chip alone meanwhile (MAV_CMD_OMNI_OE_TEST), so the chip goes on with its duties. Wheels
that stop are stopped by the pin. At the end of each trial the firmware disarms by itself, and so do we.
"""

from __future__ import annotations

from omni_schema import Robot as RobotFile
from omniwheel.bringup.bench import Layout, Samples, layout_of, left_disarmed, rest_time_s, spin, stream_duty
from omniwheel.bringup.other_stops import OtherStops, safety_of
from omniwheel.bringup.person import STAND, Person, require
from omniwheel.bringup.result import Findings, Result
from omniwheel.dialect import mavlink
from omniwheel.errors import CommandRefusedError
from omniwheel.limits import OUTPUT_ENABLE_DUTY
from omniwheel.robot import Robot

TRIAL_S = 1.5
REST_LIMIT_S = 1.0
"""From the moment the pin goes off until the last count; the rest of the trial shows that it stays so."""
_STREAM_S = 1.4
_WATCH_S = 1.0

_NO_PIN = "no output-enable pin"
NOT_WIRED = (
    "not wired: only the I2C bus can stop a motor. A hung processor keeps the motors running until its watchdog "
    "restarts it, and "
    "after a press of the Teensy's button the motors run until the motor supply is off"
)
_PIN_ADVICE = (
    "check the wire from output_enable_pin to the PCA9685's OE, and that OE is not tied to ground. Until then only "
    "the bus "
    "can stop a motor (docs/guides/robot-file.md, Output enable)"
)
_PULL_UP_ADVICE = (
    "OE falls when the processor's pin floats: put 1 kOhm from OE to 3.3 V, or remove the board's own pull-down. "
    "Measure it with the Teensy's button pressed and the motor supply off: at least 2.4 V"
)
BY_HAND = (
    "Now by hand, still on the stand: motor supply on, then unplug the Teensy and plug it in again, and press its "
    "button. No wheel may twitch"
)


def check_output_enable(
    robot: Robot, person: Person, *, duty: float = OUTPUT_ENABLE_DUTY, file: RobotFile | None = None
) -> Result:
    """Turn the wheels slowly and stop them by the pin, then by its pull-up. Needs a stand.

    A robot whose ``file`` or firmware has no such pin passes, with a word on what that means.
    """
    findings = Findings("oe")
    if (file is not None and file.board.output_enable_pin is None) or not _has_pin(robot):
        findings.good("output enable", NOT_WIRED)
        return findings.result()
    require(person, STAND)
    layout = layout_of(robot)
    with left_disarmed(robot) as others, Samples(robot) as samples:
        trials = (("pin", False, _PIN_ADVICE), ("pull-up", True, _PULL_UP_ADVICE))
        if all(_trial(robot, others, findings, samples, layout, duty, *trial) for trial in trials):
            person.show(BY_HAND)
    return findings.result()


def _has_pin(robot: Robot) -> bool:
    """Ask the firmware, disarmed: it then refuses the test in any case, and says why."""
    robot.disarm()
    try:
        robot.commands.send(mavlink.MAV_CMD_OMNI_OE_TEST, TRIAL_S, 0.0, what="to test the output-enable pin")
    except CommandRefusedError as refusal:
        if refusal.result == "UNSUPPORTED" and not any(_NO_PIN in reason for reason in refusal.reasons):
            raise  # a firmware that does not know the command
        return refusal.result != "UNSUPPORTED"
    return True


def _trial(
    robot: Robot,
    others: OtherStops,
    findings: Findings,
    samples: Samples,
    layout: Layout,
    duty: float,
    name: str,
    release: bool,
    advice: str,
) -> bool:
    """Stop turning wheels in one way; return whether they stopped, and by it."""
    if not spin(robot, others, findings, samples, layout, duty, name):
        return False
    since_s = samples.all[-1].time_s
    robot.commands.send(mavlink.MAV_CMD_OMNI_OE_TEST, TRIAL_S, float(release), what="to test the output-enable pin")
    stream_duty(robot, [duty] * layout.wheels, _STREAM_S)
    robot.pump(_WATCH_S)
    others.require_no_estop()
    time_s = rest_time_s(samples, layout, since_s)
    status = safety_of(robot)
    robot.disarm()
    findings.measured[f"{name.replace('-', '_')}_s"] = time_s
    if status.fault_history:
        seen = f"the robot stopped by itself: {', '.join(status.fault_history)}"
        findings.bad(name, seen, "correct that first (`omni monitor` shows the faults), then repeat the check")
        return False
    stopped = time_s is not None and time_s <= REST_LIMIT_S
    by_itself = time_s is not None and time_s < TRIAL_S
    seen = (
        f"wheels at rest after {time_s:.2f} s"
        if by_itself
        else "the wheels turned until they were stopped over the bus"
    )
    return findings.judge(name, stopped, f"{seen} (limit {REST_LIMIT_S:.2f} s)", advice)
