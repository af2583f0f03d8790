# SPDX-License-Identifier: MIT
"""When a sensor of motion over the floor is wrong: that is found, and what it has taught is taken back."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from omniwheel._core import ffi, lib
from tests.core.test_flow import ARM, RADIUS_M, SD_M, SD_RAD, SPAN, TICK_S, Array, Core, straight

SLIP = np.array([0.02, 0.05, 0.03])


class Drive:
    """A robot that drives to and fro in all directions and turns; its sensor, and the same robot without one."""

    def __init__(self, turning: float = 1.0, slip: Array = SLIP, speed: float = 0.5) -> None:
        self.core, self.dead_reckoning = Core(), Core()
        self.pose, self._way, self._turning, self.slip, self._speed = np.zeros(3), np.zeros(3), turning, slip, speed
        self._random = np.random.default_rng(1)
        self.steer: Callable[[int], Array] | None = None
        """Speed ahead and to the left [m/s], turn rate [rad/s], by tick; None: to and fro."""

    def go(
        self,
        seconds: float,
        angle: float | Callable[[int], float] = 0.0,
        silent: bool = False,
        said: Callable[[Array], Array] = lambda way: way,
    ) -> list[bool]:
        """Go on; the sensor's axes are turned by ``angle``. Return by tick whether readings are used.

        ``said``: what comes in place of a reading.
        """
        usable = []
        for _ in range(round(seconds * 1e3)):
            tick = self.core.time_us // 1000
            body = self._speed * np.array([math.cos(1.3e-3 * tick), math.sin(0.7e-3 * tick), 0.0])
            body[2] = self._turning * math.sin(0.5e-3 * tick)
            if self.steer is not None:
                body = self.steer(tick)
            moved = body * TICK_S
            cosine, sine = math.cos(self.pose[2] + moved[2] / 2), math.sin(self.pose[2] + moved[2] / 2)
            self.pose += [cosine * moved[0] - sine * moved[1], sine * moved[0] + cosine * moved[1], moved[2]]
            self._way += np.add(moved, [-ARM[1] * moved[2], ARM[0] * moved[2], 0.0])
            wheels = self.core.matrix @ moved / RADIUS_M / (1.0 - self.slip)
            reading = None
            if tick % SPAN == SPAN - 1:
                turn = angle(tick) if callable(angle) else angle
                x, y, turned = self._way
                way = [math.cos(turn) * x + math.sin(turn) * y, math.cos(turn) * y - math.sin(turn) * x, turned]
                seen = np.add(way, self._random.normal(0.0, [SD_M, SD_M, SD_RAD]))
                reading = None if silent else list(said(seen))
                self._way[:] = 0.0
            self.core.tick(wheels, reading)
            self.dead_reckoning.predict(wheels)
            usable.append(self.core.usable)
        return usable

    @staticmethod
    def _off(estimate: Array, pose: Array) -> float:
        return float(np.hypot(*(estimate[:2] - pose[:2])))

    @property
    def error_m(self) -> float:
        """How far the estimate is from the robot, with the sensor."""
        return self._off(self.core.x, self.pose)

    @property
    def error_alone_m(self) -> float:
        """The same without it."""
        return self._off(self.dead_reckoning.x, self.pose)


def test_the_direction_of_a_sensor_is_measured_while_the_wheels_slip() -> None:
    drive = Drive()
    drive.go(6.0, math.radians(6.0))
    assert drive.core.usable
    assert drive.core.flow.misalignment_rad == pytest.approx(-math.radians(6.0), abs=math.radians(1.5))


def test_straight_ahead_tells_no_direction() -> None:
    core = Core()
    for tick in range(4000):
        reading = [0.5 * SPAN * TICK_S, 0.0, 0.0] if tick % SPAN == SPAN - 1 else None
        core.tick(straight(core, 0.5, 0.2), reading)
    assert core.flow.misalignment_rad == 0.0
    assert core.usable


@pytest.mark.full
@pytest.mark.parametrize("degrees", [15.0, 20.0, 30.0, 40.0, 90.0, -25.0])
def test_one_that_points_elsewhere_from_the_start_is_found_and_does_no_harm(degrees: float) -> None:
    drive = Drive()
    usable = drive.go(20.0, math.radians(degrees))
    assert usable.index(False) < 3000
    assert not any(usable[6000:])
    assert drive.error_m < 1.6 * drive.error_alone_m + 0.02
    assert np.abs(drive.core.x[3:]).max() < 0.01, "what it taught of slip is forgotten"


@pytest.mark.full
def test_one_that_comes_loose_on_the_way_is_found_and_its_last_metres_are_taken_back() -> None:
    drive = Drive()
    drive.go(10.0)
    before = drive.error_m
    assert before < 0.01
    usable = drive.go(4.0, math.radians(25.0))
    assert not usable[-1]
    drive.go(10.0, silent=True)
    assert drive.error_m < 0.25, "without taking anything back it was 0.8 m"
    assert np.abs(drive.core.x[3:]).max() < 0.01


@pytest.mark.full
def test_one_that_is_put_right_is_used_again() -> None:
    drive = Drive()
    drive.go(6.0, math.radians(30.0))
    used = drive.core.flow.readings_used
    assert not drive.core.usable
    assert drive.go(8.0)[-1]
    assert drive.core.flow.readings_used > used + 50


def test_one_that_fits_only_now_and_then_is_not_used_for_long() -> None:
    """Twenty refused in a row never come: every eighth reading fits."""
    drive = Drive()
    drive.go(4.0)
    usable = drive.go(6.0, lambda tick: 0.0 if tick // SPAN % 8 == 0 else 1.2)
    assert not usable[-1]


@pytest.mark.full
@pytest.mark.parametrize("slip", [SLIP, np.array([0.1, 0.05, 0.15])], ids=["little slip", "much slip"])
def test_readings_of_no_sense_do_no_more_harm_than_none(slip: Array) -> None:
    """A sensor that was right has taught what is so: that stays."""
    broken, silent = Drive(slip=slip), Drive(slip=slip)
    for drive in (broken, silent):
        drive.go(20.0)
    noise = np.random.default_rng(3)
    broken.go(0.6, said=lambda way: np.array([*noise.normal(0.0, 0.05, 2), 0.0]))
    silent.go(0.6, silent=True)
    for drive in (broken, silent):
        drive.go(3.0, silent=True)
    assert not broken.core.usable
    assert broken.error_m < 1.5 * silent.error_m + 0.01


def test_one_outlier_is_no_direction() -> None:
    drive = Drive()
    drive.go(6.0)
    outlier = iter([np.array([0.0, 0.2, 0.0])])
    usable = drive.go(4.0, said=lambda way: next(outlier, way))
    assert all(usable)
    assert abs(drive.core.flow.misalignment_rad) < 0.02


@pytest.mark.full
def test_turning_on_the_spot_tells_no_direction() -> None:
    """The sensor is 72 mm off the centre; counts are rounded."""
    drive = Drive(turning=1.0, slip=np.full(3, 0.05), speed=0.0)
    assert all(drive.go(30.0))
    assert drive.core.flow.misalignment_rad == 0.0


@pytest.mark.full
@pytest.mark.parametrize("degrees", [0.0, 3.0, 5.0, 6.0])
def test_a_pause_does_not_lower_what_is_allowed(degrees: float) -> None:
    drive = Drive()
    assert all(drive.go(10.0, math.radians(degrees)))
    drive.go(0.4, silent=True)
    usable = drive.go(10.0, math.radians(degrees))
    assert all(usable[200:])


@pytest.mark.full
@pytest.mark.parametrize("slip", [0.2, 0.25, 0.3])
def test_a_slippery_floor_from_the_start_is_learned(slip: float) -> None:
    drive = Drive(slip=np.full(3, slip))
    drive.go(20.0)
    assert drive.core.usable
    assert drive.core.flow.readings_used > 700
    assert drive.error_m < 0.5 * drive.error_alone_m


def test_readings_that_come_at_rest_end_the_silence() -> None:
    """And count only once the robot has moved: its chip may have started late."""
    core = Core()
    usable = []
    for tick in range(3000):
        reading = [0.0, 0.0, 0.0] if tick > 700 and tick % SPAN == SPAN - 1 else None
        core.tick(np.zeros(3), reading)
        usable.append(core.usable)
    assert not usable[600]
    assert all(usable[800:])
    assert core.flow.readings_used == 0
    for tick in range(3000, 3400):
        core.tick(straight(core, 0.5), [0.5 * SPAN * TICK_S, 0.0, 0.0] if tick % SPAN == SPAN - 1 else None)
    assert core.flow.readings_used > 0


@pytest.mark.full
def test_counts_that_flicker_while_the_robot_stands_are_no_way() -> None:
    """A sensor that says zero all the while is right."""
    core, rng = Core(), np.random.default_rng(0)
    for tick in range(1000):
        core.tick(straight(core, 0.5), [0.5 * SPAN * TICK_S, 0.0, 0.0] if tick % SPAN == SPAN - 1 else None)
    shown = np.zeros(3, int)
    for tick in range(60_000):
        seen = rng.integers(0, 2, 3) if tick % 7 == 0 else shown
        turned, shown = (seen - shown) * 2.0 * math.pi / 1000, seen
        core.tick(turned, [0.0, 0.0, 0.0] if tick % SPAN == SPAN - 1 else None)
        assert core.usable, tick


@pytest.mark.parametrize("change", ["set anew", "switched off"])
@pytest.mark.parametrize(
    ("before", "late"), [(before, late) for late in (40, 80, 200) for before in (3, 20, 60) if before <= late]
)
def test_a_change_on_the_way_leaves_the_covariance_one(change: str, late: int, before: int) -> None:
    """Late fixes come from before the change, when readings had measured the noise of the wheels' motion."""
    core, sd, x, poses, off = Core(), 1e-3, 0.0, [0.0], False
    core.config.r_xy, core.config.r_theta, core.config.gate = sd**2, sd**2, 30.0
    rng = np.random.default_rng(1)
    for tick in range(2500):
        x += 0.5 * TICK_S
        poses.append(x)
        off = off or (change == "switched off" and tick >= 1500 - before)
        if tick == 1500 - before and not off:
            core.mount.delay_us = 3000
        way = rng.normal([0.5 * SPAN * TICK_S, 0.0, 0.0], [SD_M, SD_M, SD_RAD])
        if off:
            core.predict(straight(core, 0.5))
        else:
            core.tick(straight(core, 0.5), list(way) if tick % SPAN == SPAN - 1 else None)
        if tick % 50 == 0 and tick > 300:
            taken = rng.normal([poses[tick + 1 - late], 0.0, 0.0], sd)
            assert core.correct(list(taken), late) == lib.OMNI_OK, tick
        assert np.linalg.eigvalsh(core.p).min() > 0.0, tick


def test_a_covariance_that_is_spoilt_restarts_the_estimate() -> None:
    core = Core()
    for tick in range(400):
        core.tick(straight(core, 0.5), [0.5 * SPAN * TICK_S, 0.0, 0.0] if tick % SPAN == SPAN - 1 else None)
    core.s.p[0][0] = -1.0
    answers = []
    for _ in range(2 * core.config.gate_restart):
        core.predict(straight(core, 0.5))
        answers.append(core.correct([0.5 * core.time_us * 1e-6, 0.0, 0.0]))
    assert answers.index(lib.OMNI_OK) == core.config.gate_restart - 1
    assert set(answers[core.config.gate_restart :]) == {lib.OMNI_OK}
    assert core.s.restarts == 1
    assert np.linalg.eigvalsh(core.p).min() > 0.0
    assert ffi.string(ffi.cast("omni_result_t", answers[0])) == "OMNI_ERR_RANGE"


def leg(core: Core, bearing_rad: float, speed: float, ticks: int, points_rad: float = 0.0, slip: Any = 0.05) -> None:
    """Drive straight on without turning, to a side of the body; the sensor points ``points_rad`` to the left."""
    wheels = (
        core.matrix @ [math.cos(bearing_rad), math.sin(bearing_rad), 0.0] * speed * TICK_S / RADIUS_M / (1.0 - slip)
    )
    seen_rad, way_m = bearing_rad - points_rad, speed * SPAN * TICK_S
    said = [way_m * math.cos(seen_rad), way_m * math.sin(seen_rad), 0.0]
    for _ in range(ticks):
        core.tick(wheels, said if (core.time_us // 1000) % SPAN == SPAN - 1 else None)


AHEAD, LEFT = 0.0, math.pi / 2


def test_one_that_pointed_elsewhere_is_used_again_only_where_its_direction_shows() -> None:
    """It is put right, but five metres straight ahead do not tell that, and what told of it is forgotten by then."""
    core = Core()
    for bearing_rad in (AHEAD, LEFT):
        leg(core, bearing_rad, 1.0, 300, math.radians(20.0))
    assert not core.usable
    leg(core, AHEAD, 1.0, 5000)
    assert core.flow.misalignment_rad == 0.0, "not known"
    assert not core.usable
    for bearing_rad in (LEFT, AHEAD) * 2:
        leg(core, bearing_rad, 1.0, 500)
    assert core.usable


def test_one_that_comes_loose_while_it_leads_is_found_on_a_floor_whose_slip_is_known() -> None:
    """The wheels turn a third further than the robot goes: that is learned, and makes no difference."""
    core = Core()
    for bearing_rad in (AHEAD, LEFT) * 3:
        leg(core, bearing_rad, 0.12, 1000, slip=0.25)
    assert core.usable
    for bearing_rad in (LEFT, AHEAD) * 5:
        leg(core, bearing_rad, 0.12, 300, math.radians(35.0), slip=0.25)
    assert core.flow.misaligned
    assert not core.usable


class WithGyro(Core):
    """The sensor measures no turn, a gyro does: the robot does not turn."""

    def __init__(self) -> None:
        super().__init__(axes=2)
        self.config.has_gyro, self.config.q_gyro, self.config.p_bias, self.config.p_scale = True, 2.5e-12, 1e-8, 2.5e-5
        lib.omni_pose_ekf_start_gyro(self.s, self.config)
        self._turn = ffi.new("omni_ekf_gyro_rate_t *", {"overrides_wheels": True})

    def predict(self, turned: Any) -> None:
        self.time_us += 1000
        wheels = ffi.new("float[4]", list(turned))
        lib.omni_pose_ekf_predict_gyro(self.s, self.config, self.k, wheels, self._turn, self.time_us)


def test_wheels_that_turn_a_robot_more_than_its_gyro_does_say_nothing_of_where_a_sensor_points() -> None:
    """One spins whenever the robot goes ahead, so by the wheels it goes to a side as well, and turns."""
    core = WithGyro()
    for _ in range(2):
        leg(core, AHEAD, 0.5, 500, slip=np.array([0.05, 0.7, 0.05]))
        leg(core, LEFT, 0.5, 500)
        assert core.usable
    assert core.flow.misalignment_rad == 0.0
