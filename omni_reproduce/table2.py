# SPDX-License-Identifier: MIT
"""Table 2 and figure 10: the ISMC on the kinematics, as published and corrected."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from hil_sim.world import World
from omni_reproduce.experiment import Context, Result, Row, read_spec
from omni_reproduce.loops import (
    Array,
    Path,
    Track,
    law_of,
    make_kinematics,
    make_world,
    one_step_limit,
    rmse_rows,
    share_row,
    track,
)
from omni_reproduce.track_picture import View, draw_tracks
from omniwheel._core import lib

NAME = "table2"
FIGURE = "fig10.png"
_LIMIT = (
    "The limit is the part of the slip that the estimate misses, over one step: it is drawn anew every step, so that "
    "no controller can know it before it has acted."
)
_MARGIN = "(44) asks for k ≥ |B⁺ Δv_s| on each axis; below 0 the switching term does not cover the slip's error."
_EXPLANATIONS = {
    "published": "λ and K are a fit. x and y: switching moves the robot by r K T = {switched_mm:.2f} mm per step, back "
    "and forth. θ: the backward difference lags by a step, T² θ̈ = {lag_mrad:.1f} mrad RMS, of which λ leaves a share "
    "of about 1 / (λ T).",
    "feed_forward": "With the derivative of the middle of the step nearly all of the heading error is gone: it was the "
    "lag.",
    "with_r": "With the 1/r that eq. 42 needs, K = 1 means 1 m/s: K T = {full_mm:.0f} mm per step, and wheels at their "
    "limit. K = 1 gives the published figures only without the 1/r.",
    "condition": "(44) needs K to cover no more than the part of the slip that the estimate misses.",
    "corrected": "λ = 1/T takes an error out in one step; K covers (44) inside a boundary layer, so that nothing "
    "switches; feed-forward and heading are those of the middle of the step.",
}


@dataclass(frozen=True)
class Case:
    """One run: the experiment's file, the name of the setting, the seed."""

    spec: Mapping[str, Any]
    setting: str
    seed: int


def world_of(spec: Mapping[str, Any], seed: int, start: Array) -> World:
    """Return the world of the experiment at a pose."""
    head = spec["experiment"]
    return make_world(
        spec["robot"], "kinematic", seed, start, slip_speed_max_m_s=head["slip_m_s"], slip_time_s=head["step_s"]
    )


def drive(case: Case) -> Track:
    """Run one case."""
    head = case.spec["experiment"]
    law = law_of(case.spec["setting"][case.setting], case.spec["robot"])
    path = Path(case.spec["path"], make_kinematics(world_of(case.spec, case.seed, np.zeros(3))))
    references = path.sampled(head["step_s"], law.feed_forward)
    world = world_of(case.spec, case.seed, references[0][0])

    def act(world: World, wheels: Any, step_s: float) -> bool:
        factor = lib.omni_saturate_direction(wheels, world.wheels, head["wheel_limit_rad_s"])
        world.drive_speed(list(wheels)[: world.wheels])
        world.step(1, round(1e6 * step_s))
        return bool(factor < 1.0)

    return track(world, law, references, head["step_s"], head["slip_error"], case.seed, act)


def measure(case: Case) -> tuple[Array, float, float]:
    """Return a run's RMSE per axis, the share of steps at the wheels' limit, and of K the smallest margin of (44)."""
    run_ = drive(case)
    return run_.rmse, float(run_.limited.mean()), run_.smallest_margin


def run(context: Context) -> Result:
    """Run all settings over the seeds."""
    spec = read_spec(NAME)
    head = spec["experiment"]
    seeds = range(head["seed"], head["seed"] + context.count(head["seeds"], head["quick_seeds"]))
    cases = [Case(spec, setting, seed) for setting in spec["setting"] for seed in seeds]
    found = context.map(measure, cases)
    limit = one_step_limit(
        world_of(spec, head["seed"], np.zeros(3)), head["step_s"], head["slip_m_s"], head["slip_error"]
    )
    rows: list[Row] = []
    for number, (name, setting) in enumerate(spec["setting"].items()):
        part = found[number * len(seeds) : (number + 1) * len(seeds)]
        published = spec["published"]["rmse"] if name in ("published", "corrected") else None
        why = _explanation(spec, name)
        rows += rmse_rows(NAME, setting["title"], np.array([rmse for rmse, _, _ in part]), published, limit, why)
        rows.append(share_row(NAME, setting["title"], "steps at the wheels' limit", [share for _, share, _ in part]))
        margin = 100.0 * min(margin for _, _, margin in part)
        rows.append(
            Row(
                NAME,
                setting["title"],
                "smallest margin of (44)",
                "% of K",
                margin,
                seeds=len(seeds),
                explanation=_MARGIN,
            )
        )
    picture = context.folder / FIGURE
    tracks = {spec["setting"][name]["title"]: drive(Case(spec, name, head["seed"])) for name in head["drawn"]}
    draw_tracks(tracks, _view(head["step_s"], spec["path"]["size_m"]), picture)
    return Result(tuple(rows), (picture,), (_note(spec), _LIMIT))


def _view(step_s: float, size_m: float) -> View:
    title = "Figure 10: ISMC on the kinematics, eight-petal rose while rotating"
    return View(title, step_s, from_s=10.0, until_s=13.0, centre_m=(0.0, size_m - 0.002), half_width_m=0.015)


def _explanation(spec: Mapping[str, Any], name: str) -> str:
    step_s, path = spec["experiment"]["step_s"], spec["path"]
    omega = 2.0 * np.pi * path["rotation_cycles"] / path["period_s"]
    lag_mrad = 1e3 * step_s**2 * path["rotation_amplitude_rad"] * omega**2 / np.sqrt(2.0)
    switched_mm = 1e3 * spec["robot"]["wheel_radius_m"] * spec["setting"]["published"]["k_without_r"][0] * step_s
    full_mm = 1e3 * spec["setting"]["with_r"]["k"][0] * step_s
    return _EXPLANATIONS[name].format(lag_mrad=lag_mrad, switched_mm=switched_mm, full_mm=full_mm)


def _note(spec: Mapping[str, Any]) -> str:
    head, path = spec["experiment"], spec["path"]
    return (
        f"Rose of {path['petals']} petals, {path['size_m']} m, in {path['period_s']:.0f} s, θ = "
        f"{path['rotation_amplitude_rad']} sin(2π t); T = {head['step_s']} s; slip ±{head['slip_m_s']} m/s per wheel, "
        f"estimate off by up to {100 * head['slip_error']:.0f} %; wheels limited to {head['wheel_limit_rad_s']:.0f} "
        "rad/s with their direction kept. The slip that is estimated is that of the coming step, as (41) has it and "
        "for every law alike; no robot can know it before. The robot starts on the path; errors are taken at the "
        "controller's instants. The report steps eq. 23 with the heading of the step's beginning; this world turns "
        "while it drives."
    )
