# SPDX-License-Identifier: MIT
"""The driver of a sensor that counts its own pose, against models of two: the start, the ways, what goes wrong."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest

from tests.firmware.flow_model import (
    CAME,
    CHIPS,
    OTOS,
    PERIOD_TICKS,
    PINPOINT,
    RETRY_TICKS,
    TURN,
    WHOLE,
    Cause,
    Chip,
    Flow,
)

CURVE = (0.4, -0.2, 1.5)
"""x, y [m/s] and turn rate [rad/s] of a drive in a curve."""


@pytest.fixture(params=CHIPS, ids=lambda chip: chip.name)
def flow(request: pytest.FixtureRequest) -> Iterator[Flow]:
    made = Flow(request.param)
    yield made
    made.close()


def made(chip: Chip) -> Iterator[Flow]:
    one = Flow(chip)
    yield one
    one.close()


@pytest.fixture
def otos() -> Iterator[Flow]:
    yield from made(OTOS)


@pytest.fixture
def pinpoint() -> Iterator[Flow]:
    yield from made(PINPOINT)


@pytest.mark.full
def test_it_reads_fifty_times_a_second_after_one_start(flow: Flow) -> None:
    flow.start()
    assert flow.valid[-PERIOD_TICKS:].max() == WHOLE
    first = flow.valid[flow.valid > 0][0]
    assert first == CAME, "nobody knows since when the first one has been counting"
    flow.run(1000)
    assert np.count_nonzero(flow.valid == WHOLE) == 1000 // PERIOD_TICKS
    assert set(flow.valid) == {0, WHOLE}
    assert np.abs(flow.moved[flow.valid == WHOLE]).max() == 0.0
    assert (flow.cause(), flow.call("starts"), flow.call("recoveries")) == (Cause.NONE, 1, 0)
    assert (flow.call("calibrations"), flow.call("ignored_writes")) == (1, 0)


@pytest.mark.parametrize("speed", [(0.3, 0.0, 0.0), (0.0, -0.3, 0.0), (0.0, 0.0, 2.0), CURVE, (-2.0, 2.0, -12.0)])
def test_the_ways_are_those_of_the_robot(flow: Flow, speed: tuple[float, float, float]) -> None:
    """Also round and round: the heading of an OTOS wraps each turn."""
    flow.start()
    flow.run(4000 + PERIOD_TICKS, lambda tick: speed if tick < 4000 else (0.0, 0.0, 0.0))
    radius = np.hypot(*speed[:2]) / speed[2] if speed[2] else 0.0
    way = flow.moved[flow.valid == WHOLE]
    steady = way[5:150].mean(axis=0)
    seconds = PERIOD_TICKS * 1e-3
    # A chord is shorter than its arc.
    chord = np.sin(speed[2] * seconds / 2) / (speed[2] * seconds / 2) if speed[2] else 1.0
    assert steady[:2] == pytest.approx(np.multiply(speed[:2], seconds) * chord, abs=flow.chip.step_m / 10 + 2e-6)
    assert steady[2] == pytest.approx(speed[2] * seconds, abs=flow.chip.step_rad / 10 + 2e-6)
    x, y, turn = flow.sum()
    assert turn == pytest.approx(speed[2] * 4.0, abs=flow.chip.step_rad + 1e-4)
    expected = [speed[0] * 4.0, speed[1] * 4.0]
    if radius:
        sine, cosine = np.sin(turn) / speed[2], (1 - np.cos(turn)) / speed[2]
        expected = [speed[0] * sine - speed[1] * cosine, speed[0] * cosine + speed[1] * sine]
    # Steps of the heading turn the axes a little: by half a step over the whole way.
    slack = flow.chip.step_m + flow.chip.step_rad * np.hypot(*speed[:2]) * 4.0 + 1e-4
    assert [x, y] == pytest.approx(expected, abs=slack)


def test_a_sensor_that_is_not_wanted_has_a_quiet_bus(flow: Flow) -> None:
    flow.use(False)
    flow.run(500)
    assert (flow.call("batches"), flow.call("starts")) == (0, 0)
    assert not flow.valid.any()
    flow.use(True)
    assert flow.start().valid[-PERIOD_TICKS:].max() == WHOLE
    flow.use(False)
    flow.run(2)
    before = flow.call("batches")
    flow.run(500)
    assert flow.call("batches") == before


def test_one_that_is_not_there_is_asked_five_times_a_second(flow: Flow) -> None:
    flow.faults.absent = True
    flow.run(2000)
    assert flow.cause() is Cause.ABSENT
    assert not flow.valid.any()
    assert flow.call("starts") == pytest.approx(10, abs=1)
    assert flow.call("recoveries") == 0, "the bus is free: nobody answers"
    flow.faults.absent = False
    flow.run(RETRY_TICKS).start()
    flow.run(12 * PERIOD_TICKS)
    assert (flow.valid[-PERIOD_TICKS:].max(), flow.cause()) == (WHOLE, Cause.NONE)


def test_another_chip_is_told_from_it_and_nothing_is_written_to_it(flow: Flow) -> None:
    flow.faults.other_id = 0x47
    flow.run(2000)
    assert (flow.cause(), flow.call("seen")) == (Cause.WRONG_ID, 0x47)
    assert not flow.valid.any()
    assert flow.call("calibrations") == 0


def test_a_pinpoint_of_the_second_version_is_one(pinpoint: Flow) -> None:
    pinpoint.faults.other_id = 2
    assert pinpoint.start().valid[-PERIOD_TICKS:].max() == WHOLE


@pytest.mark.parametrize("lost", [1, 3, 9])
def test_a_read_that_fails_loses_no_way(flow: Flow, lost: int) -> None:
    flow.start().run(100, CURVE)
    before = flow.sum()
    flow.call("lose", lost)
    flow.run((lost + 2) * PERIOD_TICKS, CURVE)
    readings = flow.moved[flow.valid == WHOLE]
    assert len(readings) == 2
    assert readings[:, 2].sum() == pytest.approx((lost + 2) * PERIOD_TICKS * 1e-3 * CURVE[2], abs=2e-4)
    assert flow.cause() is Cause.NONE
    assert before[2] > 0.0


def test_ten_reads_that_fail_begin_the_start_anew_and_it_is_calibrated_at_the_next_rest(flow: Flow) -> None:
    flow.start()
    flow.rest(False)
    flow.call("lose", 10)
    flow.run(10 * PERIOD_TICKS + 2, CURVE)
    assert flow.cause() is Cause.ABSENT
    flow.run(RETRY_TICKS + 20 * PERIOD_TICKS, CURVE)
    assert (flow.cause(), flow.call("starts"), flow.call("calibrations")) == (Cause.NONE, 2, 1)
    first = flow.valid[flow.valid > 0][0]
    assert first == CAME, "what it counted meanwhile is not known to be whole"
    flow.rest(True)
    flow.run(1000)
    assert flow.call("calibrations") == 2


def test_a_bus_that_is_held_low_is_freed_and_said(flow: Flow) -> None:
    flow.start()
    flow.call("hold", 1)
    flow.run(500)
    assert flow.call("recoveries") > 0
    assert flow.cause() is Cause.BUS
    assert not flow.valid[PERIOD_TICKS:].any()
    flow.call("hold", 0)
    flow.run(RETRY_TICKS).start()
    flow.run(15 * PERIOD_TICKS)
    assert (flow.valid[-PERIOD_TICKS:].max(), flow.cause()) == (WHOLE, Cause.NONE)


@pytest.mark.parametrize(
    ("chip", "fault", "cause"),
    [
        (OTOS, "blind", Cause.BLIND),
        (OTOS, "broken", Cause.BROKEN),
        (PINPOINT, "unplugged", Cause.UNPLUGGED),
        (PINPOINT, "broken", Cause.BROKEN),
    ],
    ids=lambda value: getattr(value, "name", str(value)),
)
def test_a_pose_that_the_sensor_does_not_trust_is_not_used(chip: Chip, fault: str, cause: Cause) -> None:
    """What it measures meanwhile is lost: the next way counts from the last reading that came."""
    flow = Flow(chip)
    flow.start().run(200, CURVE)
    setattr(flow.faults, fault, True)
    flow.run(PERIOD_TICKS, CURVE)
    flow.run(300, CURVE)
    assert set(flow.valid) == {0, CAME}
    assert flow.cause() is cause
    setattr(flow.faults, fault, False)
    flow.run(PERIOD_TICKS)
    flow.run(300, CURVE)
    ways = np.hypot(*flow.moved[flow.valid == WHOLE][1:, :2].T)
    assert ways == pytest.approx(np.hypot(*CURVE[:2]) * PERIOD_TICKS * 1e-3, abs=2 * chip.step_m)
    assert flow.cause() is Cause.NONE
    flow.close()


def test_one_that_restarts_by_itself_on_its_way_is_noticed(flow: Flow) -> None:
    flow.start().rest(False)
    flow.run(3000, (1.0, 0.0, 0.0))
    flow.call("power_cycle")
    flow.run(2 * PERIOD_TICKS, (1.0, 0.0, 0.0))
    assert not (flow.valid == WHOLE)[1:].any()
    assert flow.cause() is (Cause.JUMPED if flow.chip is OTOS else Cause.RESTARTED)
    flow.run(RETRY_TICKS + 20 * PERIOD_TICKS + 300, (1.0, 0.0, 0.0))
    assert flow.cause() is Cause.NONE
    ways = flow.moved[flow.valid == WHOLE]
    assert ways[:, 0] == pytest.approx(0.02, abs=2 * flow.chip.step_m), "its settings are those of the robot file again"


@pytest.mark.full
def test_a_way_without_end_never_fills_the_counter(flow: Flow) -> None:
    """100 m: an OTOS counts to 10. A reading is lost each time that it is set to zero, and said to be."""
    flow.start()
    flow.run(100_000, (1.0, 0.0, 0.0))
    assert np.abs(flow.pose()[:2]).max() < 9.0
    ways = flow.moved[flow.valid == WHOLE][1:, 0]
    assert ways == pytest.approx(0.02, abs=2 * flow.chip.step_m), "none is of another time than the driver says"
    assert ways.sum() == pytest.approx(100.0, abs=0.5)
    assert np.count_nonzero(flow.valid == CAME) == 12
    assert (flow.cause(), flow.call("starts")) == (Cause.NONE, 1)


def test_bits_that_were_lost_are_no_way(flow: Flow) -> None:
    flow.start()
    flow.put(3.0, 0.0, 0.0)
    flow.run(PERIOD_TICKS + 2)
    assert not (flow.valid == WHOLE).any()
    assert flow.cause() is Cause.JUMPED


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf, 3e38])
@pytest.mark.parametrize("axis", [0, 1, 2])
def test_a_pinpoint_that_says_no_number_is_not_believed(pinpoint: Flow, value: float, axis: int) -> None:
    pinpoint.start()
    pinpoint.put(*(value if axis == here else 0.0 for here in range(3)))
    pinpoint.run(PERIOD_TICKS + 2)
    assert not (pinpoint.valid == WHOLE).any()
    assert pinpoint.cause() is Cause.JUMPED


@pytest.mark.parametrize(
    "wheels",
    [
        {"steps": 19.894367},
        {"x_mm": 0.0},
        {"y_mm": 168.0},
        {"reversed_axes": (True, True)},
        {"reversed_axes": (False, False)},
    ],
    ids=str,
)
def test_settings_of_other_wheels_show(pinpoint: Flow, wheels: dict[str, object]) -> None:
    """So the test of the ways would fail if the driver had not written what the robot file says."""
    pinpoint.wheels(**wheels)  # type: ignore[arg-type]
    pinpoint.start().run(1000, CURVE)
    way = pinpoint.moved[pinpoint.valid == WHOLE][2:].mean(axis=0)
    assert np.abs(way[:2] - np.multiply(CURVE[:2], PERIOD_TICKS * 1e-3)).max() > 5e-4


def test_a_pinpoint_that_takes_longer_to_calibrate_is_waited_for(pinpoint: Flow) -> None:
    pinpoint.call("slow_calibration", 900)
    pinpoint.run(3000)
    assert (pinpoint.cause(), pinpoint.call("calibrations")) == (Cause.NONE, 1)
    assert pinpoint.valid[-PERIOD_TICKS:].max() == WHOLE


def test_a_tilted_otos_sees_the_floor(otos: Flow) -> None:
    otos.faults.tilted = True
    otos.start().run(1000, CURVE)
    assert otos.cause() is Cause.NONE
    assert np.count_nonzero(otos.valid == WHOLE) == 50


def test_a_gyro_is_not_calibrated_while_the_robot_moves(flow: Flow) -> None:
    """It is at the next rest, once, and the readings come all the while before that."""
    flow.rest(False)
    flow.start().run(2000, CURVE)
    assert (flow.call("calibrations"), flow.cause()) == (0, Cause.NONE)
    assert np.count_nonzero(flow.valid == WHOLE) == 2000 // PERIOD_TICKS
    flow.rest(True)
    flow.run(1000)
    assert flow.call("calibrations") == 1
    flow.run(2000)
    assert flow.call("calibrations") == 1
    assert flow.valid[-PERIOD_TICKS:].max() == WHOLE


def test_a_calibration_during_which_the_robot_moved_is_done_again(flow: Flow) -> None:
    flow.run(100)
    assert flow.call("calibrations") == 1
    flow.rest(False)
    flow.run(3000, CURVE)
    assert flow.call("calibrations") == 1
    assert set(flow.valid[-100:]) == {0, WHOLE & ~TURN}, "its gyro has been taught a bias that is not there"
    flow.rest(True)
    flow.run(3000)
    assert flow.call("calibrations") == 2
    assert flow.valid[-PERIOD_TICKS:].max() == WHOLE


def test_one_that_lost_its_power_on_the_way_is_calibrated_at_the_next_rest(flow: Flow) -> None:
    flow.start()
    flow.rest(False)
    flow.run(3000, (1.0, 0.0, 0.0))
    before = flow.call("calibrations")
    flow.call("power_cycle")
    flow.run(3000, (1.0, 0.0, 0.0))
    assert flow.call("calibrations") == before
    flow.rest(True)
    flow.run(1500)
    assert flow.call("calibrations") == before + 1


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_a_pinpoint_that_says_no_number_is_set_to_zero_and_used_again(pinpoint: Flow, axis: int) -> None:
    pinpoint.start()
    pinpoint.put(*(np.nan if axis == here else 0.0 for here in range(3)))
    pinpoint.run(RETRY_TICKS + 1000)
    pinpoint.run(1000, CURVE)
    assert (pinpoint.cause(), pinpoint.call("starts")) == (Cause.NONE, 2)
    assert np.count_nonzero(pinpoint.valid == WHOLE) == 1000 // PERIOD_TICKS
