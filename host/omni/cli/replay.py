# SPDX-License-Identifier: MIT
"""``omni replay``: a log once more through the core's estimators, beside its truth."""

from __future__ import annotations

import math
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from omni.cli.common import JsonOption, console, examples, new_path, print_json, redrawn_path
from omni.cli.log_options import (
    CalibrationOption,
    LogArgument,
    MappingOption,
    NoCalibrationOption,
    PartOption,
    RobotOption,
    TruthOption,
    jumps_of_truth,
    robot_and_calibration,
    shares_of,
)
from omni.cli.options import PLOT, ForceOption
from omniwheel import files

if TYPE_CHECKING:
    from omniwheel.logs.alignment import Alignment
    from omniwheel.logs.log import WheelLog
    from omniwheel.replay import Replay

EXAMPLES = examples(
    "omni replay run1.npz --robot identified.toml",
    "omni replay run1.npz --robot identified.toml --fixes 5 --plot run1.png",
    "omni replay runs/demo-seed1 --robot three_wheel",
    "omni replay flight.tlog --robot three_wheel",
)
CSV_HEADER = "time_s,x_m,y_m,theta_rad,sd_x_m,sd_y_m,sd_theta_rad,truth_x_m,truth_y_m"


def replay_command(
    log: LogArgument,
    robot: RobotOption,
    mapping: MappingOption = None,
    truth: TruthOption = None,
    part: PartOption = None,
    calibration: CalibrationOption = None,
    no_calibration: NoCalibrationOption = False,
    no_heading: Annotated[bool, typer.Option("--no-heading", help="Do not use a measured heading.")] = False,
    no_counts: Annotated[
        bool, typer.Option("--no-counts", help="Do not use encoder counts: compute wheel speeds from the duty cycles.")
    ] = False,
    fixes: Annotated[
        float,
        typer.Option(
            "--fixes", min=0.0, max=1000.0, metavar="HZ", help="Also use the ground truth as pose fixes, at this rate."
        ),
    ] = 0.0,
    fix_sd: Annotated[
        float,
        typer.Option(
            "--fix-sd", min=0.0, max=10.0, metavar="M", help="Standard deviation of these fixes; 0: EKF_R_XY."
        ),
    ] = 0.0,
    plot: Annotated[Path | None, PLOT] = None,
    csv: Annotated[
        Path | None, typer.Option("--csv", metavar="FILE.csv", help="Write estimate and truth to this file.")
    ] = None,
    force: ForceOption = False,
    as_json: JsonOption = False,
) -> None:
    """Feed a log's counts tick by tick through the robot's own wheel filters and pose EKF.

    Of a telemetry log in which the robot restarted it takes the longest part; --part chooses another one.

    With a truth, says how far the estimate is from it after the best clock offset and rigid alignment. With --fixes the
    truth, aligned to the dead-reckoned path, also comes in as pose fixes. The mean NIS then says whether the noise
    figures are right.
    """
    from omniwheel.log_sources import open_log
    from omniwheel.logs.alignment import align
    from omniwheel.replay import dropped_counts, fixes_from_truth, replay, require_curve

    if plot is not None:
        redrawn_path(plot, "the picture")
    if csv is not None:
        new_path(csv, "the table", force=force)
    model, used, source = robot_and_calibration(robot, calibration, no_calibration)
    run_log = open_log(log, model, mapping, truth, part)
    if no_counts:
        require_curve(run_log, used)
        run_log = run_log.without_counts()
    run = replay(run_log, model, used, use_heading=not no_heading)
    aligned = None
    if run_log.truth is not None:
        aligned = align(run.time_s, run.pose[:, :2], run_log.truth, mirrored=None)
    if fixes > 0.0:
        run_log.require_truth()
    fixed = None
    if aligned is not None and fixes > 0.0:
        given = fixes_from_truth(run_log, aligned, fixes, fix_sd)
        fixed = replay(run_log, model, used, use_heading=not no_heading, fixes=given)
    shown = run if fixed is None else fixed
    if csv is not None:
        _write_csv(csv, run_log, shown, aligned)
    if plot is not None:
        from omniwheel.replay_plot import draw_replay  # here, not above: matplotlib takes a second to import

        draw_replay(run_log, run, fixed, aligned, plot)
    facts = _facts(run_log, run, fixed, aligned)
    dropped = None if no_counts else dropped_counts(run_log, run, model, used, use_heading=not no_heading)
    facts |= {
        "dropped_counts": None if dropped is None else asdict(dropped),
        "calibration": None if source is None else str(source),
        "heading_used": run_log.has_heading and not no_heading,
    }
    if as_json:
        print_json(facts)
        return
    _print(facts, run_log)


def _facts(log: WheelLog, run: Replay, fixed: Replay | None, aligned: Alignment | None) -> dict[str, Any]:
    import numpy as np

    from omniwheel.logs.alignment import truth_at

    x, y, theta = (float(value) for value in run.pose[-1])
    facts: dict[str, Any] = {"log": log.name, "rows": len(log.time_s), "end_pose": [x, y, theta]}
    facts["truth_jumps"] = [] if log.truth is None else [asdict(jump) for jump in log.truth.jumps]
    if aligned is not None:
        facts |= {
            "rms_m": aligned.rms_m,
            "clock_offset_s": aligned.offset_s,
            "clock_offset_between_s": [aligned.offset_low_s, aligned.offset_high_s],
            "mirrored": aligned.mirrored,
            "best_scale": aligned.scale,
        }
    if fixed is not None and aligned is not None:
        truth = aligned.to_robot(truth_at(log.require_truth(), log.time_s + aligned.offset_s))
        left = fixed.pose[:, :2] - truth
        facts["fixes"] = {
            "rms_m": float(np.sqrt(np.mean(np.sum(left**2, axis=1)))),
            "looked_at": len(fixed.nis),
            "nis_mean": float(np.mean(fixed.nis)) if len(fixed.nis) else None,
            "nis_degrees": fixed.nis_degrees,
            "refused": fixed.refused,
        }
    return facts


def _print(facts: dict[str, Any], log: WheelLog) -> None:
    console.print(
        f"{facts['log']}: {facts['rows']} rows, calibration: {facts['calibration'] or 'none'}", soft_wrap=True
    )
    x, y, theta = facts["end_pose"]
    by = "the measured heading" if facts["heading_used"] else "wheels only"
    console.print(f"dead reckoning on {by} ends at ({x:+.3f} m, {y:+.3f} m, {theta:+.3f} rad)")
    dropped = facts["dropped_counts"]
    if dropped is not None:
        shares = shares_of(dropped["share"], facts["rows"])
        console.print(
            f"[yellow]counts rejected as spikes per wheel: {shares}.[/] With every count as logged the path would be "
            f"up to {dropped['moved_m']:.3f} m and {math.degrees(dropped['turned_rad']):.1f}° from this one"
        )
    for text in jumps_of_truth(log):
        console.print(f"[yellow]{text}[/]", soft_wrap=True)
    if "rms_m" not in facts:
        console.print("no truth to compare with")
        return
    low, high = facts["clock_offset_between_s"]
    console.print(
        f"[bold]{1e3 * facts['rms_m']:.1f} mm RMS[/] from the truth after alignment: clock offset "
        f"{facts['clock_offset_s']:+.2f} s ({low:+.2f} to {high:+.2f}), best scale {facts['best_scale']:.3f} (not "
        f"applied)" + (", mirrored" if facts["mirrored"] else "")
    )
    fixes = facts.get("fixes")
    if fixes is not None and fixes["nis_mean"] is not None:
        console.print(
            f"with {fixes['looked_at']} pose fixes: {1e3 * fixes['rms_m']:.1f} mm RMS, mean NIS "
            f"{fixes['nis_mean']:.2f} for "
            f"{fixes['nis_degrees']} degrees of freedom, {fixes['refused']} refused"
        )


def _write_csv(path: Path, log: WheelLog, run: Replay, aligned: Alignment | None) -> None:
    import numpy as np

    from omniwheel.logs.alignment import truth_at

    truth = np.full((len(log.time_s), 2), np.nan)
    if aligned is not None:
        truth = aligned.to_robot(truth_at(log.require_truth(), log.time_s + aligned.offset_s))
    table = np.column_stack((log.time_s, run.pose, run.pose_sd, truth))
    with files.replaced(path) as file:
        np.savetxt(file, table, delimiter=",", header=CSV_HEADER, comments="", fmt="%.9g")
