# SPDX-License-Identifier: MIT
"""Each motor on a stand at low duty: is it the right one, which way does it turn, how fast, from which duty on."""

from __future__ import annotations

from dataclasses import dataclass

from omniwheel.bringup.bench import (
    Layout,
    Samples,
    armed,
    counted,
    file_line,
    flipped,
    layout_of,
    mean_voltage_V,
    stream_duty,
    swapped,
    wheel_names,
)
from omniwheel.bringup.person import STAND, Person, require
from omniwheel.bringup.result import Findings, Result
from omniwheel.limits import MOTORS_DUTY
from omniwheel.robot import Robot

SETTLE_S = 0.3
RUN_S = 1.0
REST_S = 0.4
MOVED_SHARE = 0.15
"""A wheel that turns with less than this share of the motor model's speed stands still."""
MIN_COUNTS = 4
SPEED_RANGE = (0.6, 1.6)
"""Allowed speed divided by the motor model's."""
SYMMETRY = 0.7
_WARNING = 4
_STEP_S = 0.1
_STEP_DUTY = 0.01
_CPR_RATIOS = (4.0, 2.0, 0.5, 0.25)


@dataclass(frozen=True)
class Turn:
    """One motor driven for a while: mean voltage [V] in the wheel's direction, counts of every encoder, time [s]."""

    duty: float
    voltage_V: float
    counts: tuple[int, ...]
    time_s: float


def check_motors(robot: Robot, person: Person, *, duty: float = MOTORS_DUTY) -> Result:
    """Drive one motor after the other both ways at ``duty`` and judge what the encoders saw. Needs a stand."""
    require(person, STAND)
    layout = layout_of(robot)
    findings = Findings("motors")
    with Samples(robot) as samples:
        for wheel in range(layout.wheels):
            person.show(f"wheel {wheel + 1} turns both ways at {100 * duty:g} % duty")
            mark = robot.texts.mark()
            forward, back = (_turn(robot, samples, layout, wheel, sign * duty) for sign in (1.0, -1.0))
            findings.measured[f"wheel_{wheel + 1}"] = {"forward": vars(forward), "back": vars(back)}
            if not _was_driven(robot, findings, wheel, layout, (forward, back), mark):
                break
            if _turns_alone(findings, person, layout, wheel, forward, back):
                _judge_direction(findings, person, layout, wheel, forward, back)
                _judge_speed(findings, layout, wheel, forward, back)
                _measure_deadband(robot, findings, samples, layout, wheel, duty)
    return findings.result()


def _duties(layout: Layout, wheel: int, duty: float) -> list[float]:
    return [duty if i == wheel else 0.0 for i in range(layout.wheels)]


def _turn(robot: Robot, samples: Samples, layout: Layout, wheel: int, duty: float) -> Turn:
    duties = _duties(layout, wheel, duty)
    with armed(robot):
        stream_duty(robot, duties, SETTLE_S)
        samples.forget()
        stream_duty(robot, duties, RUN_S)
        before, after = samples.all[0], samples.all[-1]
        stream_duty(robot, [0.0] * layout.wheels, REST_S)
    time_s = after.time_s - before.time_s
    return Turn(duty, mean_voltage_V(before, after, wheel), counted(before, after, layout.wheels), time_s)


def _was_driven(
    robot: Robot, findings: Findings, wheel: int, layout: Layout, turns: tuple[Turn, ...], mark: int
) -> bool:
    """See that the firmware put the voltage out; note it otherwise."""
    if all(turn.voltage_V / turn.duty > 0.3 * layout.supply_V for turn in turns):
        return True
    warnings = [text.text for text in robot.texts.since(mark) if text.severity <= _WARNING]
    said = [text for text in warnings if text.startswith("failsafe")] or warnings[-1:]
    findings.bad(
        f"motor {wheel + 1}",
        f"the robot stopped by itself: {'; '.join(said) or 'without a reason'}",
        "correct that first (`omni monitor` shows the faults), then repeat the check",
    )
    return False


def _expected_counts(layout: Layout, turn: Turn) -> float:
    return abs(turn.voltage_V) / layout.speed_V_s / layout.rad_per_count * turn.time_s


def _movers(layout: Layout, turn: Turn) -> list[int]:
    threshold = max(MIN_COUNTS, MOVED_SHARE * _expected_counts(layout, turn))
    return [i for i in range(layout.wheels) if abs(turn.counts[i]) >= threshold]


def _turns_alone(findings: Findings, person: Person, layout: Layout, wheel: int, *turns: Turn) -> bool:
    """Judge whether the motor moves its own wheel's encoder and no other."""
    seen = sorted({i for turn in turns for i in _movers(layout, turn)})
    name = f"motor {wheel + 1}"
    if not seen:
        _judge_silence(findings, person, layout, wheel)
        return False
    if wheel not in seen:
        _judge_crossing(findings, person, layout, wheel, seen)
        return False
    if len(seen) > 1:
        findings.bad(
            name,
            f"{wheel_names(seen)} turn",
            f"check that no two motors share a PWM channel: wheel {wheel + 1} has {layout.in1_channel[wheel]} and "
            f"{layout.in2_channel[wheel]}; check the wires from the PWM board to the bridges",
        )
        return False
    findings.good(name, f"turns wheel {wheel + 1} alone")
    return True


def _judge_silence(findings: Findings, person: Person, layout: Layout, wheel: int) -> None:
    turned = person.saw(f"Did wheel {wheel + 1} turn?")
    motor = (
        f"check motor {wheel + 1}: motor supply, the bridge's output wires, IN1 on PWM channel "
        f"{layout.in1_channel[wheel]}, IN2 on {layout.in2_channel[wheel]}; turn the wheel by hand to check that it "
        "is free"
    )
    encoder = f"encoder {wheel + 1} is dead or stuck: run `omni bringup encoders`"
    advice = {True: encoder, False: motor, None: f"if the wheel stood still, {motor}; if it turned, {encoder}"}[turned]
    findings.bad(f"motor {wheel + 1}", f"no encoder sees wheel {wheel + 1} turn", advice)


def _judge_crossing(findings: Findings, person: Person, layout: Layout, wheel: int, seen: list[int]) -> None:
    other = seen[0]
    pair = f"{min(wheel, other) + 1} and {max(wheel, other) + 1}"
    own_turned = person.saw(f"Did wheel {wheel + 1} itself turn?")
    motors = (
        f"motors {pair} are exchanged: "
        + file_line("wiring", "in1_channel", swapped(layout.in1_channel, wheel, other))
        + " and in2_channel = "
        + str(swapped(layout.in2_channel, wheel, other))
    )
    encoders = (
        f"encoders {pair} are exchanged: exchange their pairs in the robot file, section "
        "[wiring]: encoder_pins (and build and flash again), or their plugs"
    )
    both = f"if `omni bringup encoders` passed, {motors}; else {encoders}"
    advice = {True: encoders, False: motors, None: both}[own_turned]
    findings.bad(f"motor {wheel + 1}", f"it turns {wheel_names(seen)} instead", advice)


def _judge_direction(findings: Findings, person: Person, layout: Layout, wheel: int, forward: Turn, back: Turn) -> None:
    direction = layout.encoder_direction[wheel]
    signs = [turn.counts[wheel] * direction * (1 if turn.duty > 0 else -1) > 0 for turn in (forward, back)]
    name = f"motor {wheel + 1} direction"
    if signs == [True, True]:
        findings.good(name, "follows the sign of the duty")
    elif signs[0] != signs[1]:
        findings.bad(
            name,
            "it turns in one direction for both signs of the duty",
            f"one of the bridge's inputs is not connected: IN1 on PWM channel {layout.in1_channel[wheel]}, IN2 on "
            f"{layout.in2_channel[wheel]}",
        )
    else:
        _judge_reversal(findings, person, layout, wheel, name)


def _judge_reversal(findings: Findings, person: Person, layout: Layout, wheel: int, name: str) -> None:
    right = person.saw(
        f"When wheel {wheel + 1} began to turn, did it turn clockwise as seen from outside the robot, and then "
        "counter-clockwise?"
    )
    motor = file_line("motor", "direction", flipped(layout.motor_direction, wheel))
    motor += f" (or exchange the motor's two wires; to try: omni params set W{wheel + 1}_MOT_DIR="
    motor += f"{-layout.motor_direction[wheel]})"
    encoder = file_line("encoder", "direction", flipped(layout.encoder_direction, wheel))
    both = f"if `omni bringup encoders` passed, {motor}; else {encoder}"
    advice = {True: encoder, False: motor, None: both}[right]
    findings.bad(name, "motor and encoder disagree about the direction", advice)


def _judge_speed(findings: Findings, layout: Layout, wheel: int, forward: Turn, back: Turn) -> None:
    ratios = [abs(turn.counts[wheel]) / _expected_counts(layout, turn) for turn in (forward, back)]
    ratio = sum(ratios) / 2
    near = next((r for r in _CPR_RATIOS if 0.8 < ratio / r < 1.1), None)
    advice = "the motor model is not this motor's: `omni identify live --on-stand` measures it"
    if near is not None:
        number = round(near * layout.counts_per_revolution)
        advice = f"if it is the encoder: {file_line('encoder', 'counts_per_revolution', number)}; else {advice}"
    findings.measured[f"wheel_{wheel + 1}"]["speed_over_model"] = ratio
    findings.judge(
        f"motor {wheel + 1} speed",
        SPEED_RANGE[0] <= ratio <= SPEED_RANGE[1],
        f"{ratio:.2f} times the motor model's no-load speed",
        advice,
    )
    findings.judge(
        f"motor {wheel + 1} symmetry",
        min(ratios) >= SYMMETRY * max(ratios),
        f"forward {ratios[0]:.2f}, back {ratios[1]:.2f} times the model",
        "it is weaker in one direction: check that wheel for friction, and the bridge's two inputs",
    )


def _measure_deadband(
    robot: Robot, findings: Findings, samples: Samples, layout: Layout, wheel: int, limit: float
) -> None:
    """Raise the duty until the wheel moves; a measurement, not a verdict."""
    step = max(MIN_COUNTS, layout.counts_per_revolution // 1000)
    with armed(robot):
        stream_duty(robot, [0.0] * layout.wheels, REST_S)
        start = samples.fresh()
        duty = 0.0
        while duty < limit:
            duty += _STEP_DUTY
            stream_duty(robot, _duties(layout, wheel, duty), _STEP_S)
            if abs(counted(start, samples.all[-1], layout.wheels)[wheel]) >= step:
                break
        stream_duty(robot, [0.0] * layout.wheels, REST_S)
    findings.measured[f"wheel_{wheel + 1}"]["deadband_duty"] = duty
    findings.good(f"motor {wheel + 1} deadband", f"it moves from a duty of about {duty:.2f} on")
