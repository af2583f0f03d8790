# SPDX-License-Identifier: MIT
"""Presets: what they hold, that they drive, and the commands that use them."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from hil_sim import metrics
from hil_sim.runs import faults_seen, run_in_process
from hil_sim.scenario import Event, load_scenario
from omni.cli import app
from omni_reproduce.experiment import read_spec
from omniwheel.errors import ParameterFileError
from omniwheel.presets import preset_names, read_preset
from omniwheel.robots import parameter_table, read_robot
from tests.host import preset_page
from tests.host.stepped import connect

TABLE = parameter_table()
ROOT = Path(__file__).resolve().parents[2]
GAINS = [name for name in preset_names() if not name.startswith("radio_")]
RADIO = {"radio_9600", "radio_57600", "radio_115200"}


def omni(*arguments: object, code: int = 0) -> str:
    result = CliRunner().invoke(app, [str(argument) for argument in arguments])
    assert result.exit_code == code, result.output
    return result.stdout


def omni_json(*arguments: object, code: int = 0) -> Any:
    return json.loads(omni(*arguments, "--json", code=code))


def test_the_report_s_controllers_are_there_next_to_ours() -> None:
    report = {f"report_{name}" for name in ("p", "pd", "pid", "ismc", "ismc_motor", "torque")}
    assert set(preset_names()) == report | {"default", "fixed_noise", "original"} | RADIO


@pytest.mark.parametrize("name", preset_names())
def test_a_preset_says_what_it_is(name: str) -> None:
    preset = read_preset(name, TABLE)
    assert preset.name == name
    assert preset.description
    assert preset.source
    assert not [key for key in preset.parameters if TABLE[key].robot_key]
    assert name in RADIO or not [key for key in preset.parameters if TABLE[key].disarmed_only]


@pytest.mark.parametrize("law", ["P", "PD", "PID"])
def test_the_fitted_gains_are_those_of_table_1(law: str) -> None:
    fit = read_spec("table1")["controller"][law]
    gains = read_preset(f"report_{law.lower()}", TABLE).parameters
    for letter in law:
        assert gains[f"FL_K{letter}_XY"] == gains[f"FL_K{letter}_TH"] == pytest.approx(fit[f"k{letter.lower()}"])


def test_the_sliding_mode_gains_are_those_of_table_2() -> None:
    fit, gains = read_spec("table2")["setting"]["published"], read_preset("report_ismc", TABLE).parameters
    assert [gains["ISMC_LAM_XY"], gains["ISMC_LAM_XY"], gains["ISMC_LAM_TH"]] == fit["lambda_"]


@pytest.mark.nightly
def test_the_tables_of_presets_have_the_figures_of_today() -> None:
    assert preset_page.written() == preset_page.PAGE.read_text(encoding="utf-8"), (
        "python -m tests.host.preset_page --write"
    )


@pytest.mark.full
def test_what_the_page_says_of_presets_on_real_wheels() -> None:
    def error(preset: str, robot: str, *, ideal: bool = False, fixes: bool = True) -> float:
        return preset_page.driven(preset, robot, ideal=ideal, fixes=fixes).error_mm

    slow = ("three_wheel", "four_wheel")
    for robot in slow:
        for preset in ("default", "report_pd", "report_pid"):
            assert error(preset, robot) < 1.1 * error(preset, robot, ideal=True)
        assert error("report_torque", robot) > 1.1 * error("report_torque", robot, ideal=True)
        assert error("report_ismc", robot) > 1.3 * error("default", robot)
        for preset in ("report_ismc", "report_ismc_motor"):
            assert preset_page.driven(preset, robot).at_limit > 0.4
    for ideal in (False, True):
        assert preset_page.driven("original", "fast_three_wheel", ideal=ideal).fault == "tracking"
    for law in ("p", "pd", "pid"):
        assert 15.0 < error(f"report_{law}", "fast_three_wheel") / error("default", "fast_three_wheel") < 40.0
    for robot in preset_page.ROBOTS:
        assert all(error(preset, robot, fixes=False) > 1.8 for preset in preset_page.PRESETS)


def test_the_default_preset_undoes_every_other_one() -> None:
    default = read_preset("default", TABLE).parameters
    assert default == {name: TABLE[name].default for name in default}
    for name in GAINS:
        assert set(read_preset(name, TABLE).parameters) <= set(default), name


@pytest.mark.parametrize("robot", ["three_wheel", "four_wheel"])
@pytest.mark.parametrize("name", GAINS)
def test_each_preset_drives_each_robot_in_the_full_plant(name: str, robot: str) -> None:
    scenario = replace(load_scenario("demo", robot), duration_s=15.0)
    run = run_in_process(scenario.with_parameters(read_preset(name, TABLE).parameters))
    assert faults_seen(run)[0] == []
    rmse = metrics.tracking_rmse(run.record)
    assert rmse.position_m < 0.06
    assert rmse.theta_rad < 0.1


def test_a_scenario_s_events_leave_a_preset_s_parameters_alone() -> None:
    settings = {"ISMC_LAM_XY": 1.0, "WS_P": 2.0}
    scenario = replace(
        load_scenario("demo"), events=(Event(at_s=1.0, settings=settings), Event(at_s=1.0, command="arm"))
    )
    changed = scenario.with_parameters({"ISMC_LAM_XY": 9.0})
    assert changed.parameter_values()["ISMC_LAM_XY"] == 9.0
    assert [event.settings for event in changed.events] == [{"WS_P": 2.0}, None]
    assert len(scenario.with_parameters({"ISMC_LAM_XY": 9.0, "WS_P": 3.0}).events) == 1


def test_unknown_and_broken_presets_are_named(tmp_path: Path) -> None:
    with pytest.raises(ParameterFileError, match="did you mean report_torque"):
        read_preset("report_torqe", TABLE)
    broken = tmp_path / "mine.toml"
    broken.write_text('[preset]\nnam = "x"\n[parameters]\nWS_P = 1.0\n')
    with pytest.raises(ParameterFileError, match=r"preset\.nam.*did you mean name"):
        read_preset(broken, TABLE)
    broken.write_text("[parameters]\nWS_P = -1.0\n")
    with pytest.raises(ParameterFileError, match="WS_P"):
        read_preset(broken, TABLE)


def test_presets_are_listed_and_shown() -> None:
    listed = omni_json("params", "list", "--presets")["presets"]
    assert [entry["name"] for entry in listed] == preset_names()
    shown = omni_json("params", "list", "--presets", "report_torque")["presets"][0]
    assert shown["parameters"]["DT_KP_XY"] == 5
    assert "eq. 28-32" in omni("params", "list", "--presets")
    assert "DT_KD_TH" in omni("params", "list", "--presets", "report_torque")
    assert omni_json("params", "list", "--presets", "nothing", code=2)["error"]["type"] == "ParameterFileError"


def test_a_preset_is_loaded_and_undone_by_name(sitl: str) -> None:
    changes = omni_json("params", "load", "report_torque", "--link", sitl)
    assert changes["DT_KP_XY"] == {"before": 400, "after": 5}
    omni("params", "diff", "report_torque", "--link", sitl)
    omni("params", "load", "default", "--link", sitl)
    with connect(sitl) as robot:
        assert robot.parameters["DT_KP_XY"] == 400.0
        assert robot.parameters["CTL_PERIOD"] == 1.0
    omni("params", "load", "no_such_preset", "--link", sitl, code=2)


@pytest.mark.full
def test_sim_takes_a_preset_over_the_scenario(tmp_path: Path) -> None:
    scenario = tmp_path / "short.toml"
    scenario.write_text('[scenario]\nname = "short"\nextends = "demo"\nduration_s = 3.0\n')
    told = omni_json("run", "--core-only", scenario, "--preset", "report_pid", "--out", tmp_path)
    assert told["controller"] == "pid"
    assert told["parameters"]["CTL_PERIOD"] == 20
    omni("run", "--core-only", scenario, "--preset", "reprot_pid", "--out", tmp_path, code=2)


def test_presets_leave_the_robot_file_alone() -> None:
    robot = read_robot("four_wheel")
    assert not set(read_preset("default", TABLE).parameters) & set(robot.overrides)
