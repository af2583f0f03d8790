# SPDX-License-Identifier: MIT
"""What an identification from logs says and what of it can be trusted, as Markdown and as plain data."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from typing import Any

import numpy as np

from omni_schema import Robot
from omniwheel.identification.estimate import student_quantile
from omniwheel.identification.log_study import LogStudy
from omniwheel.identification.motor_curve import CurveFit
from omniwheel.identification.path_fit import Settings
from omniwheel.logs.log import Array, WheelLog
from omniwheel.number_text import finite

KINDS = ("nominal", "identified", "held_out", "held_out_wheels_only", "held_out_duty_only")
_KIND_NAMES = ("nominal geometry", "all runs", "the other runs", "… wheels only", "… duty only")


def study_data(study: LogStudy, robot: Robot) -> dict[str, Any]:
    """Return everything as plain data; lengths in m, intervals are ± half widths (95 %)."""
    whole = study.whole
    nominal = robot.parameter_values()
    half = interval(study)
    return finite(  # type: ignore[no-any-return]
        {
            "median_rms_m": {kind: study.median_m(kind) for kind in KINDS},
            "runs": {
                run.name: {
                    **{f"{kind}_rms_m": getattr(run, kind).alignment.rms_m for kind in KINDS},
                    "clock_offset_s": run.held_out.alignment.offset_s,
                    "clock_offset_between_s": [
                        run.held_out.alignment.offset_low_s,
                        run.held_out.alignment.offset_high_s,
                    ],
                    "mirrored": run.held_out.alignment.mirrored,
                    "best_scale": run.held_out.alignment.scale,
                    "held_out_shape_rms_m": run.held_out.alignment.shape_rms_m,
                    "settings": asdict(other.settings),
                    "rejected_share": run.rejected_share,
                    "nis_mean": run.nis_mean,
                    "nis_degrees": run.nis_degrees,
                }
                for run, other in zip(study.scored, study.without, strict=True)
            },
            "settings": asdict(whole.settings),
            "forward_radius_m": whole.forward_radius_m.tolist(),
            "reverse_radius_m": whole.reverse_radius_m.tolist(),
            "forward_radius_half_width_m": half["forward"].tolist(),
            "reverse_radius_half_width_m": half["reverse"].tolist(),
            "common_radius_m": whole.plain_radius_m,
            "common_radius_half_width_m": float(half["plain"]),
            "wheel_distance_m": whole.wheel_distance_m if whole.distance_seen else None,
            "wheel_distance_half_width_m": float(half["distance"]),
            "nominal_radius_m": nominal["WHEEL_RADIUS"],
            "nominal_distance_m": nominal["WHEEL_DIST"],
            "process_noise": whole.process_noise,
            "measurement_noise_rad_s": whole.measurement_noise,
            "motor_curve": _curve_data(whole.curve),
            "motor_curve_lifted": None if study.lifted is None else _curve_data(study.lifted),
        }
    )


def interval(study: LogStudy) -> dict[str, Array]:
    """Half widths of the 95 % intervals [m], from leaving out one run at a time and Student's t."""
    factor = student_quantile(len(study.without) - 1)
    return {
        "forward": factor * study.jackknife_sd(lambda found: found.forward_radius_m),
        "reverse": factor * study.jackknife_sd(lambda found: found.reverse_radius_m),
        "plain": factor * study.jackknife_sd(lambda found: found.plain_radius_m),
        "distance": factor * study.jackknife_sd(lambda found: found.wheel_distance_m),
    }


def study_page(study: LogStudy, robot: Robot, runs: Sequence[WheelLog], picture: str) -> str:
    """Return the page as Markdown; ``picture`` is the name of the PNG beside it."""
    lines = [
        f"# Identification of {robot.name} from {len(runs)} runs",
        "",
        "RMS distance from the truth after the best clock offset and rigid alignment, dead reckoning on the "
        "measured heading:",
        "",
        *_score_table(study),
        "",
        f"![Paths]({picture})",
        "",
        "## What was found",
        "",
        *_radius_table(study, robot),
        "",
        *_curve_table("Motor curve on the floor", study.whole.curve),
        "",
    ]
    if study.lifted is not None:
        lines += [*_curve_table("Motor curve with the wheels in the air", study.lifted), ""]
    return "\n".join([*lines, "## What can be trusted", "", *_trust(study, robot, runs), ""])


def _score_table(study: LogStudy) -> list[str]:
    lines = [
        "| Run | "
        + " | ".join(f"{name} [mm]" for name in _KIND_NAMES)
        + " | clock offset [s] | best scale | shape [mm] | NIS / dof |",
        "|---|" + "---:|" * (len(KINDS) + 4),
    ]
    for run in study.scored:
        found = run.held_out.alignment
        cells = [f"{1e3 * getattr(run, kind).alignment.rms_m:.0f}" for kind in KINDS]
        offset = f"{found.offset_s:.2f} ({found.offset_low_s:.1f} to {found.offset_high_s:.1f})"
        nis = f"{run.nis_mean / run.nis_degrees:.1f}"
        lines.append(
            f"| {run.name} | {' | '.join(cells)} | {offset} | {found.scale:.2f} | "
            f"{1e3 * found.shape_rms_m:.0f} | {nis} |"
        )
    medians = " | ".join(f"**{1e3 * study.median_m(kind):.0f}**" for kind in KINDS)
    return [*lines, f"| **median** | {medians} | | | | |"]


def _radius_table(study: LogStudy, robot: Robot) -> list[str]:
    whole, half = study.whole, interval(study)
    nominal = robot.parameter_values()
    lines = ["| Effective | nominal [mm] | forward [mm] | backward [mm] |", "|---|---:|---:|---:|"]
    for wheel in range(robot.wheels):
        cells = [
            f"{1e3 * radii[wheel]:.1f} ± {1e3 * half[key][wheel]:.1f}"
            for radii, key in ((whole.forward_radius_m, "forward"), (whole.reverse_radius_m, "reverse"))
        ]
        lines.append(f"| radius of wheel {wheel + 1} | {1e3 * nominal['WHEEL_RADIUS']:.1f} | {' | '.join(cells)} |")
    plain = f"{1e3 * whole.plain_radius_m:.1f} ± {1e3 * float(half['plain']):.1f}"
    distance = f"{1e3 * whole.wheel_distance_m:.1f} ± {1e3 * float(half['distance']):.1f}"
    lines.append(f"| one radius for all | {1e3 * nominal['WHEEL_RADIUS']:.1f} | {plain} | |")
    lines.append(f"| wheel distance | {1e3 * nominal['WHEEL_DIST']:.1f} | {distance} | |")
    return lines


def _curve_data(fit: CurveFit) -> dict[str, Any]:
    return {
        name: {"value": getattr(fit.curve, name).tolist(), "sd": getattr(fit.sd, name).tolist()}
        for name in type(fit.curve).__dataclass_fields__
    } | {"noise_rad_s": fit.noise_rad_s.tolist()}


def _curve_table(title: str, fit: CurveFit) -> list[str]:
    lines = [
        f"{title} (± one standard deviation; – where the duty never went):",
        "",
        "| Wheel | forward: duty per rad/s [%] | deadband [%] | backward: duty per rad/s [%] | deadband [%] | lag "
        "[ms] |",
        "|---|---:|---:|---:|---:|---:|",
    ]
    columns = (
        ("forward_duty_per_rad_s", 100.0, 2),
        ("forward_deadband", 100.0, 1),
        ("reverse_duty_per_rad_s", 100.0, 2),
        ("reverse_deadband", 100.0, 1),
        ("time_constant_s", 1e3, 0),
    )
    for wheel in range(len(fit.noise_rad_s)):
        cells = []
        for name, factor, digits in columns:
            value, sd = (factor * float(getattr(part, name)[wheel]) for part in (fit.curve, fit.sd))
            cells.append(f"{value:.{digits}f} ± {sd:.{digits}f}" if np.isfinite(sd) else "–")
        lines.append(f"| {wheel + 1} | {' | '.join(cells)} |")
    return lines


def _trust(study: LogStudy, robot: Robot, runs: Sequence[WheelLog]) -> list[str]:
    scales = [run.held_out.alignment.scale for run in study.scored]
    return [
        _trust_counts(study, runs),
        _trust_size(study, robot),
        f"- **Between runs** the best scale of the left-out path varies from {min(scales):.2f} to "
        f"{max(scales):.2f}: that "
        "much is not repeatable, whatever is identified. *Shape* is what would be left with that scale.",
        _trust_settings(study),
        "- **By wheel and direction.** The radii take in whatever is repeatable in these runs, a slanted camera "
        "too. They "
        "hold for motion of the kind they were identified from; they do not prove that a wheel has two radii.",
        "- **Clock.** The range of an offset is where the RMS stays within 5 % of the best.",
        "- **Heading.** `wheels only` leaves the measured heading aside: how the wheels turn the body is fitted to the "
        "headings of the other runs. Rows in which the heading was frozen are bridged in the same way.",
        _trust_deadbands(study, robot),
        "- **Motor.** Only K (at b = 0) and R J can be seen in a speed; R and L in the robot file are assumed.",
        "- **NIS / dof** well above 1 means that the robot file's pose noise (`EKF_Q_XY`, `EKF_R_XY`) is too small "
        "for these "
        "data, well below 1 too large. It checks the filter with truth aligned afterwards, not the calibration.",
    ]


def settings_text(settings: Settings) -> str:
    """Return what was chosen, in a few words."""
    turning = "one for all" if settings.turn_ridge is None else f"by direction, {settings.turn_ridge:g}"
    counts = "as likely" if settings.counts else "hardly"
    return f"radii by direction, {settings.ridge:g}; turning {turning}; counts trusted {counts}"


def _trust_settings(study: LogStudy) -> str:
    found = [
        f"{run.name}: {settings_text(other.settings)}" for run, other in zip(study.scored, study.without, strict=True)
    ]
    return (
        '- **Settings** are how strongly radii and turning are drawn towards "all alike", and whether the counts are '
        "trusted. They were chosen among the other runs alone, by leaving out one of those. Per left-out run: "
        + ". ".join(found)
        + "."
    )


def _trust_counts(study: LogStudy, runs: Sequence[WheelLog]) -> str:
    whole = study.whole
    shares = [100.0 * run.rejected_share for run in study.scored]
    noise = whole.curve.noise_rad_s
    count_rad_s = runs[0].quantum_rad_s
    without, with_counts = (1e3 * study.median_m(kind) for kind in ("held_out_duty_only", "held_out"))
    asks = (
        "The likelihood of the innovations asks for"
        if whole.settings.counts
        else "Left-out runs are told best with next to none of them:"
    )
    return (
        f"- **Counts.** {min(shares):.1f} to {max(shares):.1f} % of them were rejected as spikes. The rest scatter by "
        f"{noise.min():.1f} to {noise.max():.1f} rad/s about what the duty explains; one count is "
        f"{count_rad_s:.2f} rad/s. {asks} a process noise of {whole.process_noise:g} "
        f"rad/s per √s against {whole.measurement_noise:.1f} rad/s of a measured speed. `duty only` leaves the "
        f"run's counts "
        f"aside altogether: {without:.0f} mm in the median, against {with_counts:.0f} mm with them."
    )


def _trust_size(study: LogStudy, robot: Robot) -> str:
    whole, nominal = study.whole, robot.parameter_values()
    seen = "" if whole.distance_seen else " (nominal distance: the runs hardly turn)"
    return (
        f"- **Size.** The paths fit with {whole.plain_radius_m / nominal['WHEEL_RADIUS']:.2f} of the nominal "
        f"radius. The logs "
        "cannot tell small or slipping wheels from a camera whose metre is long: radii and wheel distance are in the "
        "camera's metres. Their quotient is not touched by that, but takes the IMU's word for the turning: wheel "
        "distance "
        f"over radius is {whole.wheel_distance_m / whole.plain_radius_m:.2f}{seen}, nominal "
        f"{nominal['WHEEL_DIST'] / nominal['WHEEL_RADIUS']:.2f}."
    )


def _trust_deadbands(study: LogStudy, robot: Robot) -> str:
    fit = study.whole.curve
    unseen = [
        f"{wheel + 1} {word}"
        for wheel in range(robot.wheels)
        for word, name in (("forward", "forward_deadband"), ("backward", "reverse_deadband"))
        if not getattr(fit.curve, name)[wheel] >= 2.0 * getattr(fit.sd, name)[wheel]
    ]
    if not unseen:
        return "- **Deadband.** Seen on every wheel, both ways."
    return f"- **Deadband.** Not told from none (below two standard deviations): wheel {', '.join(unseen)}."
