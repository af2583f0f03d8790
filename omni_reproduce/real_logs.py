# SPDX-License-Identifier: MIT
"""Logs of a real robot: identified on all runs but one, the one left out dead-reckoned, in turn."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from omni_reproduce.experiment import Context, Result, Row, read_spec
from omni_schema import Robot
from omniwheel import files
from omniwheel.errors import LogError
from omniwheel.identification.log_page import interval, settings_text, study_page
from omniwheel.identification.log_plot import draw_study
from omniwheel.identification.log_study import LogStudy, Scored, identify_from_logs
from omniwheel.logs.importer import import_log
from omniwheel.logs.log import WheelLog
from omniwheel.logs.mapping import read_mapping
from omniwheel.robots import read_robot

NAME = "real_logs"
PICTURE, REPORT = "real_logs.png", "real_logs.md"
ROBOT_FOLDER = Path(__file__).parent / "real_three_wheel"
SETTINGS = {
    "nominal": (
        "nominal geometry",
        "Radius and distance from the robot's drawing, every count as logged, IMU heading.",
    ),
    "held_out": (
        "identified on the other runs",
        "Radii by wheel and direction, motor curve and filter noise; IMU heading, bridged by the wheels while frozen.",
    ),
    "held_out_wheels_only": (
        "identified on the other runs, wheels only",
        "No IMU: the heading by gains of wheels and directions fitted to the other runs' headings, the path on it.",
    ),
    "held_out_duty_only": ("identified on the other runs, duty only", "The counts of the run itself are left aside."),
}


NEEDS = "Needs the logs, which are not part of this project."


def data_folder(spec: dict[str, Any], chosen: Path | None) -> Path:
    """Return where the logs should be: the chosen folder, else the environment's, else that beside the source tree.

    The environment's folder must exist.
    """
    if chosen is not None:
        return chosen
    variable = spec["experiment"]["folder_variable"]
    given = os.environ.get(variable)
    root = Path(__file__).resolve().parents[1]
    if given and not Path(given).is_dir():
        raise LogError(f"{variable} is {given!r}, which is no folder", hint="set it to the folder that holds the logs")
    return Path(given) if given else root / spec["experiment"]["default_folder"]


def run(context: Context) -> Result:
    """Identify with leave-one-out; a note says how to give the logs where they are absent."""
    spec = read_spec(NAME)
    settings = spec["experiment"]
    folder = data_folder(spec, context.data)
    found = sorted(folder.glob(settings["runs"]))
    paths = [path for path in found if truth_path(path).is_file()]
    if len(paths) < 2:
        missing = (
            f"Not run: {len(paths)} runs with truth in {folder}; two are needed. Set {settings['folder_variable']} to "
            f"the folder that holds {settings['runs']} and the truth*.csv of each."
        )
        return Result((Row(NAME, "not run", "RMS distance, median of the runs", "m", None, explanation=missing),))
    robot = read_robot(ROBOT_FOLDER / "robot.toml")
    runs = read_logs(paths[: settings["quick_runs"]] if context.quick else paths)
    turns, lifted = (read_logs(sorted(folder.glob(settings[key]))) for key in ("turns", "lifted"))
    study = identify_from_logs(runs, robot, turns, lifted, _mapper(context))
    draw_study(study, runs, context.folder / PICTURE)
    files.write_text(context.folder / REPORT, study_page(study, robot, runs, PICTURE))
    left_out = [path.name for path in found if path not in paths]
    notes = _notes(study, robot) + ([f"Left out, without truth: {', '.join(left_out)}."] if left_out else [])
    return Result(tuple(_rows(study, robot)), (context.folder / PICTURE,), tuple(notes))


def truth_path(run: Path) -> Path:
    """Return where the truth of a run is: truthN.csv beside runN.csv."""
    return run.with_name(run.name.replace("run", "truth", 1))


def read_logs(paths: Iterable[Path]) -> list[WheelLog]:
    """Import the robot's CSV logs; runN.csv has its truth in truthN.csv."""
    mapping = read_mapping(ROBOT_FOLDER / "mapping.toml")
    logs = []
    for path in paths:
        truth = truth_path(path) if path.name.startswith("run") else None
        logs.append(import_log(path, mapping, truth)[0])
    return logs


def _mapper(context: Context) -> Callable[[Callable[[Any], Any], Iterable[Any]], list[Any]]:
    """Map in this process: an identification takes less time than a process that is to run it takes to start."""

    def in_turn(function: Callable[[Any], Any], items: Iterable[Any]) -> list[Any]:
        work, answers = list(items), []
        for item in work:
            answers.append(function(item))
            context.progress(len(answers) / len(work))
        return answers

    return in_turn


def _rows(study: LogStudy, robot: Robot) -> list[Row]:
    rows = []
    for kind, (setting, explanation) in SETTINGS.items():
        rows.append(
            Row(NAME, setting, "RMS distance, median of the runs", "m", study.median_m(kind), explanation=explanation)
        )
        rows += [_row_of_run(run, kind, setting) for run in study.scored]
    shapes = [run.held_out.alignment.shape_rms_m for run in study.scored]
    told = "If the run's own best scale were applied: what the camera's metre, which differs from run to run, hides."
    shape = "RMS distance with the run's best scale, median of the runs"
    rows.append(Row(NAME, SETTINGS["held_out"][0], shape, "m", float(np.median(shapes)), explanation=told))
    whole, half = study.whole, interval(study)
    count = len(study.scored)
    measured = (
        (
            "effective radius, one for all",
            whole.plain_radius_m,
            half["plain"],
            robot.parameter_values()["WHEEL_RADIUS"],
        ),
        ("effective wheel distance", whole.wheel_distance_m, half["distance"], robot.parameter_values()["WHEEL_DIST"]),
    )
    for quantity, value, width, nominal in measured:
        told = (
            f"In the camera's metres; ± {1e3 * float(width):.1f} mm (95 %, {count} runs), nominal {1e3 * nominal:.0f}."
        )
        rows.append(Row(NAME, "identified on all runs", quantity, "m", value, explanation=told))
    return [replace(row, explanation=f"{row.explanation} {NEEDS}".strip()) for row in rows]


def _row_of_run(run: Scored, kind: str, setting: str) -> Row:
    return Row(NAME, setting, f"RMS distance, {run.name}", "m", getattr(run, kind).alignment.rms_m)


def _notes(study: LogStudy, robot: Robot) -> list[str]:
    whole, nominal = study.whole, robot.parameter_values()
    scales = [run.held_out.alignment.scale for run in study.scored]
    shares = [100.0 * run.rejected_share for run in study.scored]
    return [
        f"Distances are what is left after the best clock offset and rigid alignment, scale kept. {min(shares):.1f} to "
        f"{max(shares):.1f} % of the counts were rejected as spikes; the rest scatter by about "
        f"{whole.measurement_noise:.0f} rad/s per sample, so that the likelihood leans on the motors' curve. With "
        f"the counts of the left-out run the median is {1e3 * study.median_m('held_out'):.1f} mm, with nothing but its "
        f"duties and the IMU's heading {1e3 * study.median_m('held_out_duty_only'):.1f} mm: the difference is what "
        "these encoders add.",
        "Settings were chosen among the other runs alone, by leaving out one of those in turn. "
        + " ".join(
            f"Without {run.name}: {settings_text(other.settings)}."
            for run, other in zip(study.scored, study.without, strict=True)
        )
        + " Which settings there are was decided by people who knew these five runs: runs that nobody has seen may be "
        "told less well.",
        f"The camera's metre is its own: {whole.plain_radius_m / nominal['WHEEL_RADIUS']:.2f} of the nominal radius "
        f"fits, and the "
        f"best scale of a left-out run still varies from {min(scales):.2f} to {max(scales):.2f}. Wheel distance "
        f"over radius, "
        f"{whole.wheel_distance_m / whole.plain_radius_m:.2f}, does not depend on the camera but on the IMU; "
        f"nominal is "
        f"{nominal['WHEEL_DIST'] / nominal['WHEEL_RADIUS']:.2f}. `{REPORT}` says what else can be trusted.",
    ]
