# SPDX-License-Identifier: MIT
"""Foreign CSV logs and ROS bags by a declared mapping: counts recovered from quantised speeds, heading unwrapped."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from omni_schema.errors import did_you_mean
from omniwheel.errors import LogError
from omniwheel.logs.log import Array, Mask, Truth, WheelLog
from omniwheel.logs.mapping import Mapping, TruthColumns
from omniwheel.logs.motive import MotiveOptions, is_motive_export, read_motive
from omniwheel.logs.rosbag import BagPoses, is_bag, read_bag
from omniwheel.logs.spikes import reject_spikes
from omniwheel.logs.wraps import counted_on, counter_steps, signed_steps, unwrapped_clock
from omniwheel.table_file import TableFormat, read_table

INTEGER_TOLERANCE = 0.05
"""How far a recovered count may be from a whole number, in the median."""
MOST_DROPPED = 0.05
"""Share of the rows that may be left out because their time does not rise: a repeated row now and then."""
MOST_REJECTED = 0.25
"""Share of a wheel's counts that may be spikes. Where it is more, the limits of the mapping are wrong."""
RESTART_ROWS = 3
"""After so many rows in a row that rise again, but lie behind what was there before, the clock began again."""
LONGEST_GAP_S = 5.0
LONGEST_GAP_ROWS = 10
"""Where more time and more rows than these are missing, nothing is known of the motion between."""
PERIOD_TOLERANCE = 0.25
"""How far the rows' distance may be from the mapping's period, as a share, in the median."""
MAX_TURN_RAD_S = 20.0
"""A heading that changes faster than this has been restarted."""
MOST_HEADING_RESTARTS = 3
MOST_RESTARTED = 0.01
"""More restarts of the heading than these, and than this share of the rows, are none: it is no heading in this unit."""
LARGEST_TIME = 1e19
"""Nanoseconds since 1970, and more."""
LARGEST = 2.0**53
"""Beyond it a float64 holds no longer every whole number: no counter shows so much, and nothing else that is measured.
"""
MOST_RESTARTS = 3
"""Counters that restart more often are no running counts of 16 or 32 bits, but wrap at some other value."""
FASTEST_WHEEL_RAD_S = 1000.0
"""No wheel of a robot turns so fast, nearly 10 000 rpm: a counter restarted there, or the row is damaged."""

FROZEN_S = 0.5
"""A column that often changes and then keeps one value for so long is frozen."""
OFTEN = 0.1
"""Share of the rows in which a column changes that is said to change often."""


@dataclass(frozen=True)
class Frozen:
    """A column kept one value from a time on, to another [s], though it changes often elsewhere."""

    column: str
    start_s: float
    stop_s: float


@dataclass(frozen=True)
class ImportSummary:
    """What the import did to the rows: shares are of the rows that are left, per wheel.

    ``frozen`` names columns of the file, mapped or not, that kept one value while the wheels turned.
    ``noise_correlation`` is that of a count's noise with the next one's: -0.5 where counts add up to an angle, 0 where
    each stands alone.
    ``outlier_share`` is that of counts far from their neighbours, whether they were rejected as spikes or not.
    ``counter_restarts_s``: the counters began again at zero, and were counted on from there.
    ``truth_dropped_rows``: rows of the truth without a pose, or whose time does not increase.
    """

    rows: int
    dropped_rows: int
    truth_dropped_rows: int
    missing_rows: int
    rejected_share: tuple[float, ...]
    heading_restarts_s: tuple[float, ...]
    noise_counts: tuple[float, ...]
    noise_correlation: tuple[float, ...]
    frozen: tuple[Frozen, ...]
    outlier_share: tuple[float, ...]
    counter_restarts_s: tuple[float, ...]


def read_columns(path: Path, delimiter: str, header: tuple[str, ...] = ()) -> dict[str, Array]:
    """Return the columns of a CSV file; ``header`` names them where it has no header line.

    Raises LogError where a cell is no number.
    """
    hint = (
        "give a CSV file with a number in every cell; in the column mapping, log.delimiter is the sign between "
        "cells, and log.header names the columns of a file without a header line"
    )
    columns = read_table(path, TableFormat(LogError, hint, needed=header, delimiter=delimiter)).columns
    if not len(next(iter(columns.values()))):
        raise LogError(f"{path} has no rows", hint=hint)
    return columns


def _column(path: Path, columns: dict[str, Array], name: str, mapping: Mapping, largest: float = LARGEST) -> Array:
    if name not in columns:
        guess = did_you_mean(name, list(columns))
        raise LogError(f"{path} has no column {name!r}{guess}", hint=f"correct {mapping.source}")
    values = columns[name]
    if not np.all(np.isfinite(values)):
        row = int(np.argmin(np.isfinite(values))) + 2
        raise LogError(f"{path}:{row}: {name} is not finite", hint="drop or repair that row")
    worst = int(np.argmax(np.abs(values)))
    if abs(values[worst]) > largest:
        raise LogError(
            f"{path}:{worst + 2}: {name} is {values[worst]:g}: implausibly large",
            hint="drop or repair that row",
        )
    return values


def read_truth(path: Path, mapping: Mapping | None) -> tuple[Truth, int]:
    """Read ground truth, and how many rows were left out: without a pose, or with a time that does not increase.

    Motive's CSV export needs no mapping; other files need its [truth] columns. Raises LogError.
    """
    if is_motive_export(path):
        track = read_motive(path, mapping.motive if mapping is not None else MotiveOptions())
        rises = _rising(path, track.time_s)
        truth = Truth(track.time_s[rises], track.xy[rises], track.theta[rises])
        return truth, track.hidden_frames + int(np.sum(~rises))
    if mapping is None:
        raise LogError(f"{path}: a truth file needs a column mapping", hint="give --mapping FILE with [truth]")
    wanted = mapping.truth
    if wanted is None:
        raise LogError(f"{mapping.source} has no [truth]", hint="name the columns of time, x and y")
    return _truth_of(path, read_columns(path, mapping.delimiter), wanted, mapping, same_clock=False)


def _truth_of(
    path: Path, columns: dict[str, Array], wanted: TruthColumns, mapping: Mapping, *, same_clock: bool
) -> tuple[Truth, int]:
    time = unwrapped_clock(_column(path, columns, wanted.time, mapping, LARGEST_TIME) * wanted.time_unit)
    xy = np.stack([_column(path, columns, name, mapping) * wanted.unit for name in (wanted.x, wanted.y)], axis=1)
    theta = np.full(len(time), np.nan)
    if wanted.theta:
        theta = _column(path, columns, wanted.theta, mapping) * wanted.theta_unit
    rises = _rising(path, time)
    return Truth(time[rises], xy[rises], theta[rises], same_clock=same_clock), int(np.sum(~rises))


def import_log(path: Path, mapping: Mapping, truth: Path | None = None) -> tuple[WheelLog, ImportSummary]:
    """Read a CSV log or a ROS bag (and its truth), reject spikes. Raises LogError that names file, row and column."""
    columns, time, poses = _source(path, mapping)
    keep = _rising(path, time)
    wheels = np.stack([_column(path, columns, name, mapping) for name in mapping.wheels], axis=1)[keep]
    wheels *= np.array(mapping.wheel_scale)
    _require_turning(path, wheels, mapping)
    duty = np.zeros_like(wheels)
    if mapping.duty:
        raw = np.stack([_column(path, columns, name, mapping) for name in mapping.duty], axis=1)[keep]
        duty = raw * np.array(mapping.duty_sign) / mapping.duty_full_scale
        if np.any(np.abs(duty) > 1.0):
            raise LogError(
                f"{path}: a duty exceeds its full scale", hint=f"correct duty.full_scale in {mapping.source}"
            )
    step = np.concatenate(([mapping.period_s], np.diff(time[keep])))
    _require_period(path, step, mapping)
    _require_no_gap(path, time[keep], mapping)
    heading = np.full(len(wheels), np.nan)
    restarts: list[int] = []
    if mapping.heading:
        raw_heading = _column(path, columns, mapping.heading, mapping)[keep]
        heading, restarts = unwrap_heading(raw_heading * mapping.heading_unit * mapping.heading_sign, step)
        _require_few_restarts(path, restarts, len(raw_heading), mapping)
        driven = np.any(duty != 0.0, axis=1) if mapping.duty else np.ones(len(duty), dtype=bool)
        heading[frozen_rows(raw_heading, time[keep], driven, mapping.period_s)] = np.nan
    counted, counter_restarts = _counts(path, wheels, step, mapping)
    counts = counted * np.array(mapping.wheel_sign)
    known_truth, truth_dropped = _truth(path, columns, poses, mapping, truth)
    log = WheelLog(
        name=path.stem,
        period_s=mapping.period_s,
        counts_per_revolution=mapping.counts_per_revolution,
        time_s=time[keep],
        counts=counts,
        good=np.ones(counts.shape, dtype=bool),
        duty=duty,
        heading_rad=heading,
        truth=known_truth,
        sample_s=mapping.sample_s,
        noise_rad_s=mapping.noise_rad_s,
    )
    good, noise = reject_spikes(log, mapping.spikes)
    _require_few_spikes(path, good, mapping)
    _require_possible_speeds(path, log, good, mapping)
    summary = ImportSummary(
        rows=len(log.time_s),
        dropped_rows=int(np.sum(~keep)),
        truth_dropped_rows=truth_dropped,
        missing_rows=int(np.sum(np.maximum(np.round(step / mapping.period_s) - 1.0, 0.0))),
        rejected_share=tuple(float(share) for share in 1.0 - good.mean(axis=0)),
        heading_restarts_s=tuple(float(log.time_s[row]) for row in restarts),
        noise_counts=noise.counts,
        noise_correlation=noise.correlation,
        outlier_share=noise.outlier_share,
        counter_restarts_s=tuple(float(log.time_s[row]) for row in counter_restarts),
        frozen=_frozen_in_motion(columns, keep, log, mapping),
    )
    return replace(log, good=good), summary


def _source(path: Path, mapping: Mapping) -> tuple[dict[str, Array], Array, BagPoses | None]:
    """Return the columns of a CSV file or a ROS bag, the rows' times [s], and the poses in the bag. Raises LogError."""
    if is_motive_export(path):
        raise LogError(
            f"{path} is an export of OptiTrack Motive: it has poses and no wheel counts",
            hint="give the robot's own log as LOG, and this file as --truth",
        )
    if is_bag(path) and mapping.bag is None:
        raise LogError(f"{path} is a ROS bag", hint=f"name its topics in {mapping.source}: [bag] wheels, truth")
    if mapping.bag is None:
        columns = read_columns(path, mapping.delimiter, mapping.header)
        return (
            columns,
            unwrapped_clock(_column(path, columns, mapping.time, mapping, LARGEST_TIME) * mapping.time_unit),
            None,
        )
    if not is_bag(path):
        raise LogError(
            f"{path} is not a ROS bag, but {mapping.source} has [bag]",
            hint="give the folder with metadata.yaml, an .mcap file or a .bag file",
        )
    field = "velocity" if mapping.quantity == "speed" else "position"
    time, values, poses = read_bag(path, mapping.bag, mapping.wheels, field)
    return dict(zip(mapping.wheels, values.T, strict=True)), time, poses


def _require_period(path: Path, step_s: Array, mapping: Mapping) -> None:
    """Raise LogError where the rows are not one period apart: speeds would be taken for the counts of another time."""
    found_s = float(np.median(step_s[1:])) if len(step_s) > 1 else mapping.period_s
    if abs(found_s - mapping.period_s) > PERIOD_TOLERANCE * mapping.period_s:
        raise LogError(
            f"{path}: the rows are {found_s:g} s apart in the median, but log.period_s is {mapping.period_s:g} s",
            hint=f"correct log.period_s or log.time.unit in {mapping.source}",
        )


def _require_no_gap(path: Path, time_s: Array, mapping: Mapping) -> None:
    """Raise LogError where rows are missing for so long that the log is one of two runs."""
    step = np.diff(time_s)
    row = int(np.argmax(step)) if len(step) else 0
    if len(step) and step[row] > max(LONGEST_GAP_S, LONGEST_GAP_ROWS * mapping.period_s):
        raise LogError(
            f"{path}: no row from {time_s[row]:.3f} to {time_s[row + 1]:.3f} s",
            hint="cut the file there and import each part",
        )


def _require_turning(path: Path, wheels: Array, mapping: Mapping) -> None:
    """Raise LogError where a wheel's column never changes though others do: its encoder is not connected."""
    still = np.ptp(wheels, axis=0) == 0.0
    if still.any() and not still.all():
        name = mapping.wheels[int(np.argmax(still))]
        raise LogError(
            f"{path}: {name} never changes, but other wheels' columns do",
            hint=f"check that encoder, and the columns of [wheels] in {mapping.source}",
        )


def _require_few_restarts(path: Path, restarts: Sequence[int], rows: int, mapping: Mapping) -> None:
    """Raise LogError where the heading jumps so often that nothing is known of it."""
    if len(restarts) > max(MOST_HEADING_RESTARTS, MOST_RESTARTED * rows):
        raise LogError(
            f"{path}: {mapping.heading} jumps {len(restarts)} times by more than a robot can turn, first in row "
            f"{restarts[0] + 2}",
            hint=f"correct heading.column or heading.unit in {mapping.source}",
        )


def _require_few_spikes(path: Path, good: Mask, mapping: Mapping) -> None:
    rejected = 1.0 - good.mean(axis=0)
    worst = int(np.argmax(rejected))
    if rejected[worst] > MOST_REJECTED:
        raise LogError(
            f"{path}: {100.0 * rejected[worst]:.0f} % of the counts in {mapping.wheels[worst]} are rejected as spikes",
            hint=f"correct counts_per_revolution or the unit of [wheels], or max_rad_s and threshold of [spikes], in "
            f"{mapping.source}",
        )


def _require_possible_speeds(path: Path, log: WheelLog, good: Mask, mapping: Mapping) -> None:
    """Raise LogError for a wheel that is too fast for any robot, unless a row nearby takes that back.

    A counter that was misread once shows two such rows, which cancel out: nothing is added to the path.
    """
    speed = np.where(good, log.wheel_rad_s, 0.0)
    for row, wheel in np.argwhere(np.abs(speed) > FASTEST_WHEEL_RAD_S):
        near = log.counts[max(row - RESTART_ROWS, 0) : row + RESTART_ROWS + 1, wheel]
        if log.sample_s > 0.0 or abs(float(np.sum(near))) > 0.5 * abs(float(log.counts[row, wheel])):
            raise LogError(
                f"{path}: {mapping.wheels[wheel]} increases by {log.counts[row, wheel]:.0f} counts at "
                f"{log.time_s[row]:.3f} s, which is {abs(speed[row, wheel]):.0f} rad/s",
                hint="if the logger or its counters restarted there, cut the file and import each part; if the encoder "
                f"misreads, set max_rad_s under [spikes] in {mapping.source}",
            )


def _truth(
    path: Path, columns: dict[str, Array], poses: BagPoses | None, mapping: Mapping, truth: Path | None
) -> tuple[Truth | None, int]:
    """Return the truth of a file of its own, else of the log itself where the mapping says that it is there."""
    if truth is not None:
        return read_truth(truth, mapping)
    if poses is not None:
        known = np.all(np.isfinite(np.column_stack((poses.xy, poses.theta))), axis=1)
        known[known] = _rising(path, poses.time_s[known])
        return Truth(poses.time_s[known], poses.xy[known], poses.theta[known]), int(np.sum(~known))
    if mapping.truth is not None and mapping.truth.in_log:
        return _truth_of(path, columns, mapping.truth, mapping, same_clock=True)
    return None, 0


def frozen_columns(
    columns: dict[str, Array], time_s: Array, moving: dict[str, Mask] | None = None
) -> tuple[Frozen, ...]:
    """Return the longest time that each column was frozen; a setpoint, which seldom changes, never is.

    Only times count in which rows of ``moving`` (n,), by column, last FROZEN_S: at rest a sensor may keep its value.
    """
    found = []
    for name, values in columns.items():
        stretches = _frozen(values, time_s)
        if moving is not None:
            moved_s = np.cumsum(np.diff(time_s, prepend=time_s[0]) * moving[name])
            stretches = [(first, last) for first, last in stretches if moved_s[last] - moved_s[first] >= FROZEN_S]
        if stretches:
            first, last = max(stretches, key=lambda rows: rows[1] - rows[0])
            found.append(Frozen(name, float(time_s[first]), float(time_s[last])))
    return tuple(found)


def _frozen_in_motion(columns: dict[str, Array], keep: Mask, log: WheelLog, mapping: Mapping) -> tuple[Frozen, ...]:
    """Return the columns that were frozen while the wheels turned; a wheel's own column, while it turned itself."""
    moving: dict[str, Mask] = {name: np.any(log.counts != 0.0, axis=1) for name in columns}
    moving |= dict(zip(mapping.wheels, (log.counts != 0.0).T, strict=True))
    return frozen_columns({name: values[keep] for name, values in columns.items()}, log.time_s, moving)


def frozen_rows(values: Array, time_s: Array, driven: Mask, period_s: float) -> Mask:
    """Mask of the rows (n,) in which a column was frozen though the robot was ``driven`` (n,) for FROZEN_S of them.

    The first row of each time was measured. A robot at rest keeps its heading.
    """
    rows = np.zeros(len(values), dtype=bool)
    for first, last in _frozen(values, time_s):
        if period_s * np.sum(driven[first + 1 : last + 1]) >= FROZEN_S:
            rows[first + 1 : last + 1] = True
    return rows


def _frozen(values: Array, time_s: Array) -> list[tuple[int, int]]:
    """First and last row of every time that a column which changes often kept one value."""
    changes = np.flatnonzero(np.diff(values) != 0.0)
    edges = np.concatenate(([-1], changes, [len(values) - 1]))
    firsts, lasts = edges[:-1] + 1, edges[1:]
    long = time_s[lasts] - time_s[firsts] >= FROZEN_S
    elsewhere = len(values) - int(np.max(lasts - firsts + 1))
    if len(changes) <= OFTEN * elsewhere:
        return []
    return [(int(first), int(last)) for first, last in zip(firsts[long], lasts[long], strict=True)]


def _rising(path: Path, time: Array) -> Mask:
    """Mask of the rows whose time is later than every one before.

    Raises LogError where many are not, or where the clock began again.
    """
    before = np.concatenate(([-np.inf], np.maximum.accumulate(time)[:-1]))
    rises = np.asarray(time > before)
    back = np.diff(time)
    again = ~rises & np.concatenate(([False], back > 0.0))  # behind, and yet later than the row before
    began = np.convolve(again, np.ones(RESTART_ROWS), "valid") >= RESTART_ROWS
    if np.mean(~rises) > MOST_DROPPED or np.any(began):
        row = int(np.argmin(back))
        raise LogError(
            f"{path}: {np.sum(~rises)} of {len(time)} rows are not later than those before them; row {row + 2} goes "
            f"back from {time[row]:.3f} to {time[row + 1]:.3f} s",
            hint="if the logger was restarted, cut the file there and import each part; else correct the clock's unit",
        )
    return rises


def _counts(path: Path, wheels: Array, step: Array, mapping: Mapping) -> tuple[Array, Sequence[int]]:
    """Counts since the row before, and the rows in which the counters restarted.

    A speed is one period's counts; across missing rows it is taken to have lasted. Counts of a sample are those of the
    sample alone.
    """
    sampled = mapping.sample_s > 0.0
    steps = 1.0 if sampled else np.maximum(np.round(step / mapping.period_s), 1.0)[:, None]
    if mapping.quantity == "counts":
        return _running_counts(path, wheels, step, mapping)
    if mapping.quantity == "increment":
        return signed_steps(wheels) * mapping.wheel_unit, ()
    rad_per_count = 2.0 * np.pi / mapping.counts_per_revolution
    exact = wheels * mapping.wheel_unit * (mapping.sample_s if sampled else mapping.period_s) / rad_per_count
    whole = np.round(exact)
    off = float(np.median(np.abs(exact - whole)[whole != 0.0])) if np.any(whole != 0.0) else 0.0
    if off > INTEGER_TOLERANCE:
        raise LogError(
            f"{path}: the wheel speeds are {off:.2f} counts off whole counts in the median",
            hint=f"correct counts_per_revolution, period_s, sample_s or the unit in {mapping.source}",
        )
    return np.asarray(whole * steps), ()


def _running_counts(path: Path, wheels: Array, step: Array, mapping: Mapping) -> tuple[Array, Sequence[int]]:
    """Counts since the row before of counters that add up, and the rows in which they restarted. Raises LogError."""
    periods = np.maximum(np.round(step / mapping.period_s), 1.0)
    unit = mapping.wheel_unit
    counts, restarts = counted_on(wheels * unit, counter_steps(wheels) * unit, periods)
    if len(restarts) > MOST_RESTARTS:
        raise LogError(
            f"{path}: the counters begin again at zero {len(restarts)} times, first in row {restarts[0] + 2}",
            hint="cut the file at the restarts and import each part; a counter of other than 16 or 32 bits has to be "
            "unwrapped before",
        )
    return counts, restarts.tolist()


def unwrap_heading(heading: Array, step_s: Array) -> tuple[Array, list[int]]:
    """Return the heading [rad] without wraps, from 0, and the rows in which the sensor was restarted.

    A restart shows as a turn faster than any robot's; the heading then goes on from where it was.
    """
    turn = np.diff(heading)
    turn -= 2.0 * np.pi * np.round(turn / (2.0 * np.pi))
    restarted = np.abs(turn) > MAX_TURN_RAD_S * step_s[1:]
    turn[restarted] = 0.0
    return np.concatenate(([0.0], np.cumsum(turn))), [int(row) + 1 for row in np.flatnonzero(restarted)]
