# SPDX-License-Identifier: MIT
"""What differs from run to run: drawn by seed and name, checked before anything runs."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from hil_sim.batch import run_batch
from hil_sim.c_scenario import drawn_world, scenario_world
from hil_sim.dispersion import QUANTITIES, Dispersion, parse_dispersion
from hil_sim.runs import run_in_process
from hil_sim.scenario import Scenario, load_scenario
from hil_sim.schema import WORLD_NUMBERS
from hil_sim.summary import summarize
from omni_schema import SchemaError

MASS = Dispersion("mass_kg", -0.1, 0.3, relative=True)
RADIUS = Dispersion("wheel_radius_m", sd=0.01, relative=True)
START = Dispersion("start_x_m", sd=0.005)


def scenario(*entries: Dispersion) -> Scenario:
    return replace(load_scenario("demo"), dispersion=entries)


def drawn(base: Scenario, name: str, seeds: int) -> np.ndarray[Any, np.dtype[np.float64]]:
    return np.array([drawn_world(base.with_seed(seed))[name] for seed in range(seeds)])


@pytest.mark.full
def test_uniform_deviations_fill_their_interval() -> None:
    base = scenario(MASS)
    middle = scenario_world(load_scenario("demo")).mass_kg
    share = drawn(base, "mass_kg", 2000) / middle - 1.0
    assert share.min() >= -0.1
    assert share.max() < 0.3
    # Kolmogorov-Smirnov, 1 in 1000
    empirical = (np.sort(share) + 0.1) / 0.4
    assert np.max(np.abs(empirical - np.linspace(0.0, 1.0, 2000))) < 1.95 / math.sqrt(2000)


@pytest.mark.full
def test_normal_deviations_have_their_width_and_an_end() -> None:
    start_m = drawn(scenario(START), "start_x_m", 4000) - 0.5
    assert np.max(np.abs(start_m)) <= 3.0 * 0.005
    assert np.mean(start_m) == pytest.approx(0.0, abs=4.0 * 0.005 / math.sqrt(4000))
    # A normal distribution cut at three deviations has 0.9866 of its deviation.
    assert np.std(start_m) == pytest.approx(0.9866 * 0.005, rel=0.05)


def test_each_wheel_is_drawn_by_itself() -> None:
    radii = drawn(scenario(RADIUS), "wheel_radius_m", 300)
    assert radii.shape == (300, 3)
    correlation = np.corrcoef(radii.T)
    assert np.max(np.abs(correlation - np.eye(3))) < 0.25


def test_another_entry_changes_none_of_the_others() -> None:
    alone, together = scenario(MASS), scenario(RADIUS, START, MASS)
    assert drawn(alone, "mass_kg", 5).tolist() == drawn(together, "mass_kg", 5).tolist()
    assert len(set(drawn(alone, "mass_kg", 5))) == 5


def test_a_single_run_replays_a_run_of_a_batch() -> None:
    base = replace(load_scenario("tolerances"), duration_s=3.0)
    rows = run_batch(base, 20, 9).rows
    plain = run_batch(replace(base, dispersion=()), 20, 9).rows
    for number in (0, 4):
        record = run_in_process(base, 20 + number).record
        path = record[(record["phase"] == 2) & (record["state"] == 2)]
        assert rows["peak_wheel_rad_s"][number] == np.abs(path["wheel_rad_s"]).max()
        assert rows["max_position_m"][number] == np.sqrt(
            np.sum((path["truth"] - path["reference"])[:, :2] ** 2, 1).max()
        )
    assert np.all(rows["position_m"] != plain["position_m"])


def test_the_robot_is_told_where_it_was_meant_to_stand() -> None:
    base = replace(scenario(START), duration_s=0.3)
    record = run_in_process(base, 4).record
    assert record["truth"][0, 0] == drawn_world(base.with_seed(4))["start_x_m"] != 0.5
    assert record["estimate"][2, 0] == pytest.approx(0.5, abs=1e-6)


def test_the_summary_says_what_was_drawn() -> None:
    run = run_in_process(replace(scenario(MASS, RADIUS), duration_s=0.3), 2)
    found = summarize(run)["dispersion"]
    assert found["mass_kg"] == scenario_world(run.scenario).mass_kg
    assert len(found["wheel_radius_m"]) == 3


def test_every_number_of_the_world_that_can_differ_is_there() -> None:
    fixed = {
        "output_enable_wired",
        "output_enable_rest_V",
        "pca9685_address",
        "i2c_stranger",
        "rollers_per_row",
        "wheel_rows",
        "gyro_axis",
        "flow_turns",
    }
    assert set(WORLD_NUMBERS) - fixed <= set(QUANTITIES)
    one = scenario_world(scenario(*(Dispersion(name, 1e-4, 2e-4) for name in QUANTITIES)))
    other = scenario_world(load_scenario("demo"))
    for name in set(WORLD_NUMBERS) - fixed - {"coulomb_friction_N_m"}:
        assert getattr(one, name) - getattr(other, name) == pytest.approx(1.5e-4, abs=0.6e-4), name


def test_entries_survive_being_written() -> None:
    entries = load_scenario("tolerances").dispersion
    assert parse_dispersion("x", {entry.quantity: entry.document() for entry in entries}) == entries
    assert len(entries) == 14


def test_extends_merges_tables(tmp_path: Path) -> None:
    path = tmp_path / "mine.toml"
    path.write_text(
        '[scenario]\nname = "mine"\nextends = "tolerances"\n[dispersion]\nmass_kg = { normal = 0.1 }\n',
        encoding="utf-8",
    )
    entries = {entry.quantity: entry for entry in load_scenario(path).dispersion}
    assert entries["mass_kg"] == Dispersion("mass_kg", sd=0.1)
    assert len(entries) == 14


@pytest.mark.parametrize(
    ("name", "entry", "message"),
    [
        ("mas_kg", {"normal": 0.1}, "did you mean mass_kg"),
        ("pca9685_address", {"normal": 0.1}, "cannot differ"),
        ("mass_kg", 0.1, "write { uniform"),
        ("mass_kg", {}, "exactly one"),
        ("mass_kg", {"normal": 0.1, "uniform": [0, 1]}, "exactly one"),
        ("mass_kg", {"normal": 0.0}, "above 0"),
        ("mass_kg", {"normal": "much"}, "normal"),
        ("mass_kg", {"uniform": [1.0]}, "low, high"),
        ("mass_kg", {"uniform": [0.2, 0.1]}, "below the second"),
        ("mass_kg", {"normal": 0.1, "relativ": True}, "relativ"),
        ("mass_kg", {"normal": 0.1, "relative": 1}, "mass_kg.relative"),
    ],
)
def test_mistakes_are_named(name: str, entry: object, message: str) -> None:
    with pytest.raises(SchemaError, match=message) as caught:
        parse_dispersion("file.toml", {name: entry})
    assert "file.toml" in str(caught.value)


def test_what_makes_no_world_is_refused_before_it_is_drawn() -> None:
    bad = scenario(Dispersion("mass_kg", sd=0.34, relative=True))
    with pytest.raises(SchemaError, match=r"dispersion\.mass_kg.*goes too far.*mass_kg is -"):
        run_batch(bad, 1, 1)
    with pytest.raises(SchemaError, match="goes too far"):
        run_in_process(bad)
