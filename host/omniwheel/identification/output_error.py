# SPDX-License-Identifier: MIT
"""Output error: the parameters with which the simulated model turns its wheels as the measured ones turned.

A run is cut into short segments that are simulated side by side. Each starts a few time constants early from the
measured speed; what that start was off by has decayed before residuals count. Speeds are compared as means between
rows where encoder angles are logged (free of the differencing's delay), else at the rows' times.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from omniwheel.errors import IdentificationError
from omniwheel.identification.dataset import Dataset
from omniwheel.identification.estimate import Estimate, clustered_covariance, require_scipy
from omniwheel.identification.model import STAND, Model
from omniwheel.identification.segments import WARM_MAX_S, MOVING_rad_s, Segments, cut, measured_speed

Array = NDArray[np.float64]

SATURATED_SHARE_MAX = 0.5
MIN_MOVING_S = 2.0
MIN_FIT = 0.5
EXCITED_SHARE = 0.05
"""Motion in one direction of less than this share of the other's is no excitation."""
EXCITE_HINT = "drive circles and spins both ways, with changing speed"
IV_STEPS_MAX = 20
SETTLED = 5e-3
"""Steps end when no parameter moves by more than this share of itself; drag, of the speed gain it is added to."""
COARSE = 5
"""The first search takes one segment in so many."""
UNSHOWN = {
    "speed_gain_V_s": "the speeds vary too little to separate viscous from Coulomb friction",
    "inertia_xy_V_s2": "translation is not excited: the robot's speed along x and y hardly changes",
    "inertia_theta_V_s2": "rotation is not excited: the robot's turn rate hardly changes",
    "inertia_V_s2": "the wheel's speed hardly changes",
}
_UNSETTLED = "the fit did not converge"
_UNSETTLED_HINT = "check the log's voltages and wheel directions"
_STEP = 1e-5


@dataclass(frozen=True)
class Fit:
    """An estimate, the segments it was made of, and the model's speeds on them (s, rows, wheels)."""

    estimate: Estimate
    segments: Segments
    modelled_rad_s: Array
    saturated_share: float
    count_rad: float = 0.0
    """Angle of an encoder's count; 0: its rounding is taken for none."""

    @property
    def residual_rad_s(self) -> Array:
        """Measured minus modelled speed (s, rows, wheels), NaN where not used."""
        residual = self.segments.target_rad_s - self.modelled_rad_s
        return np.where(self.segments.weight > 0.0, residual, np.nan)

    @property
    def rmse_rad_s(self) -> float:
        """Root mean square of the residual [rad/s]."""
        return float(np.sqrt(np.nanmean(self.residual_rad_s**2)))

    @property
    def fit(self) -> float:
        """Share of the speed's variation that the model explains: 1 is all of it.

        What the rounding of the encoder adds to mean speeds is no motion, and no model can explain it. It is taken out.
        Both ends of a row are rounded, each with a variance of count^2 / 12.
        """
        seen, rounding = self._seen()
        if rounding >= seen:
            return 0.0
        return 1.0 - max(float(np.nansum(self.residual_rad_s**2)) - rounding, 0.0) / (seen - rounding)

    @property
    def rounding_share(self) -> float:
        """Share of the measured speed's variation that is the encoder's rounding: 1 hides all motion."""
        seen, rounding = self._seen()
        return min(rounding / seen, 1.0) if seen > 0.0 else 1.0

    def _seen(self) -> tuple[float, float]:
        """Return the sum of squares of the measured speeds about their mean, and what of it is rounding [rad^2/s^2]."""
        used = self.segments.weight > 0.0
        target = self.segments.target_rad_s[used]
        row_s = np.broadcast_to(self.segments.dt_s[:, :, None], used.shape)[used]
        rounding = float(np.sum(self.count_rad**2 / 6.0 / row_s**2)) if self.segments.means else 0.0
        return float(np.sum((target - target.mean()) ** 2)), rounding


def identify(runs: Sequence[Dataset], model: Model, warm_s: float = WARM_MAX_S, count_rad: float = 0.0) -> Fit:
    """Estimate a model's parameters from runs. Raises IdentificationError if the data cannot show them.

    ``warm_s`` is how early a segment starts at most [s]: less for short runs with long time constants. ``count_rad``:
    as of Fit.

    Output error by least squares, then steps of the instrumental-variable equation Z' r = 0. Z is the model's slope
    along the noise-free instrument. Noise of the measured supply would pass through the model and bias its inertia
    upwards.
    """
    _require_enough(runs)
    start = first_guess(runs, model)
    segments, saturated = cut(runs, model, _time_constant_s(start), warm_s)
    _require_excited(segments, model, saturated)
    used = segments.weight > 0.0
    scale = _scales(start, model)

    x = _output_error(model, segments.thinned(COARSE), start, scale)
    for _ in range(IV_STEPS_MAX):
        instrument = _slope(model, segments, x, scale)
        rest = _residual(model, segments, x, scale)
        step = np.linalg.lstsq(instrument, rest, rcond=None)[0]
        x = x + step
        if not np.all(x > _lower_bounds(model)):
            name = model.names[int(np.argmin(x - _lower_bounds(model)))]
            raise IdentificationError(
                UNSHOWN.get(name, f"{name} cannot be identified from these runs"), hint=EXCITE_HINT
            )
        if np.max(np.abs(step) * scale / _sizes(scale, model)) < SETTLED:
            break
    else:
        raise IdentificationError(_UNSETTLED, hint=_UNSETTLED_HINT)
    cluster = np.broadcast_to(segments.cluster[:, None, None], used.shape)[used]
    covariance, dof = clustered_covariance(instrument, rest, _numbered(cluster))
    estimate = Estimate(model.names, x * scale, covariance * np.outer(scale, scale), dof)
    fit = Fit(estimate, segments, _modelled(model, segments, estimate.values), saturated, count_rad)
    _require_excitation(fit)
    return fit


def _output_error(model: Model, segments: Segments, start: Array, scale: Array) -> Array:
    """Return parameters in units of ``scale`` that are close enough for the instrumental-variable steps."""
    optimize = require_scipy("optimize")
    solved = optimize.least_squares(
        lambda x: _residual(model, segments, x, scale),
        start / scale,
        jac=lambda x: -_slope(model, segments, x, scale),
        bounds=(_lower_bounds(model), np.inf),
        xtol=1e-4,
        ftol=1e-6,
        max_nfev=50,
    )
    if not solved.success:
        raise IdentificationError(_UNSETTLED, hint=_UNSETTLED_HINT)
    found: Array = solved.x
    return found


def _residual(model: Model, segments: Segments, x: Array, scale: Array) -> Array:
    residual: Array = (segments.target_rad_s - _modelled(model, segments, x * scale))[segments.weight > 0.0]
    return residual


def _slope(model: Model, segments: Segments, x: Array, scale: Array) -> Array:
    """Return the slope of the modelled speeds along the instrument, (used, p)."""
    lanes = x * scale + np.vstack((np.zeros(len(x)), _STEP * np.diag(scale)))
    speeds = _simulated(model, segments, segments.instrument_V, lanes)[:, segments.weight > 0.0]
    slope: Array = (speeds[1:] - speeds[0]).T / _STEP
    return slope


def _lower_bounds(model: Model) -> Array:
    """Nothing but the drag of the rollers, small differences, may come out negative."""
    return np.where(np.isin(model.names, ("drag_xy_V_s", "dry_drag_V")), -np.inf, 1e-9)


def _time_constant_s(values: Array) -> float:
    return float(np.max(values[2:4] / values[0]))


def evaluate(runs: Sequence[Dataset], model: Model, estimate: Estimate) -> Fit:
    """Return how known parameters predict other runs: the validation."""
    values = np.array([estimate[name] for name in model.names])
    segments, saturated = cut(runs, model, _time_constant_s(values))
    return Fit(estimate, segments, _modelled(model, segments, values), saturated)


def _modelled(model: Model, segments: Segments, values: Array) -> Array:
    speeds: Array = _simulated(model, segments, segments.voltage_V, values[None])[0]
    return speeds


def _simulated(model: Model, segments: Segments, voltage_V: Array, values: Array) -> Array:
    mean, end = model.simulate(values, segments.dt_s, voltage_V, segments.start_rad_s)
    return mean if segments.means else end


def _scales(start: Array, model: Model) -> Array:
    """Return what a parameter is measured against: its own size; drag against the speed gain."""
    scale = np.maximum(np.abs(start), 1e-3 * start[0])
    if model.names != STAND:
        scale[4] = 0.01 * start[0]
        scale[5:] = 0.1 * start[1]
    return np.asarray(scale, dtype=np.float64)


def _sizes(scale: Array, model: Model) -> Array:
    """Return what a step is small against."""
    sizes = scale.copy()
    if model.names != STAND:
        sizes[4] = scale[0]
        sizes[5:] = scale[1]
    return sizes


def _numbered(labels: NDArray[np.int64]) -> NDArray[np.int64]:
    numbers: NDArray[np.int64] = np.unique(labels, return_inverse=True)[1]
    return numbers


def first_guess(runs: Sequence[Dataset], model: Model) -> Array:
    """Return starting values from a regression of voltage on speed, sign and change of speed, wheel by wheel."""
    columns, voltages = [], []
    for run in runs:
        speed = measured_speed(run)[:, model.columns]
        change = np.gradient(speed, run.time_s, axis=0)
        known = np.isfinite(speed) & np.isfinite(change) & (np.abs(speed) > MOVING_rad_s)
        columns.append(np.column_stack((speed[known], np.sign(speed[known]), change[known])))
        voltages.append(run.voltage_V[:, model.columns][known])
    gain, coulomb, inertia = np.linalg.lstsq(np.vstack(columns), np.concatenate(voltages), rcond=None)[0]
    if gain <= 0.0:
        raise IdentificationError(
            "more voltage does not mean more speed in these runs",
            hint="check motor.direction and encoder.direction, and that the logged voltage is the bridge's",
        )
    period_s = max(run.period_s for run in runs)
    inertia = float(np.clip(inertia, 0.1 * gain * period_s, gain * 100.0 * period_s))
    start = [gain, max(coulomb, 1e-3 * gain), inertia]
    return np.array(start if model.names == STAND else [*start, inertia, *(0.0 for _ in model.names[4:])])


def _require_enough(runs: Sequence[Dataset]) -> None:
    if not runs:
        raise IdentificationError("no run was given", hint="record the excitation with `omni identify live`")
    moving_s = 0.0
    for run in runs:
        speed = measured_speed(run)[:-1]
        fast = np.any(np.nan_to_num(np.abs(speed)) > MOVING_rad_s, axis=1)
        moving_s += float(np.sum(np.diff(run.time_s)[fast]))
    if moving_s < MIN_MOVING_S:
        raise IdentificationError(
            f"the wheels turn for {moving_s:.1f} s in all; at least {MIN_MOVING_S:g} s are needed",
            hint="check that the robot was armed; drive circles and spins in both directions",
        )


def _require_excited(segments: Segments, model: Model, saturated_share: float) -> None:
    """Raise IdentificationError if bridges are mostly at full duty, or if the robot hardly moves in one direction."""
    if saturated_share > SATURATED_SHARE_MAX:
        raise IdentificationError(
            f"a bridge is at full duty for {100 * saturated_share:.0f} % of the time: its voltage is unknown",
            hint="drive at lower duty",
        )
    if model.names == STAND:
        return
    size = np.sqrt(np.mean(segments.start_rad_s**2, axis=0))
    along, turning = float(np.hypot(size[0], size[1])), float(size[2])
    for name, mine, other in (("inertia_xy_V_s2", along, turning), ("inertia_theta_V_s2", turning, along)):
        if mine < EXCITED_SHARE * other:
            raise IdentificationError(UNSHOWN[name], hint=EXCITE_HINT)


def _require_excitation(fit: Fit) -> None:
    """Raise IdentificationError that names what the data cannot show."""
    for name, why in UNSHOWN.items():
        if name in fit.estimate.names and not fit.estimate.half_width(name) < 0.5 * abs(fit.estimate[name]):
            raise IdentificationError(why, hint=EXCITE_HINT)
    if fit.fit < MIN_FIT:
        raise IdentificationError(
            f"the model explains only {100 * fit.fit:.0f} % of the measured speeds",
            hint="check wheel order, directions and the voltage column; and whether wheels slipped or stalled",
        )
