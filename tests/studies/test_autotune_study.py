# SPDX-License-Identifier: MIT
"""The study of autotune: robots that are drawn, what is said of them, and a few that are really tuned."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from hil_sim.studies import autotune_study
from hil_sim.studies.autotune_link import CABLE, RadioLink, Way, radio_parameters
from hil_sim.studies.autotune_rival import known_values, rival_row
from hil_sim.studies.autotune_robot import ROW, grown, judge, robot_row, values_after, waiting_robot
from hil_sim.studies.autotune_stop import KINDS, drawn_stop, stop_row
from hil_sim.studies.autotune_study import PARTS, Part, Plan, run_study
from hil_sim.studies.autotune_summary import document, growth, page
from hil_sim.studies.drawn_robots import COUNTS, ERROR, WRONG, DrawnRobot, draw_robot
from hil_sim.studies.errors import StudyFolderError, StudyInputError
from omni_schema import Robot
from omniwheel.autotune.procedure import Settings
from omniwheel.radio_model import RadioSettings
from omniwheel.robots import parameter_table
from tests.arm import need_emulated_firmware


def number(robot: Robot, key: str) -> float:
    section, _, name = key.partition(".")
    return float(getattr(robot, section)[name])


@pytest.fixture(scope="module")
def drawn() -> list[DrawnRobot]:
    return [draw_robot(seed) for seed in range(1, 9)]


@pytest.mark.full
def test_robots_differ_and_their_files_are_wrong_by_at_most_what_is_stated(drawn: list[DrawnRobot]) -> None:
    errors = np.array([[number(one.believed, key) / number(one.truth, key) - 1.0 for key in WRONG] for one in drawn])
    assert np.all(np.abs(errors) <= ERROR + 1e-4)
    assert np.all(np.std(errors, axis=0) > 0.02)
    assert {one.truth.wheels for one in drawn} == {3, 4}
    counts = [one.truth.parameter_values()["ENC_CPR"] for one in drawn]
    assert COUNTS[0] <= min(counts) < max(counts) <= COUNTS[1]
    assert [one.believed.parameter_values()["ENC_CPR"] for one in drawn] == counts


@pytest.mark.full
def test_a_seed_is_a_robot(drawn: list[DrawnRobot]) -> None:
    again = draw_robot(drawn[2].seed)
    assert again.believed.parameter_values() == drawn[2].believed.parameter_values()
    assert again.world == drawn[2].world


@pytest.mark.full
@pytest.mark.parametrize("seed", [174, 192, 286, 389])
def test_a_robot_that_no_file_may_describe_is_drawn_again(seed: int) -> None:
    """Robot 174 came out with a winding of 2400 ohm, and ended the whole study."""
    assert draw_robot(seed).truth.parameter_values()["MOT_R"] < 1000.0
    assert draw_robot(seed).believed.parameter_values() == draw_robot(seed).believed.parameter_values()


def test_the_world_has_the_true_robot_and_the_firmware_the_wrong_one(drawn: list[DrawnRobot]) -> None:
    one = drawn[0]
    scenario = one.judging_scenario()
    assert scenario.world_robot is one.truth
    assert (
        scenario.parameter_values()["MASS"]
        == one.believed.parameter_values()["MASS"]
        != number(one.truth, "simulation.mass_kg")
    )


@pytest.mark.full
def test_the_path_that_judges_can_be_driven_and_is_the_same_for_all_parameters(drawn: list[DrawnRobot]) -> None:
    for one in drawn[:3]:
        rows = judge(one, {}, 8)
        assert np.all(rows["completed"] == 1.0)
        assert judge(one, known_values(one), 8)["ticks"].tolist() == rows["ticks"].tolist()
        assert np.all(rows["peak_wheel_rad_s"] < one.truth.parameter_values()["LIM_WHEEL"])


def test_four_wheels_of_a_wrong_geometry_do_not_wind_up_against_each_other() -> None:
    """Robot 34: with integrals of their own, its wheels pushed against each other until one counted as stalled."""
    assert np.all(judge(draw_robot(34), {}, 4)["completed"] == 1.0)


def test_a_figure_that_grew_by_less_than_its_noise_has_not_grown() -> None:
    before = np.linspace(1.0, 2.0, 16)
    noise = 0.1 * np.sin(np.arange(16.0) * 7.0)
    assert grown(before, before + noise) < 0.0 < grown(before, before + 0.2 + noise)
    assert math.isnan(grown(before[:1], before[:1]))


def made_row(seed: int, outcome: str = "kept", **values: Any) -> np.ndarray[Any, Any]:
    row = np.zeros(1, ROW)
    row["seed"], row["outcome"] = seed, outcome
    row["position_m_before"] = row["theta_rad_before"] = row["completed_before"] = row["completed_after"] = 1.0
    row["position_m_after"] = row["theta_rad_after"] = 0.9
    row["distance_model"] = math.nan
    for name, value in values.items():
        row[name] = value
    return row


def test_the_summary_counts_what_is_worse_and_what_was_promised() -> None:
    rows = np.concatenate(
        [
            made_row(1, distance_promised=0.5, distance_measured=0.59),
            made_row(2, distance_promised=0.5, distance_measured=0.35, position_worse=1e-6),
            made_row(3, distance_promised=0.5, distance_measured=math.nan, completed_after=0.5),
            made_row(
                4,
                "refused",
                why=b"the fit did not converge",
                distance_measured=math.nan,
                position_m_before=0.0,
                position_m_after=0.0,
            ),
            made_row(5, "stopped", why=b"the robot stopped by itself: stall"),
        ]
    )
    found = document(rows, np.empty(0), np.empty(0))
    assert found["robots"]["outcomes"] == {"kept": 3, "refused": 1, "stopped": 1}
    assert found["robots"]["worse_seeds"] == [2, 3]
    assert found["robots"]["stopped_seeds"] == [5]
    assert found["margins"]["distance"]["measured"] == 2
    assert found["margins"]["distance"]["as_promised"] == 1
    assert found["margins"]["not_measured"] == 1
    assert found["margins"]["distance"]["model"]["measured"] == 0
    assert found["robots"]["worse_by"] == {"0.01": 1, "0.05": 1, "0.2": 1}
    assert found["robots"]["complete_fewer_paths"] == 1
    assert found["robots"]["reasons"] == {"the fit did not converge": 1, "the robot stopped by itself": 1}
    assert "| worse than before, however little | 2 (1 by more than 1%" in page(found)


def test_a_robot_that_is_worse_is_told_by_how_much_and_whether_its_old_values_swung() -> None:
    rows = np.concatenate(
        [
            made_row(1, position_worse=1e-6, position_m_after=1.004, hardly_damped=1.0),
            made_row(2, theta_worse=1e-6, theta_rad_after=1.07),
            made_row(3, "reverted", position_m_after=1.0, theta_rad_after=1.0),
            made_row(4, hardly_damped=1.0),
        ]
    )
    found = document(rows, np.empty(0), np.empty(0))["robots"]
    assert growth(rows).tolist() == pytest.approx([0.004, 0.07, 0.0, -0.1])
    assert found["worse_by"] == {"0.01": 1, "0.05": 1, "0.2": 0}
    assert found["worse_of_hardly_damped"] == 1
    assert found["kept_of_hardly_damped"] == 2


def test_reasons_that_differ_by_their_numbers_are_one() -> None:
    rows = np.concatenate(
        [made_row(seed, "refused", why=f"the model explains only {seed}.5% of it: x".encode()) for seed in (50, 61)]
    )
    reasons = document(rows, np.empty(0), np.empty(0))["robots"]["reasons"]
    assert reasons == {"the model explains only …% of it": 2}


asked: list[int] = []


def counted_row(seed: int, _: Any) -> np.ndarray[Any, Any]:
    asked.append(seed)
    return made_row(seed)


def test_a_study_goes_on_where_it_ended_and_refuses_another_ones_folder(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked.clear()
    monkeypatch.setattr(autotune_study, "PARTS", (Part("robots", ROW, counted_row), *PARTS[1:]))
    run_study(Plan(2), tmp_path / "study")
    summary = run_study(Plan(4), tmp_path / "study")
    assert asked == [1, 2, 3, 4]
    assert summary["robots"]["count"] == 4
    assert json.loads((tmp_path / "study" / "summary.json").read_text()) == summary
    assert len((tmp_path / "study" / "robots.csv").read_text().splitlines()) == 5
    with pytest.raises(StudyFolderError, match="another study"):
        run_study(Plan(4, settings=Settings(rounds=5)), tmp_path / "study")


@pytest.mark.nightly
@pytest.mark.parametrize("seed", [1, 6, 14])
def test_a_robot_is_tuned_and_never_becomes_much_worse(seed: int) -> None:
    (row,) = robot_row(seed, (Settings(), CABLE))
    assert row["outcome"] in (b"kept", b"reverted"), row["why"]
    assert row["completed_after"] >= row["completed_before"]
    assert not row["position_m_after"] > 1.05 * row["position_m_before"]
    assert row["explained"] > 0.8
    if np.isfinite(row["distance_measured"]):
        assert row["distance_measured"] == pytest.approx(row["distance_promised"], rel=0.2)
    if row["outcome"] == b"reverted":
        assert row["position_m_after"] == row["position_m_before"]


def test_a_slow_radio_has_the_profile_of_its_speed_on_the_first_link() -> None:
    given = radio_parameters(9600)
    assert given == pytest.approx(
        {"LINK1_BUDGET": 480, "SR1_STATE": 1, "SR1_WHEELS": 0, "SR1_STATUS": 0.2, "LINK2_BAUD": 9600}
    )
    known = parameter_table()
    assert all(name in known for name in given)


def test_each_way_to_a_robot_has_a_folder_of_its_own_and_what_there_is_not_is_refused() -> None:
    ways = (CABLE, Way(RadioSettings(9600, 0.05)), Way(emulated=True))
    assert len({way.suffix for way in ways}) == 3
    with pytest.raises(StudyInputError, match="9600, 57600, 115200"):
        Way(RadioSettings(1200))
    with pytest.raises(StudyInputError, match="has no radio"):
        Way(RadioSettings(9600), emulated=True)


@pytest.mark.full
def test_a_robot_behind_a_radio_answers_late_loses_packets_and_is_the_same_again() -> None:
    def first_words() -> tuple[float, float, int]:
        way = Way(RadioSettings(9600, 0.3))
        with waiting_robot(draw_robot(26), way) as (robot, link):
            robot.set_waypoints([(0.01 * number, 0.0, 0.0) for number in range(8)])
            radio = robot.connection.link
            assert isinstance(radio, RadioLink)
            return robot.parameters["WS_P"], link.clock_s(), radio.radio.down.packets_lost + radio.radio.up.packets_lost

    gain, time_s, lost = first_words()
    assert gain == pytest.approx(draw_robot(26).believed.parameter_values()["WS_P"], rel=1e-6)
    assert lost > 0
    assert time_s > 2.0
    assert first_words() == (gain, time_s, lost)


@pytest.mark.nightly
@pytest.mark.parametrize("way", [Way(RadioSettings(9600, 0.05)), Way(emulated=True)])
def test_a_robot_is_tuned_in_other_ways(way: Way) -> None:
    if way.emulated:
        need_emulated_firmware()
    (row,) = robot_row(26, (Settings(), way))
    assert row["outcome"] in (b"kept", b"reverted"), row["why"]
    assert row["position_m_after"] <= 1.05 * row["position_m_before"]


@pytest.mark.nightly
def test_an_optimiser_that_knows_the_robot_is_a_rival() -> None:
    drawn = draw_robot(4)
    present = {name: drawn.believed.parameter_values()[name] for name in values_after(np.zeros(1, ROW)[0])}
    (row,) = rival_row(4, present, 12)
    assert row["why"] == b""
    assert row["completed_rival"] == 1.0
    assert 0.0 < row["position_m_rival"] < 2.0 * row["position_m_autotune"]


SHORT, SHORT_S = Settings(legs=4, rounds=2), 60.0
"""A short tuning, and how long it takes at least; sooner moments are while it drives or changes parameters."""
STOPS = range(1, 201)
SAMPLE = {kind: next(seed for seed in STOPS if drawn_stop(seed)[0] == kind) for kind in KINDS}


def assert_stopped_well(seed: int) -> None:
    """At rest, with the old parameters: if the cable was pulled, the robot has taken them back by itself."""
    (row,) = stop_row(seed, SHORT, SHORT_S)
    assert row["stopped"] == 1.0, (seed, row["why"])
    assert row["at_rest"] == 1.0, (seed, row["kind"], row["moment_s"])
    assert row["old_parameters"] == 1.0, (seed, row["kind"], row["moment_s"])


@pytest.mark.full
@pytest.mark.parametrize("kind", KINDS)
def test_a_tuning_that_is_stopped_leaves_a_robot_at_rest(kind: str) -> None:
    assert_stopped_well(SAMPLE[kind])


@pytest.mark.nightly
@pytest.mark.parametrize("seed", STOPS)
def test_a_tuning_can_be_stopped_at_any_moment(seed: int) -> None:
    assert_stopped_well(seed)
