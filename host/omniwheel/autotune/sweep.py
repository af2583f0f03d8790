# SPDX-License-Identifier: MIT
"""The margins that a robot really has with its new values: a sweep of all wheels alike, while it turns on the spot.

The model knows neither that wheels slip, nor what its own measurement missed. The sweep shows both, as
``omni experiment wheel-chirp`` does.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from omniwheel.drive_log import is_slow
from omniwheel.errors import LimitError
from omniwheel.experiments import WheelPlan, wheel_chirp
from omniwheel.experiments.response import INTERVAL, Response, Sweep, measured_margins
from omniwheel.experiments.wheel import WheelSetup, WheelSignals, signals_of
from omniwheel.experiments.wheel_experiments import opened_loop
from omniwheel.robot import Robot
from omniwheel.tuning import ExperimentError
from omniwheel.wheel_loop import TICK_S, Margins

WHEEL_S = 7.5
"""Length of the sweep times wheels: so much fits into the robot's memory."""
STOPPED = ("failsafe", "estop")
MOST_SWEEPS = 4
"""Sweeps are repeated, and their mean taken, while the loop is not known well ENOUGH."""
ENOUGH, MOST_DOUBT = 0.1, 0.2
"""Half of the 95 % interval of the open loop, as a share of it: when no sweep is added, and what still says something.
"""
NEAR = (0.2, 2.0)
"""Sizes of the open loop around -1, where margins are decided."""


@dataclass(frozen=True)
class Swept:
    """Margins of the wheel loops with the load of turning; None, and ``why``, if a sweep cannot show them."""

    margins: Margins | None
    why: str = ""

    def or_model(self, model: Margins) -> Margins:
        """Return what is promised: what the sweep showed, and the ``model``'s where it showed nothing."""
        if self.margins is None:
            return model
        return Margins(
            self.margins.gain if math.isfinite(self.margins.gain) else model.gain,
            self.margins.phase_rad if self.margins.phase_rad < math.pi else model.phase_rad,
            self.margins.distance,
        )


NOT_SWEPT = Swept(None, "no sweep was made")


def sweep(robot: Robot, room_m: float, tell: Callable[[str], None]) -> Swept:
    """Sweep with the values that the robot has. Raises ExperimentError if it stopped itself."""
    if is_slow(robot.url):
        return Swept(None, "the link is too slow for a sweep")
    plan = WheelPlan(duration_s=WHEEL_S / robot.parameters["WHEELS"])
    seen: list[WheelSignals] = []
    opened, doubt, why = None, math.inf, ""
    while doubt > ENOUGH and len(seen) < MOST_SWEEPS:
        try:
            found = wheel_chirp(robot, plan, room_m, tell)
        except (LimitError, ExperimentError) as error:
            if robot.status.state in STOPPED:
                raise
            why = str(error)
            break
        plan = WheelPlan(**found.settings)
        seen.append(signals_of(found.burst))
        opened = _opened(WheelSetup(robot, plan), seen)
        doubt = _uncertainty(opened)
    if opened is not None and doubt <= MOST_DOUBT:
        return Swept(measured_margins(opened))
    return Swept(
        None, why or f"the encoders are too coarse, or wheels slip: the loop's uncertainty is {doubt:.0%} only"
    )


def _opened(setup: WheelSetup, seen: Sequence[WheelSignals]) -> Response:
    """Return the open loop from the mean of sweeps: all are alike, but for the noise."""
    length = min(len(one.time_s) for one in seen)
    wanted, counted, voltage = (
        np.mean([getattr(one, name)[:length] for one in seen], axis=0) for name in ("wanted", "counted", "voltage")
    )
    swept = Sweep(wanted, TICK_S, setup.plan.from_hz, setup.plan.to_hz)
    loop = setup.loop(swept.frequency_hz)
    assert loop is not None, "autotune needs a loop that the model covers"
    return opened_loop(swept.response(counted, voltage), loop, setup.gains)


def _uncertainty(opened: Response) -> float:
    """Return half of the 95 % interval of the open loop, relative, where the margins are decided: the median there."""
    size = np.abs(opened.value)
    near = (size > NEAR[0]) & (size < NEAR[1])
    return INTERVAL * float(np.median(opened.spread[near])) if near.any() else math.inf
