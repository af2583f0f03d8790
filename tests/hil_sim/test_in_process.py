# SPDX-License-Identifier: MIT
"""The control core closed around the world in one process."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from hil_sim.faults import Fault
from hil_sim.record import Record
from hil_sim.world import PoseSensor, World
from omni_schema import Robot
from omniwheel._core import ffi, lib

SECOND = 1000


class Loop:
    """The core with a robot file's parameters around one world."""

    def __init__(self, robot: Robot, world: World) -> None:
        values = ffi.new("float[]", lib.OMNI_PARAM_COUNT)
        lib.omni_params_defaults(values)
        for name, value in robot.parameter_values().items():
            values[lib.omni_param_find(name.encode())] = value
        self.config = ffi.new("omni_robot_config_t *")
        assert lib.omni_robot_config(self.config, values, ffi.NULL) == lib.OMNI_OK
        self.robot = ffi.new("omni_robot_t *")
        lib.omni_robot_init(self.robot, self.config)
        self.inputs = ffi.new("omni_inputs_t *")
        self.outputs = ffi.new("omni_outputs_t *")
        self.world = world

    def run(self, ticks: int, record: Record | None = None) -> None:
        target = ffi.NULL if record is None else record.c
        lib.hil_run_in_process(self.world.c, self.robot, self.inputs, self.outputs, ticks, target)

    def arm(self) -> None:
        self.run(10)
        self.inputs.events = lib.OMNI_EVENT_ARM
        self.run(2)
        assert self.outputs.state == lib.OMNI_STATE_ARMED

    def go_to(self, x: float, y: float, theta: float) -> None:
        self.inputs.setpoint.kind = lib.OMNI_SETPOINT_POSE
        self.inputs.setpoint.pose = (x, y, theta)


@pytest.fixture
def make_loop(robots: dict[str, Robot], make_world: Any) -> Any:
    def make(name: str = "three_wheel", **options: Any) -> Loop:
        options.setdefault("pose_sensor", PoseSensor())
        return Loop(robots[name], make_world(name, **options))

    return make


def test_disarmed_robot_coasts(make_loop: Any) -> None:
    loop = make_loop()
    loop.go_to(0.3, 0.2, 0.5)
    loop.run(SECOND)
    assert loop.world.truth.tolist() == [0.0, 0.0, 0.0]
    assert list(loop.world.c.in1) == [0.0] * 4


@pytest.mark.parametrize("name", ["three_wheel", "four_wheel"])
def test_robot_reaches_its_setpoint(make_loop: Any, name: str) -> None:
    loop = make_loop(name)
    loop.arm()
    loop.go_to(0.1, -0.05, 0.3)
    loop.run(6 * SECOND)
    assert np.abs(loop.world.truth - [0.1, -0.05, 0.3]).max() < 0.01


def test_events_act_once(make_loop: Any) -> None:
    loop = make_loop()
    loop.arm()
    assert loop.inputs.events == 0


def test_record_rows_are_of_their_ticks(make_loop: Any) -> None:
    loop, record = make_loop(slip_max=0.1), Record(50, every=10)
    loop.arm()
    loop.go_to(0.05, 0.0, 0.0)
    loop.run(400, record)
    rows = record.samples
    assert len(record) == 40
    assert np.allclose(np.diff(rows["time_s"]), 0.01)
    assert rows["time_s"][0] == pytest.approx(0.02), "rows fall on whole multiples of ten ticks"
    assert np.all(np.diff(rows["reference"][:, 0]) >= 0)
    assert 0.02 < rows["reference"][-1, 0] < 0.0501
    assert np.abs(rows["truth"] - rows["estimate"])[:, :2].max() < 0.02
    assert rows["slip_ratio"][:, :3].max() > 0
    assert np.abs(rows["duty"]).max() <= 1.0
    assert set(rows["state"]) == {lib.OMNI_STATE_ARMED}
    assert not rows["wheel_reference"][:, 3].any()


def test_full_record_stops_growing(make_loop: Any) -> None:
    loop, record = make_loop(), Record(5)
    loop.run(20, record)
    assert len(record) == 5


@pytest.mark.parametrize(("capacity", "every"), [(0, 1), (1, 0)])
def test_impossible_record_is_refused(capacity: int, every: int) -> None:
    with pytest.raises(ValueError, match="both must be 1 or more"):
        Record(capacity, every)


def test_pieces_make_the_same_run(make_loop: Any) -> None:
    ends = []
    for pieces in (1, 20):
        loop = make_loop(slip_max=0.1)
        loop.arm()
        loop.go_to(0.1, 0.0, 0.0)
        for _ in range(pieces):
            loop.run(1000 // pieces)
        ends.append(bytes(ffi.buffer(loop.world.c)))
    assert ends[0] == ends[1]


def test_link_silence_stops_the_robot(make_loop: Any) -> None:
    loop = make_loop(faults=[Fault("link_silence", 1.0)])
    loop.arm()
    loop.go_to(2.0, 0.0, 0.0)
    loop.run(6 * SECOND)
    assert loop.outputs.state != lib.OMNI_STATE_ARMED
    assert np.abs(loop.world.twist).max() < 1e-3


@pytest.mark.parametrize("name", ["i2c_nack", "i2c_stuck"])
def test_i2c_failures_are_counted_and_stop_the_robot(make_loop: Any, name: str) -> None:
    loop = make_loop(faults=[Fault(name, 0.5, 1.5)])
    loop.arm()
    loop.go_to(0.5, 0.0, 0.0)
    loop.run(SECOND)
    assert loop.inputs.driver_failures > 100
    assert not loop.outputs.drive
    loop.run(SECOND)
    assert loop.inputs.driver_failures == 0
    assert list(loop.world.c.in1) == [0.0] * 4


@pytest.mark.parametrize("name", ["i2c_nack", "i2c_stuck"])
def test_with_the_output_enable_pin_a_dead_bus_does_not_keep_driving(make_loop: Any, name: str) -> None:
    speeds = {}
    for wired in (True, False):
        loop = make_loop(faults=[Fault(name, 0.5)], output_enable_wired=wired)
        loop.arm()
        loop.go_to(0.5, 0.0, 0.0)
        loop.run(SECOND)
        assert not loop.outputs.drive
        speeds[wired] = np.abs(loop.world.wheel_rad_s).max()
    assert speeds[True] < 1e-6
    assert speeds[False] > 0.1


def test_encoder_fault_stops_the_robot(make_loop: Any) -> None:
    loop = make_loop(faults=[Fault("encoder_invalid", 0.5, wheel=1)])
    loop.arm()
    loop.run(SECOND)
    assert not loop.outputs.drive
    assert loop.outputs.faults & lib.OMNI_FAULT_ENCODER
