# SPDX-License-Identifier: MIT
"""A simulated stream for those without cameras: a path seen at a rate, with noise, latency and drop-outs."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from omniwheel.errors import MocapSourceError
from omniwheel.frames import Pose
from omniwheel.mocap.source import MocapPose

CIRCLE_M = 0.5
LAP_S = 60.0


@dataclass(frozen=True)
class Cameras:
    """A motion-capture system: rate [Hz], noise [m, rad], latency [s] and share of frames in which it sees nothing."""

    rate_Hz: float = 50.0
    sd_xy_m: float = 0.001
    sd_theta_rad: float = 0.003
    latency_s: float = 0.01
    drop_probability: float = 0.0

    def __post_init__(self) -> None:
        numbers = (self.sd_xy_m, self.sd_theta_rad, self.latency_s)
        good = 0.0 < self.rate_Hz <= 1e4 and all(0.0 <= number < 10.0 for number in numbers)
        if not (good and 0.0 <= self.drop_probability <= 1.0):
            hint = "the rate must be above 0 Hz, the rest 0 or above, the share of drop-outs at most 1"
            raise MocapSourceError(f"{self} cannot be simulated", hint=hint)


def circle(time_s: float) -> Pose:
    """Return where a robot is that drives a circle of 0.5 m around the origin in 60 s, looking ahead."""
    angle = math.tau * time_s / LAP_S
    return Pose(CIRCLE_M * math.cos(angle), CIRCLE_M * math.sin(angle), math.remainder(angle + math.pi / 2, math.tau))


class SimulatedSource:
    """Sees ``path(seconds since the start)`` as cameras would. Frame n is a function of the seed and n alone."""

    def __init__(
        self,
        path: Callable[[float], Pose] = circle,
        *,
        cameras: Cameras = Cameras(),
        seed: int = 1,
        clock: Callable[[], float] = time.monotonic,
        sleep: Callable[[float], None] = time.sleep,
    ) -> None:
        self.name = "simulated"
        self._path = path
        self._cameras = cameras
        self._seed = seed
        self._clock = clock
        self._sleep = sleep
        self._start_s = clock()
        self._frame = 0

    def clock(self) -> float:
        """Return the present time [s]."""
        return self._clock()

    @property
    def ended(self) -> bool:
        """Never."""
        return False

    def read(self, timeout_s: float) -> MocapPose | None:
        """Return the next frame that is seen, waiting for it."""
        end_s = self._clock() + timeout_s
        while True:
            taken_s = self._start_s + self._frame / self._cameras.rate_Hz
            arrived_s = taken_s + self._cameras.latency_s
            left_s = arrived_s - self._clock()
            if arrived_s > end_s:
                self._wait(end_s - self._clock())
                return None
            self._wait(left_s)
            noise = np.random.default_rng((self._seed, self._frame))
            self._frame += 1
            if noise.random() >= self._cameras.drop_probability:
                return MocapPose(self._seen(taken_s, noise), taken_s, arrived_s, self._frame - 1)

    def _wait(self, seconds: float) -> None:
        if seconds > 0.0:
            self._sleep(seconds)

    def _seen(self, taken_s: float, noise: np.random.Generator) -> Pose:
        truth = self._path(taken_s - self._start_s)
        sd = (self._cameras.sd_xy_m, self._cameras.sd_xy_m, self._cameras.sd_theta_rad)
        x, y, theta = (float(value + s * noise.standard_normal()) for value, s in zip(truth, sd, strict=True))
        return Pose(x, y, math.remainder(theta, math.tau))

    def close(self) -> None:
        """Nothing to close."""
