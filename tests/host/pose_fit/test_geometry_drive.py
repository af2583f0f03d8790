# SPDX-License-Identifier: MIT
"""The robot drives the runs for its geometry by itself, in a world whose geometry differs from the robot file."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Iterator
from contextlib import contextmanager, nullcontext
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
import typer
from typer.testing import CliRunner

from hil_sim.scenario import load_scenario
from omni.cli import app
from omni.cli import identify_geometry_live as command
from omni_schema import Robot as RobotFile
from omniwheel.errors import DriveError, LimitError, MocapLostError, OmniError, OutputFileError, StoppedError
from omniwheel.frames import Pose, relative_pose
from omniwheel.identification import geometry_drive
from omniwheel.identification.geometry_drive import (
    MARGIN_M,
    SPEED_M_S,
    DrivenGeometry,
    Stream,
    Tape,
    drive_geometry,
    fit_driven,
    longest_gap_s,
    planned_runs,
    reach_m,
)
from omniwheel.identification.pose_fit import robot_file
from omniwheel.identification.pose_fit.scores import Score
from omniwheel.identification.pose_fit.study import identify_geometry
from omniwheel.identification.pose_fit.wheel_model import WheelModel, wheel_model
from omniwheel.logs.log import WheelLog
from omniwheel.mocap.simulated import Cameras, SimulatedSource
from omniwheel.mocap.source import MocapPose
from omniwheel.robots import read_robot
from omniwheel.simulation import SimulatedRobot, simulate
from tests.host.pose_fit.robots import THREE, drive, runs, true_values

NAME = "fast_three_wheel"
ROOM_M = 2.6
TRUE_RADIUS, TRUE_DISTANCE, TRUE_SCALE = 0.97, 1.03, (1.0, 1.015, 0.985)
"""True geometry over that of the robot file."""


def true_robot() -> RobotFile:
    documented = read_robot(NAME)
    geometry = dict(documented.geometry)
    geometry["wheel_radius_m"] *= TRUE_RADIUS
    geometry["wheel_distance_m"] *= TRUE_DISTANCE
    geometry["wheel_radius_scale"] = list(TRUE_SCALE)
    return replace(documented, geometry=geometry)


@contextmanager
def simulated(fix_rate_Hz: float = 0.0, slip_max: float = 0.0) -> Iterator[SimulatedRobot]:
    """The documented firmware in a world with the true robot."""
    scenario = load_scenario("sitl", NAME)
    world = {**scenario.world, "fix_rate_Hz": fix_rate_Hz, "slip_max": slip_max}
    scenario = replace(scenario, world_robot=true_robot(), world=world)
    with simulate(scenario.robot, scenario=scenario, speed="max") as robot:
        yield robot


def layout() -> WheelModel:
    return wheel_model(read_robot(NAME))


def stream(robot: SimulatedRobot, cameras: Cameras | None = None, tracked: Pose | None = None) -> Stream:
    """Cameras that see the true pose of a body which is fixed to the robot at ``tracked``."""
    tracked = tracked or Pose(0.0, 0.0, 0.0)

    def seen(_: float) -> Pose:
        x, y, theta = robot.simulation.true_pose
        c, s = math.cos(theta), math.sin(theta)
        return Pose(x + c * tracked.x - s * tracked.y, y + s * tracked.x + c * tracked.y, theta + tracked.theta)

    source = SimulatedSource(
        seen, cameras=cameras or Cameras(latency_s=0.0), clock=robot.connection.clock, sleep=robot.pump
    )
    return Stream(source, tracked, robot.pump)


def tape(robot: SimulatedRobot) -> Tape:
    home = robot.simulation.true_pose
    return Tape(lambda _: relative_pose(home, robot.simulation.true_pose))


def require_rest(robot: SimulatedRobot) -> None:
    assert not robot.status.armed
    robot.pump(1.0)
    assert math.hypot(*robot.simulation.true_twist[:2]) < 1e-3


def require_true_geometry(found: DrivenGeometry) -> None:
    plain = found.study.whole.plain
    for number, scale in enumerate(TRUE_SCALE):
        name = f"wheel_{number + 1}_radius_m"
        assert plain[name] == pytest.approx(0.048 * TRUE_RADIUS * scale, rel=5e-3)
    assert plain["wheel_distance_m"] == pytest.approx(0.16 * TRUE_DISTANCE, rel=1.5e-2)
    assert found.is_better
    assert found.after.rms_m < 0.15 * found.before.rms_m
    assert found.after.heading_rad < 0.15 * found.before.heading_rad
    assert "check" not in found.study.groups


@pytest.mark.full
def test_the_error_of_a_run_that_was_not_used_falls_with_motion_capture() -> None:
    with simulated() as robot:
        logs = drive_geometry(robot, layout(), ROOM_M, stream(robot, tracked=Pose(0.05, -0.02, 0.0)))
        require_rest(robot)
    found = fit_driven(logs, layout())
    require_true_geometry(found)
    plain = found.study.whole.plain
    assert plain["tracked_x_m"] == pytest.approx(0.05, abs=5e-3)
    assert plain["tracked_y_m"] == pytest.approx(-0.02, abs=5e-3)


@pytest.mark.full
def test_the_error_of_a_run_that_was_not_used_falls_with_a_tape_measure() -> None:
    with simulated() as robot:
        logs = drive_geometry(robot, layout(), ROOM_M, tape(robot))
        require_rest(robot)
    assert all(len(log.require_truth().time_s) == 2 for log in logs)
    require_true_geometry(fit_driven(logs, layout()))


@pytest.mark.parametrize("seen", [stream, tape])
def test_a_stop_ends_the_drive(seen: Callable[[SimulatedRobot], Stream | Tape]) -> None:
    with simulated() as robot:
        truth = seen(robot)
        begun_s = robot.connection.clock()

        def press_stop(_message: Any) -> None:
            if robot.connection.clock() > begun_s + 5.0:
                robot.simulation.fault("stop_button")

        robot.connection.add_listener(press_stop)
        with pytest.raises(StoppedError):
            drive_geometry(robot, layout(), ROOM_M, truth)
        assert robot.status.state == "estop"
        robot.pump(2.0)
        require_rest(robot)


class Interrupted(Stream):
    """A truth in whose check the program is interrupted."""

    at_s = math.inf
    error: BaseException = KeyboardInterrupt()

    def check(self, largest_m: float, gap_s: float) -> None:
        self._checked = getattr(self, "_checked", 0) + 1
        if self._checked == 40:
            raise self.error


@pytest.mark.parametrize("error", [KeyboardInterrupt(), DriveError("outside")])
def test_an_interruption_ends_at_rest(error: BaseException) -> None:
    with simulated() as robot:
        truth = stream(robot)
        interrupted = Interrupted(truth._source, Pose(0.0, 0.0, 0.0), robot.pump)
        interrupted.error = error
        with pytest.raises(type(error)):
            drive_geometry(robot, layout(), ROOM_M, interrupted)
        assert robot.simulation.true_pose.x > 0.05
        require_rest(robot)


def test_a_robot_that_leaves_its_room_and_cameras_that_see_nothing_end_the_drive() -> None:
    with simulated() as robot:
        truth = stream(robot)
        truth.check(1.0, 1.0)
        truth.at_rest("start")

        def watch(_: object) -> None:
            truth.check(0.1, 1.0)

        robot.arm()
        with pytest.raises(DriveError):
            robot.drive_to(0.3, 0.0, progress=watch)
        robot.disarm()
        require_rest(robot)
        with pytest.raises(MocapLostError):
            drive_geometry(robot, layout(), ROOM_M, stream(robot, Cameras(drop_probability=1.0)))
        require_rest(robot)


class Blinding:
    """Cameras that see nothing from ``blind_s`` on the robot's clock on."""

    def __init__(self, robot: SimulatedRobot, blind_s: float = math.inf) -> None:
        self.blind_s = blind_s
        self._source = SimulatedSource(
            lambda _: robot.simulation.true_pose,
            cameras=Cameras(latency_s=0.0),
            clock=robot.connection.clock,
            sleep=robot.pump,
        )
        self.clock = self._source.clock

    def read(self, timeout_s: float) -> MocapPose | None:
        seen = self._source.read(timeout_s)
        return seen if seen is None or seen.taken_s < self.blind_s else None


@pytest.mark.parametrize("when", ["before the run", "at its start", "on its way"])
def test_a_robot_that_is_not_seen_stays_within_the_margin(when: str) -> None:
    with simulated() as robot:
        source = Blinding(robot)
        armed_at: list[float] = []

        def blind(_: object) -> None:
            now_s = robot.connection.clock()
            if robot.status.armed and not armed_at:
                armed_at.append(now_s)
                if when == "at its start":
                    source.blind_s = now_s
            if when == "on its way" and robot.simulation.true_pose.x > 0.2:
                source.blind_s = min(source.blind_s, now_s)

        truth = Stream(source, Pose(0.0, 0.0, 0.0), robot.pump)
        if when == "before the run":
            begin = truth.begin

            def begin_blind() -> None:
                begin()
                source.blind_s = robot.connection.clock()

            truth.begin = begin_blind  # type: ignore[method-assign]
        robot.connection.add_listener(blind)
        with pytest.raises(MocapLostError):
            drive_geometry(robot, layout(), ROOM_M, truth)
        require_rest(robot)
        assert bool(armed_at) == (when != "before the run")
        unseen_m = robot.simulation.true_pose.x - (0.2 if when == "on its way" else 0.0)
        assert unseen_m < MARGIN_M


def test_a_run_in_which_no_pose_comes_is_ended() -> None:
    with simulated() as robot:
        source = Blinding(robot)
        truth = Stream(source, Pose(0.0, 0.0, 0.0), robot.pump)
        truth.at_rest("start")
        source.blind_s = 0.0
        truth.begin()
        truth.check(1.0, 0.5)
        robot.pump(0.6)
        with pytest.raises(MocapLostError):
            truth.check(1.0, 0.5)
        with pytest.raises(MocapLostError):
            truth.require_recent(0.5)


@pytest.mark.parametrize("speed_m_s", [0.01, SPEED_M_S, 1.0])
def test_the_margin_is_not_crossed_without_a_pose(speed_m_s: float) -> None:
    assert speed_m_s * longest_gap_s(speed_m_s) < MARGIN_M


def wrong_wheels() -> WheelModel:
    return wheel_model(read_robot("four_wheel"))


@pytest.mark.parametrize(
    ("model", "room_m", "speed_m_s", "error"),
    [
        (layout, 1.0, None, LimitError),
        (layout, math.nan, None, LimitError),
        (wrong_wheels, ROOM_M, None, DriveError),
        (layout, ROOM_M, 5.0, LimitError),
        (layout, ROOM_M, math.nan, LimitError),
    ],
)
def test_bad_input_moves_nothing(
    model: Callable[[], WheelModel], room_m: float, speed_m_s: float | None, error: type[OmniError]
) -> None:
    with simulated() as robot:
        states: list[str] = []
        robot.connection.add_listener(lambda _: states.append(robot.status.state))
        with pytest.raises(error):
            drive_geometry(robot, model(), room_m, stream(robot), speed_m_s=speed_m_s)
        robot.pump(0.5)
        assert "armed" not in states
        assert robot.simulation.true_pose == pytest.approx((0.0, 0.0, 0.0), abs=1e-6)


def test_a_program_that_sends_pose_fixes_is_named_before_anything_moves() -> None:
    with simulated(fix_rate_Hz=50.0) as robot:
        moved = stream(robot)
        moved.at_rest("start")
        robot.arm()
        robot.drive_to(0.3, 0.0)
        robot.disarm()
        here = robot.simulation.true_pose
        with pytest.raises(DriveError):
            drive_geometry(robot, layout(), ROOM_M, stream(robot))
        assert robot.simulation.true_pose == pytest.approx(here, abs=2e-3)


def test_all_goals_are_within_the_reach_and_the_wheels_within_the_room() -> None:
    reach = reach_m(ROOM_M, layout())
    for plan in planned_runs(reach):
        assert all(max(abs(goal.x), abs(goal.y)) <= reach for goal in plan.goals)
    assert reach + layout().distance_m + layout().radius_m < 0.5 * ROOM_M


@pytest.mark.full
def test_the_command_writes_the_robot_file_and_the_logs(tmp_path: Path) -> None:
    text = (Path(__file__).parents[3] / "shared" / "robots" / f"{NAME}.toml").read_text(encoding="utf-8")
    true = text.replace("wheel_radius_m = 0.048 ", "wheel_radius_m = 0.0466 ")
    assert true != text
    (tmp_path / "true.toml").write_text(true, encoding="utf-8")
    (tmp_path / "mine.toml").write_text(text, encoding="utf-8")
    result = CliRunner().invoke(
        app,
        ["identify", "geometry-live", "--simulated", str(tmp_path / "true.toml"), "--robot",
         str(tmp_path / "mine.toml"), "--room", str(ROOM_M), "--out", str(tmp_path / "found.toml"),
         "--logs", str(tmp_path / "logs"), "--json"],
    )  # fmt: skip
    assert result.exit_code == 0, result.output
    told = json.loads(result.stdout)
    assert told["check"]["after"]["rms_m"] < 0.7 * told["check"]["before"]["rms_m"]
    found = read_robot(tmp_path / "found.toml").parameter_values()
    assert 0.9 * 0.0466 < found["WHEEL_RADIUS"] * found["W1_RSCALE"] < 0.0466  # the floor takes up to 10 %
    assert len(list((tmp_path / "logs").glob("*.npz"))) == 9


@pytest.mark.parametrize(
    "options",
    [
        [],
        ["--tape", "--source", "natnet:host/robot"],
        ["--simulated", NAME, "--source", "natnet:host/robot"],
        ["--source", "simulated"],
        ["--source", "recorded:poses.csv"],
        ["--tape", "--room", "1.0"],
        ["--tape", "--out", "nowhere/found.toml"],
    ],
)
def test_wrong_options_are_refused_before_the_robot_is_looked_for(options: list[str]) -> None:
    result = CliRunner().invoke(app, ["identify", "geometry-live", "--robot", NAME, *options])
    assert result.exit_code == 2


def test_runs_that_ended_are_kept_where_a_later_one_fails(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    log = drive(THREE, true_values(THREE, 5), 1, duration_s=2.0)

    def fail_in_the_third(*_: object, save: Callable[[WheelLog], None], **__: object) -> None:
        save(replace(log, name="ahead"))
        save(replace(log, name="left turns"))
        raise MocapLostError("no pose of the robot")

    monkeypatch.setattr(command, "_robot", lambda *_: nullcontext())
    monkeypatch.setattr(command, "_truth", lambda *_, **__: nullcontext())
    monkeypatch.setattr(geometry_drive, "drive_geometry", fail_in_the_third)
    result = CliRunner().invoke(
        app, ["identify", "geometry-live", "--simulated", NAME, "--robot", NAME, "--logs", str(tmp_path / "logs")]
    )
    assert result.exit_code != 0
    assert {path.name for path in (tmp_path / "logs").iterdir()} == {"ahead.npz", "left_turns.npz"}


def test_each_log_is_given_away_when_its_run_has_ended(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(geometry_drive, "planned_runs", lambda reach: planned_runs(reach)[:2])
    with simulated() as robot:
        kept: list[str] = []

        def save(log: WheelLog) -> None:
            kept.append(log.name)
            raise OutputFileError("the disk is full")

        with pytest.raises(OutputFileError):
            drive_geometry(robot, layout(), ROOM_M, tape(robot), save=save)
        require_rest(robot)
    assert kept == ["ahead"]


def test_the_result_is_printed_where_the_robot_file_cannot_be_written(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    study = identify_geometry(runs(THREE, true_values(THREE, 5), count=2), THREE)
    before = Score("check", "check", 0.1, 0.1, 0.1, 0.1, 1.0)
    found = DrivenGeometry(study, (), before, replace(before, rms_m=0.01))

    def full_disk(*_: object) -> Path:
        raise OutputFileError("the disk is full")

    monkeypatch.setattr(command, "_robot", lambda *_: nullcontext())
    monkeypatch.setattr(command, "_truth", lambda *_, **__: nullcontext())
    monkeypatch.setattr(geometry_drive, "drive_geometry", lambda *_, **__: [])
    monkeypatch.setattr(geometry_drive, "fit_driven", lambda *_: found)
    monkeypatch.setattr(robot_file, "write_geometry", full_disk)
    result = CliRunner().invoke(
        app,
        ["identify", "geometry-live", "--simulated", NAME, "--robot", NAME, "--out", str(tmp_path / "found.toml"),
         "--json"],
    )  # fmt: skip
    assert result.exit_code != 0
    told = json.loads(result.stdout)
    assert told["check"]["is_better"] is True
    assert told["file"] is None
    assert "error" in told


@pytest.mark.parametrize(
    ("typed", "pose"),
    [("1.032 -0.011 90", (1.032, -0.011, math.pi / 2)), ("1, 0.5, 0", (1.0, 0.5, 0.0)), ("1; 0.5; 0", (1.0, 0.5, 0.0))],
)
@pytest.mark.parametrize("unclear", ["0,5 1", "1,0,2", "1 2", "one 2 3", ""])
def test_a_typed_pose_is_three_numbers_and_a_decimal_comma_is_asked_again(
    unclear: str, typed: str, pose: tuple[float, float, float], monkeypatch: pytest.MonkeyPatch
) -> None:
    answers = iter([unclear, typed])
    monkeypatch.setattr(typer, "prompt", lambda *_, **__: next(answers))
    assert command._typed_pose(3.0)("ahead") == pytest.approx(pose)
    assert next(answers, None) is None
