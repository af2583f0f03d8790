# SPDX-License-Identifier: MIT
"""The record of a simulated run, as plots need it. What a real robot reports, too, has the same names as there."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from omni.studio.samples import Trace, thinned
from omni.studio.signals import MOST_WHEELS, Signal, possible_signals
from omniwheel.errors import LogError
from omniwheel.logs.run_folder import load_run
from omniwheel.telemetry import Tracking

_AXES = (("x", "m"), ("y", "m"), ("theta", "rad"))
_AS_REPORTED = (
    ("reference", "tracking.reference"),
    ("estimate", "tracking.pose"),
    ("wheel_reference", "wheels.reference"),
    ("duty", "wheels.duty"),
    ("wheel_scale", "wheels.wheel_scale"),
    ("duty_scale", "wheels.duty_scale"),
)
"""Fields of the record, and the keys of the signals that a robot reports for the same."""
_TRUTH = (
    ("wheel_rad_s", "wheel speed", "rad/s"),
    ("current_A", "motor current", "A"),
    ("slip_ratio", "slip ratio", ""),
)
_ON_PATH = 2
"""omni_trajectory_phase_t: 0 none, 1 lead-in, 2 path, 3 done."""
_DOC = "True value in the simulated world, unknown to the robot."


def _truth(words: str, part: str, unit: str) -> Signal:
    return Signal(f"truth.{words}.{part}", "truth", f"true {words} {part}", unit, _DOC, Tracking, 0)


_TRUE_SIGNALS = [
    *(_truth("pose", axis, unit) for axis, unit in _AXES),
    *(_truth(words, str(n), unit) for _, words, unit in _TRUTH for n in range(1, MOST_WHEELS + 1)),
]
LOG_SIGNALS: Mapping[str, Signal] = {**possible_signals(), **{signal.key: signal for signal in _TRUE_SIGNALS}}
"""Every signal that some log holds, by key."""


class SimulatedLog:
    """An open record of a simulated run; times are seconds since it began. Raises LogError if there is none."""

    def __init__(self, path: Path) -> None:
        self.path = path
        try:
            self._summary, samples = load_run(path.parent)
            wheels = int(self._summary["parameters"]["WHEELS"])
            self._columns = _columns(samples, wheels)
            self._time_s = np.asarray(samples["time_s"], dtype=np.float64)
            self._phase = np.asarray(samples["phase"])
        except (OSError, ValueError, KeyError, TypeError) as error:
            raise LogError(f"{path.parent.name} cannot be read: {error}", hint="repeat the run") from error
        self.start_s, self.end_s = float(self._time_s[0]), float(self._time_s[-1])
        self.lost_bytes = self.bad_frames = 0

    def close(self) -> None:
        """Nothing is open."""

    def signals(self) -> list[Signal]:
        """Return the signals of the record."""
        return [LOG_SIGNALS[key] for key in self._columns]

    def marks(self) -> list[dict[str, Any]]:
        """Return the run's events, as a page draws them."""
        events = self._summary.get("events")
        return [
            {"number": 0, "time_s": float(event["time_s"]) - self.start_s, "changes": {}, "text": str(event["what"])}
            for event in (events if isinstance(events, list) else [])
        ]

    def path_s(self) -> float | None:
        """Return when the robot began to follow its path, past the way to its beginning; None if it never did."""
        on_path = np.flatnonzero(self._phase >= _ON_PATH)
        return None if not len(on_path) else float(self._time_s[on_path[0]] - self.start_s)

    def parameters(self) -> dict[str, float]:
        """Return the parameters that the run began with."""
        return {name: float(value) for name, value in self._summary["parameters"].items()}

    def window(self, keys: Sequence[str], begin_s: float, end_s: float, width: int) -> list[Trace]:
        """Return of each of these signals what a plot of ``width`` pixels shows between two times."""
        return [thinned(trace, width) for trace in self.samples(keys, begin_s, end_s)]

    def samples(self, keys: Sequence[str], begin_s: float, end_s: float) -> list[Trace]:
        """Return every sample of these signals between two times."""
        time_s = self._time_s - self.start_s
        inside = (time_s >= begin_s) & (time_s <= end_s)
        found = []
        for key in keys:
            if key in self._columns:
                value = self._columns[key]
                there = inside & np.isfinite(value)
                found.append(Trace(key, time_s[there], value[there]))
        return found


def _columns(samples: NDArray[Any], wheels: int) -> dict[str, NDArray[np.float32]]:
    """Return values by the signals' keys."""
    found: dict[str, NDArray[np.float32]] = {}

    def add(key: str, value: NDArray[Any]) -> None:
        found[key] = np.asarray(value, dtype=np.float32)

    for number, (axis, _) in enumerate(_AXES):
        add(f"truth.pose.{axis}", samples["truth"][:, number])
    for field, key in _AS_REPORTED:
        value = samples[field]
        parts = [""] if value.ndim == 1 else [axis for axis, _ in _AXES] if value.shape[1] == len(_AXES) else []
        for number, part in enumerate(parts or [str(wheel + 1) for wheel in range(wheels)]):
            add(f"{key}.{part}" if part else key, value if value.ndim == 1 else value[:, number])
    for field, words, _ in _TRUTH:
        for wheel in range(wheels):
            add(f"truth.{words}.{wheel + 1}", samples[field][:, wheel])
    add("battery.voltage", samples["supply_V"])
    return found
