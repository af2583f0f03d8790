# SPDX-License-Identifier: MIT
"""Every drive leaves a folder that says what was asked, what happened and how well; runs are listed and compared."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner, Result

from omni.cli import app
from omniwheel import FirmwareProcess
from omniwheel.dialect import mavlink
from omniwheel.drive_log.listing import list_runs
from omniwheel.telemetry_record import record_of

runner = CliRunner()


def omni(*words: object) -> Result:
    return runner.invoke(app, [str(word) for word in words], env={"COLUMNS": "200"})


def run(*words: object) -> tuple[int, str]:
    result = omni(*words)
    return result.exit_code, result.output


def test_a_drive_is_kept_listed_compared_plotted_renamed_and_deleted(sitl: str, tmp_path: Path) -> None:
    runs = tmp_path / "runs"
    for gain in ("4", "12"):
        assert omni("params", "set", f"ISMC_LAM_XY={gain}", "--link", sitl).exit_code == 0
        driven = omni("drive", "pose", "0", "0.05" if gain == "4" else "0", "0", "--link", sitl, "--out", runs)
        assert driven.exit_code == 0, driven.stderr
        assert "run.png" in driven.stderr
    first = json.loads((runs / "drive-pose" / "drive.json").read_text())
    assert (first["asked"], first["end"], first["stops"]) == ("pose 0 0.05 0", "done", [])
    assert first["controller"] == "ismc"
    assert first["numbers"]["way_m"] == pytest.approx(0.05, abs=0.02)
    assert {"armed", "state armed"} <= {event["what"] for event in first["events"]}
    assert {path.name for path in (runs / "drive-pose").iterdir()} == {
        "drive.json", "parameters.toml", "run.png", "telemetry.tlog",
    }  # fmt: skip
    output = run("runs", "--folder", runs, "--json")[1]
    assert [entry["name"] for entry in json.loads(output)["runs"]] == ["drive-pose", "drive-pose-2"]
    assert {entry["controller"] for entry in json.loads(output)["runs"]} == {"ismc"}
    assert "0.05" in run("runs", "--folder", runs, "--find", "0.05")[1]
    compared = json.loads(run("runs", "drive-pose", "drive-pose-2", "--folder", runs, "--json")[1])
    assert compared["parameters"] == {"ISMC_LAM_XY": [4.0, 12.0]}
    (runs / "drive-pose" / "run.png").unlink()
    assert run("plot", runs / "drive-pose")[0] == 0
    assert (runs / "drive-pose" / "run.png").is_file()
    assert run("plot", runs / "drive-pose" / "telemetry.tlog", "--out", tmp_path / "x.png")[0] == 0
    assert run("runs", "drive-pose", "--rename", "before", "--folder", runs)[0] == 0
    assert run("runs", "before", "--rename", "drive-pose-2", "--folder", runs)[0] == 2
    assert run("runs", "before", "--delete", "--yes", "--folder", runs)[0] == 0
    assert [path.name for path in runs.iterdir()] == ["drive-pose-2"]
    assert run("runs", "before", "drive-pose-2", "--folder", runs)[0] == 2


@pytest.mark.parametrize(
    "words",
    [["--delete"], ["--rename", "x"], ["one", "other", "--delete"], ["one", "--find", "o"], ["one", "--yes"]],
)
def test_options_of_runs_that_do_not_belong_together_are_refused(tmp_path: Path, words: list[str]) -> None:
    for name in ("one", "other"):
        kept_run(tmp_path / name, "WS_P = 4.0")
    assert run("runs", *words, "--folder", tmp_path)[0] == 2
    assert {path.name for path in tmp_path.iterdir()} == {"one", "other"}


def test_one_run_is_shown_alone(tmp_path: Path) -> None:
    for name in ("one", "other"):
        kept_run(tmp_path / name, "WS_P = 4.0")
    shown = json.loads(run("runs", "other", "--folder", tmp_path, "--json")[1])["runs"]
    assert [entry["name"] for entry in shown] == ["other"]


def kept_run(folder: Path, parameters: str) -> None:
    folder.mkdir()
    document = {"kind": "drive", "asked": "keys", "began": "", "end": "done", "numbers": {}}
    (folder / "drive.json").write_text(json.dumps(document))
    (folder / "parameters.toml").write_text(f"[parameters]\n{parameters}\n")


def test_runs_with_other_named_values_are_compared(tmp_path: Path) -> None:
    kept_run(tmp_path / "one", 'CTL_MODE = "ismc"\nWS_P = 4.0')
    kept_run(tmp_path / "other", 'CTL_MODE = "pid"\nWS_P = 4.0')
    code, output = run("runs", "one", "other", "--folder", tmp_path)
    assert code == 0, output
    line = next(line for line in output.splitlines() if "CTL_MODE" in line)
    assert line.split() == ["CTL_MODE", "ismc", "pid"]
    assert json.loads(run("runs", "--folder", tmp_path, "--json")[1])["runs"][0]["parameters"]["CTL_MODE"] >= 0


def test_parameters_of_another_version_are_not_compared(tmp_path: Path) -> None:
    kept_run(tmp_path / "one", "NOT_KNOWN_HERE = 1.0")
    kept_run(tmp_path / "other", "WS_P = 4.0")
    assert run("runs", "one", "other", "--folder", tmp_path)[0] == 0


def test_a_refused_drive_leaves_nothing(firmware: FirmwareProcess, tmp_path: Path) -> None:
    for words in (["velocity", "3", "0", "0"], ["duty", "0.1"]):
        assert omni("drive", *words, "--link", firmware.urls[0], "--out", tmp_path / "runs").exit_code == 2
    assert list((tmp_path / "runs").iterdir()) == []
    assert omni("drive", "velocity", "0", "0", "0", "--link", "tcp:127.0.0.1:9", "--out", tmp_path / "r").exit_code == 1
    assert list((tmp_path / "r").iterdir()) == []


@pytest.mark.full
def test_a_drive_that_the_robot_ends_says_so(firmware: FirmwareProcess, tmp_path: Path) -> None:
    """No world answers: the wheels that should turn do not, and the robot stops itself."""
    driven = omni(
        "drive", "velocity", "0.1", "0", "0", "--duration", "5", "--link", firmware.urls[0], "--out", tmp_path
    )
    assert driven.exit_code == 1, driven
    kept = json.loads((tmp_path / "drive-velocity" / "drive.json").read_text())
    assert "stopped by itself" in kept["end"]
    assert kept["stops"] != []


def test_damaged_runs_are_listed_as_such(tmp_path: Path) -> None:
    for name, text in (("a", "{"), ("b", "[]"), ("c", '{"kind": "drive"}')):
        (tmp_path / name).mkdir()
        (tmp_path / name / "drive.json").write_text(text)
    (tmp_path / "not-a-run").mkdir()
    assert [(entry.name, entry.kind) for entry in list_runs(tmp_path)] == [(name, "damaged") for name in "abc"]


def message(made: Any, component: int = 1) -> Any:
    codec = mavlink.MAVLink(None, 7, component)
    return mavlink.MAVLink(None).decode(bytearray(made.pack(codec)))


def tracking(ms: int, x: float, theta: float, reference: float) -> Any:
    return message(
        mavlink.MAVLink_omni_tracking_message(ms, [reference, 0, 0], [0, 0, 0], [x, 0, theta], [0, 0, 0], 0.0, 0)
    )


def test_numbers_are_those_of_the_telemetry() -> None:
    rows = [tracking(100 * k, 0.1 * k, 0.0, 0.1 * k + 0.003) for k in range(11)]
    numbers = record_of([*rows[5:], *rows[:5]]).numbers()  # whatever order a radio brings them in
    assert numbers["duration_s"] == pytest.approx(1.0)
    assert numbers["way_m"] == pytest.approx(1.0)
    assert numbers["top_speed_m_s"] == pytest.approx(1.0, rel=1e-5)
    assert numbers["position_rmse_m"] == pytest.approx(0.003, rel=1e-3)
    assert numbers["top_wheel_rad_s"] is None


def test_a_row_that_is_no_number_is_left_out_and_said() -> None:
    rows = [tracking(100 * k, math.nan if k == 5 else 0.1 * k, 0.0, 0.1 * k) for k in range(11)]
    record = record_of(rows)
    assert record.numbers()["way_m"] == pytest.approx(1.0)
    assert len(record.time_s) == 10
    assert len(record.notes) == 1


def test_a_heading_beyond_a_half_turn_is_no_error() -> None:
    rows = [tracking(100 * k, 0.0, math.remainder(0.2 * k, math.tau), 0.0) for k in range(40)]
    record = record_of(rows)
    assert record.pose[-1, 2] == pytest.approx(7.8, rel=1e-5)


def test_a_ground_stations_heartbeat_is_no_event() -> None:
    robot, station = (1, 0, 0), (190, 1, 8)
    beats = [
        message(mavlink.MAVLink_heartbeat_message(10, autopilot, 0, mode, 3, 3), component)
        for component, mode, autopilot in (robot, station, robot, station)
    ]
    assert record_of(beats).events == ()


def test_a_file_that_is_no_log_is_refused(tmp_path: Path) -> None:
    (tmp_path / "x.tlog").write_bytes(b"not a log at all, but long enough")
    code, output = run("plot", tmp_path / "x.tlog")
    assert code == 2
    assert "x.tlog" in output
    assert "Traceback" not in output
