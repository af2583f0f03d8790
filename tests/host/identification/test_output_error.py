# SPDX-License-Identifier: MIT
"""What output error recovers, how sure it says it is, and what it refuses."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from hil_sim.known_robot import SimulatedRobot
from omniwheel.errors import IdentificationError
from omniwheel.identification import excitation, output_error
from omniwheel.identification.dataset import Dataset
from omniwheel.identification.diagnostics import diagnose
from omniwheel.identification.model import Layout, Model
from omniwheel.identification.output_error import Fit, evaluate, identify
from tests.host.identification.conftest import SHORT_S, TRUE, Array, model_run

ENCODER_rad = 2.0 * np.pi / 10000.0


def profiles(layout: Layout) -> list[Array]:
    return list(excitation.appendix_d(layout.angle_rad, SHORT_S).values())


@pytest.fixture(scope="module")
def driven(layout: Layout) -> list[Dataset]:
    """Runs of the model itself, with an encoder's noise."""
    return [model_run(layout, duty, noise_rad=0.3 * ENCODER_rad) for duty in profiles(layout)]


@pytest.fixture(scope="module")
def found_of_runs(runs: list[Dataset], layout: Layout) -> Fit:
    return identify(runs, Model.floor(layout))


@pytest.mark.full
def test_runs_of_the_model_itself_give_its_parameters_back(driven: list[Dataset], layout: Layout) -> None:
    found = identify(driven, Model.floor(layout))
    np.testing.assert_allclose(found.estimate.values[:4], TRUE[:4], rtol=2e-3)
    assert found.estimate["drag_xy_V_s"] == pytest.approx(TRUE[4], abs=2e-4)
    assert found.fit > 0.9999


def test_intervals_hold_the_truth_of_simulated_robots(simulated: SimulatedRobot, found_of_runs: Fit) -> None:
    """One of five parameters may lie outside its 95 % interval; the share over 100 robots is Table 9's experiment."""
    found, truth = found_of_runs.estimate, simulated.true_values()
    inside = [found.covers(name, truth[name]) for name in found.names]
    assert sum(inside) >= 4
    for name in found.names[:4]:
        assert found.half_width(name) < 0.1 * truth[name]


@pytest.mark.full
def test_noise_of_the_supply_does_not_swell_the_inertia(driven: list[Dataset], layout: Layout) -> None:
    """Plain output error overestimates inertia by several of its own intervals here."""
    draw = np.random.default_rng(3)
    noisy = []
    for run in driven:
        supply = 12.0 + 0.15 * draw.standard_normal(len(run.time_s))
        noisy.append(replace(run, voltage_V=run.voltage_V * supply[:, None] / 12.0, supply_V=supply))
    with_instrument = identify(noisy, Model.floor(layout)).estimate
    without = identify([replace(run, supply_V=None) for run in noisy], Model.floor(layout)).estimate
    assert with_instrument.covers("inertia_xy_V_s2", TRUE[2])
    assert without["inertia_xy_V_s2"] > TRUE[2] + 2.0 * without.half_width("inertia_xy_V_s2")


def test_a_run_that_was_not_fitted_is_predicted(simulated: SimulatedRobot, found_of_runs: Fit, layout: Layout) -> None:
    other = simulated.run("validation", excitation.validation(layout.angle_rad), run=9)
    assert evaluate([other], Model.floor(layout), found_of_runs.estimate).fit > 0.995


def test_quantised_encoders_leave_a_residual_of_their_own(found_of_runs: Fit) -> None:
    found = diagnose(found_of_runs)
    assert found.rmse_rad_s == pytest.approx(ENCODER_rad / np.sqrt(6.0) / excitation.PERIOD_S, rel=0.1)
    assert found.correlation == pytest.approx(-0.5, abs=0.1)
    assert any("not white" in remark for remark in found.remarks())


@pytest.mark.full
def test_unknown_speeds_and_gaps_are_left_out(driven: list[Dataset], layout: Layout) -> None:
    damaged = []
    for run in driven:
        assert run.wheel_angle_rad is not None
        keep = np.ones(len(run.time_s), dtype=bool)
        keep[300:340] = False
        damaged.append(
            replace(
                run,
                time_s=run.time_s[keep],
                wheel_rad_s=run.wheel_rad_s[keep],
                voltage_V=run.voltage_V[keep],
                wheel_angle_rad=run.wheel_angle_rad[keep],
                supply_V=None,
            )
        )
    found = identify(damaged, Model.floor(layout))
    np.testing.assert_allclose(found.estimate.values[:4], TRUE[:4], rtol=5e-3)


@pytest.mark.full
@pytest.mark.parametrize(
    ("kept", "says"), [(slice(0, 2), "rotation is not excited"), (slice(2, 4), "translation is not")]
)
def test_a_direction_that_was_not_driven_is_named(
    driven: list[Dataset], layout: Layout, kept: slice, says: str
) -> None:
    with pytest.raises(IdentificationError, match=says) as caught:
        identify(driven[kept], Model.floor(layout))
    assert caught.value.hint


@pytest.mark.full
def test_full_duty_is_refused(layout: Layout) -> None:
    runs = [model_run(layout, np.sign(duty) * (np.abs(duty) > 0.05)) for duty in profiles(layout)]
    with pytest.raises(IdentificationError, match="full duty"):
        identify(runs, Model.floor(layout))


@pytest.mark.full
def test_some_full_duty_is_left_out_and_told(layout: Layout) -> None:
    runs = [model_run(layout, np.clip(1.75 * duty, -1.0, 1.0)) for duty in profiles(layout)]
    found = identify(runs, Model.floor(layout))
    np.testing.assert_allclose(found.estimate.values[:4], TRUE[:4], rtol=5e-3)
    assert any("full duty" in remark for remark in diagnose(found).remarks())


def test_standing_still_and_too_little_are_refused(layout: Layout) -> None:
    for duty in (np.zeros((500, 3)), profiles(layout)[0][:60]):
        with pytest.raises(IdentificationError, match=r"turn for .* s in all"):
            identify([model_run(layout, duty)], Model.floor(layout))
    with pytest.raises(IdentificationError, match="no run"):
        identify([], Model.floor(layout))


def test_wrong_directions_are_refused(driven: list[Dataset], layout: Layout) -> None:
    with pytest.raises(IdentificationError, match="more voltage does not mean more speed"):
        identify([replace(run, voltage_V=-run.voltage_V) for run in driven], Model.floor(layout))


@pytest.mark.full
def test_steps_that_do_not_settle_give_no_estimate(
    driven: list[Dataset], layout: Layout, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(output_error, "SETTLED", 0.0)
    monkeypatch.setattr(output_error, "IV_STEPS_MAX", 2)
    with pytest.raises(IdentificationError, match="did not converge"):
        identify(driven, Model.floor(layout))


@pytest.mark.full
def test_what_an_encoder_rounds_is_not_held_against_the_model(layout: Layout) -> None:
    """The model is right about these robots. With 200 counts per turn a fifth of what they show is rounding."""
    count_rad = 2.0 * np.pi / 200.0
    runs = [model_run(layout, duty, noise_rad=0.0) for duty in profiles(layout)]
    coarse = [
        replace(run, wheel_angle_rad=count_rad * np.round(np.asarray(run.wheel_angle_rad) / count_rad)) for run in runs
    ]
    plain = identify(coarse, Model.floor(layout))
    known = identify(coarse, Model.floor(layout), count_rad=count_rad)
    assert plain.rounding_share == 0.0
    assert plain.fit < 0.9
    assert known.fit > 0.98
    assert known.rounding_share == pytest.approx(1.0 - plain.fit, rel=0.2)
