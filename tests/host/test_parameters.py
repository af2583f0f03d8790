# SPDX-License-Identifier: MIT
"""The parameter protocol against a robot made of Python, with and without loss, in simulated time."""

from __future__ import annotations

import json
import math
import pickle
from collections.abc import Callable
from enum import IntEnum
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from omni.cli import app
from omni_schema import as_float32
from omniwheel import sync
from omniwheel.errors import (
    LinkLostError,
    LinkTimeoutError,
    OtherRobotError,
    ParameterError,
    ParameterFileError,
    ParameterRangeError,
    ParameterRefusedError,
    UnknownParameterError,
)
from omniwheel.robot import Robot, connect


def test_download_gives_every_parameter_in_the_robots_order(fake: Any, robot: Robot) -> None:
    seen: list[tuple[int, int]] = []
    values = robot.parameters.download(lambda done, total: seen.append((done, total)))
    assert values == pytest.approx(fake.values)
    assert list(robot.parameters) == list(fake.values)
    assert len(robot.parameters) == len(fake.values)
    assert seen[-1] == (len(fake.values), len(fake.values))


def test_what_is_known_stays_known_while_it_is_downloaded_anew(fake: Any, robot: Robot) -> None:
    values = robot.parameters.download()
    fake.values["ISMC_LAM_XY"] = 3.0
    seen: list[bool] = []
    robot.connection.add_listener(
        lambda _: seen.append(robot.parameters.known.keys() == values.keys() and robot.parameters.complete)
    )
    assert robot.parameters.download() == {**values, "ISMC_LAM_XY": 3.0}
    assert seen
    assert all(seen)


def test_a_download_that_fails_leaves_what_is_known(fake: Any, robot: Robot) -> None:
    values = robot.parameters.download()
    fake.silent = True
    with pytest.raises(LinkTimeoutError):
        robot.parameters.download()
    assert robot.parameters.known == values


@pytest.mark.full
@pytest.mark.parametrize(("loss", "seeds"), [(0.1, 10), (0.3, 10), (0.5, 100)])
def test_download_survives_loss(fake_robot: Callable[..., Any], loss: float, seeds: int) -> None:
    """At 50 % a download fails once in 10^5: of 18 list requests, or of 46 for the last value, every one is in vain."""
    for seed in range(seeds):
        fake = fake_robot(loss=loss, seed=seed, names=8)
        with connect(fake, clock=fake.clock, timeout_s=60.0) as robot:
            assert robot.parameters.download() == pytest.approx(fake.values), seed


def test_a_robot_that_falls_silent_ends_the_download(fake: Any, robot: Robot) -> None:
    fake.silent = True
    with pytest.raises(LinkTimeoutError, match="does not answer"):
        robot.parameters.download()


def test_setting_returns_with_the_robots_confirmation(fake: Any, robot: Robot) -> None:
    robot.parameters["ISMC_LAM_XY"] = 15.1
    assert fake.values["ISMC_LAM_XY"] == as_float32(15.1) == robot.parameters["ISMC_LAM_XY"]


def test_enum_values_can_be_named(fake: Any, robot: Robot) -> None:
    robot.parameters.set_many({"CTL_MODE": "pid", "TRJ_SCALE": 0})
    assert (fake.values["CTL_MODE"], fake.values["TRJ_SCALE"]) == (4.0, 0.0)


@pytest.mark.parametrize("value", [math.nan, math.inf, -1.0, 200.001, 1e300])
def test_a_value_out_of_range_is_not_even_sent(fake: Any, robot: Robot, value: float) -> None:
    with pytest.raises(ParameterRangeError, match=r"ISMC_LAM_XY.*from 0 to 200"):
        robot.parameters["ISMC_LAM_XY"] = value
    assert not [m for m in fake.received if m.get_type() == "PARAM_SET"]


def test_an_unknown_name_comes_with_the_closest_known_one(robot: Robot) -> None:
    with pytest.raises(UnknownParameterError, match="did you mean ISMC_LAM_XY"):
        robot.parameters["ISMC_LAM_YX"] = 1.0
    with pytest.raises(KeyError):
        robot.parameters["NO_SUCH"]


def test_a_refusal_carries_the_robots_words_and_changes_nothing(fake: Any, robot: Robot) -> None:
    fake.refusals["WHEELS"] = "WHEELS refused: disarm first"
    with pytest.raises(ParameterRefusedError, match="disarm first") as caught:
        robot.parameters["WHEELS"] = 4
    assert (caught.value.wanted, caught.value.kept) == (4.0, 3.0)
    assert robot.parameters["WHEELS"] == 3.0


def test_set_many_sets_all_or_none(fake: Any, robot: Robot) -> None:
    before = dict(fake.values)
    fake.refusals["WHEELS"] = "no"
    with pytest.raises(ParameterRefusedError):
        robot.parameters.set_many({"ISMC_LAM_XY": 1.0, "WHEELS": 4, "ISMC_LAM_TH": 2.0})
    assert fake.values == before
    with pytest.raises(ParameterRangeError):
        robot.parameters.set_many({"ISMC_LAM_XY": 1.0, "ISMC_LAM_TH": -2.0})
    assert fake.values == before


def test_set_many_tries_again_what_needs_another_value_first(fake: Any, robot: Robot) -> None:
    set_value = fake._set

    def needs_four_wheels(name: str, value: float) -> None:
        fake.refusals = {"W4_ANGLE": "only with 4 wheels"} if fake.values["WHEELS"] != 4 else {}
        set_value(name, value)

    fake._set = needs_four_wheels
    robot.parameters.set_many({"W4_ANGLE": 90.0, "WHEELS": 4})
    assert (fake.values["W4_ANGLE"], fake.values["WHEELS"]) == (90.0, 4.0)


def test_a_lost_confirmation_is_asked_for_again(fake_robot: Callable[..., Any]) -> None:
    fake = fake_robot(loss=0.4, seed=5)
    with connect(fake, clock=fake.clock, timeout_s=60.0) as robot:
        for value in (1.0, 2.0, 3.0, 4.0):
            robot.parameters["FL_KP_XY"] = value
            assert fake.values["FL_KP_XY"] == value


def test_parameters_cannot_be_deleted(robot: Robot) -> None:
    with pytest.raises(TypeError, match="reset_parameters"):
        del robot.parameters["WHEELS"]


def test_a_saved_file_loads_to_the_same_bits(fake: Any, robot: Robot, tmp_path: Path) -> None:
    file = tmp_path / "p.toml"
    robot.parameters.set_many({"ISMC_LAM_XY": 0.1, "KF_Q_W": 1 / 3, "CTL_MODE": "pid"})
    robot.parameters.save(file)
    saved = dict(fake.values)
    robot.parameters.set_many({"ISMC_LAM_XY": 5, "KF_Q_W": 2, "CTL_MODE": "ismc"})
    changes = robot.parameters.load(file)
    assert set(changes) == {"ISMC_LAM_XY", "KF_Q_W", "CTL_MODE"}
    assert fake.values == saved
    assert robot.parameters.load(file) == {}
    assert 'CTL_MODE = "pid"' in file.read_text()


def test_diff_lists_what_differs(robot: Robot) -> None:
    assert robot.parameters.diff({"ISMC_LAM_XY": 15.0, "WHEELS": 3}) == {"ISMC_LAM_XY": (12.0, 15.0)}


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("[parameters]\nISMC_LAM_XZ = 1\n", ["ISMC_LAM_XZ", "did you mean"]),
        ("[parameters]\nISMC_LAM_XY = 1000\n", ["ISMC_LAM_XY", "1000", "from 0 to 200"]),
        ("[parameters]\nISMC_LAM_XY = nan\n", ["ISMC_LAM_XY", "nan"]),
        ('[parameters]\nCTL_MODE = "pidd"\n', ["CTL_MODE", "did you mean pid"]),
        ("ISMC_LAM_XY = 1\n", ["ISMC_LAM_XY", "section [parameters]"]),
        ("[parameters\n", ["not valid TOML"]),
    ],
)
def test_a_bad_file_changes_nothing_and_says_where(
    fake: Any, robot: Robot, tmp_path: Path, text: str, words: list[str]
) -> None:
    file = tmp_path / "bad.toml"
    file.write_text(text)
    before = dict(fake.values)
    with pytest.raises(ParameterFileError) as caught:
        robot.parameters.load(file)
    assert all(word in str(caught.value) for word in [*words, "bad.toml"])
    assert fake.values == before


def test_a_missing_file_is_named(robot: Robot, tmp_path: Path) -> None:
    with pytest.raises(ParameterFileError, match=r"nowhere\.toml: no such file"):
        robot.parameters.load(tmp_path / "nowhere.toml")


@pytest.mark.parametrize("gone", ["silent", "closed"])
def test_a_link_that_is_lost_half_way_names_what_was_set_and_what_is_not_known(
    fake: Any, robot: Robot, gone: str
) -> None:
    answer = fake._answer

    def lost(message: Any) -> None:
        if message.get_type() == "PARAM_SET" and message.param_id == "LIM_W":
            fake.silent = True
            if gone == "closed":
                fake.read = closed
        answer(message)

    def closed(_timeout_s: float) -> bytes:
        raise LinkLostError("the port is gone")

    fake._answer = lost
    with pytest.raises((LinkLostError, LinkTimeoutError)) as error:
        robot.parameters.set_many({"LIM_V": 0.7, "LIM_W": 1.5, "ISMC_LAM_XY": 9.0})
    assert fake.values["LIM_V"] == pytest.approx(0.7)
    assert fake.values["ISMC_LAM_XY"] != 9.0
    assert all(name in str(error.value) for name in ("LIM_V", "LIM_W", "ISMC_LAM_XY"))
    assert "LIM_V LIM_W ISMC_LAM_XY" in error.value.hint


def test_ctrl_c_half_way_sets_the_old_values_back(fake: Any, robot: Robot) -> None:
    old = dict(fake.values)
    answer = fake._answer
    pressed: list[Any] = []

    def interrupted(message: Any) -> None:
        answer(message)
        if message.get_type() == "PARAM_SET" and message.param_id == "LIM_W" and not pressed:
            pressed.append(message)
            raise KeyboardInterrupt

    fake._answer = interrupted
    with pytest.raises(KeyboardInterrupt):
        robot.parameters.set_many({"LIM_V": 0.7, "LIM_W": 1.5, "ISMC_LAM_XY": 9.0})
    assert fake.values == old


OTHER_HARDWARE = {
    "wheels": "WHEELS = 4",
    "angle": "W2_ANGLE = 90",
    "radius": "WHEEL_RADIUS = 0.06",
    "distance": "WHEEL_DIST = 0.2",
    "encoder": "ENC_CPR = 4000",
    "direction": "W1_MOT_DIR = -1",
    "wiring": "W3_IN1_CH = 9",
}


@pytest.mark.parametrize("name", OTHER_HARDWARE)
def test_the_file_of_another_robot_is_named_and_sets_nothing(
    fake: Any, robot: Robot, tmp_path: Path, name: str
) -> None:
    file = tmp_path / "other.toml"
    file.write_text(f"[parameters]\nISMC_LAM_XY = 9\n{OTHER_HARDWARE[name]}\n")
    before = dict(fake.values)
    with pytest.raises(OtherRobotError) as caught:
        robot.parameters.load(file)
    assert OTHER_HARDWARE[name].split()[0] in str(caught.value)
    assert "ISMC_LAM_XY" not in str(caught.value)
    assert fake.values == before
    assert len(robot.parameters.load(file, force=True)) == 2


def test_a_calibrated_file_of_the_same_robot_is_loaded(robot: Robot, tmp_path: Path) -> None:
    file = tmp_path / "calibrated.toml"
    file.write_text(
        "[parameters]\nWHEEL_RADIUS = 0.0505\nWHEEL_DIST = 0.2601\nW1_RSCALE = 1.02\nW1_ANGLE = 1.5\nW4_ANGLE = 200\n"
    )
    assert len(robot.parameters.load(file)) == 5


def test_the_command_wants_force_for_another_robots_file(tmp_path: Path, sitl: str) -> None:
    file = tmp_path / "other.toml"
    file.write_text("[parameters]\nW3_MOT_DIR = -1\n")
    words = ["params", "load", str(file), "--link", sitl]
    assert CliRunner().invoke(app, words).exit_code == 1
    assert CliRunner().invoke(app, [*words, "--other-robot"]).exit_code == 0
    assert CliRunner().invoke(app, words).exit_code == 0  # it is this robot's now


@pytest.mark.parametrize("names", [1, 60])
def test_what_another_program_changed_is_set_again(fake: Any, robot: Robot, names: int) -> None:
    """A reset by another program, or a restart, changes values without a message about each."""
    before = robot.parameters.download()
    wanted = {**dict(list(before.items())[:names]), "ISMC_LAM_XY": 15.5}
    robot.parameters.set_many(wanted)
    fake.values["ISMC_LAM_XY"] = before["ISMC_LAM_XY"]
    robot.parameters.set_many(wanted)
    assert fake.values["ISMC_LAM_XY"] == 15.5


def test_a_refused_set_brings_back_what_another_program_set(fake: Any, robot: Robot) -> None:
    robot.parameters.download()
    fake.values["ISMC_LAM_XY"] = 3.0
    fake.refusals["WS_P"] = "no"
    with pytest.raises(ParameterRefusedError):
        robot.parameters.set_many({"ISMC_LAM_XY": 15.5, "WS_P": robot.parameters["WS_P"] * 0.5})
    assert fake.values["ISMC_LAM_XY"] == 3.0


def test_values_have_the_types_of_their_parameters(robot: Robot) -> None:
    parameters = robot.parameters
    mode = parameters["CTL_MODE"]
    assert isinstance(mode, IntEnum)
    assert mode == 1
    assert (mode.name, f"{mode}", f"{mode:g}", f"{mode:>6}") == ("ismc", "ismc", "1", "  ismc")
    assert isinstance(parameters["WHEELS"], int)
    assert isinstance(parameters["LIM_V"], float)
    values = parameters.download()
    assert isinstance(values["CTL_MODE"], IntEnum)
    assert isinstance(parameters.known["TRJ_TYPE"], IntEnum)


def test_an_enum_is_set_by_member_name_or_number(fake: Any, robot: Robot) -> None:
    modes = robot.parameters.enum("CTL_MODE")
    assert [mode.name for mode in modes][:2] == ["none", "ismc"]
    for value in (modes["pid"], "pid", 4):
        robot.parameters["CTL_MODE"] = 1
        robot.parameters["CTL_MODE"] = value
        assert fake.values["CTL_MODE"] == 4.0
        assert robot.parameters["CTL_MODE"] is modes["pid"]


def test_a_value_of_another_firmware_is_kept_as_a_number(fake: Any, robot: Robot) -> None:
    fake.values["CTL_MODE"] = 99.0
    assert robot.parameters.read("CTL_MODE") == 99.0


def test_enums_become_numbers_in_json_and_other_processes(robot: Robot) -> None:
    mode = robot.parameters["CTL_MODE"]
    assert json.dumps(mode) == "1"
    assert pickle.loads(pickle.dumps(mode)) == 1


def test_only_enums_have_an_enumeration(robot: Robot) -> None:
    with pytest.raises(ValueError, match="LIM_V"):
        robot.parameters.enum("LIM_V")
    with pytest.raises(UnknownParameterError):
        robot.parameters.enum("CTL_MOD")


@pytest.mark.full
def test_what_stays_changed_after_a_block_is_said() -> None:
    with sync.simulate() as robot:
        before = robot.parameters["LIM_V"]
        with pytest.raises(ParameterError) as caught, robot.parameters.changed(FLOW_MODE="xy", LIM_V=0.3):
            robot.arm()
        assert "FLOW_MODE" in str(caught.value)
        assert "LIM_V" not in str(caught.value)
        assert robot.parameters.read("FLOW_MODE") == 1
        assert robot.parameters.read("LIM_V") == before
        robot.disarm()
        remedy = caught.value.hint.rpartition("then: ")[2]
        eval(remedy, {"robot": robot})
        assert robot.parameters.read("FLOW_MODE") == 0
