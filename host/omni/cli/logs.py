# SPDX-License-Identifier: MIT
"""``omni logs``: import, look at and align logs of any robot."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.markup import escape

from omni.cli.common import JsonOption, console, examples, new_path, print_json
from omni.cli.log_options import (
    MAPPING,
    CalibrationOption,
    LogArgument,
    MappingOption,
    NoCalibrationOption,
    RobotOption,
    TruthOption,
    jumps_of_truth,
    robot_and_calibration,
    shares_of,
)
from omni.cli.options import ForceOption
from omniwheel.limits import ALIGN_WITHIN_S

if TYPE_CHECKING:
    from omniwheel.logs.log import WheelLog

app = typer.Typer(help="Import, show and align logs of any robot.", no_args_is_help=True)

_MAPPING = "--mapping omni_reproduce/real_three_wheel/mapping.toml"


@app.command(
    "import",
    epilog=examples(
        f"omni logs import run1.csv {_MAPPING} --truth truth1.csv --out run1.npz",
    ),
)
def import_command(
    log: Annotated[Path, typer.Argument(metavar="LOG", help="A CSV file, or a ROS bag.")],
    mapping: Annotated[Path, MAPPING],
    out: Annotated[Path, typer.Option("--out", metavar="LOG.npz", help="Where to write the imported log.")],
    truth: TruthOption = None,
    force: ForceOption = False,
    as_json: JsonOption = False,
) -> None:
    """Read another robot's log with its column mapping, recover counts, mark spikes, unwrap the heading."""
    from omniwheel.logs.importer import import_log
    from omniwheel.logs.log import save_log
    from omniwheel.logs.mapping import read_mapping
    from omniwheel.logs.spikes import OUTLIER_SD, count_noise_warning

    if out.suffix != ".npz":
        raise typer.BadParameter(f"{out}: an imported log's name ends in .npz")
    new_path(out, "the imported log", force=force)
    imported, summary = import_log(log, read_mapping(mapping), truth)
    save_log(imported, out)
    if as_json:
        print_json({"file": str(out), **asdict(summary), **_facts(imported)})
        return
    shares = shares_of(summary.rejected_share, summary.rows)
    noise = ", ".join(f"{value:.1f}" for value in summary.noise_counts)
    tells = ", ".join(f"{value:+.2f}" for value in summary.noise_correlation)
    over = "sample" if imported.sample_s > 0.0 else "period"
    console.print(
        f"{escape(str(out))}: {summary.rows} rows; {summary.dropped_rows} dropped, {summary.missing_rows} missing"
    )
    if summary.truth_dropped_rows:
        console.print(f"truth: {summary.truth_dropped_rows} rows dropped, which have no pose or no later time")
    console.print(
        f"spikes rejected per wheel: {shares}; noise left: {noise} counts per {over}, {imported.quantum_rad_s:.3g} "
        f"rad/s each; correlation with the next count's: {tells}"
    )
    if max(summary.outlier_share) > max(summary.rejected_share):
        outliers = shares_of(summary.outlier_share, summary.rows)
        console.print(
            f"outliers kept, as counts add up: {outliers} (more than {OUTLIER_SD:g} robust standard deviations from "
            "their neighbours). If the encoder misreads, reject them: threshold under \\[spikes] in the mapping"
        )
    doubt = count_noise_warning(imported, summary.noise_counts, summary.noise_correlation)
    if doubt:
        console.print(f"[yellow]{escape(doubt)}[/]")
    for stretch in summary.frozen:
        console.print(
            f"[yellow]{escape(stretch.column)} is frozen[/] from {stretch.start_s:.2f} to {stretch.stop_s:.2f} s, "
            "while the wheels turned: one value throughout"
        )
    for time in summary.counter_restarts_s:
        console.print(
            f"[yellow]the wheels' counters restarted at {time:.2f} s:[/] counting continues from zero; the "
            "rotation since the previous row is lost"
        )
    for time in summary.heading_restarts_s:
        console.print(
            f"[yellow]the heading sensor restarted at {time:.2f} s:[/] the rotation since the previous row is lost"
        )


@app.command("show", epilog=examples("omni logs show run1.npz"))
def show(
    log: Annotated[Path, typer.Argument(metavar="LOG.npz", help="An imported log.")], as_json: JsonOption = False
) -> None:
    """Show the contents of an imported log."""
    from omniwheel.logs.log import load_log

    facts = _facts(load_log(log))
    if as_json:
        print_json(facts)
        return
    for name, value in facts.items():
        console.print(f"[cyan]{escape(name):24}[/] {value}")


@app.command("align", epilog=examples("omni logs align run1.npz --robot mine.toml"))
def align_command(
    log: LogArgument,
    robot: RobotOption,
    mapping: MappingOption = None,
    truth: TruthOption = None,
    calibration: CalibrationOption = None,
    no_calibration: NoCalibrationOption = False,
    search: Annotated[
        float | None,
        typer.Option(
            "--search",
            min=0.0,
            max=60.0,
            metavar="S",
            help=f"Largest clock offset to try. \\[default: {ALIGN_WITHIN_S:g}]",
        ),
    ] = None,
    as_json: JsonOption = False,
) -> None:
    """Find clock offset, rotation, shift and mirroring that bring a log's dead-reckoned path to its truth."""
    import numpy as np

    from omniwheel.log_sources import open_log
    from omniwheel.logs.alignment import align
    from omniwheel.replay import replay

    model, used, _ = robot_and_calibration(robot, calibration, no_calibration)
    run_log = open_log(log, model, mapping, truth)
    run = replay(run_log, model, used)
    found = align(run.time_s, run.pose[:, :2], run_log.require_truth(), search_s=search, mirrored=None)
    if as_json:
        print_json(asdict(found))
        return
    for text in jumps_of_truth(run_log):
        console.print(f"[yellow]{text}[/]", soft_wrap=True)
    console.print(
        f"clock offset {found.offset_s:+.2f} s ({found.offset_low_s:+.2f} to {found.offset_high_s:+.2f} s fit "
        f"within 5 %)\n"
        f"rotation {np.degrees(found.rotation_rad):+.1f}°, {'mirrored' if found.mirrored else 'not mirrored'}, "
        f"shift ({found.shift[0]:+.3f}, {found.shift[1]:+.3f}) m\n"
        f"left: {1e3 * found.rms_m:.1f} mm RMS; {100.0 * found.overlap:.0f} % of the path overlaps the truth in time\n"
        f"the best scale of the path would be {found.scale:.3f} (not applied)"
    )


def _facts(log: WheelLog) -> dict[str, Any]:
    import numpy as np

    return {
        "name": log.name,
        "duration_s": round(float(log.time_s[-1] - log.time_s[0]), 6),
        "period_s": log.period_s,
        "wheels": log.wheels,
        "counts_per_revolution": log.counts_per_revolution,
        "sample_s": log.sample_s,
        "noise_rad_s": log.noise_rad_s,
        "good_share": [round(float(share), 6) for share in log.good.mean(axis=0)],
        "peak_duty": round(float(np.max(np.abs(log.duty))), 6),
        "heading": log.has_heading,
        "truth_rows": 0 if log.truth is None else len(log.truth.time_s),
    }
