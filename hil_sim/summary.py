# SPDX-License-Identifier: MIT
"""What a run leaves on disk: a folder with summary.json, the record, the report, and over a link the telemetry log."""

from __future__ import annotations

import platform
from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from hil_sim import core, metrics
from hil_sim.c_scenario import drawn_world
from hil_sim.runs import Run, faults_seen
from hil_sim.timeline import Applied
from omni_schema import ParameterTable
from omniwheel import __version__, files
from omniwheel.logs.run_folder import RECORD_FILE, SUMMARY_FILE
from omniwheel.number_text import finite

PICTURE_FILE = "run.png"
TLOG_FILE = "telemetry.tlog"
STORED_EVERY = 10
"""Every so many ticks a sample is stored; numbers are computed from all of them."""

WALL_TIME_KEYS = ("wall_s", "realtime_factor", "tick_us")
"""The entries of a summary that differ between two runs with the same seed."""

_COMPARED = ("description", "way", "completed", "rmse", "estimator_rmse", "effort", "faults", "realtime_factor")


def summarize(run: Run) -> dict[str, Any]:
    """Return everything that is known of a run as plain data for JSON; units are in the names, RMSE as in metrics."""
    scenario = run.scenario
    table = scenario.robot.table
    stops, warnings = faults_seen(run)
    summary: dict[str, Any] = {
        "scenario": scenario.name,
        "description": scenario.description,
        "way": run.way,
        "robot": scenario.robot.name,
        "controller": enum_name(table, "CTL_MODE", run.parameters),
        "trajectory": enum_name(table, "TRJ_TYPE", run.parameters),
        "plan": _plan(run),
        "seed": scenario.seed,
        "ticks": run.ticks,
        "duration_s": run.ticks * 1e-3,
        "completed": run.done,
        "final_state": core.state_name(int(run.record["state"][-1])),
        "rmse": metrics.as_dict(metrics.tracking_rmse(run.record)),
        "estimator_rmse": metrics.as_dict(metrics.estimator_rmse(run.record)),
        "effort": metrics.as_dict(metrics.effort(run.record, scenario.robot.wheels)),
        "change": change(run),
        "events": [{"time_s": entry.time_s, "what": entry.event.describe()} for entry in run.applied],
        "faults": stops,
        "warnings": warnings,
        "injected_faults": [{**asdict(f), "stop_s": f.stop_s, "wheel": f.wheel + 1} for f in scenario.faults],
        "messages": list(run.messages),
        "wall_s": run.wall_s,
        "realtime_factor": run.realtime_factor,
        "tick_us": run.tick_us,
        "firmware_version": run.firmware_version,
        "versions": _versions(table),
        "world": {
            **({"external": run.world} if run.world else {"plant": scenario.plant}),
            **scenario.world,
            **{name: list(values) for name, values in scenario.wheel_numbers.items()},
            **({"patches": [patch.document() for patch in scenario.patches]} if scenario.patches else {}),
            "start_pose": list(scenario.start_pose),
        },
        "dispersion": drawn_world(scenario),
        "parameters": run.parameters,
    }
    return {key: finite(value) for key, value in summary.items()}


def comparable(summary: Mapping[str, Any]) -> dict[str, Any]:
    """Return the part of a summary that is shown beside another run's."""
    return {name: summary[name] for name in _COMPARED}


def change(run: Run) -> dict[str, Any] | None:
    """Return what the first change of parameters was and the accuracy before and after it, None without a change."""
    entry = first_change(run)
    if entry is None:
        return None
    return {
        "time_s": entry.time_s,
        "what": entry.event.describe(),
        "rmse_before": metrics.as_dict(metrics.tracking_rmse(run.record, stop_s=entry.time_s)),
        "rmse_after": metrics.as_dict(metrics.tracking_rmse(run.record, start_s=entry.time_s)),
    }


def first_change(run: Run) -> Applied | None:
    """Return the first event of the run that changed parameters."""
    return next((entry for entry in run.applied if entry.event.settings is not None), None)


def enum_name(table: ParameterTable, parameter: str, values: Mapping[str, float]) -> str:
    """Return the name of an enum parameter's value."""
    number = int(values[parameter])
    return next(name for name, value in table[parameter].values.items() if value == number)


def save_run(run: Run, summary: Mapping[str, Any], folder: Path) -> None:
    """Write summary.json and the record; run.png is run_picture.draw_run's. Raises OutputFileError."""
    files.write_json(folder / SUMMARY_FILE, summary)
    with files.replaced(folder / RECORD_FILE) as file:
        np.savez_compressed(file, samples=run.record[::STORED_EVERY])


def _plan(run: Run) -> dict[str, float | None] | None:
    if not any(entry.event.command == "trajectory_start" for entry in run.applied):
        return None
    return core.plan_summary(run.scenario.parameter_values(), run.scenario.robot.table)


def _versions(table: ParameterTable) -> dict[str, Any]:
    return {
        "omniwheel": __version__,
        "parameter_schema": table.schema_version,
        "python": platform.python_version(),
        "numpy": np.__version__,
    }
