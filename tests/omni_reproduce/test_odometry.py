# SPDX-License-Identifier: MIT
"""UMBmark: its statistics, closed forms for wrong geometry, the worlds against them, and logs of real robots."""

from __future__ import annotations

import math
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from hil_sim.runs import run_in_process
from hil_sim.world import IDEAL_WHEELS
from omni_reproduce import odometry, square_logs
from omni_reproduce.experiment import Context, read_spec
from omni_reproduce.numbers import number
from omni_reproduce.odometry import Setting, expected, petal_settings, result_of, square_settings
from omni_reproduce.odometry_runs import MUJOCO, OURS, Case, drive, petal, scenario_of, square, wheels_of
from omni_reproduce.square import Wheels, end_of, expected_error, legs, true_motion, umbmark
from omniwheel.errors import LogError, OmniError
from tests.omni_reproduce import kept_page

SPEC = read_spec("odometry")
FAST = "fast_three_wheel"
WHEELS = Wheels(np.full(3, 0.05), np.radians([0.0, 120.0, 240.0]), 0.2)


def test_the_farther_centre_counts_and_spread_is_about_the_own_centre() -> None:
    clockwise, counter = np.array([[3.0, 4.0], [3.0, 4.0]]), np.array([[0.0, 1.0], [0.0, -1.0]])
    found = umbmark(clockwise, counter)
    assert (found.clockwise_m, found.counter_clockwise_m) == ((3.0, 4.0), (0.0, 0.0))
    assert found.systematic_m == 5.0
    assert found.spread_m == 1.0
    assert math.isnan(umbmark(clockwise[:1], counter[:1]).spread_m)


@pytest.mark.parametrize("sign", [-1, 1])
@pytest.mark.parametrize("turning", [True, False])
def test_a_square_closes(sign: int, turning: bool) -> None:
    end = end_of(legs(4.0, sign, turning=turning))
    assert np.abs(end[:2]).max() < 1e-12
    assert end[2] == pytest.approx(sign * 2.0 * math.pi if turning else 0.0)


def test_a_body_that_turns_drives_a_circle() -> None:
    """Of a given twist: at half a turn it is a diameter away, 2 v / omega, to its left."""
    assert end_of([np.array([math.pi, 0.0, math.pi])]) == pytest.approx([0.0, 2.0, math.pi])


@pytest.mark.parametrize("sign", [-1, 1])
def test_a_wrong_wheel_distance_turns_each_corner_too_far_by_its_share(sign: int) -> None:
    """The four edges are then a sum of four unit vectors that turn by (1 + e) a right angle: a geometric series."""
    share, edge_m = 0.005, 4.0
    error = expected_error(legs(edge_m, sign, turning=True), WHEELS, replace(WHEELS, distance_m=0.2 * (1.0 + share)))
    corner = np.exp(1j * sign * 0.5 * math.pi * (1.0 + share))
    end = edge_m * (1.0 - corner**4) / (1.0 - corner)
    assert error == pytest.approx([end.real, end.imag, sign * 2.0 * math.pi * share], abs=1e-12)


def test_a_small_error_of_the_distance_is_borensteins_first_order() -> None:
    """Each corner is off by alpha = e times 90 degrees; the end is off by 2 edge alpha along both axes."""
    share, edge_m = 1e-5, 4.0
    wrong = replace(WHEELS, distance_m=0.2 * (1.0 + share))
    error = expected_error(legs(edge_m, 1, turning=True), WHEELS, wrong)
    assert np.abs(error[:2]) == pytest.approx(2.0 * edge_m * 0.5 * math.pi * share, rel=1e-4)


def test_without_turning_a_wrong_wheel_distance_does_no_harm_and_neither_does_a_wrong_size_of_all_wheels() -> None:
    path = legs(4.0, 1, turning=False)
    for believed in (replace(WHEELS, distance_m=0.21), replace(WHEELS, radius_m=1.01 * WHEELS.radius_m)):
        assert np.abs(expected_error(path, WHEELS, believed)).max() < 1e-12


def test_what_a_robot_believes_comes_back_from_the_rims_of_true_motion() -> None:
    """Three wheels contradict each other in nothing: reckoning the true motion's turns by the wrong file is exact."""
    believed = Wheels(np.array([0.051, 0.049, 0.05]), WHEELS.angle_rad, 0.21)
    motion = np.array([0.3, -0.2, 0.7])
    turned = WHEELS.rims() @ true_motion(motion, WHEELS, believed) / WHEELS.radius_m
    assert np.linalg.solve(believed.rims(), believed.radius_m * turned) == pytest.approx(motion)


@pytest.mark.parametrize("turning", [True, False])
def test_perfect_wheels_give_the_closed_form(turning: bool) -> None:
    """Wheels that never slip and follow at once; what is left, 1 % of the error, is counts and the ends of the legs."""
    for sign in (-1, 1):
        case = Case(FAST, 1, square(SPEC, FAST, sign, turning=turning), wrong=True)
        scenario = replace(scenario_of(SPEC, case).with_world(IDEAL_WHEELS), plant="kinematic")
        last = run_in_process(scenario).record[-1]
        setting = Setting(FAST, wrong=True, gyro=False, world=OURS, turning=turning)
        told = expected(SPEC, setting)[0 if sign < 0 else 1]
        away = (last["truth"] - last["estimate"])[:2] - told
        assert np.hypot(*away) < 0.012 * np.hypot(*told)


@pytest.mark.full
def test_real_wheels_keep_near_the_closed_form_and_a_gyro_heals_the_turn() -> None:
    limits = {}
    for wrong, gyro in ((False, False), (True, False), (True, True)):
        runs = [
            drive(Case(FAST, seed, square(SPEC, FAST, sign, turning=True), wrong, gyro))
            for sign in (-1, 1)
            for seed in (1, 2)
        ]
        limits[wrong, gyro] = result_of(runs).systematic_m
    told = max(
        float(np.hypot(*error))
        for error in expected(SPEC, Setting(FAST, wrong=True, gyro=False, world=OURS, turning=True))
    )
    assert limits[True, False] == pytest.approx(told, rel=0.2)
    assert limits[False, False] < 0.2 * limits[True, False]
    assert limits[True, True] < 0.1 * limits[True, False]


def test_a_petal_comes_back_to_where_it_left() -> None:
    (motion,) = petal(SPEC, FAST, 0.7)
    assert np.abs(end_of([np.array(motion)])[:2]).max() < 1e-12
    case = Case(FAST, 1, (motion,))
    truth = run_in_process(scenario_of(SPEC, case)).record["truth"]
    assert np.hypot(*truth[-1, :2]) < 0.15 < 0.9 < np.ptp(truth[:, :2], axis=0).max()


def test_a_wrong_file_has_what_the_settings_say_and_the_world_keeps_the_right_one() -> None:
    right, wrong = (wheels_of(SPEC, FAST, wrong=wrong) for wrong in (False, True))
    assert wrong.distance_m / right.distance_m == pytest.approx(1.005)
    assert wrong.radius_m / right.radius_m == pytest.approx([1.002, 0.998, 1.0])
    scenario = scenario_of(SPEC, Case(FAST, 1, square(SPEC, FAST, 1, turning=True), wrong=True))
    assert scenario.robot.geometry["wheel_distance_m"] == right.distance_m
    assert scenario.parameters["WHEEL_DIST"] == wrong.distance_m


def test_a_robot_that_stops_on_its_way_is_an_error(monkeypatch: pytest.MonkeyPatch) -> None:
    """Here because it is never armed."""

    def unarmed(spec: dict[str, object], case: Case) -> object:
        scenario = scenario_of(spec, case)
        return replace(scenario, events=scenario.events[1:])

    monkeypatch.setattr("omni_reproduce.odometry_runs.scenario_of", unarmed)
    with pytest.raises(OmniError, match=r"stopped on its way after 0\.0 s, seed 3, our world"):
        drive(Case(FAST, 3, square(SPEC, FAST, 1, turning=False)))


def test_mujoco_drives_squares_with_and_without_gyro_and_petals() -> None:
    squares = [entry for entry in square_settings(SPEC, mujoco=True) if entry.world == MUJOCO]
    assert {(entry.turning, entry.gyro) for entry in squares} == {(True, False), (True, True), (False, False)}
    assert [entry.robot for entry in petal_settings(SPEC, mujoco=True) if entry.world == MUJOCO] == [FAST]
    assert not [entry for entry in square_settings(SPEC, mujoco=False) if entry.world == MUJOCO]


@pytest.mark.nightly
def test_mujoco_without_a_gyro_gives_errors_of_the_same_size_as_our_world() -> None:
    pytest.importorskip("mujoco")
    for world in (OURS, MUJOCO):
        found = drive(Case(FAST, 1, square(SPEC, FAST, 1, turning=False), world=world))
        assert np.hypot(*found.error[:2]) < 0.02


@pytest.mark.full
def test_a_quick_run_has_its_rows_picture_and_seeds(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(odometry, "square_settings", lambda *_, **__: [Setting(FAST, True, False, OURS, False)])
    monkeypatch.setattr(odometry, "petal_settings", lambda *_, **__: [Setting(FAST, False, False, OURS)])
    result = odometry.run(Context(tmp_path, quick=True))
    systematic = next(row for row in result.rows if row.setting == f"{FAST}, not turning, wrong file, our world")
    assert systematic.limit is not None
    assert systematic.ours == pytest.approx(systematic.limit, rel=0.1)
    assert systematic.seeds == 4
    assert [row.explanation for row in result.rows if row.setting == MUJOCO] == ["Not run: a quick run leaves it out."]
    assert result.pictures == (tmp_path / "odometry.png",)
    assert result.pictures[0].stat().st_size > 10_000
    assert "Seeds count up from 1" in result.notes[0]


def test_the_kept_page_has_the_published_figures_of_today() -> None:
    """The rest of the section takes minutes; ``make nightly ARGS=reproduce`` compares it."""
    kept = kept_page.sections(kept_page.PAGE.read_text(encoding="utf-8"))["Benchmarks of dead reckoning"]
    for row in odometry.published(SPEC):
        assert f"| {row.setting} | {row.quantity} | mm | {number(row.published)} | – |" in kept


def _write_session(folder: Path, *, distance_m: float = 0.2, drop: str = "") -> Path:
    """Write a session of ``omni3`` in which a robot drives exact squares, twice in each direction.

    Its wheels are as OptiOdom numbers them; the file says ``distance_m`` where 0.2 m is true.
    """
    place = folder / "omni3" / "square" / "1"
    place.mkdir(parents=True)
    lines = ["type,omni3", "ngear,1", "encRes,1000", f"Li,{distance_m}", "Di,0.1,0.1,0.1"]
    (place / "1_metadata.csv").write_text("\n".join(line for line in lines if not drop or not line.startswith(drop)))
    if drop:
        return folder
    third, root = 1.0 / 3.0, math.sqrt(1.0 / 3.0)
    body = np.array([[-root, root, 0.0], [-third, -third, 2.0 * third], [-third / 0.2] * 3])
    for run, sign in enumerate((-1, -1, 1, 1), start=1):
        steps = [leg / 50.0 for leg in legs(1.5, sign, turning=True) for _ in range(50)]
        poses = [np.zeros(3)]
        for step in steps:
            c, s = math.cos(poses[-1][2]), math.sin(poses[-1][2])
            x, y, turn = end_of([step])
            poses.append(poses[-1] + np.array([c * x - s * y, s * x + c * y, turn]))
        counts = [np.zeros(3), *(np.linalg.solve(body, step) * 1000.0 / (math.pi * 0.1) for step in steps)]
        rows = np.column_stack([0.04 * np.arange(len(poses)), poses, counts])
        np.savetxt(place / f"1_run-0{run}.csv", rows, delimiter=",")
    return folder


def test_logs_of_a_perfect_robot_have_no_error(tmp_path: Path) -> None:
    (found,) = square_logs.sessions(_write_session(tmp_path))
    assert (found.runs, found.kinds) == (4, 2)
    assert found.edge_m == pytest.approx(1.5, abs=0.05)
    assert found.systematic_m < 1e-6
    assert found.spread_m < 1e-6


def test_logs_with_a_wrong_wheel_distance_give_the_closed_form(tmp_path: Path) -> None:
    """What is reckoned turns less by the share, so the error is the mirror image of the one that a drive has."""
    (found,) = square_logs.sessions(_write_session(tmp_path, distance_m=0.2 * 1.005))
    corner = np.exp(0.5j * math.pi / 1.005)
    assert found.systematic_m == pytest.approx(abs(1.5 * (1.0 - corner**4) / (1.0 - corner)), rel=1e-3)


@pytest.mark.parametrize(("drop", "message"), [("Li", "has no Li"), ("Di", "has no Di")])
def test_logs_without_geometry_are_an_error_that_names_it(tmp_path: Path, drop: str, message: str) -> None:
    with pytest.raises(LogError, match=message):
        square_logs.sessions(_write_session(tmp_path, drop=drop))


@pytest.mark.full
def test_the_command_for_logs_prints_a_line_per_session_and_refuses_an_empty_folder(tmp_path: Path) -> None:
    command = [sys.executable, "-m", "omni_reproduce.square_logs"]
    good = subprocess.run(
        [*command, str(_write_session(tmp_path / "data"))], capture_output=True, text=True, check=True
    )
    assert good.stdout.startswith("omni3 1: 4 runs, 2 kinds, edge 1.5")
    bad = subprocess.run([*command, str(tmp_path)], capture_output=True, text=True, check=False)
    assert bad.returncode == 1
    assert "give the folder data of that repository" in bad.stderr
