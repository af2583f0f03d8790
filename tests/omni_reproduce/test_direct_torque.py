# SPDX-License-Identifier: MIT
"""Figures 5 to 8: what the experiment must show, and that its own arithmetic is right."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from omni_reproduce import direct_torque as experiment
from omni_reproduce.experiment import Context, Row, read_spec
from omni_reproduce.torque_loop import Case, TorqueLoop, Trace, goals_of, law_of, rose, simulate

SPEC = read_spec("direct_torque")
LAP_S = SPEC["rose"]["period_s"]


def test_the_wheels_are_those_of_equation_5() -> None:
    """Column i of Q(phi) is (-sin, cos, R) of phi + (i - 1) pi / 2."""
    assert np.radians(SPEC["robot"]["wheel_angle_deg"]) == pytest.approx(np.pi / 2.0 * np.arange(4))


def rmse_mm(trace: Trace) -> np.ndarray:
    error = trace.error[trace.time_s >= 6.0]
    return np.asarray(1e3 * np.sqrt((error**2).mean(axis=0)))


@pytest.mark.full
@pytest.mark.parametrize("law", ["report", "fast", "watched"])
def test_the_rose_is_followed_within_3_mm_an_axis(law: str) -> None:
    trace = simulate(SPEC, Case(law, "rose", 0.6, 1.5 * LAP_S))
    assert rmse_mm(trace)[:2].max() <= 3.0
    assert np.abs(trace.torque_N_m).max() < 0.11, "no limit binds"
    assert np.hypot(*trace.pose[0, :2]) == 0.0


def test_the_rose_is_r_04_cos_15_t() -> None:
    """Independent: x + i y = 0.4 cos(1.5 t) e^(i t), and its derivatives by differences."""
    trace = simulate(SPEC, Case("fast", "rose", 0.6, 1.2 * LAP_S))
    angle = trace.time_s
    wanted = 0.4 * np.cos(1.5 * angle) * np.exp(1j * angle)
    got = trace.reference[:, 0] + 1j * trace.reference[:, 1]
    assert np.abs(got - wanted).max() < 1e-4
    assert np.abs(trace.reference[:, 2]).max() == 0.0


@pytest.mark.full
def test_random_points_settle_as_fast_as_the_gains_allow() -> None:
    for seed in (1, 2, 3):
        trace = simulate(SPEC, Case("report", "wide", 1e6, 20.0, seed))
        found = experiment.settling(trace, 5.0, 0.02)
        assert found.time_s.max() <= 2.5
        assert found.time_s == pytest.approx(experiment.settling_of_gains(5.0, 4.1, 0.02), abs=0.021)
        assert np.abs(trace.torque_N_m).max() < 23.15 / 5.0, "the limit is far away"
        stiff = simulate(SPEC, Case("stiff", "wide", 1e6, 20.0, seed))
        assert experiment.settling(stiff, 5.0, 0.02).time_s.max() < 0.6 * found.time_s.min()


def test_stiffer_gains_are_faster_within_real_limits() -> None:
    gentle, stiff = (simulate(SPEC, Case(law, "near_real", 0.6, 20.0, 4)) for law in ("report_real", "stiff_real"))
    times = [experiment.settling(trace, 5.0, 0.02).time_s.mean() for trace in (gentle, stiff)]
    assert times[1] < 0.7 * times[0]
    for trace in (gentle, stiff):
        assert np.abs(trace.torque_N_m).max() <= 0.1 + 1e-6
        assert np.abs(trace.slip_m_s).max() < 0.05


@pytest.mark.parametrize("friction", [0.1, 0.02])
def test_on_ice_ours_degrades_and_the_unwatched_law_runs_away(friction: float) -> None:
    ours, theirs = (simulate(SPEC, Case(law, "slippery", friction, 12.0)) for law in ("watched", "report"))
    bound = experiment.slip_bound(SPEC, law_of(SPEC, "watched"), friction, ours)
    assert np.abs(ours.slip_m_s).max() < min(bound, 2.0 * SPEC["law"]["watched"]["slip_limit_m_s"])
    assert np.hypot(*ours.error[:, :2].T).max() < 1.0
    assert np.abs(theirs.slip_m_s).max() > 100.0


def test_the_printed_law_leaves_at_its_unstable_root() -> None:
    trace = simulate(SPEC, Case("printed", "rose", 1e6, LAP_S))
    assert trace.lost
    expected = experiment.growth_of_gains(law_of(SPEC, "printed"))
    assert experiment.growth(trace, 0.7, 1.05) == pytest.approx(expected, rel=0.03)


def test_growth_of_gains_held_shortly_is_the_root() -> None:
    law = replace(law_of(SPEC, "printed"), period_s=1e-5)
    assert experiment.growth_of_gains(law) == pytest.approx((4.1 + np.sqrt(4.1**2 + 20.0)) / 2.0, rel=1e-4)


@pytest.mark.parametrize(("kp", "kd"), [(5.0, 4.1), (25.0, 10.0), (4.0, 8.0)])
def test_settling_of_gains(kp: float, kd: float) -> None:
    """Against the error stepped finely, below, at and above critical damping."""
    error, rate, step_s, last = 1.0, 0.0, 1e-4, 0.0
    for n in range(100_000):
        if abs(error) > 0.02:
            last = n * step_s
        rate += step_s * (-kd * rate - kp * error)
        error += step_s * rate
    assert experiment.settling_of_gains(kp, kd, 0.02) == pytest.approx(last, abs=5e-3)


def test_a_point_that_is_not_reached_counts_with_all_its_time() -> None:
    time_s = np.arange(0.0, 10.0, 0.1)
    pose = np.zeros((100, 3))
    pose[50:, 0] = 1.2
    reference = np.tile([1.0, 0.0, 0.0], (100, 1))
    found = experiment.settling(Trace(time_s, pose, reference, pose, pose, lost=False), 5.0, 0.02)
    assert found.time_s == pytest.approx([5.0, 5.0])
    assert found.overshoot == pytest.approx([0.0, 0.0])


def test_points_depend_on_the_seed_alone() -> None:
    one, same, other = (goals_of(SPEC, "wide", seed) for seed in (1, 1, 2))
    assert (one == same).all()
    assert (one != other).all()
    assert np.abs(np.concatenate([goals_of(SPEC, "wide", seed) for seed in range(50)])).max() <= 3.0


def test_a_loop_refuses_a_plant_without_torques() -> None:
    loop = TorqueLoop(SPEC["robot"], law_of(SPEC, "report"))
    loop.world.c.config.plant = 1
    with pytest.raises(ValueError, match="torques"):
        loop.run(rose(SPEC["robot"], 6, 0.4, LAP_S), 0.1)


@pytest.mark.full
def test_rows_and_pictures(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    short = {**SPEC, "points": {**SPEC["points"], "count": 2}}
    monkeypatch.setattr(experiment, "read_spec", lambda name: short)
    result = experiment.run(Context(tmp_path, quick=True, seeds=1))
    names = ["fig5.png", "fig6.png", "fig7.png", "fig8.png", "direct_torque_low_friction.png"]
    assert [figure.name for figure in result.pictures] == names
    assert all(figure.stat().st_size > 10_000 for figure in result.pictures)
    assert not any("{" in note for note in result.notes)

    def row(setting: str, quantity: str) -> Row:
        (found,) = [row for row in result.rows if row.setting == setting and row.quantity == quantity]
        return found

    rose_row = row("six-petal rose: report's gains", "x RMSE after 6 s")
    assert rose_row.unit == "mm"
    assert rose_row.ours is not None
    assert 0.0 < rose_row.ours < 3.0
    settled = row("points within ±3 m: report's gains", "settled to 2 %, mean over points")
    assert settled.seeds == 1
    assert settled.limit == pytest.approx(2.18, abs=0.01)
    assert row("rose, friction 0.6: as printed", "position RMSE after 6 s").ours is None, "it has left"
