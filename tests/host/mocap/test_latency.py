# SPDX-License-Identifier: MIT
"""How old poses are, measured with the real firmware in lockstep with a world, and with headings made by hand."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scipy import stats
from typer.testing import CliRunner

from omni.cli import app, mocap_latency
from omniwheel import FirmwareProcess
from omniwheel.errors import LinkTimeoutError, MocapLatencyError, MocapLostError, SetpointError
from omniwheel.frames import Pose
from omniwheel.mocap import Bridge, BridgeSettings, MocapPose
from omniwheel.mocap.latency import Array, Headings, PoseLatency, observe, pose_latency, student_95
from omniwheel.robot import Robot, connect
from tests.host.mocap.natnet_server import Server
from tests.host.mocap.test_bridge import Lab

PAGE = Path(__file__).parents[3] / "docs/guides/camera.md"
RATE_HZ = 30.0
SWING = {
    "TRJ_TYPE": "circle",
    "TRJ_SIZE": 0.05,
    "TRJ_PERIOD": 10.0,
    "TRJ_LAPS": 0.0,
    "TRJ_ROT": "sine",
    "TRJ_ROT_AMP": 0.15,
    "TRJ_ROT_N": 8.0,
}


class Late:
    """Poses of the lab's robot that are ``late_s`` older than they say. Reading them sends heartbeats."""

    name, ended = "late", False

    def __init__(self, lab: Lab, late_s: float, sd_rad: float = 0.003) -> None:
        self.lab, self._late_s, self._sd_rad, self._frame = lab, late_s, sd_rad, 0
        self.robot: Robot | None = None

    def clock(self) -> float:
        return self.lab.clock()

    def read(self, timeout_s: float) -> MocapPose | None:
        comes_s = (self._frame + 1) / RATE_HZ + 0.1
        left_s = comes_s - self.clock()
        if left_s > 0.0 and timeout_s > 0.0:
            self.lab.sleep(min(left_s, timeout_s))
        if left_s > timeout_s:
            return None
        self._frame += 1
        if self.robot is not None and self._frame % 10 == 0:
            self.robot.connection._send_heartbeat()
        truth = self.lab.truth_at(comes_s - 0.1)
        noise = np.random.default_rng((7, self._frame)).standard_normal() * self._sd_rad
        seen = Pose(truth.x, truth.y, math.remainder(truth.theta + noise, math.tau))
        return MocapPose(seen, comes_s - 0.1 + self._late_s, comes_s, self._frame)

    def close(self) -> None:
        """Nothing to close."""


@contextmanager
def swinging(late_s: float) -> Iterator[tuple[Late, Robot]]:
    with FirmwareProcess("three_wheel") as process:
        lab = Lab(process.urls[0], SWING)
        source = Late(lab, late_s)
        with connect(lab, heartbeat=False, clock=lab.clock) as robot:
            robot.arm()
            robot.start_trajectory()
            source.robot = robot
            yield source, robot


@pytest.mark.full
@pytest.mark.parametrize("late_s", [0.0314, -0.02])
def test_the_real_firmware_tells_how_late_poses_are(late_s: float) -> None:
    """Its wheels slip by up to 10 %, poses come at 30 Hz with 3 mrad of noise."""
    with swinging(late_s) as (source, robot):
        found = pose_latency(observe(source, robot, 15.0, 2.0))
    assert found.latency_s == pytest.approx(late_s, abs=found.limit_s + found.clock_error_s)
    assert found.limit_s < 0.004
    assert found.clock_error_s < 0.004
    assert found.scale == pytest.approx(1.0, abs=0.1)
    assert found.poses > 300


@pytest.mark.full
def test_the_command_watches_the_real_firmware(monkeypatch: pytest.MonkeyPatch) -> None:
    """All of the command runs, in simulated time."""
    with swinging(0.05) as (source, _):
        monkeypatch.setattr("omniwheel.mocap.streams.open_source", lambda *_, **__: source)
        monkeypatch.setattr("omniwheel.hub.shared_link.open_shared", lambda *_, **__: source.lab)
        monkeypatch.setattr(source.lab, "close", lambda: None)  # the robot that swings needs it, too
        monkeypatch.setattr("omniwheel.robot.connect", partial(connect, clock=source.clock))
        words = ["mocap", "latency", "--source", "vicon:here/robot", "--link", "tcp:127.0.0.1:1", "--duration", "15"]
        told = CliRunner().invoke(app, words)
    assert told.exit_code == 0, told.output
    said = re.search(r"give `omni mocap bridge` the option --older-by (0[.]\d+)", told.output.replace("\n", " "))
    assert said is not None, told.output
    assert float(said[1]) == pytest.approx(0.05, abs=0.008)


def test_a_bridge_that_is_told_sends_poses_with_the_time_at_which_they_were_taken() -> None:
    with FirmwareProcess("three_wheel") as process:
        lab = Lab(process.urls[0], {})
        settings = BridgeSettings(budget_bytes_s=5000.0, latency_s=0.05)
        with Bridge(Late(lab, 0.05), lab, settings, clock=lab.clock) as bridge:
            bridge.run(2.0)
        sent = [message.time_boot_ms * 1e-3 for _, message in lab.fixes("compact")]
    assert len(sent) > 15
    frames = np.array(sent) * RATE_HZ
    # Frame n was taken at n / 30 s. Messages and the robot's clock count in milliseconds; a round trip takes one more.
    assert np.max(np.abs(frames - np.round(frames))) < 0.003 * RATE_HZ


@pytest.mark.parametrize("latency_s", [-0.01, 0.2, 0.24, 1.5, math.nan, math.inf])
def test_a_latency_out_of_range_is_refused(latency_s: float) -> None:
    with pytest.raises(SetpointError, match="latency_s"):
        BridgeSettings(latency_s=latency_s)


def test_the_rates_are_given_back_also_after_an_error() -> None:
    with swinging(0.0) as (source, robot):

        def lost(timeout_s: float) -> MocapPose | None:
            raise MocapLostError("the camera is gone")

        source.read = lost  # type: ignore[method-assign]
        with pytest.raises(MocapLostError):
            observe(source, robot, 3.0, 2.0)
        came: list[str] = []
        robot.connection.add_listener(lambda message: came.append(message.get_type()))
        robot.pump(0.5)
    assert "HEARTBEAT" in came or "OMNI_STATUS" in came
    assert "OMNI_SAMPLE" not in came


def test_fixes_from_elsewhere_are_noticed() -> None:
    with swinging(0.0) as (source, robot):
        read = source.read

        def and_fixed(timeout_s: float) -> MocapPose | None:
            pose = read(timeout_s)
            if pose is not None:
                robot.send_pose_fix(*pose.pose)
            return pose

        source.read = and_fixed  # type: ignore[method-assign]
        with pytest.raises(MocapLatencyError, match="from another program"):
            observe(source, robot, 3.0, 2.0)


@pytest.mark.full
def test_a_robot_that_is_silent_is_said() -> None:
    with swinging(0.0) as (source, robot):
        robot.connection.link.write = lambda data: None  # type: ignore[method-assign]
        with pytest.raises(LinkTimeoutError, match="TIMESYNC"):
            observe(source, robot, 10.0, 1.0)


def turned(time_s: Array) -> Array:
    return 0.7 * np.sin(math.tau * 0.8 * time_s) + 0.2 * np.sin(math.tau * 0.31 * time_s)


def headings(
    late_s: float = 0.03,
    *,
    seed: int = 1,
    slip_rad: float = 0.0,
    calm: Array | None = None,
    turned: Callable[[Array], Array] = turned,
    **changed: Any,
) -> Headings:
    """20 s at 30 and 100 Hz, as a robot would show them; headings of poses pass ±180° on the way.

    ``slip_rad``: the wheels' random walk in a second. ``calm``: by what each sample's turning is multiplied.
    """
    draw = np.random.default_rng(seed)
    robot_s = np.arange(100.0, 120.0, 0.01)
    walk = np.cumsum(draw.standard_normal(len(robot_s))) * slip_rad * 0.1
    pose_s = np.arange(100.0, 120.0, 1.0 / 30.0)
    truth = turned(robot_s) * (1.0 if calm is None else calm)
    seen = np.interp(pose_s - late_s, robot_s, truth) + 3.0 + 0.003 * draw.standard_normal(len(pose_s))
    made = {
        "pose_s": pose_s,
        "pose_rad": np.angle(np.exp(1j * seen)),
        "robot_s": robot_s,
        "robot_rad": truth + walk,
        "clock_error_s": 0.003,
    }
    return Headings(**{**made, **changed})


@pytest.mark.full
@pytest.mark.parametrize("restless_s", [20.0, 9.0])
def test_the_limit_is_true_on_two_hundred_pushed_robots(restless_s: float) -> None:
    """By hand, wheels slip: 20 mrad in a second, on no straight line. Some are hardly turned after ``restless_s``."""
    inside = []
    for seed in range(200):
        calm = np.where(np.arange(0.0, 20.0, 0.01) < restless_s, 1.0, 0.1)
        found = pose_latency(headings(0.03, seed=seed, slip_rad=0.02, calm=calm))
        inside.append(abs(found.latency_s - 0.03) <= found.limit_s)
    assert 0.90 < np.mean(inside) < 0.995


def test_a_few_seconds_of_turning_are_not_enough() -> None:
    calm = np.where(np.arange(0.0, 20.0, 0.01) < 4.0, 1.0, 0.02)
    with pytest.raises(MocapLatencyError, match="95 % limit above"):
        pose_latency(headings(0.03, calm=calm))


@pytest.mark.parametrize("hertz", [1.0, 1.5, 2.5])
def test_even_swings_that_fit_half_a_swing_later_too_are_refused(hertz: float) -> None:
    with pytest.raises(MocapLatencyError, match="so evenly") as refused:
        pose_latency(headings(0.03, turned=lambda time_s: 0.5 * np.sin(math.tau * hertz * time_s)))
    assert "irregularly" in refused.value.hint


def test_poses_that_are_missing_for_a_while_do_no_harm() -> None:
    """Also if the robot makes more than a whole turn meanwhile, and where samples of the robot are lost."""

    def turning(time_s: Array) -> Array:
        return turned(time_s) + 8.0 / (1.0 + np.exp(-3.0 * (time_s - 108.0)))

    whole = headings(0.03, turned=turning)
    seen, told = np.abs(whole.pose_s - 108.0) > 1.5, np.abs(whole.robot_s - 114.0) > 0.3
    holes = Headings(whole.pose_s[seen], whole.pose_rad[seen], whole.robot_s[told], whole.robot_rad[told])
    found = pose_latency(holes)
    assert found.latency_s == pytest.approx(0.03, abs=0.001)
    assert found.poses < np.count_nonzero(seen) - 40


@pytest.mark.parametrize("freedom", [3.0, 5.0, 8.0, 30.0])
def test_students_t(freedom: float) -> None:
    assert student_95(freedom) == pytest.approx(stats.t.ppf(0.975, freedom), rel=0.01)


def test_wheels_of_another_size_are_told_and_move_no_delay() -> None:
    found = pose_latency(headings(0.03, robot_rad=0.9 * turned(np.arange(100.0, 120.0, 0.01))))
    assert found.scale == pytest.approx(1.0 / 0.9, rel=0.01)
    assert found.latency_s == pytest.approx(0.03, abs=0.001)


STILL = np.zeros(2000)
POSE_S = np.arange(100.0, 120.0, 1.0 / 30.0)


@pytest.mark.parametrize(
    ("changed", "said"),
    [
        ({"robot_rad": STILL}, "too little"),
        ({"robot_rad": np.linspace(0.0, 12.0, 2000)}, "too little"),
        ({"pose_s": np.zeros(0), "pose_rad": np.zeros(0)}, "0 poses were received"),
        ({"pose_s": POSE_S[::10], "pose_rad": turned(POSE_S[::10])}, "60 poses were received.*5 per second"),
        ({"pose_s": POSE_S[:70], "pose_rad": turned(POSE_S[:70])}, "hardly overlap"),
        ({"robot_s": np.zeros(0), "robot_rad": np.zeros(0)}, "no OMNI_SAMPLE"),
        ({"robot_s": np.arange(100.0, 120.0, 0.2), "robot_rad": np.zeros(100)}, "too slow"),
        ({"robot_rad": -turned(np.arange(100.0, 120.0, 0.01))}, "opposite"),
        ({"pose_rad": 0.003 * np.random.default_rng(1).standard_normal(600)}, "does not match the robot"),
        ({"pose_rad": turned(POSE_S - 0.9)}, "does not match the robot"),
        (
            {"pose_rad": turned(POSE_S) + 0.2 * np.random.default_rng(1).standard_normal(600)},
            "does not match the robot",
        ),
    ],
)
def test_what_cannot_tell_is_refused_with_what_to_do(changed: dict[str, Any], said: str) -> None:
    with pytest.raises(MocapLatencyError, match=said) as refused:
        pose_latency(headings(**changed))
    assert refused.value.hint


def found(latency_s: float, scale: float = 1.0) -> PoseLatency:
    return PoseLatency(latency_s, 0.0008, 500, 20.0, scale, 0.002)


def test_the_command_says_what_to_set(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("omniwheel.mocap.camera.setup.load_setup", lambda path: SimpleNamespace(latency_s=0.01))
    camera = tmp_path / "camera.toml"

    def last(latency_s: float, source: str) -> str:
        return mocap_latency._lines(found(latency_s), source)[-1]

    assert last(0.0025, "vicon:1.2.3.4/r").endswith("nothing to set")
    assert last(-0.0025, f"camera:{camera}").endswith("nothing to set")
    assert last(0.3, "vicon:1.2.3.4/r") == last(0.235, f"camera:{camera}") == mocap_latency.TOO_LATE
    assert last(0.03, "vicon:1.2.3.4/r").endswith("--older-by 0.0300")
    assert "too early" in last(-0.03, "vicon:1.2.3.4/r")
    assert last(0.03, f"camera:{camera}") == f"set latency_s = 0.0400 in {camera}"
    assert last(-0.004, f"camera:{camera}") == f"set latency_s = 0.0060 in {camera}"
    assert "too early by 10.0 ms" in last(-0.02, f"camera:{camera}")
    assert "disagree" in mocap_latency._lines(found(0.03, 1.2), "simulated")[-2]


def test_the_page_shows_what_is_printed(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("omniwheel.mocap.camera.setup.load_setup", lambda path: SimpleNamespace(latency_s=0.0))
    turn = pose_latency(headings(0.0284, slip_rad=0.02))
    shown = "\n".join(mocap_latency._lines(turn, "camera:tags/camera.toml"))
    assert f"```\n{shown}\n```" in PAGE.read_text()


@pytest.mark.full
def test_the_command_prints_and_ends_with_an_error_code(monkeypatch: pytest.MonkeyPatch) -> None:
    """Firmware and stream are real, what was watched is not: a busy computer's seconds tell no delay."""
    watched: list[Headings] = [headings(0.03), headings(0.03), headings(robot_rad=STILL)]
    monkeypatch.setattr("omniwheel.mocap.latency.observe", lambda *_: watched.pop(0))
    with Server() as server, FirmwareProcess("three_wheel") as process:
        source = f"natnet:127.0.0.1:{server.port}/robot"
        command = ["mocap", "latency", "--source", source, "--link", process.urls[0], "--duration", "10"]
        told, as_json, refused = (CliRunner().invoke(app, [*command, *more]) for more in ([], ["--json"], []))
    assert told.exit_code == 0
    assert "Turn the robot to the left and back" in told.output
    assert "--older-by 0.03" in told.output
    assert json.loads(as_json.stdout)["latency_s"] == pytest.approx(0.03, abs=0.001)
    assert refused.exit_code == 1
    assert "too little" in refused.output
    assert "a quarter turn" in refused.output


@pytest.mark.parametrize("source", ["simulated", "recorded:lap.csv"])
def test_a_stream_that_does_not_see_the_robot_is_refused(source: str) -> None:
    refused = CliRunner().invoke(app, ["mocap", "latency", "--source", source, "--link", "tcp:127.0.0.1:1"])
    assert refused.exit_code == 2
    assert source in refused.output
