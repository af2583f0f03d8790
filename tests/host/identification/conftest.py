# SPDX-License-Identifier: MIT
"""Simulated robots with known truth, and runs of the model itself."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from hil_sim.known_robot import SimulatedRobot
from omniwheel.identification import excitation
from omniwheel.identification.dataset import Dataset
from omniwheel.identification.model import Layout, Model, layout_of
from omniwheel.robots import read_robot

Array = NDArray[np.float64]
TRUE = np.array([3.6, 0.13, 0.042, 0.03, 0.002, 0.03])
SHORT_S = 14.0


@pytest.fixture(scope="session")
def layout() -> Layout:
    return layout_of(read_robot("three_wheel"))


@pytest.fixture(scope="session")
def simulated() -> SimulatedRobot:
    """A robot on ideal wheels, which is what the identification's model describes."""
    return SimulatedRobot.random(read_robot("three_wheel"), 11).on_ideal_wheels()


@pytest.fixture(scope="session")
def runs(simulated: SimulatedRobot, layout: Layout) -> list[Dataset]:
    profiles = excitation.appendix_d(layout.angle_rad, SHORT_S)
    return [simulated.run(name, duty, run=i) for i, (name, duty) in enumerate(profiles.items())]


@pytest.fixture(scope="session")
def stand(simulated: SimulatedRobot) -> Dataset:
    return simulated.run("stand", excitation.stand_steps(3), run=4, on_stand=True)


def model_run(
    layout: Layout, duty: Array, *, noise_rad: float = 0.0, supply_V: float = 12.0, values: Array = TRUE
) -> Dataset:
    """Return a run that the floor model itself drove; ``noise_rad`` is the encoder's."""
    rows = len(duty)
    dt = np.full((1, rows), excitation.PERIOD_S)
    voltage = supply_V * duty
    mean, _ = Model.floor(layout).simulate(values[None], dt, voltage[None], np.zeros((1, 3)))
    angle = np.vstack((np.zeros(duty.shape[1]), np.cumsum(mean[0, 0] * excitation.PERIOD_S, axis=0)))
    angle += noise_rad * np.random.default_rng(5).standard_normal(angle.shape)
    time_s = np.arange(rows + 1, dtype=np.float64) * excitation.PERIOD_S
    return Dataset(
        "model",
        time_s,
        np.gradient(angle, time_s, axis=0),
        np.vstack((voltage, voltage[-1:])),
        np.zeros(0),
        np.zeros((0, 3)),
        wheel_angle_rad=angle,
        supply_V=np.full(rows + 1, supply_V),
    )
