# SPDX-License-Identifier: MIT
from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import pytest

from hil_sim.faults import Fault
from hil_sim.limits import MAX_SEED
from hil_sim.runs import new_world
from hil_sim.scenario import Event, load_scenario, parse_scenario, scenario_names
from hil_sim.scenario_file import scenario_document
from omni_schema import SchemaError
from omniwheel.errors import RobotFileError
from omniwheel.robots import find_robot_file

HEAD: dict[str, Any] = {"name": "mine", "description": "for a test", "robot": "three_wheel"}


SQUARE: dict[str, Any] = {"x_m": [0, 1], "y_m": [0, 1]}


def parse(**parts: Any) -> Any:
    return parse_scenario({"scenario": HEAD, **parts}, "mine.toml")


def test_every_packaged_scenario_can_be_read_and_has_its_file_s_name() -> None:
    names = scenario_names()
    assert {"demo", "no_slip", "original_law", "original_law_fixes", "four_wheel", "sitl"} <= set(names)
    for name in names:
        scenario = load_scenario(name)
        assert scenario.name == name
        assert scenario.description


def test_the_demo_is_the_path_that_the_readme_speaks_of() -> None:
    demo = load_scenario("demo")
    values = demo.parameter_values()
    assert (values["TRJ_PETALS"], values["TRJ_SIZE"], values["TRJ_SCALE"]) == (8.0, 0.5, 1.0)
    assert (demo.world["slip_max"], demo.world["fix_rate_Hz"], demo.world["fix_delay_s"]) == (0.1, 50.0, 0.02)
    assert demo.duration_s is None
    change = demo.first_setting()
    assert change is not None
    assert change.at_progress == 0.5


def test_what_a_scenario_says_is_what_it_holds() -> None:
    scenario = parse(
        scenario={**HEAD, "seed": 7, "duration_s": 3},
        parameters={"CTL_MODE": "pid", "TRJ_SCALE": False},
        world={"slip_max": 0.05, "start_pose": [1, 2, 0.5]},
        event=[
            {"at_s": 0.5, "command": "arm"},
            {"at_progress": 0.25, "set": {"WS_P": 5}},
            {"at_s": 1, "velocity": [0.1, 0, 0]},
            {"at_s": 2, "duty": [0.5, -1, 0]},
        ],
        fault=[
            {"kind": "encoder_stuck", "wheel": 2, "start_s": 1.0},
            {"kind": "battery_sag", "start_s": 0, "value": 8},
        ],
    )
    assert (scenario.seed, scenario.duration_s) == (7, 3.0)
    assert scenario.parameters == {"CTL_MODE": 4.0, "TRJ_SCALE": 0.0}
    assert scenario.parameter_values()["CTL_MODE"] == 4.0
    assert scenario.start_pose == (1.0, 2.0, 0.5)
    assert scenario.events == (
        Event(at_s=0.5, command="arm"),
        Event(at_progress=0.25, settings={"WS_P": 5.0}),
        Event(at_s=1.0, velocity=(0.1, 0.0, 0.0)),
        Event(at_s=2.0, duty=(0.5, -1.0, 0.0)),
    )
    assert scenario.faults == (Fault("encoder_stuck", 1.0, math.inf, wheel=1), Fault("battery_sag", 0.0, value=8.0))


@pytest.mark.parametrize(
    ("parts", "said"),
    [
        ({"scenario": {**HEAD, "nane": "x"}}, ("scenario.nane", "did you mean name")),
        ({"scenario": {"name": "x", "robot": "three_wheel"}}, ("scenario.description", "missing")),
        ({"scenario": {**HEAD, "name": "Two Words"}}, ("scenario.name", "'Two Words'")),
        ({"scenario": {**HEAD, "seed": -1}}, ("scenario.seed", "-1", str(MAX_SEED))),
        ({"scenario": {**HEAD, "seed": True}}, ("scenario.seed", "True")),
        ({"scenario": {**HEAD, "duration_s": "forever"}}, ("scenario.duration_s", "forever", "until_done")),
        ({"scenario": {**HEAD, "duration_s": 0}}, ("scenario.duration_s", "0.1")),
        ({"parameters": {"ISMC_LAM_XX": 1}}, ("parameters.ISMC_LAM_XX", "did you mean ISMC_LAM_XY")),
        ({"parameters": {"ISMC_LAM_XY": 1e9}}, ("parameters.ISMC_LAM_XY", "200")),
        ({"parameters": {"CTL_MODE": "ismcc"}}, ("parameters.CTL_MODE", "did you mean ismc")),
        ({"world": {"slip_maximum": 0.1}}, ("world.slip_maximum", "did you mean slip_max")),
        ({"world": {"EKF_GATE": 0}}, ("world.EKF_GATE", "write it in the section [parameters]")),
        ({"world": {"plant": "slipp"}}, ("world.plant", "did you mean slip", "kinematic+motors")),
        ({"world": {"plant": 3}}, ("world.plant", "3")),
        ({"world": {"slip_speed_max_m_s": -0.1}}, ("world.slip_speed_max_m_s", "-0.1")),
        ({"world": {"slip_max": 1.5}}, ("world.slip_max", "1.5", "0.9")),
        ({"world": {"slip_max": math.nan}}, ("world.slip_max", "nan")),
        ({"world": {"start_pose": [0, 0]}}, ("world.start_pose", "three numbers")),
        ({"event": {"at_s": 1}}, ("event", "[[event]]")),
        ({"event": [{"command": "arm"}]}, ("event[1]", "none of at_s, at_progress")),
        ({"event": [{"at_s": 1, "at_progress": 0.5, "command": "arm"}]}, ("event[1]", "exactly one")),
        ({"event": [{"at_s": 1, "command": "amr"}]}, ("event[1].command", "did you mean arm")),
        ({"event": [{"at_progress": 1.5, "command": "arm"}]}, ("event[1].at_progress", "from 0 to 1")),
        ({"event": [{"at_s": 1, "set": {"WS_P": math.inf}}]}, ("event[1].set.WS_P", "inf")),
        ({"event": [{"at_s": 1, "duty": [0.5, 0.5]}]}, ("event[1].duty", "list of 3")),
        ({"event": [{"at_s": 1, "duty": [0.5, 0.5, 1.5]}]}, ("event[1].duty[3]", "from -1 to 1")),
        ({"fault": [{"kind": "encoder_stuk", "start_s": 1}]}, ("fault[1].kind", "did you mean encoder_stuck")),
        ({"fault": [{"start_s": 1}]}, ("fault[1].kind", "None")),
        ({"fault": [{"kind": "encoder_stuck", "start_s": 1}]}, ("fault[1].wheel", "is needed")),
        ({"fault": [{"kind": "encoder_stuck", "start_s": 1, "wheel": 4}]}, ("fault[1].wheel", "from 1 to 3")),
        ({"fault": [{"kind": "pose_loss", "start_s": 1, "wheel": 1}]}, ("fault[1].wheel", "does not apply")),
        ({"fault": [{"kind": "pose_loss", "start_s": 2, "stop_s": 1}]}, ("fault[1].stop_s", "from 2")),
        ({"scenrio": {}}, ("scenrio", "did you mean scenario")),
        ({"world": {"wheel_friction": [1, 1]}}, ("world.wheel_friction", "has 2 numbers; 3 are needed")),
        ({"world": {"wheel_friction": [1, 1, 0]}}, ("world.wheel_friction[3]", "from 0.001 to 10")),
        ({"world": {"wheel_drag": -1}}, ("world.wheel_drag", "-1", "from 0 to 100")),
        ({"world": {"backlash_rad": 0.6}}, ("world.backlash_rad", "from 0 to 0.5 rad")),
        ({"patch": {"friction": 1}}, ("patch", "[[patch]]")),
        ({"patch": [{"friction": 0.5}]}, ("patch[1]", "no place", "centre_m and radius_m")),
        ({"patch": [{"x_m": [0, 1], "radius_m": 1, "friction": 1}]}, ("patch[1]", "radius_m, x_m; give")),
        ({"patch": [{**SQUARE, "friction": 0}]}, ("patch[1].friction", "from 0.001 to 10")),
        ({"patch": [SQUARE]}, ("patch[1].friction", "None")),
        ({"patch": [{**SQUARE, "y_m": [1, 0], "friction": 1}]}, ("patch[1].y_m", "the first must be below")),
        ({"patch": [{**SQUARE, "x_m": [0, math.inf], "friction": 1}]}, ("patch[1].x_m[2]", "finite")),
        ({"patch": [{"centre_m": [0, 0], "radius_m": 0, "friction": 1}]}, ("patch[1].radius_m", "0")),
        ({"patch": [{**SQUARE, "frictoin": 1}]}, ("patch[1].frictoin", "did you mean friction")),
        ({"patch": [{**SQUARE, "friction": 1}] * 9}, ("patch", "9", "at most 8")),
        ({"world": {"plant": "linear"}, "patch": [{**SQUARE, "friction": 1}]}, ("patch", "plant linear", "full")),
    ],
)
def test_a_mistake_is_named_with_file_key_and_what_is_allowed(parts: dict[str, Any], said: tuple[str, ...]) -> None:
    with pytest.raises(SchemaError) as caught:
        parse(**parts)
    for words in ("mine.toml", *said):
        assert words in str(caught.value)


def test_an_unknown_robot_is_named() -> None:
    with pytest.raises(RobotFileError, match=r"three_whel.*did you mean three_wheel"):
        parse(scenario={**HEAD, "robot": "three_whel"})


def test_an_unknown_scenario_is_named() -> None:
    with pytest.raises(SchemaError, match="did you mean demo"):
        load_scenario("demos")


def test_a_file_that_is_no_toml_is_named(tmp_path: Path) -> None:
    file = tmp_path / "bad.toml"
    file.write_text("[scenario\n")
    with pytest.raises(SchemaError, match=r"bad.toml.*not valid TOML"):
        load_scenario(file)


def test_a_scenario_extends_another(tmp_path: Path) -> None:
    file = tmp_path / "mine.toml"
    file.write_text(
        '[scenario]\nname = "mine"\ndescription = "d"\nextends = "demo"\n'
        "[parameters]\nWS_P = 3.0\n[world]\nslip_max = 0.2\n"
    )
    mine, demo = load_scenario(file), load_scenario("demo")
    assert mine.parameters == {**demo.parameters, "WS_P": 3.0}
    assert mine.world == {**demo.world, "slip_max": 0.2}
    assert mine.events == demo.events
    assert (mine.name, mine.robot.name) == ("mine", "three_wheel")


def test_scenarios_that_extend_one_another_are_refused(tmp_path: Path) -> None:
    for name, other in (("a", "b"), ("b", "a")):
        (tmp_path / f"{name}.toml").write_text(f'[scenario]\nname = "{name}"\nextends = "./{other}.toml"\n')
    with pytest.raises(SchemaError, match="refers back"):
        load_scenario(tmp_path / "a.toml")


def test_another_robot_can_take_a_scenario_s_place() -> None:
    assert load_scenario("sitl", "four_wheel").robot.name == "four_wheel"


@pytest.mark.parametrize("seed", [-1, MAX_SEED + 1])
def test_a_seed_out_of_range_is_refused(seed: int) -> None:
    with pytest.raises(SchemaError, match=r"scenario\.seed"):
        load_scenario("demo").with_seed(seed)


def test_an_event_describes_itself() -> None:
    assert Event(at_s=0.0, command="trajectory_start").describe() == "trajectory start"
    assert Event(at_s=0.0, settings={"WS_P": 5.0}).describe() == "WS_P = 5"
    assert Event(at_s=0.0, velocity=(0.1, 0.0, -1.0)).describe() == "velocity 0.1, 0, -1"
    assert Event(at_s=0.0, duty=(0.1, 0.0, -1.0)).describe() == "duty 0.1, 0, -1"


def test_the_plant_is_the_full_one_unless_another_is_named() -> None:
    demo = load_scenario("demo")
    assert demo.plant == "full"
    assert demo.with_plant(None) is demo
    assert demo.with_plant("kinematic+motors").plant == "kinematic+motors"
    with pytest.raises(SchemaError, match=r"world\.plant"):
        demo.with_plant("magic")


def test_a_scenario_names_its_plant(tmp_path: Path) -> None:
    path = tmp_path / "mine.toml"
    path.write_text('[scenario]\nname = "mine"\nextends = "demo"\n[world]\nplant = "slip"\n')
    assert load_scenario(path).plant == "slip"


def test_the_world_may_hold_another_robot_than_the_firmware_believes(tmp_path: Path) -> None:
    text = find_robot_file("three_wheel").read_text(encoding="utf-8")
    crossed = tmp_path / "crossed.toml"
    crossed.write_text(text.replace("in1_channel = [9, 13, 3]", "in1_channel = [13, 9, 3]"), encoding="utf-8")
    scenario = load_scenario("stand", world_robot=str(crossed))
    assert scenario.parameter_values()["W1_IN1_CH"] == 9
    assert list(new_world(scenario).c.config.in1_channel)[:3] == [13, 9, 3]


def test_the_world_s_robot_has_as_many_wheels() -> None:
    with pytest.raises(SchemaError, match=r"world_robot.*4 wheels"):
        load_scenario("stand", world_robot="four_wheel")


def test_a_scenario_s_floor_and_wheels_reach_the_world() -> None:
    circle = {"centre_m": [0.5, -0.2], "radius_m": 0.3, "friction": 0.25}
    scenario = parse(
        world={"wheel_friction": [1, 0.5, 2], "wheel_drag": 3, "backlash_rad": 0.01},
        patch=[{**SQUARE, "friction": 0.5}, circle],
    )
    config = new_world(scenario).c.config
    assert list(config.wheel_friction)[:3] == [1.0, 0.5, 2.0]
    assert list(config.wheel_drag)[:3] == [3.0, 3.0, 3.0]
    assert config.backlash_rad == 0.01
    assert config.patch_count == 2
    assert (list(config.patch[0].x_m), config.patch[0].radius_m, config.patch[0].friction) == ([0.0, 1.0], 0.0, 0.5)
    middle = (config.patch[1].x_m[0], config.patch[1].y_m[0])
    assert (middle, config.patch[1].radius_m, config.patch[1].friction) == ((0.5, -0.2), 0.3, 0.25)
    assert parse_scenario(scenario_document(scenario), "copy.toml").patches == scenario.patches
    assert parse_scenario(scenario_document(scenario), "copy.toml").wheel_numbers == scenario.wheel_numbers
