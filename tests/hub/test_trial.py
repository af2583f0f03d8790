# SPDX-License-Identifier: MIT
"""Parameters on trial behind a hub: all clients are one link to the robot, but each trial is one client's."""

from __future__ import annotations

import pytest

from omni.hub.rules import receipt_of
from omniwheel.dialect import HUB_COMPONENT, TRIAL_ASK, TRIAL_BACK, TRIAL_BEGIN, TRIAL_KEEP, mavlink
from omniwheel.robots import parameter_table
from tests.hub.bench import ACCEPTED, DENIED, LATER, TRIAL, Bench, Station, beat, command


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
    assert "hub: tuner began a parameter trial" in other.texts()
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
    assert not any("parameter trial" in text for text in second.texts())
    assert trials(bench) == [(190, TRIAL_ASK), (190, TRIAL_BEGIN), (190, TRIAL_BEGIN)]


SILENCE = "SAFE_LINK_TO"
TIMEOUT_S = parameter_table()[SILENCE].default


def began(bench: Bench) -> Station:
    """Return a client whose trial goes on."""
    tuner = bench.join("tuner")
    bench.robot_is(armed=False)
    tuner.send(beat(), command(TRIAL, TRIAL_BEGIN, count=1))
    bench.run()
    assert bench.trial_goes_on
    return tuner


def test_a_client_that_hangs_in_its_trial_but_stays_connected_is_cleaned_up_after() -> None:
    bench = Bench()
    tuner, watcher = began(bench), bench.join("monitor")
    for _ in range(10):
        tuner.send(beat())
        watcher.send(beat())
        bench.run(1.0, 0.01)
    assert bench.trial_goes_on
    for _ in range(round(TIMEOUT_S) + 2):
        watcher.send(beat())
        bench.run(1.0, 0.01)
    assert not bench.trial_goes_on
    watcher.send(command(TRIAL, TRIAL_BEGIN, count=2))
    bench.run()
    assert watcher.results(TRIAL)[-1] == ACCEPTED


def test_a_client_may_be_silent_in_its_trial_for_as_long_as_the_robot_allows_a_link() -> None:
    bench = Bench()
    began(bench)
    assert bench.looks[0][1].param_id == SILENCE, "the hub asks the robot"
    bench.robot_sends(mavlink.MAVLink_param_value_message(SILENCE.encode(), 20.0, 9, 300, 65535))
    bench.run(19.0, 0.01)
    assert bench.trial_goes_on
    bench.run(3.0, 0.01)
    assert not bench.trial_goes_on


@pytest.mark.parametrize("lost", [False, True], ids=["answered", "answer lost"])
def test_a_refused_begin_ends_no_trial(lost: bool) -> None:
    """It is refused because one goes on: that of this client."""
    bench = Bench()
    tuner, watcher = bench.join("tuner"), bench.join("monitor")
    bench.robot_is(armed=False)
    bench.run()
    tuner.send(beat())
    if lost:
        bench.trial_goes_on, bench.answers = True, False
    tuner.send(command(TRIAL, TRIAL_BEGIN, count=1))
    bench.run()
    bench.answers = True
    tuner.send(command(TRIAL, TRIAL_BEGIN, count=2))
    bench.run()
    assert tuner.results(TRIAL)[-1] == DENIED
    watcher.send(command(TRIAL, TRIAL_BEGIN, count=1))
    bench.run()
    assert any("tuner began a parameter trial" in text for text in watcher.texts())
    assert bench.trial_goes_on
    bench.leave(tuner)
    bench.run()
    assert not bench.trial_goes_on


@pytest.mark.parametrize("hand_over", ["by its client", "by a program that is gone"])
def test_a_trial_that_goes_on_when_the_hub_takes_the_robot_over(hand_over: str) -> None:
    """The robot's link is a serial port, which does not see programs come and go."""
    bench = Bench(opened=False)
    bench.trial_goes_on = True
    client = bench.join("127.0.0.1:1")
    if hand_over == "by its client":
        client.send(mavlink.MAVLink_statustext_message(6, b"this was omni tune (1)"))
    bench.hub.port_opened()
    watcher = bench.join("monitor")
    for _ in range(6):
        bench.robot_is(armed=False)
        client.send(beat())
        watcher.send(beat())
        bench.run(1.0, 0.01)
    assert bench.trial_goes_on == (hand_over == "by its client")
    bench.leave(client)
    bench.run()
    assert not bench.trial_goes_on


def test_the_question_whether_a_trial_goes_on_is_asked_until_it_is_answered_but_not_for_ever() -> None:
    bench = Bench()
    bench.join("monitor")
    bench.answers = False
    bench.trial_goes_on = True
    bench.robot_is(armed=False)
    bench.run(3.0, 0.01)
    assert bench.trial_goes_on
    bench.answers = True
    bench.run(3.0, 0.01)
    assert not bench.trial_goes_on
    silent = Bench()
    silent.answers = False
    silent.robot_is(armed=False)
    silent.run(60.0, 0.01)
    assert len(silent.looks) < 30


def test_a_trial_that_the_robot_has_ended_by_itself_keeps_nobody_out() -> None:
    """It has restarted: its clock goes back."""
    bench = Bench()
    began(bench)
    other = bench.join("studio")
    bench.trial_goes_on = False
    for boot_ms in (50_000, 10):
        bench.robot_sends(mavlink.MAVLink_attitude_message(boot_ms, 0, 0, 0, 0, 0, 0))
    bench.robot_is(armed=False)
    bench.run()
    other.send(command(TRIAL, TRIAL_BEGIN, count=1))
    bench.run()
    assert other.results(TRIAL) == [ACCEPTED]


def test_the_trial_of_another_robot_on_the_line_is_taken_back_there() -> None:
    bench = Bench()
    tuner = bench.join("tuner")
    bench.robot_is(armed=False)
    begin = command(TRIAL, TRIAL_BEGIN)
    begin.target_system = 2
    tuner.send(begin)
    bench.run()
    bench.leave(tuner)
    bench.run()
    assert [(m.target_system, m.param1) for m in bench.commands(TRIAL)] == [(2, TRIAL_BEGIN), (2, TRIAL_BACK)]


def test_a_robot_that_gets_another_system_id_in_a_trial_keeps_it() -> None:
    bench = Bench()
    tuner = began(bench)
    tuner.send(mavlink.MAVLink_param_set_message(1, 1, b"SYS_ID", 5.0, 9))
    bench.robot_system(5)
    for _ in range(3):
        bench.robot_is(armed=False)
        tuner.send(beat())
        bench.run(1.0, 0.01)
    assert bench.trial_goes_on
    bench.leave(tuner)
    bench.run()
    assert bench.commands(TRIAL)[-1].target_system == 5
