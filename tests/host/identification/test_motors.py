# SPDX-License-Identifier: MIT
"""Steps on a stand, and the way from volts and seconds to newtons and kilograms."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from hil_sim.known_robot import SimulatedRobot
from omniwheel.errors import IdentificationError
from omniwheel.identification.dataset import Dataset
from omniwheel.identification.estimate import Estimate
from omniwheel.identification.model import FLOOR, STAND, Layout
from omniwheel.identification.motor_steps import deadband, identify_motors
from omniwheel.identification.physical import Known, physical


def exact(names: tuple[str, ...], truth: dict[str, float]) -> Estimate:
    values = np.array([truth[name] for name in names])
    return Estimate(names, values, np.diag((1e-3 * values) ** 2), 100.0)


def test_steps_show_gain_friction_and_inertia(simulated: SimulatedRobot, stand: Dataset) -> None:
    found, truth = identify_motors(stand), simulated.true_values()
    for fit in (found.together, *found.each):
        assert fit.estimate["speed_gain_V_s"] == pytest.approx(truth["speed_gain_V_s"], rel=2e-3)
        assert fit.estimate["coulomb_V"] == pytest.approx(truth["coulomb_V"], rel=0.05)
        assert fit.estimate["inertia_V_s2"] == pytest.approx(truth["inertia_V_s2"], rel=0.08)
    assert len(found.deadbands) == 6
    for band in found.deadbands:
        assert band.still_V < band.moving_V <= truth["coulomb_V"] + 0.25


def test_a_motor_that_never_turns_is_named(stand: Dataset) -> None:
    assert stand.wheel_angle_rad is not None
    stuck = replace(stand, wheel_angle_rad=stand.wheel_angle_rad * [1.0, 0.0, 1.0])
    with pytest.raises(IdentificationError, match="wheel 2 never turns forwards"):
        deadband(stuck, 1, 1)


def test_mass_and_resistance_give_everything_else(simulated: SimulatedRobot, layout: Layout) -> None:
    """With the layout's own radius and distance the conversion is exact."""
    plain = replace(simulated, radius_scale=(), distance_scale=1.0)
    truth = plain.true_values()
    known = Known(truth["mass_kg"], truth["motor_resistance_ohm"], 0.0014)
    found = physical(exact(FLOOR, truth), layout, known, exact(STAND, truth))
    for name in found.names:
        assert found[name] == pytest.approx(truth[name], rel=2e-3), name
        assert 0.0 < found.sd(name) < truth[name]


def test_a_known_motor_constant_stands_in_for_the_stand(simulated: SimulatedRobot, layout: Layout) -> None:
    truth = replace(simulated, radius_scale=(), distance_scale=1.0).true_values()
    known = Known(truth["mass_kg"], truth["motor_resistance_ohm"], 0.0014, truth["motor_constant_N_m_A"])
    found = physical(exact(FLOOR, truth), layout, known)
    for name in found.names:
        assert found[name] == pytest.approx(truth[name], rel=2e-3), name


def test_what_cannot_be_is_refused(simulated: SimulatedRobot, layout: Layout) -> None:
    truth = simulated.true_values()
    floor = exact(FLOOR, truth)
    with pytest.raises(IdentificationError, match="motor constant cannot be identified"):
        physical(floor, layout, Known(3.5, 2.7, 0.0014))
    with pytest.raises(IdentificationError, match="implies negative friction"):
        physical(floor, layout, Known(3.5, 2.7, 0.0014, 2.0 * truth["speed_gain_V_s"]))
    for bad in (0.0, -1.0, float("nan"), float("inf")):
        with pytest.raises(IdentificationError, match="mass_kg"):
            Known(bad, 2.7, 0.0014)
