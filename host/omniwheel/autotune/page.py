# SPDX-License-Identifier: MIT
"""The page that autotune leaves: what was measured, which gains follow and why, and what they did."""

from __future__ import annotations

import math
from pathlib import Path

from omni_schema import ParameterTable
from omniwheel import files, parameter_file
from omniwheel.autotune.design import Design
from omniwheel.autotune.gains import Requirements
from omniwheel.autotune.procedure import Outcome
from omniwheel.tuning_plot import draw_tuning
from omniwheel.wheel_loop import Margins

PAGE, PICTURE, BEFORE, AFTER = "autotune.md", "autotune.png", "before.toml", "after.toml"

NAMES = {
    "speed_gain_V_s": ("volts per wheel speed", "V s/rad"),
    "coulomb_V": ("voltage of dry friction", "V"),
    "inertia_xy_V_s2": ("volts per wheel acceleration, translating", "V s²/rad"),
    "inertia_theta_V_s2": ("volts per wheel acceleration, turning", "V s²/rad"),
    "drag_xy_V_s": ("drag across the rollers", "V s/rad"),
}
_WHY = {
    "MOT_K": "measured volts per speed; the back-EMF fraction stays the robot file's",
    "MOT_B": "the rest of the volts per speed",
    "MOT_J": "measured inertia; the wheel's own fraction stays the robot file's",
    "KF_J": "measured inertia when the robot translates: what a wheel moves on the floor",
    "WS_FF_S": "measured dry friction, at the lower end of its interval, so that it never overcompensates",
    "KF_Q_W": "process noise of the wheel filter: the candidate with the stiffest loop",
    "WS_P": "with WS_I: the stiffest loop within margins and noise limit",
    "WS_I": "see WS_P",
    "ISMC_LAM_XY": "the quickest position loop that keeps the margins",
    "ISMC_PHI_XY": "so that ISMC_K_XY / ISMC_PHI_XY is at most a quarter of ISMC_LAM_XY",
    "ISMC_LAM_TH": "as ISMC_PHI_XY, for the heading",
    "ISMC_PHI_TH": "as ISMC_PHI_XY, for the heading",
}


def write_page(outcome: Outcome, required: Requirements, table: ParameterTable, folder: Path) -> Path:
    """Write page, picture and both parameter files into a folder; return the page. Raises OutputFileError."""
    parameter_file.write(folder / BEFORE, outcome.old, table)
    parameter_file.write(folder / AFTER, outcome.new, table)
    draw_tuning(outcome.traces, "autotune: the same path before and after", folder / PICTURE)
    lines = [*_measured(outcome), *_parameters(outcome, table), *_margins(outcome, required), *_verdicts(outcome)]
    files.write_text(folder / PAGE, "\n".join(lines) + "\n")
    return folder / PAGE


def _measured(outcome: Outcome) -> list[str]:
    fit = outcome.design.fit
    rows = [
        f"| {NAMES[name][0]} | {fit.estimate[name]:.4g} ± {fit.estimate.half_width(name):.2g} {NAMES[name][1]} |"
        for name in fit.estimate.names
    ]
    return [
        "# Autotune",
        "",
        "## Measurements",
        "",
        f"The model explains {fit.fit:.1%} of the wheels' motion. ± is half the 95 % interval.",
        "",
        "| | |",
        "|---|---|",
        *rows,
        "",
    ]


def _parameters(outcome: Outcome, table: ParameterTable) -> list[str]:
    def shown(name: str, value: float) -> str:
        return f"{value:.4g} {table[name].unit}".strip()

    rows = [
        f"| `{name}` | {shown(name, outcome.old[name])} | {shown(name, outcome.new[name])} | {_WHY[name]} |"
        for name in outcome.new
    ]
    return ["## Resulting parameters", "", "| | before | after | why |", "|---|---|---|---|", *rows, ""]


def _margins(outcome: Outcome, required: Requirements) -> list[str]:
    design = outcome.design

    def row(name: str, found: Margins, noise_V: float | None = None) -> str:
        noise = "" if noise_V is None else f"{noise_V:.2g} V"
        words = f"{found.gain:.2g} | {math.degrees(found.phase_rad):.0f}° | {found.distance:.2f} | {noise}"
        return f"| {name} | {words} |"

    return [
        "## Predicted margins",
        "",
        "The least of all loads on the floor. Margins say how wrong the model may be before the loop swings; all 0: it",
        "swings already.",
        "",
        "| | gain margin | phase margin | distance from -1 | noise of the voltage |",
        "|---|---|---|---|---|",
        f"| required | {required.gain:.2g} | {math.degrees(required.phase_rad):.0f}° | {required.distance:.2f} | "
        f"{required.noise:.1%} of the supply |",
        row("wheel loops, before", design.before.margins, design.before.noise_V),
        row("wheel loops, after", design.after.margins, design.after.noise_V),
        row("position loop, before", design.position_before),
        row("position loop, after", design.position_after),
        row("a lifted wheel, before", design.lifted_before),
        row("a lifted wheel, after", design.lifted_after),
        *(
            []
            if outcome.swept.margins is None
            else [row("wheel loops turning, after, as swept", outcome.swept.margins)]
        ),
        "",
        *([f"A sweep with the new values showed nothing: {outcome.swept.why}.", ""] if outcome.swept.why else []),
        *_lifted(design, required),
    ]


def _lifted(design: Design, required: Requirements) -> list[str]:
    if required.half().kept_by(design.lifted_after):
        return []
    return [
        "A lifted wheel has less than half of the required margins, as with the old values. It may hum or swing when",
        "the robot is on a stand. How much inertia is the wheel's own is a number of the robot file, not measured.",
        "",
    ]


def _verdicts(outcome: Outcome) -> list[str]:
    end = "The new parameters are in use" if outcome.kept else "The old parameters are restored"
    pace = f"Driven in turns at {outcome.compared.share:.0%} of the limits."
    if outcome.in_steps:
        pace += " The old values hardly damp the robot as it was measured, so it came to that pace in steps."
    lines = [pace, "", *(f"- {verdict.sentence()}" for verdict in outcome.verdicts)]
    return [
        "## Driven comparison",
        "",
        f"![Errors before and after]({PICTURE})",
        "",
        *lines,
        "",
        f"{end}: {outcome.choice.why}.",
    ]
