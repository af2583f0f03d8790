# SPDX-License-Identifier: MIT
"""What may be varied, how a user writes it, and which points come of it."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from hil_sim.scenario import load_scenario
from hil_sim.studies import space
from hil_sim.studies.errors import StudyInputError
from hil_sim.studies.space import grid, parse_axes, parse_axis, sobol
from omniwheel.errors import MissingPackageError
from omniwheel.robots import parameter_table

TABLE = parameter_table()
BAD = {
    "": "not a range",
    "ISMC_LAM_XY": "not a range",
    "ISMC_LAM_XY=": "not a range",
    "ISMC_LAM_XY=1:2:3:4": "not a range",
    "ISMC_LAM_XY=8:2": "not below",
    "ISMC_LAM_XY=2:2": "not below",
    "ISMC_LAM_XY=1:1e9": "allowed is",
    "ISMC_LAM_XY=nan:2": "finite",
    "world.wheel_friction=0.5:1": "one number per wheel",
    "ISMC_LAM_XY=a:b": "allowed is",
    "ISMC_LAM_XY=1:2:1": "number of points",
    "ISMC_LAM_XY=1:2:x": "number of points",
    "ISMC_LAM_XY=0:2:log": "above 0",
    "ISMC_LAM_XYZ=1:2": "did you mean ISMC_LAM_XY",
    "CTL_MODE=0:3": "choice",
    "CTL_MODE=pid,nonsense": "allowed is",
    "CTL_MODE=ismc,ismc": "duplicate",
    "world.slip_mux=0:0.1": "did you mean slip_max",
    "world.slip_max=0:5": "must be",
}


@pytest.mark.parametrize("word", BAD)
def test_what_cannot_be_varied_says_why(word: str) -> None:
    with pytest.raises(StudyInputError, match=BAD[word]):
        parse_axis(word, TABLE)


def test_axes_are_needed_and_once_each() -> None:
    for words in ([], ["ISMC_LAM_XY=1:2", "ismc_lam_xy=3:4"]):
        with pytest.raises(StudyInputError):
            parse_axes(words, TABLE)


def test_a_grid_is_every_combination_with_its_ends() -> None:
    scenario = load_scenario("demo")
    axes = parse_axes(["ISMC_LAM_XY=1:16:5", "CTL_MODE=pid,ismc", "world.slip_max=0:0.2:2"], TABLE)
    points = grid(axes, scenario)
    assert len(points) == 20
    assert {point.values["ISMC_LAM_XY"] for point in points} == {1.0, 4.75, 8.5, 12.25, 16.0}
    applied = points[-1].applied()
    assert applied.world["slip_max"] == 0.2
    assert applied.parameter_values()["CTL_MODE"] == TABLE["CTL_MODE"].values["ismc"]
    assert applied.parameter_values()["ISMC_LAM_XY"] == 16.0
    with pytest.raises(StudyInputError, match="too large"):
        grid(parse_axes(["ISMC_LAM_XY=1:16:1000", "ISMC_LAM_TH=1:16:1000"], TABLE), scenario)


def test_values_are_shown_with_names_and_units() -> None:
    mode, gain = parse_axes(["CTL_MODE=pid,ismc", "ISMC_LAM_XY=1:16"], TABLE)
    assert [mode.show(value) for value in mode.values] == ["pid", "ismc"]
    assert (mode.heading, gain.heading) == ("CTL_MODE", "ISMC_LAM_XY [1/s]")
    assert gain.show(4.75) == "4.75"


def test_whole_numbers_stay_whole_and_ratios_are_equal() -> None:
    assert parse_axis("TRJ_PETALS=3:8:20", TABLE).values == (3.0, 4.0, 5.0, 6.0, 7.0, 8.0)
    values = np.array(parse_axis("ISMC_LAM_XY=1:16:log", TABLE).values)
    assert values == pytest.approx([1.0, 2.0, 4.0, 8.0, 16.0], rel=1e-6)


def test_sobols_points_fill_the_ranges_evenly_and_again_the_same() -> None:
    scenario = load_scenario("demo")
    axes = parse_axes(["ISMC_LAM_XY=2:10", "TRJ_PETALS=3:6", "CTL_MODE=pid,ismc"], TABLE)
    points = sobol(axes, scenario, 64, 7)
    first = np.array([point.values["ISMC_LAM_XY"] for point in points])
    assert np.histogram(first, bins=8, range=(2.0, 10.0))[0].tolist() == [8] * 8
    petals = [point.values["TRJ_PETALS"] for point in points]
    assert [petals.count(value) for value in (3.0, 4.0, 5.0, 6.0)] == [16] * 4
    assert [point.values for point in sobol(axes, scenario, 64, 7)] == [point.values for point in points]
    assert sobol(axes, scenario, 64, 8)[0].values != points[0].values
    assert len(sobol(axes, scenario, 5, 7)) == 5


def test_without_scipy_it_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(name: str) -> Any:
        raise ImportError(name)

    monkeypatch.setattr(space, "import_module", refuse)
    with pytest.raises(MissingPackageError) as caught:
        sobol(parse_axes(["ISMC_LAM_XY=1:2"], TABLE), load_scenario("demo"), 4, 1)
    assert "omniwheel[study]" in caught.value.hint
