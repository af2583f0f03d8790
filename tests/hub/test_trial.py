# SPDX-License-Identifier: MIT
"""Parameters on trial behind a hub: all clients are one link to the robot, but each trial is one client's."""

from __future__ import annotations

import pytest

from omniwheel.dialect import HUB_COMPONENT, TRIAL_ASK, TRIAL_BACK, TRIAL_BEGIN, TRIAL_KEEP, mavlink
from omniwheel.hub.rules import receipt_of
from tests.hub.bench import ACCEPTED, DENIED, LATER, Bench, beat, command

TRIAL = mavlink.MAV_CMD_OMNI_TRIAL


def trials(bench: Bench) -> list[tuple[int, float]]:
    """Return the component that asked and the action, of each command that reached the robot."""
    return [(m.get_srcComponent(), m.param1) for _, m in bench.sent if getattr(m, "command", None) == TRIAL]


def test_a_client_that_goes_in_its_trial_is_cleaned_up_after() -> None:
    """The other client's heartbeats keep the link alive: the robot itself cannot know."""
    bench = Bench()
    tuner, watcher = bench.join("tuner"), bench.join("monitor")
    bench.robot_is(armed=False)
    tuner.send(command(TRIAL, TRIAL_BEGIN))
    bench.run()
    bench.leave(tuner)
    watcher.send(beat())
    bench.run()
    assert trials(bench) == [(190, TRIAL_BEGIN), (HUB_COMPONENT, TRIAL_BACK)]
    assert watcher.results(TRIAL) == [ACCEPTED], "that of the tuner, which all may know; none of the hub's"


@pytest.mark.parametrize("answer", [None, LATER])
def test_the_end_of_a_trial_is_said_until_the_robot_acknowledges_it(answer: int | None) -> None:
    bench = Bench()
    tuner, other = bench.join("tuner"), bench.join("studio")
    bench.robot_is(armed=False)
    tuner.send(command(TRIAL, TRIAL_BEGIN))
    bench.run()
    bench.answers = False
    bench.leave(tuner)
    for _ in range(5):
        bench.run(1.0)
        if answer is not None:
            receipt = receipt_of(bench.sent[-1][1])
            bench.robot_sends(mavlink.MAVLink_command_ack_message(TRIAL, answer, 0, receipt, 255, HUB_COMPONENT))
    other.send(command(TRIAL, TRIAL_BEGIN, count=9))
    bench.run(0.1)
    assert other.results(TRIAL)[-1] == LATER
    bench.answers = True
    bench.run(2.0)
    ends = trials(bench)
    assert len(ends) >= 5
    assert set(ends[1:]) == {(HUB_COMPONENT, TRIAL_BACK)}
    bench.run(5.0)
    assert trials(bench) == ends
    other.send(command(TRIAL, TRIAL_BEGIN, count=10))
    bench.run()
    assert trials(bench)[-1] == (190, TRIAL_BEGIN)


@pytest.mark.parametrize("end", [TRIAL_KEEP, TRIAL_BACK])
def test_a_client_that_goes_before_the_end_of_its_trial_is_acknowledged_is_cleaned_up_after(end: float) -> None:
    bench = Bench()
    tuner = bench.join("tuner")
    bench.robot_is(armed=False)
    tuner.send(command(TRIAL, TRIAL_BEGIN))
    bench.run()
    bench.answers = False
    tuner.send(command(TRIAL, end, count=2))
    bench.run()
    bench.leave(tuner)
    bench.run()
    assert trials(bench)[-1] == (HUB_COMPONENT, TRIAL_BACK)


def test_a_client_that_has_ended_its_trial_leaves_everything_as_it_is() -> None:
    for end in (TRIAL_KEEP, TRIAL_BACK):
        bench = Bench()
        tuner = bench.join("tuner")
        bench.robot_is(armed=False)
        tuner.send(command(TRIAL, TRIAL_BEGIN), command(TRIAL, TRIAL_ASK, count=1), command(TRIAL, end, count=2))
        bench.run()
        bench.leave(tuner)
        bench.run()
        assert trials(bench) == [(190, TRIAL_BEGIN), (190, TRIAL_ASK), (190, end)]


def test_the_trial_of_one_client_is_kept_from_the_others() -> None:
    bench = Bench()
    tuner, other = bench.join("tuner"), bench.join("studio")
    bench.robot_is(armed=False)
    tuner.send(command(TRIAL, TRIAL_BEGIN))
    bench.run()
    other.inbox.clear()
    for action in (TRIAL_BEGIN, TRIAL_KEEP, TRIAL_BACK, TRIAL_ASK):
        other.send(command(TRIAL, action, count=7))
        bench.run()
    assert other.results(TRIAL) == [DENIED] * 4
    assert "hub: tuner tries parameters" in other.texts()
    assert trials(bench) == [(190, TRIAL_BEGIN)]
    tuner.send(command(TRIAL, TRIAL_KEEP))
    bench.run()
    other.send(command(TRIAL, TRIAL_BEGIN))
    bench.run()
    assert trials(bench)[1:] == [(190, TRIAL_KEEP), (190, TRIAL_BEGIN)]


def test_a_trial_that_was_only_asked_about_or_refused_keeps_nobody_out() -> None:
    bench = Bench()
    bench.answers = False
    first, second = bench.join("studio"), bench.join("tuner")
    bench.robot_is(armed=False)
    for number, action in enumerate((TRIAL_ASK, TRIAL_BEGIN), 1):
        first.send(command(TRIAL, action, count=number))
        bench.run()
        receipt = receipt_of(bench.sent[-1][1])
        bench.robot_sends(mavlink.MAVLink_command_ack_message(TRIAL, DENIED, 0, receipt, 255, 190))
        bench.run()
    second.send(command(TRIAL, TRIAL_BEGIN, count=3))
    bench.run()
    assert not any("tries parameters" in text for text in second.texts())
    assert trials(bench) == [(190, TRIAL_ASK), (190, TRIAL_BEGIN), (190, TRIAL_BEGIN)]
