# SPDX-License-Identifier: MIT
"""A simulator of somebody else: a three-wheeled robot in plain Python that knows nothing of the package's models.

Wheels follow their motors with a time constant and roll without slip.
"""

from __future__ import annotations

import math
from typing import Any

from hil_sim.external import Fix, Sensed

STEP_s = 1e-3
SUPPLY_V = 12.0
FIX_TICKS = 20


class TinyWorld:
    """The robot ``three_wheel``: speeds of its motors are proportional to the voltage, with a lag."""

    fixes = True

    def __init__(self, scenario: Any) -> None:
        robot = scenario.robot
        self.x, self.y, self.theta = scenario.start_pose
        self.bearings = [math.radians(angle) for angle in robot.geometry["wheel_angle_deg"]]
        self.radius = robot.geometry["wheel_radius_m"]
        self.distance = robot.geometry["wheel_distance_m"]
        self.counts_per_rad = robot.encoder["counts_per_revolution"] / (2.0 * math.pi)
        motor = robot.motor
        constant, resistance = motor["constant_N_m_A"], motor["resistance_ohm"]
        drag = motor["viscous_friction_N_m_s"] + constant**2 / resistance
        self.speed_per_volt = constant / resistance / drag
        self.lag_s = 3.0 * motor["inertia_kg_m2"] / drag  # the body's mass counts, too
        self.speeds = [0.0] * len(self.bearings)
        self.angles = [0.0] * len(self.bearings)
        self.duty: tuple[float, ...] = (0.0,) * len(self.bearings)
        self.ticks = 0
        self.calls: list[str] = []

    def sense(self) -> Sensed:
        """Return encoders, battery, truth, and at 50 Hz what a camera sees."""
        self.calls.append("sense")
        fix = (
            Fix(self.ticks * STEP_s, self.x, self.y, self.theta) if self.fixes and self.ticks % FIX_TICKS == 0 else None
        )
        counts = [math.floor(angle * self.counts_per_rad) for angle in self.angles]
        return Sensed(counts, SUPPLY_V, (self.x, self.y, self.theta), fix, wheel_rad_s=self.speeds)

    def apply(self, duty: tuple[float, ...], coast: tuple[float, ...]) -> None:
        """Take the duties; a wheel that coasts rolls out as if its motor were shorted."""
        self.calls.append("apply")
        self.duty = tuple(0.0 if open_ == 1.0 else share for share, open_ in zip(duty, coast, strict=True))

    def step(self) -> None:
        """Go on by 1 ms."""
        self.calls.append("step")
        self.ticks += 1
        for i, duty in enumerate(self.duty):
            wanted = self.speed_per_volt * duty * SUPPLY_V
            self.speeds[i] += (wanted - self.speeds[i]) * STEP_s / self.lag_s
            self.angles[i] += self.speeds[i] * STEP_s
        self._roll()

    def _roll(self) -> None:
        """Three wheels at equal angles: each rolls along its own tangent."""
        rims = [self.radius * speed for speed in self.speeds]
        forward = 2.0 / 3.0 * sum(-math.sin(a) * rim for a, rim in zip(self.bearings, rims, strict=True))
        left = 2.0 / 3.0 * sum(math.cos(a) * rim for a, rim in zip(self.bearings, rims, strict=True))
        turn = sum(rims) / (3.0 * self.distance)
        heading = self.theta + 0.5 * turn * STEP_s
        self.x += (forward * math.cos(heading) - left * math.sin(heading)) * STEP_s
        self.y += (forward * math.sin(heading) + left * math.cos(heading)) * STEP_s
        self.theta += turn * STEP_s
