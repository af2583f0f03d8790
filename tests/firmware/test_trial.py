# SPDX-License-Identifier: MIT
"""Parameters on trial: the robot takes them back by itself if whoever tries them has gone."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from omniwheel.dialect import HUB_COMPONENT
from tests.firmware.client import Client, connect, firmware, mav
from tests.firmware.test_commands import ARM, ARMED, DISARMED, FAILSAFE
from tests.firmware.test_stations import TwoLinks

TRIAL, STORAGE = mav.MAV_CMD_OMNI_TRIAL, mav.MAV_CMD_PREFLIGHT_STORAGE
KEEP, BEGIN, BACK, ASK = 0.0, 1.0, 2.0, 3.0
ACCEPTED, DENIED = mav.MAV_RESULT_ACCEPTED, mav.MAV_RESULT_DENIED
NEWS = "trial ended: parameters are as before"
NAME, BEFORE = "ISMC_LAM_XY", 12.0


@pytest.fixture
def two() -> Iterator[TwoLinks]:
    """Station 1 has begun a trial and tries a gain; station 2 watches."""
    with firmware("--lockstep", links=("tcp:127.0.0.1:0", "tcp:127.0.0.1:0")) as robot:
        links = TwoLinks(connect(robot, 0), connect(robot, 1))
        links.first.set("SAFE_LINK_TO", 0.5)
        links.run(0.3, links.first, links.second)
        assert links.first.get(NAME) == BEFORE
        assert links.first.command(TRIAL, BEGIN) == ACCEPTED
        assert links.first.set(NAME, 3.5) == 3.5
        yield links
        links.first.socket.close()
        links.second.socket.close()


def test_a_silent_station_loses_what_it_tried(two: TwoLinks) -> None:
    two.run(0.4, two.second)
    assert two.second.get(NAME) == 3.5
    assert NEWS not in two.texts
    two.run(0.8, two.second)
    assert two.second.get(NAME) == BEFORE
    assert two.texts.count(NEWS) == 1
    assert two.first.command(TRIAL, ASK) == DENIED
    assert two.first.set(NAME, 4.5) == 4.5  # no trial any more: this stays
    two.run(0.8, two.second)
    assert two.second.get(NAME) == 4.5


def test_others_are_told_of_what_is_taken_back(two: TwoLinks) -> None:
    two.run(0.2, two.first, two.second)
    two.second.inbox.clear()
    assert two.first.command(TRIAL, BACK) == ACCEPTED
    assert two.second.wait("PARAM_VALUE", param_id=NAME).param_value == BEFORE


def test_what_is_kept_stays(two: TwoLinks) -> None:
    assert two.first.command(TRIAL, ASK) == ACCEPTED
    assert two.first.command(TRIAL, KEEP) == ACCEPTED
    assert two.first.command(TRIAL, ASK) == DENIED
    two.run(0.8, two.second)
    assert two.second.get(NAME) == 3.5
    assert NEWS not in two.texts


def test_a_driving_robot_stops_first(two: TwoLinks) -> None:
    two.first.armed()
    assert two.run(0.3, two.first, two.second) == ARMED
    assert two.first.command(TRIAL, BACK) == ACCEPTED
    assert two.run(0.2, two.first, two.second) == ARMED
    assert two.first.get(NAME) == 3.5
    assert two.run(0.8, two.second) == FAILSAFE
    assert two.second.get(NAME) == BEFORE


def test_a_silence_while_driving_is_not_forgotten(two: TwoLinks) -> None:
    """Another station drives on; the one that tries something comes back too late."""
    two.first.armed()
    two.run(0.3, two.first, two.second)
    two.second.mav.command_long_send(1, 1, mav.MAV_CMD_OMNI_TRAJECTORY_STOP, 0, 0, 0, 0, 0, 0, 0, 0)
    two.second.wait("COMMAND_ACK", command=mav.MAV_CMD_OMNI_TRAJECTORY_STOP)
    assert two.run(0.8, two.second) == ARMED
    assert two.run(0.3, two.first, two.second) == ARMED
    assert two.first.command(TRIAL, ASK) == DENIED
    assert two.first.get(NAME) == 3.5
    assert two.first.command(ARM, 0) == ACCEPTED
    assert two.run(0.1, two.first, two.second) == DISARMED
    assert two.first.get(NAME) == BEFORE


@pytest.mark.parametrize("where", ["on another link", "on the same link"])
def test_a_trial_belongs_to_its_station(two: TwoLinks, where: str) -> None:
    other = two.second if where == "on another link" else neighbour(two.first)
    two.run(0.2, two.first, other)
    for action in (BEGIN, KEEP, BACK, ASK):
        assert other.command(TRIAL, action) == DENIED
    assert two.second.get(NAME) == 3.5
    assert two.first.command(TRIAL, ASK) == ACCEPTED
    assert two.first.command(TRIAL, BEGIN) == DENIED
    assert two.first.command(TRIAL, BACK) == ACCEPTED
    assert two.second.get(NAME) == BEFORE


def neighbour(client: Client, component: int = 190) -> Client:
    """Return another station on the same link, as on one radio channel."""
    other = Client(client.socket)
    other.mav.srcSystem, other.mav.srcComponent = 254, component
    return other


def test_what_another_station_says_after_the_end_changes_nothing(two: TwoLinks) -> None:
    other = neighbour(two.first)
    assert two.first.command(TRIAL, KEEP) == ACCEPTED
    for action in (KEEP, BACK, ASK):
        assert other.command(TRIAL, action) == DENIED
    assert two.second.get(NAME) == 3.5


def test_a_silent_station_is_not_kept_alive_by_another_on_its_link(two: TwoLinks) -> None:
    two.run(0.8, neighbour(two.first))
    assert two.second.get(NAME) == BEFORE


def test_the_hub_of_a_link_ends_the_trial_of_a_program_that_has_gone(two: TwoLinks) -> None:
    hub, far_hub = neighbour(two.first, HUB_COMPONENT), neighbour(two.second, HUB_COMPONENT)
    assert hub.command(TRIAL, ASK) == ACCEPTED
    assert far_hub.command(TRIAL, BACK) == DENIED
    assert hub.command(TRIAL, BACK) == ACCEPTED
    assert two.second.get(NAME) == BEFORE


def test_nothing_on_trial_is_stored(two: TwoLinks) -> None:
    assert two.first.command(STORAGE, 1.0) == DENIED
    two.run(0.01)
    assert "nothing stored: parameters are on trial" in two.texts
    assert two.first.command(TRIAL, KEEP) == ACCEPTED
    assert two.first.command(STORAGE, 1.0) == ACCEPTED


def test_a_trial_needs_a_robot_at_rest_and_a_station_that_is_heard(robot: Client) -> None:
    assert robot.command(TRIAL, BEGIN) == DENIED
    assert robot.wait("STATUSTEXT").text == "trial refused: no heartbeats of this station"
    robot.armed()
    assert robot.command(TRIAL, BEGIN) == DENIED
    assert robot.command(TRIAL, KEEP) == DENIED  # nobody shall think that something was kept
    assert robot.command(TRIAL, BACK) == DENIED  # ... or taken back


@pytest.mark.parametrize("action", [-1.0, 0.5, 4.0, float("nan"), float("inf")])
def test_other_actions_are_refused(two: TwoLinks, action: float) -> None:
    assert two.first.command(TRIAL, action) == DENIED
    assert two.first.command(TRIAL, ASK) == ACCEPTED
    assert two.first.get(NAME) == 3.5


def test_host_in_the_loop_that_starts_over_ends_a_trial(two: TwoLinks) -> None:
    assert two.first.command(mav.MAV_CMD_OMNI_HIL, 1) == ACCEPTED
    two.first.time_us = 0
    two.first.ticks(3)
    assert two.first.get(NAME) == BEFORE
