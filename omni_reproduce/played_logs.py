# SPDX-License-Identifier: MIT
"""A real log's duties played to a simulated world, and what that robot would have logged of it.

The duties go through the motors' curve into the voltages at which linear motors are as fast, and these onto the
windings, open loop. Each row of the log then has what such a robot's sensors show. A wheel's speed is the difference of
an analogue angle over one millisecond, in counts. The IMU's heading is rounded, and its accelerometer is the mean over
the row.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hil_sim.mujoco_world import MujocoWorld
from hil_sim.runs import new_world
from hil_sim.scenario import Scenario
from hil_sim.world import GRAVITY_M_S2
from omni_reproduce.ripple import Piece
from omniwheel.logs.log import Truth, WheelLog

Array = NDArray[np.float64]
TICK_S = 1e-3


@dataclass(frozen=True)
class Signals:
    """What is compared, a row per row of a log: acceleration (n, 2) [m/s^2], turn rate (n,) [rad/s], wheels (n, w).

    ``wheel_rad_s`` is as it was logged [rad/s]. ``pieces`` are the rows in which a wheel turns steadily.
    """

    period_s: float
    acceleration: Array
    turn_rate: Array
    wheel_rad_s: Array
    pieces: tuple[Piece, ...]


@dataclass(frozen=True)
class Played:
    """A world's run: a row per millisecond. Poses (t, 3), wheel angles (t, w) [rad], acceleration (t, 2) [m/s^2]."""

    pose: Array
    angle: Array
    acceleration: Array

    def after(self, lead_s: float) -> Played:
        """Return what comes after a lead, with wheel angles that begin at 0 there."""
        first = round(lead_s / TICK_S)
        return Played(self.pose[first:], self.angle[first:] - self.angle[first], self.acceleration[first:])


class OurRobot:
    """Our own world, with an accelerometer at the height of the axles, as MuJoCo's model has it."""

    def __init__(self, scenario: Scenario) -> None:
        """Make the scenario's world."""
        self._world = new_world(scenario)
        config = self._world.c.config
        self._above_m = float(config.wheel_radius_m[0]) - float(config.centre_of_mass_height_m)
        self._before = self._speeds()

    def step(self, volts: Array) -> None:
        """Go on by 1 ms with these voltages on the windings."""
        self._before = self._speeds()
        self._world.drive_voltage(volts)
        self._world.step()

    @property
    def pose(self) -> Array:
        """True pose x, y [m], theta [rad]."""
        return self._world.truth

    @property
    def wheel_rad_s(self) -> Array:
        """True wheel speeds [rad/s]."""
        return self._world.wheel_rad_s

    @property
    def acceleration(self) -> Array:
        """Acceleration less gravity along the body's x and y, over the last step [m/s^2].

        The body's roll and pitch move the sensor, which is not at the centre of mass, and tilt it.
        """
        change = (self._speeds() - self._before) / TICK_S
        theta = self._world.truth[2]
        cosine, sine = np.cos(theta), np.sin(theta)
        rise = self._world.c.rise
        return np.array(
            [
                cosine * change[0] + sine * change[1] + self._above_m * change[3] - GRAVITY_M_S2 * float(rise[2]),
                -sine * change[0] + cosine * change[1] - self._above_m * change[2] + GRAVITY_M_S2 * float(rise[1]),
            ]
        )

    def _speeds(self) -> Array:
        return np.concatenate((self._world.twist[:2], list(self._world.c.rise_rate)[1:]))


class MujocoRobot:
    """The same robot in MuJoCo."""

    def __init__(self, scenario: Scenario) -> None:
        """Make the scenario's world. Raises ExternalWorldInputError without the package ``mujoco``."""
        self._world = MujocoWorld(scenario)
        self._supply_V = float(scenario.robot.motor["supply_V"])

    def step(self, volts: Array) -> None:
        """Go on by 1 ms with these voltages on the windings."""
        self._world.apply(tuple(volts / self._supply_V), (0.0,) * len(volts))
        self._world.step()

    @property
    def pose(self) -> Array:
        """True pose x, y [m], theta [rad]."""
        return np.array(self._world.pose)

    @property
    def wheel_rad_s(self) -> Array:
        """True wheel speeds [rad/s]."""
        return np.array(self._world.sense().wheel_rad_s)

    @property
    def acceleration(self) -> Array:
        """What the accelerometer shows along the body's x and y [m/s^2]."""
        return np.array(self._world.accelerometer_m_s2[:2])


def play(robot: OurRobot | MujocoRobot, volts: Array, period_s: float) -> Played:
    """Play voltages (n, wheels) [V], each held for a period, from rest."""
    ticks = round(period_s / TICK_S)
    poses, accelerations = [robot.pose], []
    angles = [np.zeros(volts.shape[1])]
    for row in volts:
        for _ in range(ticks):
            before = robot.wheel_rad_s
            robot.step(row)
            angles.append(angles[-1] + 0.5 * TICK_S * (before + robot.wheel_rad_s))
            poses.append(robot.pose)
            accelerations.append(robot.acceleration)
    return Played(np.array(poses), np.array(angles), np.array(accelerations))


def rounded(values: Array, step: float) -> Array:
    """Return values as a sensor with this step shows them."""
    return np.asarray(step * np.floor(values / step + 0.5))


def logged(played: Played, log: WheelLog, heading_step_rad: float) -> tuple[WheelLog, Signals]:
    """Return a run as a log whose counts add up, and the signals as the real robot would have logged them.

    A row has what was measured at its end; ``log`` says how many rows there are, and how long and how fine they are.
    The signals have no pieces yet.
    """
    ticks = round(log.period_s / TICK_S)
    ends = np.arange(1, len(log.time_s) + 1) * ticks
    starts = np.concatenate(([0], ends))
    edges = np.floor(played.angle / log.rad_per_count)
    heading = rounded(played.pose[starts, 2] - played.pose[0, 2], heading_step_rad)
    time_s = log.period_s * np.arange(1, len(ends) + 1, dtype=np.float64)
    rows = WheelLog(
        name=log.name,
        period_s=log.period_s,
        counts_per_revolution=log.counts_per_revolution,
        time_s=time_s,
        counts=np.diff(edges[starts], axis=0),
        good=np.ones_like(log.good),
        duty=log.duty,
        heading_rad=heading[1:],
        truth=Truth(time_s, played.pose[ends, :2], played.pose[ends, 2], same_clock=True),
    )
    signals = Signals(
        period_s=log.period_s,
        acceleration=played.acceleration.reshape(len(ends), ticks, 2).mean(axis=1),
        turn_rate=np.diff(heading) / log.period_s,
        wheel_rad_s=(edges[ends] - edges[ends - 1]) * log.rad_per_count / TICK_S,
        pieces=(),
    )
    return rows, signals
