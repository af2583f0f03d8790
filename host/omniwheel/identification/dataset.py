# SPDX-License-Identifier: MIT
"""What every identification starts from: wheel speeds, voltages and true poses of one run."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from omniwheel.errors import DatasetError

Array = NDArray[np.float64]
MIN_ROWS = 2
WHEEL_COUNTS = (3, 4)


@dataclass(frozen=True)
class Dataset:
    """One run: n rows of the robot's own clock and m rows of ground truth, on the same (already aligned) clock.

    Wheels are in the robot file's order, positive drives the body counter-clockwise. Raises DatasetError.

    ``time_s`` (n,) [s] rises strictly.
    ``wheel_rad_s`` (n, wheels) [rad/s] measured wheel speeds, NaN where unknown.
    ``voltage_V`` (n, wheels) [V] mean bridge voltage from this row's time to the next one's: duty times supply.
    ``pose_time_s`` (m,) [s] rises strictly; may be empty.
    ``pose`` (m, 3) ground truth x [m], y [m], theta [rad]; theta NaN where unreliable.
    ``wheel_angle_rad`` (n, wheels) [rad] accumulated encoder angle at ``time_s``; None if no counts were logged.
    ``supply_V`` (n,) [V] supply voltage, which tells full duty; None if it was not logged.
    """

    name: str
    time_s: Array
    wheel_rad_s: Array
    voltage_V: Array
    pose_time_s: Array
    pose: Array
    wheel_angle_rad: Array | None = None
    supply_V: Array | None = None

    def __post_init__(self) -> None:
        """Check and convert."""
        rows = _clock(self, "time_s", MIN_ROWS)
        wheels = _columns(self, "wheel_rad_s", rows, None, nan_allowed=True)
        if wheels not in WHEEL_COUNTS:
            raise _error(self, "wheel_rad_s", f"has {wheels} columns; 3 or 4 are needed, one per wheel")
        _columns(self, "voltage_V", rows, wheels)
        if self.wheel_angle_rad is not None:
            _columns(self, "wheel_angle_rad", rows, wheels)
        if self.supply_V is not None and _array(self, "supply_V").shape != (rows,):
            raise _error(self, "supply_V", f"has shape {self.supply_V.shape}; must be one column of {rows} rows")
        _columns(self, "pose", _clock(self, "pose_time_s", 0), 3, nan_columns=(2,))

    @property
    def wheels(self) -> int:
        """Number of wheels."""
        return int(self.wheel_rad_s.shape[1])

    @property
    def period_s(self) -> float:
        """Median time between rows [s]."""
        return float(np.median(np.diff(self.time_s)))

    def between(self, start_s: float, stop_s: float) -> Dataset:
        """Return the rows with start_s <= time < stop_s; DatasetError if too few are left."""
        rows = (self.time_s >= start_s) & (self.time_s < stop_s)
        poses = (self.pose_time_s >= start_s) & (self.pose_time_s < stop_s)
        return replace(
            self,
            time_s=self.time_s[rows],
            wheel_rad_s=self.wheel_rad_s[rows],
            voltage_V=self.voltage_V[rows],
            pose_time_s=self.pose_time_s[poses],
            pose=self.pose[poses],
            wheel_angle_rad=None if self.wheel_angle_rad is None else self.wheel_angle_rad[rows],
            supply_V=None if self.supply_V is None else self.supply_V[rows],
        )


def _error(data: Dataset, field: str, problem: str, hint: str = "") -> DatasetError:
    return DatasetError(f"{data.name}: {field} {problem}", hint=hint or "correct the log or its column mapping")


def _array(data: Dataset, field: str) -> Array:
    try:
        array = np.array(getattr(data, field), dtype=np.float64)
    except (TypeError, ValueError):
        raise _error(data, field, "is not an array of numbers") from None
    array.setflags(write=False)
    object.__setattr__(data, field, array)
    return array


def _clock(data: Dataset, field: str, minimum: int) -> int:
    """Check a column of times and return its length."""
    times = _array(data, field)
    if times.ndim != 1 or len(times) < minimum:
        raise _error(data, field, f"has shape {times.shape}; must be one column of at least {minimum} times")
    if not np.all(np.isfinite(times)):
        raise _error(data, field, f"is not finite in row {int(np.argmin(np.isfinite(times)))}")
    falls = np.flatnonzero(np.diff(times) <= 0.0)
    if len(falls):
        hint = "sort the log by time and drop repeated rows"
        raise _error(data, field, f"does not increase after row {int(falls[0])} ({times[falls[0]]:g} s)", hint)
    return len(times)


def _columns(
    data: Dataset,
    field: str,
    rows: int,
    columns: int | None,
    *,
    nan_allowed: bool = False,
    nan_columns: tuple[int, ...] = (),
) -> int:
    """Check a table of numbers and return how many columns it has."""
    table = _array(data, field)
    wanted = "any number of" if columns is None else str(columns)
    if field == "pose" and table.size == 0:
        table = np.zeros((0, 3))
        object.__setattr__(data, field, table)
    if table.ndim != 2 or len(table) != rows or (columns is not None and table.shape[1] != columns):
        raise _error(data, field, f"has shape {table.shape}; {rows} rows and {wanted} columns expected")
    bad = np.isinf(table)
    if not nan_allowed:
        bad |= np.isnan(table) & ~np.isin(np.arange(table.shape[1]), nan_columns)
    if np.any(bad):
        row, column = np.argwhere(bad)[0]
        raise _error(data, field, f"is {table[row, column]} in row {row}, column {column}; must be a finite number")
    return int(table.shape[1])
