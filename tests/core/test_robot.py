# SPDX-License-Identifier: MIT
"""The whole tick: what moves the motors, what stops them, and what never reaches them."""

from __future__ import annotations

import math
from typing import Any

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from omniwheel._core import ffi, lib
from omniwheel.robots import parameter_table

TICK_US = 1000


class Bench:
    """One robot on a test bench: wheels that follow the voltage with the motor's mechanical lag."""

    def __init__(self, robot_name: str = "three_wheel", **parameters: float) -> None:
        self.values = ffi.new("float[]", lib.OMNI_PARAM_COUNT)
        index = lib.omni_builtin_robot_find(robot_name.encode())
        assert index >= 0
        for i in range(lib.OMNI_PARAM_COUNT):
            self.values[i] = lib.omni_builtin_robots[index].values[i]
        self.config = self.configure(**parameters)
        self.robot = ffi.new("omni_robot_t *")
        lib.omni_robot_init(self.robot, self.config)
        self.inputs = ffi.new("omni_inputs_t *")
        self.outputs = ffi.new("omni_outputs_t *")
        self.inputs.counts_valid = 0xF
        self.angle = [0.0] * 4
        self.speed = [0.0] * 4
        self.wheels = int(self.values[lib.OMNI_PARAM_WHEELS])
        self.time_us = 0
        self.alive = True
        self.turning: float = 1.0  # share of the speed that a free wheel has
        self.crossed: int | None = None  # wheel whose encoder wires are swapped
        self.plan: Any = None

    def configure(self, **parameters: float) -> Any:
        """Build a configuration with some parameters changed."""
        for name, value in parameters.items():
            index = lib.omni_param_find(name.encode())
            assert index >= 0, name
            self.values[index] = value
        config = ffi.new("omni_robot_config_t *")
        bad = ffi.new("int32_t *")
        assert lib.omni_robot_config(config, self.values, bad) == lib.OMNI_OK, bad[0]
        return config

    def tick(self, events: int = 0, count: int = 1) -> Any:
        """Run some ticks; the events belong to the first."""
        counts_per_rad = self.values[lib.OMNI_PARAM_ENC_CPR] / (2 * math.pi)
        motor = ffi.addressof(self.config, "motor")
        speed_gain = lib.omni_motor_speed_gain(motor)
        lag = 1 - math.exp(-TICK_US * 1e-6 * speed_gain / lib.omni_motor_acceleration_gain(motor))
        for k in range(count):
            self.time_us += TICK_US
            self.inputs.time_us = self.time_us
            if self.alive:
                self.inputs.heartbeat_us = self.time_us
            self.inputs.events = events if k == 0 else 0
            for i in range(self.wheels):
                direction = self.config.encoder_direction[i] * (-1 if i == self.crossed else 1)
                self.inputs.counts[i] = math.floor(self.angle[i] * counts_per_rad) * direction
            lib.omni_robot_tick(self.robot, self.inputs, self.outputs)
            for i in range(self.wheels):
                voltage = self.outputs.duty[i] * self.config.motor_direction[i] * self.outputs.supply_V
                self.speed[i] += (voltage / speed_gain - self.speed[i]) * lag
                self.angle[i] += self.speed[i] * TICK_US * 1e-6 * self.turning
        return self.outputs

    def arm(self) -> Any:
        """Arm and check that it took."""
        self.tick(count=2)
        out = self.tick(lib.OMNI_EVENT_ARM)
        assert out.state == lib.OMNI_STATE_ARMED
        return out

    def command(self, kind: int, *, pose: Any = (0, 0, 0), twist: Any = (0, 0, 0), duty: Any = (0, 0, 0, 0)) -> None:
        """Give a fresh set-point."""
        setpoint = self.inputs.setpoint
        setpoint.kind = kind
        setpoint.time_us = self.time_us
        setpoint.pose.x, setpoint.pose.y, setpoint.pose.theta = pose
        setpoint.twist.vx, setpoint.twist.vy, setpoint.twist.wz = twist
        for i in range(4):
            setpoint.duty[i] = duty[i]

    def follow(self, **parameters: float) -> None:
        """Plan the configured trajectory from where the robot is, and start it."""
        self.config = self.configure(**parameters)
        lib.omni_robot_set_config(self.robot, self.config)
        self.plan = ffi.new("omni_trajectory_t *")
        at = ffi.new("omni_pose_t *", self.outputs.pose)
        config = ffi.addressof(self.config, "trajectory")
        kinematics = ffi.addressof(self.config, "kinematics")
        assert lib.omni_trajectory_plan(self.plan, config, kinematics, ffi.NULL, at) == lib.OMNI_OK
        self.inputs.trajectory = self.plan
        self.command(lib.OMNI_SETPOINT_TRAJECTORY)
        self.tick(lib.OMNI_EVENT_TRAJECTORY_START)


def silent(out: Any) -> bool:
    """No motor gets anything."""
    return not out.drive and all(out.duty[i] == 0.0 for i in range(4))


def test_motors_rest_until_armed() -> None:
    bench = Bench()
    bench.command(lib.OMNI_SETPOINT_VELOCITY_BODY, twist=(0.1, 0, 0))
    for _ in range(20):
        bench.command(lib.OMNI_SETPOINT_VELOCITY_BODY, twist=(0.1, 0, 0))
        out = bench.tick()
        assert silent(out)
    assert out.state == lib.OMNI_STATE_DISARMED
    bench.arm()
    bench.command(lib.OMNI_SETPOINT_VELOCITY_BODY, twist=(0.1, 0, 0))
    out = bench.tick(count=50)
    assert out.drive
    assert any(abs(out.duty[i]) > 0.05 for i in range(3))


@pytest.mark.parametrize("robot_name", ["three_wheel", "four_wheel"])
@pytest.mark.parametrize("twist", [(0.05, 0, 0), (0, 0.05, 0), (0, 0, 0.3), (0.03, -0.04, 0.2)])
def test_velocity_command_moves_the_body_as_asked(robot_name: str, twist: tuple[float, float, float]) -> None:
    # The bench's wheels are independent: what they show in the null direction is not slip, so none is estimated.
    bench = Bench(robot_name, LIM_A=100.0, EKF_MODE=lib.OMNI_EKF_MODE_POSE)
    bench.arm()
    for _ in range(1000):
        bench.command(lib.OMNI_SETPOINT_VELOCITY_BODY, twist=twist)
        out = bench.tick()
    speed = math.hypot(out.rate.vx, out.rate.vy)
    assert speed == pytest.approx(math.hypot(*twist[:2]), abs=2e-3)
    assert out.rate.wz == pytest.approx(twist[2], abs=0.02)
    assert out.pose.theta == pytest.approx(twist[2] * 1.0, abs=0.02)


def test_signs_of_motor_and_encoder_are_data() -> None:
    plain, turned = Bench(), Bench(W2_MOT_DIR=-1, W2_ENC_DIR=-1)
    for bench in (plain, turned):
        bench.arm()
        for _ in range(200):
            bench.command(lib.OMNI_SETPOINT_VELOCITY_BODY, twist=(0.05, 0.02, 0.1))
            bench.tick()
    assert turned.outputs.duty[1] == -plain.outputs.duty[1]
    assert turned.outputs.wheel_rad_s[1] == pytest.approx(plain.outputs.wheel_rad_s[1])
    assert turned.outputs.pose.x == pytest.approx(plain.outputs.pose.x)


def test_silent_set_points_stop_the_motors_on_time() -> None:
    bench = Bench(SAFE_CMD_TO=0.3)
    bench.arm()
    bench.command(lib.OMNI_SETPOINT_VELOCITY_BODY, twist=(0.05, 0, 0))
    out = bench.tick(count=300)
    assert out.state == lib.OMNI_STATE_ARMED
    out = bench.tick(count=1)
    assert out.state == lib.OMNI_STATE_FAILSAFE
    assert silent(out)
    assert out.fault_history & lib.OMNI_FAULT_COMMAND_LOSS
    bench.command(lib.OMNI_SETPOINT_VELOCITY_BODY, twist=(0.05, 0, 0))
    assert silent(bench.tick(lib.OMNI_EVENT_ARM)), "only disarming leads out of a failsafe"
    bench.tick(lib.OMNI_EVENT_DISARM, count=200)  # its wheels come to rest
    assert bench.tick(lib.OMNI_EVENT_ARM).state == lib.OMNI_STATE_ARMED


def test_a_set_point_from_before_arming_is_ignored_not_a_fault() -> None:
    bench = Bench()
    bench.command(lib.OMNI_SETPOINT_VELOCITY_BODY, twist=(0.1, 0, 0))
    bench.tick(count=1000)
    bench.arm()
    out = bench.tick(count=500)
    assert out.state == lib.OMNI_STATE_ARMED
    assert out.setpoint_kind == lib.OMNI_SETPOINT_NONE
    assert abs(out.rate.vx) < 1e-3


def test_lost_heartbeat_stops_and_prevents_arming() -> None:
    bench = Bench(SAFE_LINK_TO=1.0)
    bench.arm()
    bench.alive = False
    assert bench.tick(count=1000).state == lib.OMNI_STATE_ARMED
    out = bench.tick()
    assert out.state == lib.OMNI_STATE_FAILSAFE
    assert out.faults & lib.OMNI_FAULT_LINK_LOSS
    bench.tick(lib.OMNI_EVENT_DISARM)
    assert bench.tick(lib.OMNI_EVENT_ARM).state == lib.OMNI_STATE_DISARMED
    bench.outputs.faults = 0  # telemetry: nothing of the core reads it back
    assert lib.omni_robot_arming_faults(bench.robot) & lib.OMNI_FAULT_LINK_LOSS


def test_emergency_stop_latches() -> None:
    bench = Bench()
    bench.arm()
    assert silent(bench.tick(lib.OMNI_EVENT_ESTOP))
    for event in (lib.OMNI_EVENT_ARM, lib.OMNI_EVENT_DISARM, lib.OMNI_EVENT_ARM | lib.OMNI_EVENT_DISARM):
        assert bench.tick(event).state == lib.OMNI_STATE_ESTOP
    assert bench.tick(lib.OMNI_EVENT_ESTOP_CLEAR | lib.OMNI_EVENT_ESTOP).state == lib.OMNI_STATE_ESTOP
    assert bench.tick(lib.OMNI_EVENT_ESTOP_CLEAR).state == lib.OMNI_STATE_DISARMED


def test_blocked_wheels_stop_the_motors() -> None:
    bench = Bench(SAFE_STALL_T=0.2)
    bench.arm()
    bench.turning = False
    ticks = 0
    while bench.outputs.state == lib.OMNI_STATE_ARMED and ticks < 2000:
        bench.command(lib.OMNI_SETPOINT_VELOCITY_BODY, twist=(0.1, 0, 0))
        bench.tick()
        ticks += 1
    assert bench.outputs.fault_history & lib.OMNI_FAULT_STALL
    assert ticks < 600


def test_reversed_encoder_stops_the_motors() -> None:
    bench = Bench()
    bench.arm()
    bench.crossed = 0
    ticks = 0
    while bench.outputs.state == lib.OMNI_STATE_ARMED and ticks < 3000:
        bench.command(lib.OMNI_SETPOINT_VELOCITY_BODY, twist=(0, 0.05, 0.2))
        bench.tick()
        ticks += 1
    assert bench.outputs.state == lib.OMNI_STATE_FAILSAFE
    assert bench.outputs.fault_history & lib.OMNI_FAULT_STALL
    assert ticks < 500


def test_one_impossible_count_is_thrown_away() -> None:
    bench = Bench()
    bench.arm()
    bench.tick(count=100)
    bench.angle[0] += 3.0
    out = bench.tick()
    assert out.faults & lib.OMNI_WARN_ENCODER
    assert out.state == lib.OMNI_STATE_ARMED
    assert math.hypot(out.pose.x, out.pose.y) < 1e-3
    out = bench.tick(count=50)
    assert not out.faults & lib.OMNI_WARN_ENCODER


@pytest.mark.parametrize("mode", ["OFF", "SPEED", "ANGLE"])
def test_a_thrown_away_count_leaves_no_trace_in_the_speed(mode: str) -> None:
    benches = [Bench(KF_MODE=float(getattr(lib, f"OMNI_KF_MODE_{mode}")), WS_P=0.0, WS_I=0.0) for _ in range(2)]
    for bench in benches:
        bench.arm()
        for _ in range(40):
            bench.command(lib.OMNI_SETPOINT_DUTY, duty=(0.5, -0.5, 0.5, 0))
            bench.tick(count=10)
    benches[1].angle[0] += 3.0
    apart = []
    for _ in range(20):
        speeds = [bench.tick().wheel_rad_s[0] for bench in benches]
        apart.append(abs(speeds[1] - speeds[0]))
    assert max(apart) < (0.64 if mode != "ANGLE" else 0.1)  # a count more or less is 0.63 rad/s, filtered 0.08
    assert speeds[0] > 1.0
    assert benches[1].outputs.pose.theta == pytest.approx(benches[0].outputs.pose.theta, abs=1e-4)


def test_counts_that_come_late_are_not_counted_twice() -> None:
    benches = [Bench() for _ in range(2)]
    for bench in benches:
        bench.arm()
        for _ in range(40):
            bench.command(lib.OMNI_SETPOINT_DUTY, duty=(0.5, 0.5, 0.5, 0))
            bench.tick(count=10)
    for n in range(90):
        benches[1].inputs.counts_valid = 0xF if n % 3 == 0 else 0xE
        for bench in benches:
            bench.command(lib.OMNI_SETPOINT_DUTY, duty=(0.5, 0.5, 0.5, 0))
            bench.tick()
    assert benches[1].outputs.state == lib.OMNI_STATE_ARMED
    # Twice counted, 60 ticks of wheel 1 would have turned the robot by 5 mrad more.
    assert benches[1].outputs.pose.theta == pytest.approx(benches[0].outputs.pose.theta, abs=3e-4)


def test_an_encoder_reported_dead_stops_the_motors() -> None:
    bench = Bench()
    bench.arm()
    bench.inputs.counts_valid = 0b101
    out = bench.tick(count=2)
    assert out.state == lib.OMNI_STATE_ARMED
    assert bench.tick().state == lib.OMNI_STATE_FAILSAFE
    assert bench.outputs.faults & lib.OMNI_FAULT_ENCODER


@pytest.mark.parametrize("mode", [lib.OMNI_KF_MODE_OFF, lib.OMNI_KF_MODE_SPEED, lib.OMNI_KF_MODE_ANGLE])
def test_a_wheel_whose_encoder_is_dead_is_not_said_to_stand(mode: int) -> None:
    bench = Bench(KF_MODE=mode)
    bench.arm()
    for _ in range(500):
        bench.command(lib.OMNI_SETPOINT_VELOCITY_BODY, twist=(0.0, 0.0, 0.4))
        bench.tick()
    speed = bench.speed[1]
    bench.inputs.counts_valid = 0b101
    assert bench.tick(count=3).state == lib.OMNI_STATE_FAILSAFE
    assert bench.outputs.stop.wheel == 2
    assert abs(speed) > 1.0
    assert bench.outputs.stop.wheel_rad_s == pytest.approx(speed, rel=0.2)


@pytest.mark.parametrize("step_us", [0, -1000, 10_001, 5_000_000])
def test_a_jump_in_time_stops_the_motors(step_us: int) -> None:
    bench = Bench()
    bench.arm()
    bench.tick(count=10)
    bench.time_us += step_us - TICK_US
    out = bench.tick()
    assert out.faults & lib.OMNI_FAULT_TIME
    assert silent(out)


def test_missed_ticks_do_not_bend_the_estimate() -> None:
    def drive(period: int) -> Any:
        bench = Bench()
        bench.arm()
        for k in range(300):
            bench.command(lib.OMNI_SETPOINT_VELOCITY_BODY, twist=(0.08, 0, 0))
            bench.tick()
            if period and k % period == 0:  # two ticks go missing, the wheels turn on
                for i in range(3):
                    bench.angle[i] += 2e-3 * bench.outputs.wheel_rad_s[i]
                bench.time_us += 2 * TICK_US
        return bench.outputs

    full, gaps = drive(0), drive(50)
    assert gaps.rate.vx == pytest.approx(full.rate.vx, abs=3e-3)
    assert not gaps.faults & lib.OMNI_FAULT_STOP_MASK


def test_low_battery_and_dead_driver_stop_the_motors() -> None:
    bench = Bench()
    bench.arm()
    bench.inputs.battery_V = 8.0
    assert bench.tick(count=lib.OMNI_BATTERY_TICKS).state == lib.OMNI_STATE_FAILSAFE
    bench = Bench(SAFE_I2C_N=5)
    bench.arm()
    bench.inputs.driver_failures = 4
    assert bench.tick().state == lib.OMNI_STATE_ARMED
    bench.inputs.driver_failures = 5
    assert bench.tick().state == lib.OMNI_STATE_FAILSAFE


def test_another_parameter_set_acts_in_the_very_next_tick() -> None:
    bench = Bench()
    bench.arm()
    bench.follow(TRJ_TYPE=3, TRJ_SIZE=0.2, TRJ_PERIOD=30)
    bench.inputs.setpoint.kind = lib.OMNI_SETPOINT_TRAJECTORY
    bench.tick(count=200)
    config = bench.configure(ISMC_LAM_XY=1.0)
    config.sequence = 77
    lib.omni_robot_set_config(bench.robot, config)
    before = [bench.outputs.terms.integral[i] for i in range(3)]
    out = bench.tick()
    assert out.config_sequence == 77
    terms = out.terms
    rate = out.reference.rate
    assert terms.equivalent[0] == pytest.approx(rate.vx - 1.0 * terms.error[0], abs=1e-6)
    assert terms.integral[0] == pytest.approx(before[0], abs=1e-4), "the integral goes on"


def test_a_far_pose_is_approached_within_the_limits() -> None:
    bench = Bench()
    bench.arm()
    limit = bench.config.limits.wheel_rad_s
    furthest = 0.0
    for _ in range(12_000):
        bench.command(lib.OMNI_SETPOINT_POSE, pose=(0.6, -0.3, 0.8))
        out = bench.tick()
        furthest = max(furthest, out.reference.pose.x)
        assert max(abs(out.wheel_reference[i]) for i in range(3)) <= limit * 1.0001
        assert out.state == lib.OMNI_STATE_ARMED
    assert out.pose.x == pytest.approx(0.6, abs=2e-3)
    assert out.pose.y == pytest.approx(-0.3, abs=2e-3)
    assert out.pose.theta == pytest.approx(0.8, abs=5e-3)
    assert furthest < 0.601


def test_pose_beyond_the_limit_is_refused_and_the_robot_holds() -> None:
    bench = Bench(LIM_POS=2.0)
    bench.arm()
    bench.command(lib.OMNI_SETPOINT_POSE, pose=(2.1, 0, 0))
    out = bench.tick(count=100)
    assert out.faults & lib.OMNI_WARN_SETPOINT
    assert out.state == lib.OMNI_STATE_ARMED
    assert abs(out.pose.x) < 1e-3


def test_the_pose_estimate_is_set_only_while_disarmed() -> None:
    bench = Bench()
    bench.tick()
    bench.inputs.pose.x, bench.inputs.pose.theta = 1.5, 0.5
    out = bench.tick(lib.OMNI_EVENT_SET_POSE)
    assert (out.pose.x, out.pose.theta) == pytest.approx((1.5, 0.5))
    bench.arm()
    bench.inputs.pose.x = -3.0
    assert bench.tick(lib.OMNI_EVENT_SET_POSE).pose.x == pytest.approx(1.5, abs=1e-3)


def test_losing_the_track_stops_the_motors() -> None:
    bench = Bench(SAFE_ERR_XY=0.05)
    bench.arm()
    bench.follow(TRJ_TYPE=3, TRJ_SIZE=0.5, TRJ_PERIOD=20, TRJ_SCALE=0, SAFE_STALL_V=60)
    bench.turning = False
    bench.inputs.setpoint.kind = lib.OMNI_SETPOINT_TRAJECTORY
    out = bench.tick(count=8000)
    assert out.state == lib.OMNI_STATE_FAILSAFE
    assert out.fault_history & lib.OMNI_FAULT_TRACKING


@pytest.mark.parametrize("controller", range(lib.OMNI_CTL_MODE_COUNT))
@pytest.mark.parametrize("robot_name", ["three_wheel", "four_wheel"])
def test_every_controller_follows_a_circle(controller: int, robot_name: str) -> None:
    bench = Bench(robot_name, CTL_MODE=controller)
    bench.arm()
    bench.follow(TRJ_TYPE=3, TRJ_SIZE=0.2, TRJ_PERIOD=20, TRJ_LAPS=1, TRJ_RAMP=1.0, TRJ_ROT_AMP=0.3)
    bench.inputs.setpoint.kind = lib.OMNI_SETPOINT_TRAJECTORY
    worst = 0.0
    for _ in range(12_000):
        out = bench.tick()
        error = math.hypot(out.pose.x - out.reference.pose.x, out.pose.y - out.reference.pose.y)
        worst = max(worst, error)
    assert out.state == lib.OMNI_STATE_ARMED
    assert worst < 0.03


def test_controllers_have_the_names_of_ctl_mode() -> None:
    names = [ffi.string(lib.omni_controller_name(mode)).decode() for mode in range(lib.OMNI_CTL_MODE_COUNT)]
    assert {name: number for number, name in enumerate(names)} == parameter_table()["CTL_MODE"].values
    assert lib.omni_controller_name(lib.OMNI_CTL_MODE_COUNT) == ffi.NULL


WILD = st.one_of(
    st.floats(width=32, allow_nan=True, allow_infinity=True),
    st.floats(-2, 2, width=32),
    st.sampled_from([math.nan, math.inf, -math.inf, 0.0, 3.4e38]),
)
COUNT = st.one_of(st.integers(-(2**31), 2**31 - 1), st.integers(-20, 20))


@pytest.mark.full
@settings(suppress_health_check=[HealthCheck.data_too_large, HealthCheck.too_slow])
@given(data=st.data())
def test_nothing_that_comes_in_breaks_the_promise_of_what_goes_out(data: st.DataObject) -> None:
    bench = Bench(CTL_MODE=data.draw(st.integers(0, lib.OMNI_CTL_MODE_COUNT - 1)))
    bench.arm()
    for _ in range(8):
        inputs = bench.inputs
        inputs.time_us = data.draw(st.one_of(st.integers(0, 2**63), st.just(bench.time_us + TICK_US)))
        bench.time_us = min(inputs.time_us, 2**62)
        inputs.counts = data.draw(st.lists(COUNT, min_size=4, max_size=4))
        inputs.counts_valid = data.draw(st.integers(0, 255))
        inputs.battery_V = data.draw(WILD)
        inputs.has_fix = data.draw(st.booleans())
        inputs.fix.time_us = data.draw(st.one_of(st.just(inputs.time_us), st.integers(0, 2**64 - 1)))
        inputs.fix.pose.x, inputs.fix.pose.y, inputs.fix.pose.theta = data.draw(st.tuples(WILD, WILD, WILD))
        inputs.fix.sd_xy, inputs.fix.sd_theta = data.draw(st.tuples(WILD, WILD))
        inputs.setpoint.kind = data.draw(st.integers(0, 255))
        inputs.setpoint.time_us = inputs.time_us
        pose, twist = inputs.setpoint.pose, inputs.setpoint.twist
        pose.x, pose.y, pose.theta = data.draw(st.tuples(WILD, WILD, WILD))
        twist.vx, twist.vy, twist.wz = data.draw(st.tuples(WILD, WILD, WILD))
        inputs.setpoint.duty = data.draw(st.lists(WILD, min_size=4, max_size=4))
        inputs.events = data.draw(st.integers(0, 127))
        inputs.pose.x, inputs.pose.y, inputs.pose.theta = data.draw(st.tuples(WILD, WILD, WILD))
        inputs.heartbeat_us = inputs.time_us
        lib.omni_robot_tick(bench.robot, inputs, bench.outputs)
        check_promises(bench.outputs)
    clean = Bench()
    clean.robot, clean.time_us = bench.robot, bench.time_us
    clean.inputs.battery_V = 12.0
    lib.omni_robot_set_config(clean.robot, clean.config)
    clean.tick(lib.OMNI_EVENT_ESTOP_CLEAR | lib.OMNI_EVENT_DISARM)
    # A fix may have been beyond LIM_POS. And the wheels come to rest.
    clean.tick(lib.OMNI_EVENT_DISARM | lib.OMNI_EVENT_SET_POSE, count=300)
    assert clean.tick(lib.OMNI_EVENT_ARM).state == lib.OMNI_STATE_ARMED, "whatever happened, the robot recovers"


def check_promises(out: Any) -> None:
    """|duty| <= 1, zero unless armed, everything finite."""
    for i in range(4):
        assert abs(out.duty[i]) <= 1.0
        assert math.isfinite(out.voltage_V[i])
        assert math.isfinite(out.wheel_rad_s[i])
        if out.state != lib.OMNI_STATE_ARMED:
            assert out.duty[i] == 0.0
    assert out.drive == (out.state == lib.OMNI_STATE_ARMED)
