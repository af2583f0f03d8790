# SPDX-License-Identifier: MIT
"""Real programs at a real hub: the firmware in its world, a cable that is a pseudo-terminal, our commands, MAVProxy."""

from __future__ import annotations

import os
import re
import signal
import subprocess
from contextlib import suppress
from pathlib import Path

import pytest

from omniwheel.errors import CommandRefusedError, LinkOpenError
from omniwheel.robot import Robot, connect
from omniwheel.telemetry import Sample, decode
from tests.host.test_mavproxy import MavProxy
from tests.hub.parts import PROGRAM, WAIT_S, Cable, omni
from tests.waiting import wait_until

DRIVE = ("drive", "velocity", "0.05", "0", "0", "--duration", "1000", "--no-log")
TRAJECTORY = ("drive", "trajectory", "circle", "--laps", "100", "--no-log")


def run(*words: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run([PROGRAM, *words], capture_output=True, text=True, timeout=WAIT_S, check=False)


def said(robot: Robot, pattern: str) -> None:
    """Wait until a text matches."""
    found = robot.connection.wait(lambda _: any(re.search(pattern, text.text) for text in robot.texts.all), WAIT_S)
    assert found is not None, [text.text for text in robot.texts.all]


def shared_by_now(robot: Robot) -> str:
    """Wait until the robot's port has been handed to a hub, and return what its user is told."""
    robot.connection.wait(lambda _: "shared" in getattr(robot.connection.link, "notice", ""), WAIT_S)
    notice = str(getattr(robot.connection.link, "notice", ""))
    assert "is shared: through the hub at" in notice
    return notice


@pytest.mark.full
def test_a_second_command_starts_a_hub_and_the_first_goes_on(cable: Cable) -> None:
    with connect(str(cable.path)) as first:
        assert getattr(first.connection.link, "notice", None) == ""
        with subprocess.Popen(
            [PROGRAM, "params", "list", "WS_P", "--link", str(cable.path)],
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        ) as second:
            wait_until(lambda: second.poll() is not None, "the command goes on", pause=lambda: first.pump(0.1))
            output, notes = second.communicate()
        assert "WS_P" in output
        assert re.search(r"robot is shared: through the hub at tcp:127\.0\.0\.1:\d+", notes)
        shared_by_now(first)
        first.parameters["WS_P"] = 5.0
        assert first.wait_until(lambda status: status.heartbeat_age_s < 1.0, WAIT_S, "heard")
        third = run("params", "list", "WS_P", "--link", str(cable.path))
        assert re.search(r"WS_P +5 ", third.stdout)


@pytest.mark.full
def test_a_hub_that_is_started_takes_the_port_from_a_command_that_runs(cable: Cable) -> None:
    with (
        connect(str(cable.path)) as first,
        omni("link", "--link", str(cable.path), "--listen", "udpout:127.0.0.1:9", "--json") as (_, ready),
    ):
        assert ready["listen"][1] in shared_by_now(first)
        first.parameters["WS_P"] = 5.0


def go_on(robot: Robot) -> None:
    robot.set_velocity(0.02, 0.0, 0.0)
    robot.pump(0.05)


@pytest.mark.full
def test_the_first_goes_on_driving_while_the_hub_takes_the_port(cable: Cable) -> None:
    with connect(str(cable.path)) as first:
        first.parameters.set_many({"SAFE_CMD_TO": 60.0, "SAFE_LINK_TO": 600.0})  # a busy computer shall not matter
        first.arm()
        with subprocess.Popen([PROGRAM, "params", "list", "WS_P", "--link", str(cable.path)]) as second:
            wait_until(lambda: second.poll() is not None, "the command goes on", pause=lambda: go_on(first))
        assert "shared" in getattr(first.connection.link, "notice", "")
        words = ("drive", "velocity", "0", "0", "0", "--duration", "0.1", "--no-log", "--link", str(cable.path))
        with subprocess.Popen([PROGRAM, *words], stderr=subprocess.PIPE, text=True) as denied:
            # A station that is silent for three seconds does not command any more.
            wait_until(lambda: denied.poll() is not None, "the command goes on", pause=lambda: go_on(first))
            assert denied.stderr is not None
            assert re.search(r"refused, \S+.* in command", denied.stderr.read())
        assert denied.returncode == 1
        assert first.status.armed
        first.disarm()


@pytest.mark.full
def test_the_rates_that_the_first_asked_for_outlast_those_of_another_program_at_the_hub(cable: Cable) -> None:
    def samples() -> int:
        return sum(sample is not None for sample in heard)

    heard: list[Sample | None] = []
    with (
        connect(str(cable.path)) as first,
        omni("link", "--link", str(cable.path), "--listen", "tcp:127.0.0.1:0", "--json", first_line=False) as (hub, _),
    ):
        first.connection.add_listener(lambda message: heard.append(decode(Sample, message)))
        first.set_message_interval("OMNI_SAMPLE", 10.0)
        wait_until(lambda: samples() > 2, "samples come", pause=lambda: first.pump(0.1))
        url = shared_by_now(first).split()[-1]
        with connect(url) as second:
            second.set_message_interval("OMNI_SAMPLE", 50.0)
            first.pump(1.0)
        first.pump(3.0)  # the hub has asked the robot for what is left
        heard.clear()
        wait_until(lambda: samples() > 2, "samples still come", pause=lambda: first.pump(0.1))
        assert hub.poll() is None


def test_a_port_that_a_stranger_has_is_refused_as_ever(cable: Cable) -> None:
    from omniwheel.link import open_link

    stranger = open_link(str(cable.path))
    with pytest.raises(LinkOpenError, match="cannot open"):
        connect(str(cable.path))
    stranger.close()


@pytest.mark.full
def test_a_second_hub_for_the_same_port_says_who_serves_it(cable: Cable, hub_url: str) -> None:
    result = run("link", "--link", str(cable.path), "--listen", "tcp:127.0.0.1:0")
    assert result.returncode == 1
    assert "another hub serves" in result.stderr
    assert hub_url in result.stderr


@pytest.mark.full
@pytest.mark.mavproxy
def test_mavproxy_and_two_of_our_commands_at_once(cable: Cable, hub_url: str, tmp_path: Path) -> None:
    log = tmp_path / "seen.tlog"
    with (
        MavProxy(hub_url, tmp_path) as proxy,
        connect(hub_url) as looker,
        omni("record", str(log), "--duration", "1000", "--link", str(cable.path), first_line=False),
    ):
        proxy.expect(r"Received \d+ parameters")
        proxy.enter("param set ISMC_LAM_XY 15")
        wait_until(
            lambda: proxy.fetch("ISMC_LAM_XY") == 15.0, "the parameter was not set", pause=lambda: looker.pump(0.1)
        )
        assert looker.parameters.read("ISMC_LAM_XY") == 15.0
        with omni(*DRIVE, "--link", str(cable.path), first_line=False):
            looker.wait_until(lambda status: status.armed, WAIT_S, "armed")
            proxy.enter("arm throttle")
            proxy.expect("COMPONENT_ARM_DISARM: DENIED")
            with pytest.raises(CommandRefusedError, match="omni drive"):
                looker.start_trajectory("circle")
            proxy.enter("disarm")
            looker.wait_until(lambda status: not status.armed, WAIT_S, "disarmed")
    assert log.stat().st_size > 0


@pytest.mark.full
def test_an_emergency_stop_from_another_program_stops_what_one_drives(cable: Cable, hub_url: str) -> None:
    with connect(hub_url) as looker, omni(*DRIVE, "--link", str(cable.path), first_line=False):
        looker.wait_until(lambda status: status.armed, WAIT_S, "armed")
        assert run("stop", "--link", str(cable.path)).returncode == 0
        looker.wait_until(lambda status: status.state == "estop", WAIT_S, "stopped")


@pytest.mark.full
@pytest.mark.parametrize(("words", "why"), [(DRIVE, "command loss|link loss"), (TRAJECTORY, "link loss")])
def test_the_robot_stops_by_itself_when_the_commanding_program_is_killed(
    hub_url: str, words: tuple[str, ...], why: str
) -> None:
    with connect(hub_url) as looker, omni(*words, "--link", hub_url, first_line=False) as (driver, _):
        looker.wait_until(lambda status: status.armed, WAIT_S, "armed")
        driver.send_signal(signal.SIGKILL)
        looker.wait_until(lambda status: status.state == "failsafe", WAIT_S, "stopped, though we send heartbeats")
        said(looker, f"failsafe: ({why})")


@pytest.mark.full
def test_the_robot_stops_by_itself_when_the_hub_is_killed(cable: Cable, robot_urls: list[str]) -> None:
    with (
        connect(robot_urls[1]) as looker,
        omni("link", "--link", str(cable.path), "--listen", "tcp:127.0.0.1:0", "--json") as (hub, ready),
        omni(*DRIVE, "--link", ready["listen"][0], first_line=False) as (driver, _),
    ):
        looker.wait_until(lambda status: status.armed, WAIT_S, "armed")
        hub.send_signal(signal.SIGKILL)
        looker.wait_until(lambda status: status.state == "failsafe", WAIT_S, "stopped")
        assert driver.wait(WAIT_S) == 1


@pytest.mark.full
def test_a_hub_survives_unplugging_and_its_clients_are_told(cable: Cable, hub_url: str) -> None:
    with connect(hub_url) as robot:
        cable.unplug()
        said(robot, "waiting for it")
        with pytest.raises(CommandRefusedError, match="disconnected"):
            robot.arm()
        cable.plug_in()
        said(robot, "is connected")
        robot.wait_until(lambda status: status.heartbeat_age_s < 1.0, WAIT_S, "heard again")
        robot.arm()
        robot.disarm()
        found = connect(str(cable.path))
        assert "shared" in getattr(found.connection.link, "notice", ""), "it is found under its name again"
        found.close()


@pytest.mark.full
def test_an_automatic_hub_ends_when_nobody_is_there(cable: Cable, tmp_path: Path) -> None:
    from omniwheel.hub import places

    with connect(str(cable.path)) as first:
        with subprocess.Popen([PROGRAM, "params", "list", "WS_P", "--link", str(cable.path)]) as second:
            wait_until(lambda: second.poll() is not None, "the command goes on", pause=lambda: first.pump(0.1))
        hub = places.find(places.HUB, str(cable.path))
    assert hub is not None
    pid = int(hub["pid"])

    def is_forgotten() -> bool:
        with suppress(ProcessLookupError):
            os.kill(pid, 0)
            return places.find(places.HUB, str(cable.path)) is None
        assert places.find(places.HUB, str(cable.path)) is None, "a hub that has ended is found"
        return True

    wait_until(is_forgotten, "the hub goes on")


@pytest.mark.full
def test_commands_reach_a_robot_in_the_network_through_its_hub_from_any_folder(
    own_places: None, robot_urls: list[str], tmp_path: Path
) -> None:
    words = [PROGRAM, "stop", "--link", robot_urls[0]]
    with omni("link", "--link", robot_urls[0], "--listen", "tcp:127.0.0.1:0", "--json"):
        done = subprocess.run(words, cwd=tmp_path, capture_output=True, text=True, timeout=WAIT_S, check=False)
        assert done.returncode == 0, done.stderr
        assert "is shared" in done.stderr
        refused = run("link", "--link", robot_urls[0], "--listen", "tcp:127.0.0.1:0")
        assert refused.returncode == 1
        assert "another hub" in refused.stderr
