# SPDX-License-Identifier: MIT
"""The commands through Typer's runner and as processes: output, exit codes, errors."""

from __future__ import annotations

import io
import json
import os
import re
import signal
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from omni.cli import app
from omniwheel import FirmwareProcess
from omniwheel.robot import connect
from omniwheel.telemetry import Heartbeat
from tests.waiting import wait_until

runner = CliRunner()
COMMANDS = [
    ["params", "list"], ["params", "set"], ["params", "save"], ["params", "load"],
    ["params", "diff"], ["params", "reset"], ["monitor"], ["record"], ["drive", "velocity"],
    ["drive", "pose"], ["drive", "trajectory"],
    ["drive", "keys"], ["robots", "show"], ["robots", "check"], ["robots", "new"],
    ["robots", "wiring"], ["doctor"],
]  # fmt: skip


def run(*words: str, code: int = 0) -> Any:
    # Wide enough that no message is broken into lines, however long the paths in it are.
    result = runner.invoke(app, list(words), env={"COLUMNS": "400"})
    assert result.exit_code == code, (result.output, result.stderr, result.exception)
    return result


def run_json(*words: str, code: int = 0) -> Any:
    return json.loads(run(*words, "--json", code=code).stdout)


OMNI = [sys.executable, "-c", "from omni.cli import main; main()"]


def omni(*words: str, **options: Any) -> subprocess.CompletedProcess[str]:
    return subprocess.run([*OMNI, *words], capture_output=True, text=True, timeout=60, check=False, **options)


def start(*words: str) -> subprocess.Popen[str]:
    return subprocess.Popen([*OMNI, *words], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)


@pytest.mark.parametrize("words", COMMANDS, ids=" ".join)
def test_every_command_has_help_with_examples(words: list[str]) -> None:
    text = run(*words, "--help").output
    assert "Examples" in text
    assert f"omni {' '.join(words)}" in text


def values_of(*words: str) -> dict[str, float]:
    """Return the values that ``omni params list`` shows."""
    return {name: entry["value"] for name, entry in run_json("params", "list", *words).items()}


def test_params_set_list_and_diff(url: str) -> None:
    changes = run_json("params", "set", "isMc_lam_xy=15.5", "CTL_MODE=pid", "--link", url)
    assert changes["ISMC_LAM_XY"] == {"before": 12.0, "after": 15.5}
    assert values_of("ISMC_LAM_XY", "CTL_MODE", "--link", url) == {"ISMC_LAM_XY": 15.5, "CTL_MODE": 4.0}
    assert "pid" in run("params", "list", "CTL_MODE", "--link", url).stdout
    differences = run_json("params", "diff", "--link", url, code=1)
    assert differences["ISMC_LAM_XY"] == {"robot": 15.5, "default": 12.0}


def test_a_fresh_robot_does_not_differ_from_its_robot_file(url: str, robot_file: Path) -> None:
    assert "no difference" in run("params", "diff", "three_wheel", "--link", url).stdout
    assert run_json("params", "diff", str(robot_file), "--link", url) == {}
    run("params", "set", "WS_P=3", "--link", url)
    assert run_json("params", "diff", "three_wheel", "--link", url, code=1) == {"WS_P": {"robot": 3.0, "file": 4.0}}
    assert "WHEELS" in run_json("params", "diff", "four_wheel", "--link", url, code=1)


def test_json_shows_numbers_as_people_write_them(url: str) -> None:
    text = run("params", "set", "TRJ_SIZE=0.1", "--json", "--link", url).stdout
    assert json.loads(text) == {"TRJ_SIZE": {"before": 0.5, "after": 0.1}}


def test_params_list_shows_all_or_those_asked_for(url: str) -> None:
    everything = run_json("params", "list", "--link", url)
    assert everything["WHEEL_RADIUS"]["unit"] == "m"
    assert len(everything) > 100
    table = run("params", "list", "ismc_lam", "--link", url).stdout
    assert "ISMC_LAM_XY" in table
    assert "1/s" in table
    assert "WHEELS" not in table


def test_params_save_load_and_reset(url: str, tmp_path: Path) -> None:
    file = tmp_path / "mine.toml"
    run("params", "set", "ISMC_LAM_XY=15", "--link", url)
    assert run_json("params", "save", str(file), "--link", url)["file"] == str(file)
    assert run_json("params", "reset", "--link", url)["ISMC_LAM_XY"] == {"before": 15.0, "after": 12.0}
    assert run_json("params", "load", str(file), "--link", url) == {"ISMC_LAM_XY": {"before": 12.0, "after": 15.0}}
    assert run_json("params", "diff", str(file), "--link", url) == {}
    run("params", "reset", "ISMC_LAM_XY", "--link", url)
    assert values_of("ISMC_LAM_XY", "--link", url) == {"ISMC_LAM_XY": 12.0}


def test_a_value_out_of_range_is_bad_input_and_needs_no_robot() -> None:
    result = run("params", "set", "ISMC_LAM_XY=1000", code=2)
    assert "from 0 to 200" in result.stderr
    assert run_json("params", "set", "ISMC_LAM_XY=nan", code=2)["error"]["type"] == "ParameterRangeError"


@pytest.mark.parametrize("words", [["ISMC_LAM_XY"], ["=1"], ["ISMC_LAM_XY="]])
def test_an_assignment_that_is_none_is_bad_input(words: list[str]) -> None:
    assert "NAME=VALUE" in run("params", "set", *words, code=2).stderr


def test_an_unknown_parameter_is_bad_input_with_a_suggestion() -> None:
    assert "did you mean ISMC_LAM_XY" in run("params", "set", "ISMC_LAM_YX=1", code=2).stderr


@pytest.mark.full
def test_a_refused_parameter_is_exit_code_1_with_the_robots_reason() -> None:
    with FirmwareProcess(links=["tcp:127.0.0.1:0", "tcp:127.0.0.1:0"]) as both, connect(both.urls[0]) as pilot:
        pilot.arm()
        next(beat for beat in pilot.telemetry(Heartbeat) if beat.armed)
        process = start("params", "set", "WHEELS=4", "--link", both.urls[1])
        wait_until(lambda: process.poll() is not None, "the command goes on", pause=lambda: pilot.pump(0.05))
        output, errors = process.communicate()
    assert process.returncode == 1
    assert output == ""
    assert "disarm first" in errors
    assert "Traceback" not in errors


@pytest.mark.full
def test_no_robot_at_the_port_ends_with_one_line_and_a_hint() -> None:
    result = omni("params", "list", "--link", "tcp:127.0.0.1:1")
    assert result.returncode == 1
    assert result.stdout == ""
    lines = result.stderr.splitlines()
    assert [line.split(":")[0] for line in lines] == ["error", "hint"]
    assert "refused" in lines[0]


@pytest.mark.full
def test_json_errors_are_one_object_on_standard_output() -> None:
    result = omni("monitor", "--json", "--link", "tcp:127.0.0.1:1")
    assert result.returncode == 1
    assert json.loads(result.stdout)["error"]["type"] == "LinkOpenError"


@pytest.mark.parametrize("link", ["nonsense:1", "tcp:host", "/dev/ttyACM0,fast"])
def test_a_link_that_is_none_is_bad_input(link: str) -> None:
    assert link in run("monitor", "--link", link, code=2).stderr


def test_without_a_link_the_user_is_told_how_to_give_one(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("omniwheel.ports.serial_ports", list)
    monkeypatch.delenv("OMNI_LINK", raising=False)
    assert "--link" in run("monitor", code=2).stderr


def test_the_environment_can_name_the_link(url: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("OMNI_LINK", url)
    assert values_of("WHEELS") == {"WHEELS": 3.0}


def test_monitor_once(url: str) -> None:
    with connect(url) as robot:  # the very first status may still say "init"
        robot.wait_until(lambda status: status.state == "disarmed", 10.0, "ready")
    status = run_json("monitor", "--once", "--link", url)
    assert (status["state"], status["armed"], status["mode"]) == ("disarmed", False, "hold")
    assert set(status["pose"]) == {"x", "y", "theta"}
    shown = run("monitor", "--once", "--link", url).stdout
    assert all(text in shown for text in ("disarmed", "x [m]", "theta [rad]", "speed [rad/s]", "slip [m/s]"))
    counted = ("missed: ", "bus errors since the start: ", "frames received: ", "link was full: ")
    assert all(words in shown for words in counted), "each number says what it counts, in one line"
    assert "no path" in shown
    assert status["quality"]["verdict"] == "no fixes"
    assert status["quality"]["text"].startswith("pose without fixes: ±")
    assert "pose without fixes: ±" in shown
    assert "start a pose source" in shown
    heading = next(line for line in shown.splitlines() if "wheel " in line)
    assert [word for word in heading.split() if word.isdigit()] == ["1", "2", "3"]


def test_monitor_shows_the_fields_of_any_message(url: str) -> None:
    from omniwheel.dialect import mavlink

    told = run_json("monitor", "-m", "OMNI_CONTROL", "-m", "heartbeat", "--link", url)
    for name, fields in told.items():
        assert list(fields) == getattr(mavlink, f"MAVLink_{name.lower()}_message").fieldnames
    assert list(told) == ["OMNI_CONTROL", "HEARTBEAT"]
    assert told["HEARTBEAT"]["type"] == mavlink.MAV_TYPE_GROUND_ROVER
    assert "OMNI_CONTROL  time_boot_ms=" in run("monitor", "--once", "-m", "OMNI_CONTROL", "--link", url).stdout
    assert "OMNI_CONTROL?" in run("monitor", "-m", "OMNI_CONTROLL", "--link", url, code=2).stderr


def test_the_monitor_does_not_show_an_old_state_as_the_present_one(robot: Any, fake: Any) -> None:
    from rich.console import Console

    from omni.cli.monitor import view

    fake.silent = True
    robot.pump(4.0)
    console = Console(width=200, record=True, file=io.StringIO())
    console.print(view(robot, 3))
    shown = console.export_text()
    assert "silent for" in shown
    assert "not known (it was" in shown


def test_record_writes_a_log_that_pymavlink_reads(url: str, tmp_path: Path) -> None:
    from pymavlink import mavutil

    from omniwheel.dialect import install

    out = tmp_path / "run.tlog"
    result = run_json("record", str(out), "--duration", "1.5", "--link", url)
    assert result["frames"] > 10
    install()
    log = mavutil.mavlink_connection(str(out))
    kinds = set()
    while (message := log.recv_match()) is not None:
        kinds.add(message.get_type())
    assert {"HEARTBEAT", "OMNI_TRACKING", "LOCAL_POSITION_NED"} <= kinds
    assert "exists already" in run("record", str(out), "--link", url, code=2).stderr


@pytest.mark.full
def test_drive_velocity_disarms_at_the_end(url: str) -> None:
    result = run_json("drive", "velocity", "0", "0", "0", "--for", "0.3", "--link", url)
    assert set(result["pose"]) == {"x", "y", "theta"}
    assert result["quality"]["text"].startswith("pose without fixes: ±")
    assert run_json("monitor", "--link", url)["state"] == "disarmed"


@pytest.mark.full
def test_a_drive_ends_with_how_good_the_pose_is_and_what_to_do(url: str) -> None:
    shown = run("drive", "velocity", "0", "0", "0", "--for", "0.3", "--link", url).stdout
    words = " ".join(shown.split())
    assert "pose without fixes: ±" in words
    assert "; start a pose source" in words


@pytest.mark.full
def test_drive_pose_to_where_it_is_arrives(url: str) -> None:
    assert run_json("drive", "pose", "0", "0", "0", "--for", "3", "--link", url)["arrived"] is True


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (["duty", "2", "0", "0"], "duty 1 is 2"),
        (["duty", "nan", "0", "0"], "duty 1 is nan"),
        (["duty", "0", "0", "0", "0", "0"], "5 duties are given"),
        (["velocity", "nan", "0", "0"], "vx is nan"),
        (["pose", "0", "inf", "0"], "y is inf"),
    ],
)
def test_bad_setpoints_are_refused_before_a_link_is_opened(words: list[str], told: str) -> None:
    assert told in run("drive", *words, "--link", "tcp:127.0.0.1:1", code=2).stderr


def test_an_unknown_trajectory_is_refused_and_the_robot_disarmed(url: str) -> None:
    result = run("drive", "trajectory", "rosee", "--link", url, code=2)
    assert "did you mean rose" in result.stderr
    assert run_json("monitor", "--link", url)["state"] == "disarmed"


@pytest.mark.full
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_ctrl_c_a_kill_and_a_closed_terminal_disarm(number: signal.Signals) -> None:
    with FirmwareProcess(links=["tcp:127.0.0.1:0", "tcp:127.0.0.1:0"]) as firmware:
        process = start("drive", "velocity", "0", "0", "0", "--for", "600", "--link", firmware.urls[0])
        with connect(firmware.urls[1], timeout_s=60.0) as watcher:
            watcher.set_message_interval("HEARTBEAT", 20.0)
            next(beat for beat in watcher.telemetry(Heartbeat, timeout_s=60.0) if beat.armed)
            os.kill(process.pid, number)
            next(beat for beat in watcher.telemetry(Heartbeat, timeout_s=60.0) if not beat.armed)
            _, errors = process.communicate(timeout=60)
    assert process.returncode == 130
    assert "disarmed" in errors
    assert "Traceback" not in errors


@pytest.mark.full
def test_keys_need_a_terminal() -> None:
    result = omni("drive", "keys", "--link", "tcp:127.0.0.1:1", stdin=subprocess.DEVNULL)
    assert result.returncode == 2
    assert "terminal" in result.stderr


def test_a_robot_that_cannot_be_simulated_is_told_so(robot_file: Path) -> None:
    """A real robot needs no [simulation]; the commands that do end without a traceback."""
    text = robot_file.read_text()
    robot_file.write_text(re.sub(r"(?m)^mass_kg.*\n", "", text))
    (warning,) = [text for text in run_json("robots", "check", str(robot_file))["warnings"] if "simulated" in text]
    assert "simulation.mass_kg" in warning
    for words in (("run", "--core-only"), ("run",), ("sitl",)):
        result = run(*words, "--robot", str(robot_file), code=2)
        assert "Traceback" not in result.stderr
        assert "simulation.mass_kg" in result.stderr
        assert "hint: add simulation.mass_kg" in result.stderr


def test_what_the_core_refuses_is_not_fine(robot_file: Path) -> None:
    text = robot_file.read_text()
    robot_file.write_text(re.sub(r"(?ms)(^\[motor\].*?^direction = )\[.*?\]", r"\1[1, 1, 0]", text))
    assert "W3_MOT_DIR" in run("robots", "check", str(robot_file), code=2).stderr
    assert "motor_direction[2]" in run("run", "--core-only", "--robot", str(robot_file), code=2).stderr


def test_robots_are_listed_shown_and_checked(robot_file: Path) -> None:
    listed = {robot["name"] for robot in run_json("robots")["robots"]}
    assert listed == {"fast_three_wheel", "four_wheel", "three_wheel"}
    assert run_json("robots", "show", "three_wheel")["parameters"]["WHEELS"] == 3.0
    assert "WHEEL_RADIUS" in run("robots", "show", "four_wheel").stdout
    assert "valid" in run("robots", "check", str(robot_file)).stdout
    assert run_json("robots", "check", str(robot_file))["warnings"] == []


def test_wiring_that_only_the_teensys_build_refuses_is_told_before(robot_file: Path) -> None:
    text = robot_file.read_text().replace("[wiring]", '[wiring]\nencoder_decoder = ["auto", "hardware", "auto"]', 1)
    robot_file.write_text(text)
    told = run("robots", "check", str(robot_file)).stdout
    assert "cannot be built from this file" in told
    assert "wiring.encoder_decoder asks for hardware" in run_json("robots", "check", str(robot_file))["warnings"][0]


def test_a_new_robot_file_is_a_copy_under_another_name(tmp_path: Path) -> None:
    file = Path(run_json("robots", "new", "mine", "--from", "four_wheel", "--out", str(tmp_path))["file"])
    assert run_json("robots", "show", str(file))["name"] == "mine"
    assert run_json("robots", "show", str(file))["wheels"] == 4
    assert run_json("robots", "new", "other", "--out", str(tmp_path))["warnings"] == []
    assert "exists already" in run("robots", "new", "mine", "--out", str(tmp_path), code=2).stderr
    assert "is not a valid robot name" in run("robots", "new", "My Robot", code=2).stderr


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("wheel_radius_m = 0.0508", "wheel_radius_m = 5.0", ["geometry.wheel_radius_m", "5.0", "0.5"]),
        ("wheel_radius_m", "wheel_raduis_m", ["wheel_raduis_m", "did you mean"]),
        ("wheels = 3", "wheels = 5", ["geometry.wheels", "5", "from 3 to 4"]),
        ("[geometry]", "[geometry", ["not valid TOML"]),
    ],
)
def test_a_bad_robot_file_names_the_key_the_value_and_what_is_allowed(
    robot_file: Path, old: str, new: str, words: list[str]
) -> None:
    robot_file.write_text(robot_file.read_text().replace(old, new, 1))
    errors = run("robots", "check", str(robot_file), code=2).stderr
    assert all(word in errors for word in [*words, "mine.toml"])


def test_doctor_finds_everything_that_is_required() -> None:
    report = run_json("doctor")
    assert report["ok"] is True
    checks = {check["name"]: check for check in report["checks"]}
    assert checks["PC firmware"]["ok"] is True
    assert "MAVProxy" in checks


def test_doctor_fails_when_something_required_is_missing(monkeypatch: pytest.MonkeyPatch) -> None:
    from omniwheel.paths import MissingFileError

    def missing() -> Path:
        raise MissingFileError("the PC firmware not found")

    monkeypatch.setattr("omni.cli.doctor.firmware_path", missing)
    assert run_json("doctor", code=1)["ok"] is False


def test_the_version_is_printed() -> None:
    assert run("--version").stdout.startswith("omniwheel ")


def test_reproduce_lists_what_there_is_and_refuses_what_there_is_not() -> None:
    listed = run("reproduce", "--list").stdout
    assert "controllers" in listed
    assert "did you mean" in run("reproduce", "controlers", code=2).stderr
    assert "shows no data" in run("reproduce", "fig2", code=2).stderr


def test_reproduce_says_why_an_experiment_was_not_run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from omni_reproduce.registry import Experiment
    from omniwheel.errors import LogError

    def fails(self: Experiment, context: Any) -> Any:
        raise LogError("run2.csv holds no rows", hint="give a CSV file")

    monkeypatch.setattr(Experiment, "run", fails)
    shown = run("reproduce", "real_logs", "--out", str(tmp_path), code=1).stdout
    assert "not run: run2.csv holds no rows; give a CSV file" in shown


def test_reproduce_says_what_an_experiment_found(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from omni_reproduce.experiment import Context, Result, Row
    from omni_reproduce.registry import Experiment

    def found(self: Experiment, context: Context) -> Result:
        return Result((Row(self.name, "ours", "x RMSE", "m", 0.001, 1e-5, 3, 0.002, explanation="Because."),))

    monkeypatch.setattr(Experiment, "run", found)
    everything = run_json("reproduce", "controllers", "--out", str(tmp_path))
    row = everything["rows"][0]
    assert (row["experiment"], row["published"], row["ours"], row["seeds"]) == ("controllers", 0.002, 0.001, 3)
    shown = run("reproduce", "controllers", "--out", str(tmp_path)).stdout
    assert all(text in shown for text in ("x RMSE [m]", "0.00200", "0.00100 ± 0.00001", "0.50", "[1] Because."))
    assert "Because." in (tmp_path / "reproduce-2" / "reproduction.html").read_text(encoding="utf-8")


@pytest.mark.full
def test_stop_is_latched_until_it_is_released(url: str) -> None:
    assert run_json("stop", "--link", url) == {"state": "stopped", "systems": [1]}
    assert run_json("monitor", "--link", url)["state"] == "estop"
    refused = run("drive", "velocity", "0.1", "0", "0", "--link", url, code=1)
    assert "estop" in refused.stderr
    assert "released" in run("stop", "--release", "--link", url).stdout
    assert run_json("monitor", "--link", url)["state"] == "disarmed"


def test_a_stop_that_nobody_hears_is_an_error() -> None:
    assert "tcp:127.0.0.1:1" in run("stop", "--link", "tcp:127.0.0.1:1", code=1).stderr
