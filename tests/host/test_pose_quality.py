# SPDX-License-Identifier: MIT
"""How good the pose is, in words: the numbers are the covariance's, and each case has its text and what to do."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy import stats

from hil_sim import core
from hil_sim.runs import new_world
from hil_sim.scenario import load_scenario
from omniwheel._core import ffi, lib
from omniwheel.frames import Pose, Twist
from omniwheel.pose_quality import (
    HEADING_SIGMAS,
    LEAST_FIXES,
    LEAST_S,
    NIS_MOST,
    PoseQuality,
    QualityWatch,
    Verdict,
    half_axis_m,
)
from omniwheel.telemetry import Control, Status, Tracking

SURE = Tracking(
    time_s=1.0,
    reference=Pose(0.0, 0.0, 0.0),
    reference_rate=Twist(0.0, 0.0, 0.0),
    pose=Pose(0.0, 0.0, 0.0),
    pose_sd=(0.002, 0.001, 0.003),
    path_time_s=0.0,
    phase="none",
    pose_correlation=0.0,
)
ZERO = (0.0, 0.0, 0.0)
CONTROL = Control(
    time_s=1.0,
    error=ZERO,
    integral=ZERO,
    surface=ZERO,
    equivalent=ZERO,
    switching=ZERO,
    ismc_margin=ZERO,
    nis=3.0,
    fixes_accepted=1,
    fixes_refused=0,
    config_sequence=1,
    controller=0,
    fix_age_s=0.01,
    wheel_noise=1.0,
    fix_noise=1.0,
)


def status(*faults: str) -> Status:
    return Status(
        time_s=1.0,
        state="armed",
        faults=faults,
        fault_history=(),
        hil=False,
        ticks=1000,
        overruns=0,
        i2c_errors=0,
        rx_errors=0,
        tx_dropped=0,
        tick_us_mean=1.0,
        tick_us_max=1.0,
    )


def told(*telemetry: Tracking | Control | Status) -> PoseQuality:
    watch = QualityWatch()
    for entry in telemetry:
        watch.take(entry)
    quality = watch.quality()
    assert quality is not None
    return quality


def fixes(nis: float, count: int, period_s: float) -> list[Control]:
    return [replace(CONTROL, time_s=1.0 + n * period_s, nis=nis, fixes_accepted=1 + n) for n in range(count + 1)]


@pytest.mark.parametrize("seconds", [12, 24])
def test_the_numbers_are_those_of_the_cores_covariance(seconds: int) -> None:
    """By eigenvalues and the chi-square distribution, of a robot that drives blind: its ellipse is long and askew."""
    scenario = load_scenario("no_fixes")
    world = new_world(scenario).c
    config = core.robot_config(scenario.parameter_values(), scenario.robot.table, 0)
    run, why = ffi.new("hil_run_t *"), ffi.new("char[]", 160)
    assert lib.hil_run_init(run, ffi.addressof(world, "config"), config, why, len(why)) == lib.HIL_OK
    lib.hil_run_advance(run, 10)
    assert lib.hil_run_start_trajectory(run) == lib.OMNI_OK
    run.inputs.events |= lib.OMNI_EVENT_ARM
    lib.hil_run_advance(run, seconds * 1000)
    p = run.robot.estimator.pose_ekf.p
    covariance = np.array([[p[i][j] for j in range(3)] for i in range(3)])
    sd = float(run.outputs.pose_sd[0]), float(run.outputs.pose_sd[1]), float(run.outputs.pose_sd[2])
    tracking = replace(SURE, pose_sd=sd, pose_correlation=run.outputs.pose_xy_m2 / (sd[0] * sd[1]))
    quality = told(tracking)
    largest = np.linalg.eigvalsh(covariance[:2, :2])[-1]
    assert largest > 1.05 * max(covariance[0, 0], covariance[1, 1]), "askew, or the axes alone would do"
    assert quality.position_m == pytest.approx(math.sqrt(stats.chi2.ppf(0.95, 2) * largest), rel=1e-4)
    assert quality.heading_rad == pytest.approx(stats.norm.ppf(0.975) * math.sqrt(covariance[2, 2]), rel=1e-4)


def test_a_pose_with_fixes() -> None:
    quality = told(SURE, CONTROL, status())
    assert quality.text == "pose ±4.9 mm, ±0.34° (95 %)"
    assert (quality.advice, quality.fix_age_s) == ("", 0.01)


@pytest.mark.parametrize(("sd_m", "says"), [(0.00042, "±1.0 mm"), (0.05, "±122 mm"), (0.41, "±1.0 m"), (9.0, "±22 m")])
def test_lengths_have_two_digits_and_a_fitting_unit(sd_m: float, says: str) -> None:
    assert says in told(replace(SURE, pose_sd=(sd_m, sd_m / 2, 0.1))).text


def test_fixes_that_stop_make_it_drift_and_the_speed_of_it_is_told() -> None:
    """From 5 mm and 0.34° to 86 mm and 5.2° in 20 s."""
    late, aged = replace(SURE, time_s=21.0, pose_sd=(0.035, 0.02, 0.0463)), replace(CONTROL, fix_age_s=20.0)
    quality = told(SURE, CONTROL, late, aged, status("pose stale"))
    assert quality.verdict is Verdict.DRIFTING
    assert quality.text == "pose drifting: no fix for 20 s, ±86 mm, ±5.2° (95 %)"
    assert quality.advice == (
        "check the pose source (cameras, bridge, link); without fixes it drifts about 4.0 mm and 0.24° per second"
    )
    back = replace(CONTROL, time_s=21.1, fixes_accepted=2, fix_age_s=0.02)
    assert told(SURE, CONTROL, late, status("pose stale"), SURE, back).verdict is Verdict.GOOD, "the warning is older"


def test_a_stale_pose_of_a_robot_that_tells_no_age() -> None:
    old = replace(CONTROL, fix_age_s=0.0)
    quality = told(SURE, old, status("pose stale"))
    assert quality.text.startswith("pose drifting: no fix for some time, ")
    assert told(SURE, old, status()).verdict is Verdict.GOOD
    assert told(SURE, replace(old, fixes_accepted=0), status()).verdict is Verdict.NO_FIXES


def test_over_a_radio_that_brings_no_omni_control() -> None:
    assert told(SURE, status("pose stale")).text.startswith("pose drifting: no fix for some time, ")
    assert told(SURE, status()).text == "pose ±4.9 mm, ±0.34° (95 %)"


def test_refused_fixes_are_counted_since_the_last_good_one() -> None:
    first = replace(CONTROL, fixes_refused=7)
    used = replace(first, fixes_accepted=2, time_s=2.0)
    refused = replace(used, fixes_refused=12, time_s=3.0, nis=80.0, fix_age_s=1.0)
    late = replace(SURE, time_s=3.0)
    quality = told(SURE, first, used, refused, late, status("pose stale", "fix refused"))
    assert quality.refused == 5
    assert "no usable fix for 1.0 s" in quality.text
    assert quality.advice.startswith("the robot rejected 5 fixes: ")


def test_a_robot_that_never_had_a_fix() -> None:
    none = replace(CONTROL, fixes_accepted=0, fix_age_s=-1.0)
    later = replace(SURE, time_s=11.0, pose_sd=(0.012, 0.01, 0.02))
    quality = told(SURE, none, later, status())
    assert quality.text == "pose without fixes: ±29 mm, ±2.2° (95 %)"
    assert quality.advice == (
        "start a pose source, or use dead reckoning where its accuracy is enough; "
        "without fixes it drifts about 2.4 mm and 0.19° per second"
    )


@pytest.mark.parametrize("sd", [(0.0, 0.0, 0.0), (math.nan, 0.1, 0.1), (math.inf, 0.1, 0.1)])
def test_a_covariance_that_says_nothing_is_not_shown_as_a_good_one(sd: tuple[float, float, float]) -> None:
    quality = told(replace(SURE, pose_sd=sd), CONTROL, status())
    assert quality.text == "pose: no standard deviation reported"
    assert quality.verdict is Verdict.UNKNOWN


def test_innovations_that_contradict_the_estimate_for_long_are_told() -> None:
    quality = told(SURE, *fixes(6.1, 100, 0.2), status())
    assert quality.text == (
        "pose uncertain: reported ±4.9 mm, ±0.34° (95 %), but its fixes deviate more (NIS 6.1, not 3)"
    )
    assert "FIX_DELAY" in quality.advice
    assert "EKF_Q_XY" in quality.advice
    assert told(SURE, *fixes(3.4, 100, 0.2), status()).verdict is Verdict.GOOD


def test_wheels_taken_for_much_noisier_than_configured_are_told_although_the_innovations_fit() -> None:
    """A filter whose noise levels follow its fixes has a NIS of 3 whatever is wrong, such as a delay nobody told."""
    quality = told(SURE, replace(CONTROL, nis=3.0, wheel_noise=6.7), status())
    assert quality.verdict is Verdict.CONTRADICTED
    assert quality.text == (
        "pose uncertain: reported ±4.9 mm, ±0.34° (95 %), but wheels and fixes disagree 7 times as much as configured"
    )
    assert "FIX_DELAY" in quality.advice
    assert told(SURE, replace(CONTROL, nis=3.0, wheel_noise=1.7), status()).verdict is Verdict.GOOD


@pytest.mark.parametrize(("count", "period_s"), [(LEAST_FIXES - 1, 0.5), (200, 0.9 * LEAST_S / 200)])
def test_few_fixes_or_a_short_time_say_nothing(count: int, period_s: float) -> None:
    assert told(SURE, *fixes(9.0, count, period_s), status()).verdict is Verdict.GOOD


def test_a_few_wild_fixes_are_no_contradiction() -> None:
    """Two of a hundred with a NIS of 4000: their mean alone would be 80."""
    seen = fixes(3.0, 100, 0.2)
    for wild in (40, 41):
        seen[wild] = replace(seen[wild], nis=4000.0)
    assert told(SURE, *seen, status()).verdict is Verdict.GOOD


def test_a_right_filter_is_doubted_no_more_than_once_in_ten_thousand_times() -> None:
    most_of_all = stats.chi2.sf(NIS_MOST * LEAST_FIXES, 3 * LEAST_FIXES)
    assert most_of_all < 1e-4
    assert stats.norm.ppf(0.975) == pytest.approx(HEADING_SIGMAS)


def test_a_robot_that_restarts_begins_anew() -> None:
    watch = QualityWatch()
    for entry in (SURE, *fixes(9.0, 100, 0.2), status()):
        watch.take(entry)
    watch.take(replace(CONTROL, time_s=0.5, fixes_accepted=0))
    quality = watch.quality()
    assert quality is not None
    assert (quality.verdict, quality.nis_count) == (Verdict.GOOD, 0)


def test_the_half_axis_is_the_longer_one_whatever_the_axes_are_called() -> None:
    one = half_axis_m(replace(SURE, pose_sd=(0.03, 0.01, 0.1), pose_correlation=0.4))
    assert one == pytest.approx(half_axis_m(replace(SURE, pose_sd=(0.01, 0.03, 0.1), pose_correlation=-0.4)))
    assert one > half_axis_m(replace(SURE, pose_sd=(0.03, 0.01, 0.1)))
