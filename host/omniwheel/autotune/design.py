# SPDX-License-Identifier: MIT
"""New parameters from what drives showed: motors and inertia as measured, then filter, wheel loops, position loop."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from omniwheel.autotune.gains import (
    FILTER_NOISE_MOST,
    LAYER_MOST,
    Requirements,
    WheelGains,
    compliance,
    design_position,
    design_wheels,
    least,
    position_margins,
    worst,
)
from omniwheel.autotune.motor_values import Measured, motor_values
from omniwheel.errors import AutotuneError
from omniwheel.identification.model import Layout, Model
from omniwheel.identification.output_error import Fit, identify
from omniwheel.wheel_loop import Margins, WheelLoop, loaded, loop_of, motor_of

if TYPE_CHECKING:
    from omniwheel.autotune.room import Drive

LEAST_EXPLAINED = 0.8
"""Share of the wheels' speeds, without their rounding, that a model must explain before gains are designed from it."""
WARM_S = 1.0
"""How early a segment of the identification starts at most. A slow robot would else leave too few of them."""
FILTER_NOISE = (1.0, 0.3, 3.0, 10.0)
"""Candidates for KF_Q_W, times the present one."""
GENTLE = Requirements(gain=4.0, phase_rad=np.pi / 3.0, distance=0.65, noise=0.015, quickest_1_s=6.0)
"""What the first drives' gains keep of the robot file's model: its numbers may be 30 % wrong."""
CHANGED = (
    *("MOT_K", "MOT_B", "MOT_J", "KF_J", "KF_Q_W", "WS_FF_S", "WS_P", "WS_I"),
    *("ISMC_LAM_XY", "ISMC_PHI_XY", "ISMC_LAM_TH", "ISMC_PHI_TH"),
)


@dataclass(frozen=True)
class Design:
    """What was found and what follows: new parameters, and the margins that the model promises of old and new ones.

    ``before`` and ``after``: the wheel loops on the floor. ``lifted_*``: those of a lifted wheel. ``position_*``: the
    position loop, the least of translating and turning.
    """

    fit: Fit
    measured: Measured
    values: dict[str, float]
    before: WheelGains
    after: WheelGains
    lifted_before: Margins
    lifted_after: Margins
    position_before: Margins
    position_after: Margins

    def old_hardly_damp(self, required: Requirements) -> bool:
        """Whether wheel loops or position loop have less than half of the margins on the robot as it was measured.

        They are driven in steps then: a loop that swings and meets a limit swings more.
        """
        half = required.half()
        return not (half.kept_by(self.before.margins) and half.kept_by(self.position_before))


@dataclass(frozen=True)
class _Loops:
    """Wheel loops with each load: the floor when turning and when translating, and lifted."""

    turning: WheelLoop
    translating: WheelLoop
    lifted: WheelLoop

    @property
    def floor(self) -> tuple[WheelLoop, WheelLoop]:
        """Those that a robot drives with."""
        return self.turning, self.translating


def measure(drives: Sequence[Drive], old: Mapping[str, float], layout: Layout) -> tuple[Fit, Measured]:
    """Identify from drives. Raises AutotuneError or IdentificationError if they do not show enough."""
    count_rad = 2.0 * math.pi / old["ENC_CPR"]
    fit = identify([entry.data for entry in drives], Model.floor(layout, dry_drag=False), WARM_S, count_rad)
    if fit.fit < LEAST_EXPLAINED:
        raise AutotuneError(
            f"the model explains only {fit.fit:.0%} of the wheels' motion",
            hint="check whether wheels slipped or stalled",
        )
    return fit, motor_values(fit.estimate, old)


def design_from(fit: Fit, measured: Measured, old: Mapping[str, float], required: Requirements) -> Design:
    """Design for the robot as it was measured. Raises AutotuneError."""
    found = {**old, **measured.values}
    present = (old["WS_P"], old["WS_I"])
    old_loops = _loops(old, found, measured)
    before, lifted = worst(old_loops.floor, *present), old_loops.lifted.margins(*present)
    chosen, loops, after = _wheels(found, measured, required, [present], required.half().at_most(lifted))
    position = _position(found, loops, after, required)
    values = {**measured.values, **chosen, **position}
    return Design(
        fit,
        measured,
        values,
        before,
        after,
        lifted_before=lifted,
        lifted_after=loops.lifted.margins(after.proportional, after.integral),
        position_before=_position_margins(old_loops, before, old),
        position_after=_position_margins(loops, after, {**old, **values}),
    )


def gentle_values(old: Mapping[str, float]) -> dict[str, float]:
    """Return gains for the first drives, from the robot file's numbers alone; none if no gains keep such margins."""
    body = old["MASS"] * old["WHEEL_RADIUS"] ** 2 / old["WHEELS"]
    turning = old["MOT_J"] + old["INERTIA"] * (old["WHEEL_RADIUS"] / old["WHEEL_DIST"]) ** 2 / old["WHEELS"]
    assumed = Measured({}, old["MOT_J"], turning, old["MOT_J"] + 2.0 * body)
    found = {**old, "KF_J": assumed.translating}
    try:
        chosen, loops, gains = _wheels(found, assumed, GENTLE, [])
        position = _position(found, loops, gains, GENTLE)
    except AutotuneError:
        return {}
    return {"KF_J": assumed.translating, **chosen, **position}


def _loops(believed: Mapping[str, float], real: Mapping[str, float], measured: Measured) -> _Loops:
    """Return the loops of a robot that believes one thing while another is real."""
    motor = motor_of(real)
    turning, translating, lifted = (
        loop_of(believed, loaded(motor, inertia))
        for inertia in (measured.turning, measured.translating, measured.lifted)
    )
    return _Loops(turning, translating, lifted)


def _wheels(
    found: Mapping[str, float],
    measured: Measured,
    required: Requirements,
    present: Sequence[tuple[float, float]],
    lifted_least: Requirements | None = None,
) -> tuple[dict[str, float], _Loops, WheelGains]:
    """Return filter and wheel gains, the loops with that filter, and their margins: the stiffest of all filters'."""
    best: tuple[float, dict[str, float], _Loops, WheelGains] | None = None
    error: AutotuneError | None = None
    for noise in dict.fromkeys(min(factor * found["KF_Q_W"], FILTER_NOISE_MOST) for factor in FILTER_NOISE):
        believed = {**found, "KF_Q_W": noise}
        loops = _loops(believed, found, measured)
        try:
            gains = design_wheels(loops.floor, loops.lifted, found["BAT_V_NOM"], required, present, lifted_least)
        except AutotuneError as failed:
            error = failed
            continue
        moved = compliance(loops.floor, gains.proportional, gains.integral)
        if best is None or moved < best[0]:
            best = moved, {"KF_Q_W": noise, "WS_P": gains.proportional, "WS_I": gains.integral}, loops, gains
    if best is None:
        assert error is not None
        raise error
    return best[1:]


def _position(
    found: Mapping[str, float], loops: _Loops, wheels: WheelGains, required: Requirements
) -> dict[str, float]:
    """Return the gains of the position loop, each axis with the load that it moves."""
    values: dict[str, float] = {}
    for axis, loop in (("XY", loops.translating), ("TH", loops.turning)):
        gain = found[f"ISMC_K_{axis}"]
        present, least_1_s = gain / found[f"ISMC_PHI_{axis}"], gain / LAYER_MOST[axis]
        lam, stiffness = design_position([loop], wheels, present, required, least_1_s)
        values |= {f"ISMC_LAM_{axis}": lam, f"ISMC_PHI_{axis}": gain / stiffness}
    return values


def _position_margins(loops: _Loops, wheels: WheelGains, values: Mapping[str, float]) -> Margins:
    """Return the margins of the position loop, the least of both axes; all 0 around an unstable wheel loop."""
    if not wheels.margins.stable:
        return wheels.margins
    return least(
        [
            position_margins(
                loop, wheels, values[f"ISMC_LAM_{axis}"], values[f"ISMC_K_{axis}"] / values[f"ISMC_PHI_{axis}"]
            )
            for axis, loop in (("XY", loops.translating), ("TH", loops.turning))
        ]
    )
