# SPDX-License-Identifier: MIT
"""The peers of the filter study compute the same model as ours, step for step and on average."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import numpy.typing as npt
import pytest

from bench import octave
from bench.filter_model import Array, FilterModel, FilterRun, filter_model, study_normals
from bench.peers import filter_study_batched, filter_study_filterpy, filter_study_numpy
from omni_reproduce.experiment import read_spec
from omni_reproduce.filters import Setting, Study, read_setting, run_seeds, shortened

pytestmark = pytest.mark.reference

SEED = 3
STEPS = 250
SETTINGS = ("published", "honest_b")


def setting(name: str, steps: int = STEPS) -> Setting:
    case = read_setting(read_spec("table7"), name)
    return shortened(case, steps * case.step_s)


def by_octave(model: FilterModel, normals: Array) -> FilterRun:
    return octave.run(model, len(normals), normals)[0]


def same_heading(angle: npt.NDArray[np.float64], like: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    """Return angles plus the whole turns that bring them next to others."""
    return angle + 2.0 * np.pi * np.rint((like - angle) / (2.0 * np.pi))


@pytest.mark.parametrize("name", SETTINGS)
@pytest.mark.parametrize(
    "run",
    [
        filter_study_numpy.run,
        filter_study_filterpy.run,
        pytest.param(by_octave, marks=pytest.mark.needs("octave")),
    ],
)
def test_a_peer_with_our_noise_goes_our_way(name: str, run: Callable[[FilterModel, Array], FilterRun]) -> None:
    case = setting(name)
    ours = Study(case).samples(SEED)
    theirs = run(filter_model(case), study_normals(SEED, STEPS))
    assert theirs.truth is not None
    assert theirs.estimates is not None
    np.testing.assert_allclose(theirs.truth, ours["truth"], atol=2e-5)
    estimates = theirs.estimates
    estimates[..., 2] = same_heading(estimates[..., 2], ours["estimate"][..., 2])
    np.testing.assert_allclose(estimates, ours["estimate"], atol=2e-5)


@pytest.mark.full
@pytest.mark.parametrize("name", SETTINGS)
def test_batched_runs_have_our_rms_errors_on_average(name: str) -> None:
    case, runs, our_runs = setting(name, 400), 200, 2000
    ours = run_seeds(case, range(1, our_runs + 1), 2, lambda _: None)["rmse"]
    theirs = filter_study_batched.run(filter_model(case), runs, 400, SEED)
    mean_square = (ours**2).mean(axis=0)
    error = (ours**2).std(axis=0) * np.sqrt(1.0 / runs + 1.0 / our_runs)
    assert np.all(np.abs(theirs.rmse**2 - mean_square) < 4.5 * error)


def test_a_setting_that_the_peers_do_not_know_is_refused() -> None:
    with pytest.raises(ValueError, match="fix made of the estimate"):
        filter_model(setting("own"))
