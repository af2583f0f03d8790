# SPDX-License-Identifier: MIT
"""What real logs and played ones are compared by, and the table of it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hil_sim.world import world_config
from omni_reproduce import ripple
from omni_reproduce.experiment import Row
from omni_reproduce.played_logs import Signals
from omniwheel.robots import read_robot

Array = NDArray[np.float64]

NAME = "real_worlds"
ROBOT = Path(__file__).parent / "real_three_wheel" / "worlds.toml"
MUJOCO = "MuJoCo"
IDEAL, OURS = "ideal wheels", "our world"
LOGS, LIFTED = "logs", "logs, wheels in the air"
ACCELEROMETER, TURN, WHEEL = "accelerometer", "turn rate", "wheel speed"
UNITS = {ACCELEROMETER: "m/s^2", TURN: "rad/s", WHEEL: "rad/s"}
HEADED, WHEELS_ONLY = "dead reckoning, measured heading", "dead reckoning, wheels only"
HZ_PER_ORDER = 1.5
"""Frequencies that are looked at, over the orders that are: a wheel at 9.4 rad/s turns 1.5 times per second."""
EXPLANATIONS = {
    IDEAL: "No rollers: what the duties alone do. They came from noisy wheel speeds.",
    LIFTED: "No wheel touched the floor, so none of this is from rollers. The wheels turned faster than in the runs.",
}


@dataclass(frozen=True)
class Measured:
    """Figures of one kind of log by their quantity; ``peaks`` per sensor: the order and the frequency that stand out.

    ``drift_m`` is the RMS distance of each run's dead reckoning from its truth, by HEADED and WHEELS_ONLY.
    """

    figures: Mapping[str, float]
    peaks: Mapping[str, tuple[ripple.Peak, ripple.Peak]]
    drift_m: Mapping[str, tuple[float, ...]] = field(default_factory=dict)


@dataclass(frozen=True)
class Compared:
    """The driven logs, those with lifted wheels if there are any, and each world's runs, one per seed."""

    names: tuple[str, ...]
    real: Measured
    air: Measured | None
    worlds: Mapping[str, Sequence[Measured]]


def orders_of() -> tuple[float, float]:
    """Return how often per turn a roller of the assumed wheel passes, and how often one of the same row does."""
    config = world_config(read_robot(ROBOT))
    per_row = float(config.rollers_per_row)
    return float(config.wheel_rows) * per_row, per_row


def measured(
    head: Mapping[str, Any], logs: Sequence[Signals], drift_m: Mapping[str, tuple[float, ...]] | None = None
) -> Measured:
    """Return the figures of all logs together. The accelerometer's are of both axes; a piece's wheel is its fastest."""
    first, last, step = head["orders"]
    orders, period_s = np.arange(first, last + 0.5 * step, step), logs[0].period_s
    figures: dict[str, float] = {}
    peaks = {}
    for sensor, parts in parts_of(head, logs).items():
        factor = float(np.sqrt(2.0)) if sensor == ACCELEROMETER else 1.0
        figures[f"{sensor}, ripple"] = factor * ripple.total_rms(parts)
        for order in orders_of():
            figures[f"{sensor}, at order {order:.0f}"] = factor * ripple.band_rms(parts, order, head["band"], period_s)
        timed = [(signal, ripple.by_time(pieces, period_s)) for signal, pieces in parts]
        frequencies = HZ_PER_ORDER * orders
        peaks[sensor] = (
            ripple.peak(ripple.spectrum(parts, orders, period_s), orders),
            ripple.peak(ripple.spectrum(timed, frequencies, period_s), frequencies),
        )
    return Measured(figures, peaks, drift_m or {})


def parts_of(head: Mapping[str, Any], logs: Sequence[Signals]) -> dict[str, list[ripple.Part]]:
    """Return each sensor's ripple with the pieces that count, of all logs."""

    def swift(log: Signals, signal: Array) -> Array:
        return ripple.swift(signal, log.period_s, head["swift_s"])

    return {
        ACCELEROMETER: [(swift(log, log.acceleration[:, axis]), log.pieces) for log in logs for axis in (0, 1)],
        TURN: [(swift(log, log.turn_rate), log.pieces) for log in logs],
        WHEEL: [
            (swift(log, log.wheel_rad_s[:, wheel]), [piece for piece in log.pieces if piece.wheel == wheel])
            for log in logs
            for wheel in range(log.wheel_rad_s.shape[1])
        ],
    }


def rows(compared: Compared) -> tuple[Row, ...]:
    """Return the figures of each world beside those of the logs, which stand as published."""
    found = [] if compared.air is None else _rows(LIFTED, [compared.air], compared.real)
    for name in (IDEAL, OURS, MUJOCO):
        if name in compared.worlds:
            found += _rows(name, compared.worlds[name], compared.real)
        elif name == MUJOCO:
            missing = "Not run: it needs MuJoCo. pip install 'omniwheel[mujoco]'"
            quantity = f"{ACCELEROMETER}, ripple"
            found.append(Row(NAME, name, quantity, UNITS[ACCELEROMETER], None, explanation=missing))
    return tuple(found)


def _rows(setting: str, runs: Sequence[Measured], real: Measured) -> list[Row]:
    told, count = EXPLANATIONS.get(setting, ""), len(runs) if setting not in (LIFTED, IDEAL) else 0
    found = []

    def add(quantity: str, unit: str, values: Sequence[float], published: float) -> None:
        sd = float(np.std(values, ddof=1)) if count > 1 else None
        row = Row(NAME, setting, quantity, unit, float(np.mean(values)), sd, count, published, explanation=told)
        found.append(row)

    for quantity, published in real.figures.items():
        add(quantity, UNITS[quantity.partition(",")[0]], [run.figures[quantity] for run in runs], published)
    for quantity, of_runs in real.drift_m.items():
        if all(run.drift_m for run in runs):
            values = [1e3 * float(np.median(run.drift_m[quantity])) for run in runs]
            add(f"{quantity}, median of the runs", "mm", values, 1e3 * float(np.median(of_runs)))
    return found


def notes(head: Mapping[str, Any], compared: Compared) -> tuple[str, ...]:
    """Return what the figures mean, the orders that stand out, each run's drift, and the other wheels."""
    return (_method(head, compared), _orders(head, compared), _drifts(compared), _others(compared), *_shares(compared))


def _method(head: Mapping[str, Any], compared: Compared) -> str:
    rollers, of_row = orders_of()
    return (
        "*Published* are the figures of the logs, *ours* those of a world that got their duties, open loop. Both "
        "worlds have one robot file (`real_three_wheel/worlds.toml`): motors by the logs' motor curves, mass and "
        "wheels assumed, nothing fitted to what a world gives. A world's row is what the robot's sensors would have "
        "logged: one wheel speed in ten, from an angle read twice 1 ms apart; the heading, rounded to 1/16 of a "
        f"degree; the mean of the accelerometer over the row. *Ripple* is what a mean over {head['swift_s']:g} s "
        "leaves out, while a wheel turns steadily. *Order* N swings N times per turn of the fastest wheel. On the "
        f"assumed wheel a roller passes {rollers:.0f} times per turn, and one of the same row {of_row:.0f} times. "
        f"A band reaches {100 * head['band']:.0f} % to both sides, as uncertain as the wheels' speed is, and holds "
        "whatever else swings there. No sensor noise is simulated."
    )


def _orders(head: Mapping[str, Any], compared: Compared) -> str:
    kinds = {LOGS: compared.real, **({} if compared.air is None else {LIFTED: compared.air})}
    kinds.update({name: runs[0] for name, runs in compared.worlds.items()})
    lines = [
        "The order and the frequency that stand out most: density over that of its neighbours. From "
        f"{head['stands_out']:g} on it counts: noise without a line gets there about once in a hundred times. A line "
        "that belongs to the wheels' turning is sharper by order than by frequency.",
        "",
        "| | " + " | ".join(f"{sensor}: order | frequency" for sensor in UNITS) + " |",
        "|---" * (1 + 2 * len(UNITS)) + "|",
    ]
    for name, each in kinds.items():
        cells = []
        for sensor in UNITS:
            for peak, unit in zip(each.peaks[sensor], ("", " Hz"), strict=True):
                mark = "" if peak.contrast >= head["stands_out"] else ", none"
                cells.append(f"{peak.order:.4g}{unit} ({peak.contrast:.1f}{mark})")
        lines.append(f"| {name} | " + " | ".join(cells) + " |")
    return "\n".join(lines)


def _drifts(compared: Compared) -> str:
    worlds = [name for name in (IDEAL, OURS, MUJOCO) if name in compared.worlds]
    lines = [
        "Dead reckoning of each run, RMS distance from the truth in mm, with measured heading / wheels only. The "
        "logs' figures are those of `real_logs`, identified on the other runs; a world's have the true geometry.",
        "",
        "| run | " + " | ".join([LOGS, *worlds]) + " |",
        "|---|" + "---:|" * (1 + len(worlds)),
    ]
    for number, run in enumerate(compared.names):
        cells = [_pair([compared.real], number), *(_pair(compared.worlds[name], number) for name in worlds)]
        lines.append(f"| {run} | " + " | ".join(cells) + " |")
    return "\n".join(lines)


def _pair(runs: Sequence[Measured], number: int) -> str:
    cells = []
    for name in (HEADED, WHEELS_ONLY):
        mean = 1e3 * float(np.mean([run.drift_m[name][number] for run in runs]))
        cells.append(f"{mean:.0f}" if mean >= 10.0 else f"{mean:.1f}")
    return " / ".join(cells)


def _others(compared: Compared) -> str:
    rollers, of_row = orders_of()
    names = [f"{ACCELEROMETER}, ripple", *(f"{ACCELEROMETER}, at order {order:.0f}" for order in (rollers, of_row))]
    names += [f"{TURN}, ripple", f"{TURN}, at order {of_row:.0f}", f"{WHEEL}, ripple"]
    lines = [
        "Wheels of other shapes, because nobody knows those of the robot (first seed):",
        "",
        "| | " + " | ".join(f"{name} [{UNITS[name.partition(',')[0]]}]" for name in names) + " |",
        "|---|" + "---:|" * len(names),
    ]
    for kind, each in {LOGS: compared.real, **{name: runs[0] for name, runs in compared.worlds.items()}}.items():
        lines.append(f"| {kind} | " + " | ".join(f"{each.figures[name]:.3g}" for name in names) + " |")
    return "\n".join(lines)


def _shares(compared: Compared) -> list[str]:
    """Say how much of the logs' ripple stands where rollers pass, and how much of it each world has, and no twin."""
    rollers, _ = orders_of()
    whole, band = f"{ACCELEROMETER}, ripple", f"{ACCELEROMETER}, at order {rollers:.0f}"
    kinds = [(LOGS, compared.real)] + ([] if compared.air is None else [(LIFTED, compared.air)])
    own = [f"{name} {_percent(each.figures[band] ** 2, each.figures[whole] ** 2)}" for name, each in kinds]
    lines = [f"Of the mean square of the accelerometer's ripple, this much is in the band at order {rollers:.0f}: "]
    lines[0] += f"{', '.join(own)}."
    for world in (OURS, MUJOCO):
        if world not in compared.worlds or IDEAL not in compared.worlds:
            continue
        shares = [f"{sensor} {_explained(compared, world, f'{sensor}, ripple')}" for sensor in UNITS]
        drifts = [
            f"{_percent(_median_m(compared.worlds[world], name), _median_m([compared.real], name))} ({name})"
            for name in (HEADED, WHEELS_ONLY)
        ]
        lines.append(
            f"**What rollers explain, by {world}.** Of the mean square of the logs' ripple, beyond what ideal wheels "
            f"do: {', '.join(shares)}. The distance by which rollers mislead dead reckoning is so much of the logs' "
            f"distance: {', '.join(drifts)}."
        )
    return lines


def _explained(compared: Compared, world: str, name: str) -> str:
    of_world, ideal = (_mean_square(compared.worlds[kind], name) for kind in (world, IDEAL))
    return _percent(of_world - ideal, compared.real.figures[name] ** 2)


def _mean_square(runs: Sequence[Measured], name: str) -> float:
    return float(np.mean([run.figures[name] ** 2 for run in runs]))


def _median_m(runs: Sequence[Measured], name: str) -> float:
    return float(np.median([np.median(run.drift_m[name]) for run in runs]))


def _percent(part: float, whole: float) -> str:
    return f"{100.0 * part / whole:.2g} %"
