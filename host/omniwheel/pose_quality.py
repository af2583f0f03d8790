# SPDX-License-Identifier: MIT
"""How good the robot's pose estimate is by what it knows itself, in words, and what to do about it."""

from __future__ import annotations

import math
from collections import deque
from dataclasses import asdict, dataclass
from enum import Enum
from typing import Any

from omniwheel.telemetry import Control, Status, Telemetry, Tracking

SHARE = 0.95
"""The true position is inside the ellipse, and the true heading inside its limits, with this probability each."""
ELLIPSE_SIGMAS = math.sqrt(-2.0 * math.log(1.0 - SHARE))
HEADING_SIGMAS = 1.959964
NIS_RIGHT = 3.0
"""Mean NIS (normalised innovation squared) of a right filter: a fix has three numbers."""
NIS_MOST = 1.5 * NIS_RIGHT
"""Above it the fixes contradict the estimate. Of 50 fixes, chance brings a right filter there once in 10 000 times."""
NIS_CUT = 12.0
"""A fix counts with no more than this, as in the core: a single wild fix says nothing of the others."""
NOISE_MOST = 4.0
"""A filter that takes the wheels for so many times as noisy as configured hides a mistake. Sound robots are below 2."""
WINDOW_S, LEAST_S, LEAST_FIXES = 30.0, 10.0, 50
"""Fixes so far back count; over less time, or with fewer, nothing is said of them."""
_DRIFT_S = 1.0
_FRESH_S = 0.05
_STALE = "pose stale"


class Verdict(str, Enum):
    """What the numbers mean."""

    GOOD = "good"
    CONTRADICTED = "contradicted"
    DRIFTING = "drifting"
    NO_FIXES = "no fixes"
    UNKNOWN = "unknown"


@dataclass(frozen=True)
class PoseQuality:
    """How good the pose estimate is, by the robot's own filter.

    ``position_m`` is the larger half axis of the 95 % ellipse of x and y. ``heading_rad`` is 1.96 standard deviations,
    95 % as well. ``fix_age_s`` is the time since a fix was last used, None if there was none or the robot does not
    tell. ``refused`` counts the fixes refused since then. ``drift`` is how fast both have grown since then (m/s and
    rad/s), None if that is not known. ``nis_mean`` is over ``nis_count`` fixes, None while they are too few.
    ``wheel_noise`` is how many times as noisy as configured the filter takes the wheels' motion for, 0 if not told.
    """

    verdict: Verdict
    position_m: float
    heading_rad: float
    fix_age_s: float | None = None
    refused: int = 0
    drift: tuple[float, float] | None = None
    nis_mean: float | None = None
    nis_count: int = 0
    wheel_noise: float = 0.0

    @property
    def text(self) -> str:
        """One line that says how good the pose is."""
        size = f"±{_metres(self.position_m)}, ±{_degrees(self.heading_rad)} (95 %)"
        if self.verdict is Verdict.UNKNOWN:
            return "pose: no standard deviation reported"
        if self.verdict is Verdict.CONTRADICTED and self.wheel_noise >= NOISE_MOST:
            times = f"{self.wheel_noise:.0f} times"
            return f"pose uncertain: reported {size}, but wheels and fixes disagree {times} as much as configured"
        if self.verdict is Verdict.CONTRADICTED:
            return f"pose uncertain: reported {size}, but its fixes deviate more (NIS {self.nis_mean:.1f}, not 3)"
        if self.verdict is Verdict.NO_FIXES:
            return f"pose without fixes: {size}"
        if self.verdict is Verdict.DRIFTING:
            since = "some time" if self.fix_age_s is None else _seconds(self.fix_age_s)
            return f"pose drifting: no {'usable ' if self.refused else ''}fix for {since}, {size}"
        return f"pose {size}"

    @property
    def advice(self) -> str:
        """What to do, "" if nothing is to be done."""
        if self.verdict is Verdict.CONTRADICTED:
            return (
                "check delay (FIX_DELAY) and noise (EKF_R_XY, EKF_R_TH, or their own values) of the fixes, wheel "
                "sizes; "
                "if these are right, raise EKF_Q_XY and EKF_Q_TH for this floor"
            )
        if self.verdict is Verdict.DRIFTING and self.refused:
            return f"the robot rejected {self.refused} fixes: check the pose source's frame{self._drift()}"
        if self.verdict is Verdict.DRIFTING:
            return f"check the pose source (cameras, bridge, link){self._drift()}"
        if self.verdict is Verdict.NO_FIXES:
            return f"start a pose source, or use dead reckoning where its accuracy is enough{self._drift()}"
        return ""

    def as_dict(self) -> dict[str, Any]:
        """Return everything as plain values for JSON, with text and advice."""
        return {**asdict(self), "verdict": self.verdict.value, "text": self.text, "advice": self.advice}

    def _drift(self) -> str:
        if self.drift is None or not any(self.drift):
            return ""
        metres, radians = self.drift
        return f"; without fixes it drifts about {_metres(metres)} and {_degrees(radians)} per second"


def half_axis_m(tracking: Tracking) -> float:
    """Return the larger half axis of the 95 % ellipse of the position [m]."""
    sd_x, sd_y, _ = tracking.pose_sd
    mean, apart = 0.5 * (sd_x**2 + sd_y**2), 0.5 * (sd_x**2 - sd_y**2)
    return ELLIPSE_SIGMAS * math.sqrt(mean + math.hypot(apart, tracking.pose_correlation * sd_x * sd_y))


class QualityWatch:
    """Listens to a robot's telemetry and says how good its pose is."""

    def __init__(self) -> None:
        self._tracking: Tracking | None = None
        self._control: Control | None = None
        self._stale = False
        self._base: Tracking | None = None
        self._refused_before: int | None = None
        self._nis: deque[tuple[float, float]] = deque()

    def take(self, telemetry: Telemetry) -> None:
        """Take a message; kinds that say nothing of the pose are left aside."""
        if isinstance(telemetry, Tracking):
            self._take_tracking(telemetry)
        elif isinstance(telemetry, Control):
            self._take_control(telemetry)
        elif isinstance(telemetry, Status):
            self._stale = _STALE in telemetry.faults

    def quality(self) -> PoseQuality | None:
        """Return how good the pose is, None before the robot has told it."""
        tracking = self._tracking
        if tracking is None:
            return None
        position, heading = half_axis_m(tracking), HEADING_SIGMAS * tracking.pose_sd[2]
        mean = self._nis_mean()
        return PoseQuality(
            verdict=self._verdict(position + heading, mean),
            position_m=position,
            heading_rad=heading,
            fix_age_s=self._age_s if self._age_s > 0.0 else None,
            refused=self._refused(),
            drift=self._drift(tracking),
            nis_mean=mean,
            nis_count=len(self._nis),
            wheel_noise=0.0 if self._control is None else self._control.wheel_noise,
        )

    @property
    def _age_s(self) -> float:
        return 0.0 if self._control is None else self._control.fix_age_s

    def _verdict(self, size: float, nis_mean: float | None) -> Verdict:
        if not math.isfinite(size) or size == 0.0:
            return Verdict.UNKNOWN
        used = 1 if self._control is None else self._control.fixes_accepted
        if self._age_s < 0.0 or (self._age_s == 0.0 and not used):
            return Verdict.NO_FIXES
        if self._stale and not 0.0 < self._age_s < _FRESH_S:
            return Verdict.DRIFTING
        noisy = self._control is not None and self._control.wheel_noise >= NOISE_MOST
        contradicted = noisy or (nis_mean is not None and nis_mean > NIS_MOST)
        return Verdict.CONTRADICTED if contradicted else Verdict.GOOD

    def _take_tracking(self, new: Tracking) -> None:
        old, self._tracking = self._tracking, new
        # Only a fix or a set pose makes the heading surer.
        if old is None or new.time_s < old.time_s or new.pose_sd[2] < old.pose_sd[2]:
            self._base = new

    def _drift(self, now: Tracking) -> tuple[float, float] | None:
        base = self._base
        if base is None or now.time_s - base.time_s < _DRIFT_S:
            return None
        grown = half_axis_m(now) - half_axis_m(base), HEADING_SIGMAS * (now.pose_sd[2] - base.pose_sd[2])
        if not all(math.isfinite(part) for part in grown):
            return None
        metres, radians = (max(0.0, part / (now.time_s - base.time_s)) for part in grown)
        return metres, radians

    def _take_control(self, new: Control) -> None:
        old, self._control = self._control, new
        if old is None or _looked_at(new) < _looked_at(old) or new.time_s < old.time_s:  # begun anew
            self._nis.clear()
            self._refused_before = 0 if new.fixes_accepted == 0 else new.fixes_refused
        elif _looked_at(new) > _looked_at(old):
            self._nis.append((new.time_s, min(new.nis, NIS_CUT)))
            if new.fixes_accepted > old.fixes_accepted:
                self._refused_before = new.fixes_refused
        while self._nis and new.time_s - self._nis[0][0] > WINDOW_S:
            self._nis.popleft()

    def _refused(self) -> int:
        if self._control is None or self._refused_before is None:
            return 0
        return self._control.fixes_refused - self._refused_before

    def _nis_mean(self) -> float | None:
        seen = tuple(self._nis)  # another thread may append
        if len(seen) < LEAST_FIXES or seen[-1][0] - seen[0][0] < LEAST_S:
            return None
        return math.fsum(nis for _, nis in seen) / len(seen)


def _looked_at(control: Control) -> int:
    return control.fixes_accepted + control.fixes_refused


def _seconds(value: float) -> str:
    return f"{value:.0f} s" if value >= 2.0 else f"{value:.1f} s"


def _metres(value: float) -> str:
    return f"{_two_digits(value)} m" if value >= 0.9995 else f"{_two_digits(1e3 * value)} mm"


def _degrees(value: float) -> str:
    return f"{_two_digits(math.degrees(value))}°"


def _two_digits(value: float) -> str:
    """Write a number of two significant digits or more, without an exponent."""
    if not math.isfinite(value) or value < 0.005:
        return f"{value:.0f}"
    return f"{value:.{max(0, 1 - math.floor(math.log10(value)))}f}"
