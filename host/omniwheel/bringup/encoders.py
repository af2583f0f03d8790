# SPDX-License-Identifier: MIT
"""Each encoder by hand: whose it is, which way it counts, counts per turn, illegal transitions. Nothing is armed."""

from __future__ import annotations

from omniwheel.bringup.bench import Layout, Samples, counted, file_line, flipped, health_of, layout_of, wheel_names
from omniwheel.bringup.person import HandMotion, Person
from omniwheel.bringup.result import Findings, Result
from omniwheel.robot import Robot

RATE_HZ = 20.0
BEGIN_TIMEOUT_S = 60.0
TURN_TIMEOUT_S = 30.0
REST_S = 2.0
BEGIN_REVOLUTIONS = 0.02
"""A wheel that has turned this far is being turned."""
BY_HAND = 0.06
"""How far from one revolution a hand may end."""
_RATIOS = (4.0, 2.0, 0.5, 0.25)
"""What comes of counting one edge, or two, where four are meant, or the other way round."""
_WHICH_WAY = "clockwise as seen from outside the robot (on the floor that drives the body counter-clockwise)"


def check_encoders(robot: Robot, person: Person, *, begin_timeout_s: float = BEGIN_TIMEOUT_S) -> Result:
    """Have every wheel turned by hand by one revolution and judge what the encoders counted."""
    layout = layout_of(robot)
    findings = Findings("encoders")
    errors = health_of(robot).encoder_errors
    with Samples(robot, RATE_HZ) as samples:
        for wheel in range(layout.wheels):
            text = f"Turn wheel {wheel + 1} by hand by one whole revolution, {_WHICH_WAY}, then let go."
            person.move_by_hand(HandMotion.WHEEL, text)
            counts = _turned(robot, samples, layout, begin_timeout_s)
            findings.measured[f"wheel_{wheel + 1}_counts"] = list(counts)
            _judge(findings, layout, wheel, counts)
    _judge_errors(findings, errors, health_of(robot).encoder_errors, layout.wheels)
    return findings.result()


def _turned(robot: Robot, samples: Samples, layout: Layout, begin_timeout_s: float) -> tuple[int, ...]:
    """Wait until a counter moves and all have been at rest for a while; return what they counted."""
    clock = robot.connection.clock
    threshold = max(2, round(BEGIN_REVOLUTIONS * layout.counts_per_revolution))
    start = samples.fresh()
    end_s = clock() + begin_timeout_s
    last, moved_s, begun = start, clock(), False
    while clock() < end_s and not (begun and clock() - moved_s > REST_S):
        sample = samples.fresh()
        if any(counted(last, sample, layout.wheels)):
            moved_s = clock()
        if not begun and max(map(abs, counted(start, sample, layout.wheels))) >= threshold:
            begun, end_s = True, clock() + TURN_TIMEOUT_S
        last = sample
    return counted(start, last, layout.wheels)


def _judge(findings: Findings, layout: Layout, wheel: int, counts: tuple[int, ...]) -> None:
    name = f"encoder {wheel + 1}"
    largest = max(range(layout.wheels), key=lambda i: abs(counts[i]))
    if max(map(abs, counts)) < max(2, BEGIN_REVOLUTIONS * layout.counts_per_revolution):
        if counts[wheel]:
            advice = (
                f"it counts up and down: only one of the lines A and B of encoder {wheel + 1} is connected; check both"
            )
        else:
            advice = (
                f"check encoder {wheel + 1}: 5 V supply, GND, the level shifter, and A and B at the pins of "
                "[wiring] encoder_pins"
            )
        findings.bad(name, "counts nothing while the wheel is turned", advice)
        return
    if largest != wheel:
        findings.bad(
            name,
            f"turning wheel {wheel + 1} moves the counter of wheel {largest + 1}",
            f"encoders {wheel + 1} and {largest + 1} are exchanged: exchange their pairs in the robot file, section "
            "[wiring]: encoder_pins (and build and flash again), or their plugs",
        )
        return
    others = [i for i in range(layout.wheels) if i != wheel and abs(counts[i]) > abs(counts[wheel]) / 10]
    if others:
        findings.bad(name, f"{wheel_names(others)} count, too", "check for a short between two encoders' lines")
        return
    _judge_direction(findings, layout, wheel, counts[wheel])
    _judge_revolution(findings, layout, wheel, abs(counts[wheel]))


def _judge_direction(findings: Findings, layout: Layout, wheel: int, counts: int) -> None:
    forward = counts * layout.encoder_direction[wheel] > 0
    line = file_line("encoder", "direction", flipped(layout.encoder_direction, wheel))
    findings.judge(
        f"encoder {wheel + 1} direction",
        forward,
        f"{counts:+d} counts, direction {layout.encoder_direction[wheel]:+d}",
        f"it counts backwards (A and B exchanged, or the wheel was turned the other way: {_WHICH_WAY}); {line} "
        f"(to try it now: omni params set W{wheel + 1}_ENC_DIR={-layout.encoder_direction[wheel]})",
    )


def _judge_revolution(findings: Findings, layout: Layout, wheel: int, counts: int) -> None:
    share = counts / layout.counts_per_revolution
    ratio = next((r for r in _RATIOS if abs(share / r - 1.0) <= BY_HAND), None)
    if ratio is not None:
        number = round(ratio * layout.counts_per_revolution)
        advice = f"{file_line('encoder', 'counts_per_revolution', number)}: it counts every edge of A and B (lines x 4)"
    else:
        advice = (
            "if it was one whole revolution, "
            f"{file_line('encoder', 'counts_per_revolution', counts)}; else repeat the check"
        )
    findings.judge(
        f"encoder {wheel + 1} revolution",
        abs(share - 1.0) <= BY_HAND,
        f"{counts} counts per revolution, the file has {layout.counts_per_revolution}",
        advice,
    )


def _judge_errors(findings: Findings, before: tuple[int, ...], after: tuple[int, ...], wheels: int) -> None:
    new = [after[i] - before[i] for i in range(wheels)]
    findings.measured["illegal_transitions"] = new
    bad = [i for i in range(wheels) if new[i]]
    findings.judge(
        "illegal transitions",
        not bad,
        ", ".join(f"{wheel_names([i])}: {new[i]}" for i in bad) or "none",
        "A and B changed at once: noise or a weak signal; shorten or shield the encoder's cable, check its supply, and "
        "use pins with a hardware decoder for fast encoders",
    )
