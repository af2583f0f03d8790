# SPDX-License-Identifier: MIT
"""Runs cut into short segments that are simulated side by side."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from omniwheel.errors import IdentificationError
from omniwheel.identification.dataset import Dataset
from omniwheel.identification.model import Model

Array = NDArray[np.float64]

WARM_TIME_CONSTANTS = 8.0
WARM_MAX_ROWS = 200
WARM_MAX_S = 1000.0
BODY_ROWS = 16
CLUSTER_S = 1.0
FULL_DUTY = 0.98
"""From this share of the supply on a bridge may be at its limit: what it gives is not known well."""
MOVING_rad_s = 0.05
GAP = 1.5
"""A row that lasts longer than this many periods is a gap in the log."""


@dataclass(frozen=True)
class Segments:
    """Segments (s) of the same number of rows: voltages, targets and weights are (s, rows, wheels).

    ``dt_s`` (s, rows) length of each row. ``instrument_V`` the duty times one constant supply: it moves as the voltage
    does and has none of its noise. ``target_rad_s`` measured speeds, means over rows or at rows' ends. ``start_rad_s``
    (s, axes) velocities at the start, ``time_s`` (s, rows), ``cluster`` (s,) which second of which run.
    """

    dt_s: Array
    voltage_V: Array
    instrument_V: Array
    target_rad_s: Array
    weight: Array
    start_rad_s: Array
    time_s: Array
    cluster: NDArray[np.int64]
    means: bool

    def thinned(self, every: int) -> Segments:
        """Return every so many segments, all of them if there are few."""
        keep = slice(None, None, every if len(self.dt_s) >= 20 * every else 1)
        arrays = {name: values[keep] for name, values in vars(self).items() if name != "means"}
        return Segments(**arrays, means=self.means)


@dataclass(frozen=True)
class _Rows:
    """A run, row by row: what lies between each sample and the next, (n - 1, wheels) or (n - 1,)."""

    dt_s: Array
    voltage_V: Array
    instrument_V: Array
    target_rad_s: Array
    weight: Array
    speed_rad_s: Array
    full: NDArray[np.bool_]
    moving: NDArray[np.bool_]


def cut(
    runs: Sequence[Dataset], model: Model, time_constant_s: float, warm_s: float = WARM_MAX_S
) -> tuple[Segments, float]:
    """Cut runs into segments; return them and the share of moving rows at full duty. Raises IdentificationError."""
    period_s = max(run.period_s for run in runs)
    warm_s = min(WARM_TIME_CONSTANTS * time_constant_s, warm_s)
    warm = int(np.clip(np.ceil(warm_s / period_s), 2, WARM_MAX_ROWS))
    body = max(BODY_ROWS, 2 * warm)
    means = all(run.wheel_angle_rad is not None for run in runs)
    pieces: list[dict[str, Any]] = []
    clusters: list[int] = []
    full, moving = 0, 0
    for run in runs:
        rows = _rows(run, model.columns, warm, means=means)
        full, moving = full + int(np.sum(rows.full & rows.moving)), moving + int(np.sum(rows.moving))
        offset = clusters[-1] + 1 if clusters else 0
        for first in range(1, len(run.time_s) - warm - body, body):
            start = np.linalg.pinv(model.rows) @ rows.speed_rad_s[first]
            if np.all(np.isfinite(start)):
                pieces.append(_piece(run, rows, slice(first, first + warm + body), warm, start))
                clusters.append(offset + int((run.time_s[first] - run.time_s[0]) / CLUSTER_S))
    if not pieces:
        hint = f"with a time constant of {time_constant_s:g} s a run needs at least {(warm + body) * period_s:.1f} s"
        raise IdentificationError("the runs are too short", hint=hint)
    columns = {name: np.array([piece[name] for piece in pieces]) for name in pieces[0]}
    return Segments(**columns, cluster=np.array(clusters), means=means), full / max(moving, 1)


def _piece(run: Dataset, rows: _Rows, part: slice, warm: int, start: Array) -> dict[str, Any]:
    weight = rows.weight[part].copy()
    weight[:warm] = 0.0
    names = ("dt_s", "voltage_V", "instrument_V", "target_rad_s")
    columns = {name: getattr(rows, name)[part] for name in names}
    return {**columns, "weight": weight, "start_rad_s": start, "time_s": run.time_s[part]}


def measured_speed(run: Dataset) -> Array:
    """Return wheel speeds at the rows' times [rad/s], from angles where they are logged."""
    if run.wheel_angle_rad is None:
        return run.wheel_rad_s
    speed: Array = np.gradient(run.wheel_angle_rad, run.time_s, axis=0)
    return speed


def _rows(run: Dataset, wheels: tuple[int, ...], warm: int, *, means: bool) -> _Rows:
    dt = np.diff(run.time_s)
    voltage = run.voltage_V[:-1, wheels]
    speed = measured_speed(run)[:, wheels]
    if means and run.wheel_angle_rad is not None:
        target = np.diff(run.wheel_angle_rad[:, wheels], axis=0) / dt[:, None]
    else:
        target = run.wheel_rad_s[1:, wheels]
    full = np.zeros(len(dt), dtype=np.bool_)
    instrument = voltage
    if run.supply_V is not None:
        duty = voltage / run.supply_V[:-1, None]
        full = np.any(np.abs(duty) > FULL_DUTY, axis=1)
        instrument = duty * float(np.median(run.supply_V))
    spoilt = full | (dt > GAP * run.period_s)
    spoilt = np.convolve(spoilt, np.ones(warm + 1), mode="full")[: len(dt)] > 0.5
    weight = (np.isfinite(target) & ~spoilt[:, None]).astype(np.float64)
    moving = np.any(np.abs(speed[:-1]) > MOVING_rad_s, axis=1)
    return _Rows(dt, voltage, instrument, np.nan_to_num(target), weight, speed, full, moving)
