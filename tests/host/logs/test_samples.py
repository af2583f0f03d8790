# SPDX-License-Identifier: MIT
"""Counts that are differences over a millisecond, one per row: white noise, which the filters must know as such."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from omni_schema import Robot
from omniwheel.errors import LogError
from omniwheel.identification.odometry_calibration import identify_odometry
from omniwheel.logs.calibration import Calibration, MotorCurve
from omniwheel.logs.importer import ImportSummary, import_log
from omniwheel.logs.log import WheelLog, load_log, save_log
from omniwheel.logs.mapping import Spikes, read_mapping
from omniwheel.logs.spikes import count_noise_warning, reject_spikes
from omniwheel.replay import filter_wheels, replay
from omniwheel.robots import read_robot
from tests.host.logs import synthetic

KNOWN = synthetic.Known(spike_share=0.0)
NOISE_RAD_S = float(np.sqrt(2.0 * (KNOWN.reading_rad**2 + synthetic.RAD_SAMPLE**2 / 12.0)) / synthetic.SAMPLE_S)
"""Two readings, each with its noise and its rounding, one millisecond apart: 9.9 rad/s."""
SAMPLED = synthetic.MAPPING.replace(
    "counts_per_revolution = 264", f"counts_per_revolution = 2640\nsample_s = 0.001\nnoise_rad_s = {NOISE_RAD_S:.4f}"
)


def imported(folder: Path, mapping: str, seed: int) -> tuple[WheelLog, ImportSummary]:
    (folder / "mapping.toml").write_text(mapping, encoding="utf-8")
    log, truth = synthetic.write(folder, f"run{seed}", KNOWN, seed, sampled=True)
    return import_log(log, read_mapping(folder / "mapping.toml"), truth)


@pytest.fixture(scope="module")
def read(tmp_path_factory: pytest.TempPathFactory) -> tuple[WheelLog, ImportSummary]:
    return imported(tmp_path_factory.mktemp("sampled"), SAMPLED, 1)


@pytest.fixture(scope="module")
def sampled_robot(tmp_path_factory: pytest.TempPathFactory) -> Robot:
    path = tmp_path_factory.mktemp("robot") / "sampled.toml"
    path.write_text(synthetic.ROBOT.replace("= 264", "= 2640"), encoding="utf-8")
    return read_robot(path)


def with_motor(robot: Robot, **values: float) -> tuple[Robot, Calibration]:
    """The synthetic robot's own motor and curve, so that all that is left is noise."""
    slope, dead = np.array(KNOWN.duty_per_rad_s), np.array(KNOWN.deadband)
    curve = MotorCurve(slope, slope, dead, dead, np.full(3, KNOWN.lag_s))
    motor = {"MOT_K": 0.36, "MOT_B": 0.0, "MOT_R": 2.0, "MOT_L": 1e-4, "MOT_J": KNOWN.lag_s * 0.36**2 / 2.0}
    noise = {"KF_MODE": 1.0, "KF_Q_W": 0.5, "KF_Q_I": 0.0}
    overrides = {**robot.overrides, **motor, **noise, **values}
    return replace(robot, overrides=overrides), Calibration(np.ones(3), np.ones(3), curve)


def test_the_noise_of_a_sample_is_that_of_its_two_readings_and_none_of_it_comes_back(
    read: tuple[WheelLog, ImportSummary],
) -> None:
    log, summary = read
    speed, _ = synthetic.motion(KNOWN, synthetic.duties(1))
    assert np.std(log.wheel_rad_s - speed) == pytest.approx(NOISE_RAD_S, rel=0.03)
    assert np.array(summary.noise_counts) * log.quantum_rad_s == pytest.approx(np.full(3, NOISE_RAD_S), rel=0.06)
    assert np.abs(summary.noise_correlation).max() < 4.0 / np.sqrt(len(log.time_s))
    assert count_noise_warning(log, summary.noise_counts, summary.noise_correlation) == ""


def test_the_filter_expects_the_innovations_that_it_sees(
    read: tuple[WheelLog, ImportSummary], sampled_robot: Robot
) -> None:
    """Mean of n squares of standard normals: 1 within 4 sqrt(2 / n). The robot file's own noise is not asked."""
    robot, calibration = with_motor(sampled_robot, KF_R_W=1.0)
    speed, innovation, variance = filter_wheels(read[0], robot, calibration)
    nis = (innovation**2 / variance)[100:]
    assert np.nanmean(nis) == pytest.approx(1.0, abs=4.0 * np.sqrt(2.0 / nis.size))
    true, _ = synthetic.motion(KNOWN, synthetic.duties(1))
    assert np.sqrt(np.mean((speed - true) ** 2)) < 0.1 * NOISE_RAD_S


def test_taken_for_counts_that_add_up_they_are_doubted_and_mislead_a_filter_of_the_angle(
    tmp_path: Path, robot: Robot
) -> None:
    log, summary = imported(tmp_path, synthetic.MAPPING, 1)
    assert "sample_s" in count_noise_warning(log, summary.noise_counts, summary.noise_correlation)
    angle, calibration = with_motor(robot, KF_MODE=2.0)
    _, innovation, variance = filter_wheels(log, angle, calibration)
    assert np.nanmean(innovation**2 / variance) > 5.0


def test_a_filter_of_the_angle_is_refused_for_samples(
    read: tuple[WheelLog, ImportSummary], sampled_robot: Robot
) -> None:
    angle, calibration = with_motor(sampled_robot, KF_MODE=2.0)
    with pytest.raises(LogError, match="add up"):
        replay(read[0], angle, calibration)


def test_readings_that_go_into_one_count_and_out_of_the_next_are_no_samples(
    read: tuple[WheelLog, ImportSummary],
) -> None:
    draw = np.random.default_rng(3)
    angle = 3.3 * np.arange(1601)[:, None] + draw.normal(0.0, 2.0, (1601, 3))
    log = replace(read[0], counts=np.diff(np.round(angle), axis=0))
    _, noise = reject_spikes(log, Spikes())
    assert np.array(noise.correlation) == pytest.approx(np.full(3, -0.5), abs=0.1)
    assert "check sample_s" in count_noise_warning(log, noise.counts, noise.correlation)
    adding = replace(log, sample_s=0.0)
    assert count_noise_warning(adding, noise.counts, noise.correlation) == ""


def test_the_robot_is_identified_from_samples(
    tmp_path: Path, read: tuple[WheelLog, ImportSummary], sampled_robot: Robot
) -> None:
    found = identify_odometry([read[0], imported(tmp_path, SAMPLED, 2)[0]], sampled_robot)
    assert found.measurement_noise == pytest.approx(NOISE_RAD_S, rel=1e-3)
    assert found.forward_radius_m == pytest.approx(KNOWN.forward_m, rel=0.06)
    assert found.reverse_radius_m == pytest.approx(KNOWN.reverse_m, rel=0.06)
    assert found.wheel_distance_m == pytest.approx(KNOWN.distance_m, rel=0.05)


def test_a_missing_row_does_not_multiply_a_sample(tmp_path: Path) -> None:
    whole, _ = imported(tmp_path, SAMPLED, 1)
    lines = (tmp_path / "run1.csv").read_text(encoding="utf-8").splitlines()
    (tmp_path / "gap.csv").write_text("\n".join([*lines[:300], *lines[304:]]) + "\n", encoding="utf-8")
    log, summary = import_log(tmp_path / "gap.csv", read_mapping(tmp_path / "mapping.toml"))
    assert summary.missing_rows == 4
    assert np.array_equal(log.counts[299], whole.counts[303])
    assert np.array_equal(log.wheel_rad_s[299], whole.wheel_rad_s[303])


def test_what_a_sample_is_is_stored(tmp_path: Path, read: tuple[WheelLog, ImportSummary]) -> None:
    save_log(read[0], tmp_path / "log.npz")
    again = load_log(tmp_path / "log.npz")
    assert again.sample_s == 0.001
    assert again.noise_rad_s == pytest.approx(NOISE_RAD_S, rel=1e-4)


@pytest.mark.parametrize(
    ("old", "new", "told"),
    [
        ("sample_s = 0.001", "sample_s = 0.02", "longer than log.period_s"),
        ("sample_s = 0.001", "sample_s = -1.0", "wheels.sample_s"),
        ('quantity = "speed"\nunit = "rad/s"', 'quantity = "counts"\nunit = "counts"', "adds up"),
    ],
)
def test_a_wrong_sample_is_named(tmp_path: Path, old: str, new: str, told: str) -> None:
    assert old in SAMPLED
    with pytest.raises(LogError, match=told):
        imported(tmp_path, SAMPLED.replace(old, new), 1)
