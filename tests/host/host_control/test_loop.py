# SPDX-License-Identifier: MIT
"""The whole control from the host around the simulated robot, in simulated time, and every way it stops."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

from hil_sim.faults import Fault
from hil_sim.pwm_robot import SimulatedArduino, SimulatedLink, SimulatedRobot
from omni.cli import app
from omniwheel.errors import HostControlStopError, LinkLostError, MocapLostError
from omniwheel.frames import Pose
from omniwheel.host_control import Goal, HostController, HostControlLoop, HostControlRun, HostControlSettings, PwmRadio
from omniwheel.host_control.controller import host_control_values
from omniwheel.host_control.pwm_line import STOP
from omniwheel.mocap.source import MocapPose
from omniwheel.robots import read_robot

ROBOT = read_robot("four_wheel")
DEFAULTS = HostControlSettings()
ORIGIN = Pose(0.0, 0.0, 0.0)
CIRCLE = {"TRJ_TYPE": "circle", "TRJ_SIZE": 0.3, "TRJ_PERIOD": 25.0}
CIRCLE_START = Pose(0.3, 0.0, 0.0)


class Setup:
    """A simulated robot with its loop; ``truth`` is recorded at each step."""

    def __init__(
        self,
        goal: Goal,
        start: Pose,
        settings: HostControlSettings = DEFAULTS,
        changes: dict[str, Any] | None = None,
        **world: Any,
    ) -> None:
        self.robot = SimulatedRobot(ROBOT, start_pose=start, **world)
        self.controller = HostController(ROBOT, host_control_values(ROBOT, changes), settings)
        self.radio = PwmRadio(SimulatedLink(self.robot), self.robot.clock)
        self.loop = HostControlLoop(self.controller, self.robot, self.radio, goal, lost_after_s=2.0)
        self.truth: list[Any] = []

    def run(self, seconds: float) -> HostControlRun:
        return self.loop.run(seconds, lambda time_s, run: self.truth.append((time_s, *self.robot.world.truth)))

    def stopped(self) -> bool:
        """Whether the robot stands shortly after the loop's end, and was told so."""
        self.robot.read(0.0)
        for _ in range(300):
            self.robot._tick()
        return self.robot.arduino.pwm == STOP and float(np.abs(self.robot.world.wheel_rad_s).max()) < 1e-3


@pytest.mark.parametrize("mode", ["p", "pd", "pid", "ismc"])
@pytest.mark.parametrize("start", [Pose(1.0, 0.4, 2.0), Pose(-0.4, -0.9, -1.0)])
def test_each_controller_stabilises_from_afar(mode: str, start: Pose) -> None:
    setup = Setup(Goal(ORIGIN, tolerance_m=0.005), start, changes={"CTL_MODE": mode})
    run = setup.run(40.0)
    assert run.done
    assert math.hypot(*setup.robot.world.truth[:2]) < 0.005
    assert abs(setup.robot.world.truth[2]) < 0.05
    assert run.pauses == run.late == run.refused == 0
    assert setup.stopped()


@pytest.mark.full
def test_from_three_metres_as_in_the_report() -> None:
    setup = Setup(Goal(ORIGIN), Pose(2.2, -2.0, 3.0))
    assert setup.run(60.0).done
    assert math.hypot(*setup.robot.world.truth[:2]) < 0.01


@pytest.mark.full
@pytest.mark.parametrize("mode", ["pid", "ismc"])
def test_it_follows_a_path_within_millimetres_over_9600_baud(mode: str) -> None:
    setup = Setup(Goal(), CIRCLE_START, changes={**CIRCLE, "CTL_MODE": mode})
    run = setup.run(60.0)
    assert run.done
    record, truth = run.record(), np.array(setup.truth)[-len(run.samples) :]
    error = truth[:, 1:3] - record[:, 4:6]
    assert np.sqrt((error[100:] ** 2).sum(axis=1).mean()) < 0.002
    assert setup.radio.bytes / setup.robot.clock() < 912.0
    assert setup.robot.arduino.bad_lines == 0
    assert setup.robot.arduino.lines == setup.radio.lines


@pytest.mark.full
def test_deadband_compensation_removes_what_a_weak_p_controller_leaves() -> None:
    weak = {"CTL_MODE": "p", "FL_KP_XY": 0.5, "FL_KP_TH": 0.5}
    ends = []
    for settings in (HostControlSettings(), HostControlSettings(full_speed_rad_s=2.53, pwm_min=60)):
        setup = Setup(Goal(ORIGIN, 0.0), Pose(0.5, 0.3, 0.5), settings, weak, deadband_pwm=60.0)
        setup.run(40.0)
        ends.append(math.hypot(*setup.robot.world.truth[:2]))
    assert ends[0] > 0.02
    assert ends[1] < 0.002


def test_equal_runs_give_equal_numbers() -> None:
    records = [Setup(Goal(), CIRCLE_START, changes=CIRCLE, seed=seed).run(5.0).record() for seed in (3, 3, 4)]
    assert np.array_equal(records[0], records[1])
    assert not np.array_equal(records[0], records[2])


@pytest.mark.full
def test_it_pauses_while_the_cameras_see_nothing_and_goes_on() -> None:
    faults = [Fault("pose_loss", 4.0, 5.0)]
    setup = Setup(Goal(), CIRCLE_START, changes=CIRCLE, faults=faults)
    run = setup.run(60.0)
    truth = np.array(setup.truth)
    assert run.done
    assert run.pauses == 1
    pause = truth[(truth[:, 0] > 4.35) & (truth[:, 0] < 4.95)]
    assert np.abs(np.diff(pause[:, 1:], axis=0)).max() < 1e-5
    error = truth[-len(run.samples) :, 1:3]  # the path's clock stood too: nothing to catch up with
    wanted = run.record()[:, 4:6]
    assert np.abs(error[-500:] - wanted[-500:]).max() < 0.01
    gap = np.diff(run.record()[:, 0]).max()
    assert gap == pytest.approx(0.8 + 0.03, abs=0.05)


def test_cameras_that_never_see_the_robot_end_the_run_without_a_move() -> None:
    setup = Setup(Goal(ORIGIN), Pose(1.0, 0.0, 0.0), faults=[Fault("pose_loss", 0.0)])
    with pytest.raises(HostControlStopError, match="no pose was received"):
        setup.run(10.0)
    assert np.allclose(setup.robot.world.truth, [1.0, 0.0, 0.0], atol=1e-9)


def test_cameras_that_stay_blind_end_the_run() -> None:
    setup = Setup(Goal(ORIGIN), Pose(1.0, 0.0, 0.0), faults=[Fault("pose_loss", 3.0)])
    with pytest.raises(HostControlStopError, match="has stopped"):
        setup.run(30.0)
    assert setup.robot.clock() == pytest.approx(5.1, abs=0.2)
    assert setup.stopped()


@pytest.mark.parametrize("error", [KeyboardInterrupt, MocapLostError("gone"), RuntimeError("bug")])
def test_every_way_out_stops_the_robot(error: Any) -> None:
    setup = Setup(Goal(ORIGIN), Pose(1.0, 0.0, 0.0))
    read = setup.robot.read

    def failing(timeout_s: float) -> MocapPose | None:
        if 3.0 < setup.robot.clock() < 3.01:
            setup.robot._tick()
            setup.robot.world.step(10)
            raise error
        return read(timeout_s)

    setup.robot.read = failing  # type: ignore[method-assign]
    expected = error if isinstance(error, type) else type(error)
    with pytest.raises(expected):
        setup.run(10.0)
    assert setup.robot.arduino.lines > 50
    assert setup.stopped()


def test_a_pose_that_is_no_number_stops_the_robot_like_none() -> None:
    setup = Setup(Goal(ORIGIN), Pose(1.0, 0.0, 0.0))
    read = setup.robot.read

    def broken(timeout_s: float) -> MocapPose | None:
        measured = read(timeout_s)
        if measured is None or setup.robot.clock() < 2.0:
            return measured
        return MocapPose(Pose(math.nan, 0.0, 0.0), measured.taken_s, measured.arrived_s, measured.frame)

    setup.robot.read = broken  # type: ignore[method-assign]
    with pytest.raises(HostControlStopError):
        setup.run(10.0)
    assert setup.stopped()


@pytest.mark.parametrize("goal", [Goal(Pose(0.0, 0.0, 0.0)), Goal(Pose(1.5, 0.0, 0.0)), Goal()])
@pytest.mark.parametrize("zeros", [False, True], ids=["frozen", "zeros"])
def test_a_lost_tracker_that_goes_on_sending_stops_the_robot(goal: Goal, zeros: bool) -> None:
    """It repeats its last pose, or sends zeros, with new times and frame numbers."""
    setup = Setup(goal, Pose(1.2, -0.8, 1.0), changes=CIRCLE if goal.pose is None else None)
    read = setup.robot.read
    lost: list[MocapPose] = []

    def stuck(timeout_s: float) -> MocapPose | None:
        measured = read(timeout_s)
        if measured is None or setup.robot.clock() < 1.0:
            return measured
        lost.append(measured)
        return replace(measured, pose=ORIGIN if zeros else lost[0].pose)

    setup.robot.read = stuck  # type: ignore[method-assign]
    with pytest.raises(HostControlStopError):
        setup.run(20.0)
    assert setup.stopped()
    at = lost[0].pose
    assert math.dist(setup.robot.world.truth[:2], (at.x, at.y)) < 0.3


def test_a_robot_that_drives_away_from_its_pose_is_stopped() -> None:
    """All motors the wrong way round: each pose is a good measurement."""
    changes = {"SAFE_ERR_XY": 0.1}
    setup = Setup(Goal(ORIGIN), Pose(0.5, 0.0, 0.0), changes=changes)
    write = setup.robot.write

    def turned(data: bytes) -> None:
        write(b",".join(str(-int(word)).encode() for word in data.removesuffix(b"*").split(b",")) + b"*")

    setup.robot.write = turned  # type: ignore[method-assign]
    with pytest.raises(HostControlStopError):
        setup.run(20.0)
    assert setup.stopped()
    assert math.dist(setup.robot.world.truth[:2], (0.5, 0.0)) < 0.4


def test_a_robot_out_of_range_is_stopped() -> None:
    setup = Setup(Goal(ORIGIN), Pose(2.0, 0.0, 0.0), changes={"LIM_POS": 1.5})
    with pytest.raises(HostControlStopError, match="out of range"):
        setup.run(10.0)
    assert setup.stopped()


def test_motors_wired_in_the_wrong_order_are_noticed_by_the_path_error() -> None:
    """The report's own mistake (section 3.1): PWM sent to the wrong motors."""
    setup = Setup(Goal(), CIRCLE_START, changes={**CIRCLE, "SAFE_ERR_XY": 0.1})
    write = setup.robot.write

    def swapped(data: bytes) -> None:
        words = data.removesuffix(b"*").split(b",")
        write(b",".join([words[1], words[2], words[3], words[0]]) + b"*")

    setup.robot.write = swapped  # type: ignore[method-assign]
    with pytest.raises(HostControlStopError, match="off its path"):
        setup.run(60.0)
    assert setup.stopped()


def test_a_radio_that_is_unplugged_ends_the_run() -> None:
    setup = Setup(Goal(ORIGIN), Pose(1.0, 0.0, 0.0))

    def unplugged(data: bytes) -> None:
        raise LinkLostError("lost the serial port")

    setup.robot.write = unplugged  # type: ignore[method-assign]
    with pytest.raises(LinkLostError):
        setup.run(5.0)


def test_one_write_that_fails_does_not_end_the_stopping() -> None:
    """The radio is back at once: the robot would keep its last PWM."""
    setup = Setup(Goal(ORIGIN), Pose(1.0, 0.0, 0.0))
    write = setup.robot.write
    failures: list[float] = []

    def flaky(data: bytes) -> None:
        if setup.robot.clock() > 2.0 and len(failures) < 2:
            failures.append(setup.robot.clock())
            raise LinkLostError("lost the serial port")
        write(data)

    setup.robot.write = flaky  # type: ignore[method-assign]
    with pytest.raises(LinkLostError):
        setup.run(5.0)
    assert len(failures) == 2
    assert setup.stopped()


def test_a_late_step_is_counted_and_not_caught_up_with() -> None:
    setup = Setup(Goal(ORIGIN), Pose(1.0, 0.0, 0.0))
    read = setup.robot.read

    def slow(timeout_s: float) -> MocapPose | None:
        if 2.0 < setup.robot.clock() < 2.02:
            for _ in range(150):  # the computer is busy; the robot goes on with its last PWM
                setup.robot._tick()
        return read(timeout_s)

    setup.robot.read = slow  # type: ignore[method-assign]
    run = setup.run(4.0)
    assert run.late == 1
    assert np.diff(run.record()[:, 0]).min() > 0.015


def test_the_arduino_keeps_the_last_pwm_unless_it_watches_for_silence() -> None:
    for silence_s, kept in ((None, (9, 8, -7, 6)), (0.25, STOP)):
        arduino = SimulatedArduino(silence_s)
        for value in b"garbage,1,2*1,2,3,4*9,8,-7,6*5,5":
            arduino.take(bytes([value]), 1.0)
        arduino.watch(1.2)
        assert arduino.pwm == (9, 8, -7, 6)
        arduino.watch(1.3)
        assert arduino.pwm == kept
        assert (arduino.lines, arduino.bad_lines) == (2, 1)


def run_cli(*words: str, code: int = 0) -> Any:
    result = CliRunner().invoke(app, list(words))
    assert result.exit_code == code, (result.output, result.stderr, result.exception)
    return result


@pytest.mark.parametrize("start", [["host-control"], ["drive", "--host-control"]])
def test_the_command_simulates_and_draws(start: list[str], tmp_path: Path) -> None:
    picture = tmp_path / "run.png"
    words = [
        *start,
        "pose",
        "0",
        "0",
        "0",
        "--simulate",
        "--start",
        "0.2",
        "0.1",
        "0.5",
        "--plot",
        str(picture),
        "--json",
    ]
    found = json.loads(run_cli(*words).stdout)
    assert found["done"]
    assert found["error"]["truth"]["x_m"] < 0.01
    assert found["radio"]["bytes_per_s"] < 912.0
    assert picture.read_bytes().startswith(b"\x89PNG")


def test_the_command_follows_a_path_and_says_when_it_did_not_finish() -> None:
    words = ["host-control", "trajectory", "circle", "--simulate", "--set", "TRJ_SIZE=0.05", "--for", "3"]
    result = run_cli(*words, code=1)
    assert "not finished" in result.stderr
    assert "RMS error" in result.stdout


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ([], "--link is missing"),
        (["--link", "/dev/null"], "--source is missing"),
        (["--link", "/dev/null", "--source", "simulated"], "--source simulated"),
        (["--simulate", "--robot", "three_wheel"], "3 wheels"),
        (["--simulate", "--set", "CTL_MODE=original"], "needs encoders"),
        (["--simulate", "--pwm-min", "300"], "0 to 254"),
    ],
)
def test_the_command_says_what_is_missing(words: list[str], said: str) -> None:
    assert said in " ".join(run_cli("host-control", "pose", "0", "0", "0", *words, code=2).stderr.split())


COMMANDS = (
    ["host-control", "motor"],
    ["host-control", "pose"],
    ["host-control", "trajectory"],
    ["mocap", "bridge"],
    ["mocap", "record"],
)


@pytest.mark.parametrize("command", COMMANDS, ids=" ".join)
def test_the_commands_have_help_with_examples(command: list[str]) -> None:
    text = run_cli(*command, "--help").output
    assert "Examples" in text
    assert f"omni {' '.join(command)}" in text


@pytest.mark.parametrize("words", [["nan", "0", "0"], ["0", "inf", "0"], ["0", "0", "0", "--start", "nan", "0", "0"]])
def test_a_goal_that_is_no_number_is_refused(words: list[str]) -> None:
    result = CliRunner().invoke(app, ["host-control", "pose", "--simulate", *words])
    assert result.exit_code == 2
    assert "driving" not in result.output
