/* SPDX-License-Identifier: MIT */
/*
 * One tick from any state of the robot with any inputs. That the state after it is one of those again makes it hold for
 * every tick.
 */
#include "any.h"

static omni_robot_config_t config;
static omni_robot_t robot;
static omni_inputs_t inputs;
static omni_outputs_t outputs;

/* Any parameter set that is accepted. */
static bool make_config(int wheels, omni_real_t ekf_mode) {
    omni_real_t values[OMNI_PARAM_COUNT];
    int32_t bad;
    ANYTHING(values);
    values[OMNI_PARAM_WHEELS] = (omni_real_t)wheels;
    values[OMNI_PARAM_EKF_MODE] = ekf_mode;
    if (omni_robot_config(&config, values, &bad) != OMNI_OK) {
        return false;
    }
    ANYTHING(config.sequence);
    return true;
}

static void make_state(void) {
    ANYTHING(robot);
    robot.config = &config;
    robot.reference_generator.trajectory = NULL;
    robot.estimator.pose_ekf.open_slot = (uint16_t)Frama_C_interval(0, OMNI_EKF_HISTORY - 1);
    robot.estimator.pose_ekf.complete_slots = (uint8_t)Frama_C_interval(0, OMNI_EKF_HISTORY - 1);
    robot.estimator.pose_ekf.slot_ticks = (uint8_t)Frama_C_interval(0, OMNI_EKF_SLOT_TICKS - 1);
    robot.supervisor.state = (omni_safety_state_t)Frama_C_interval(0, OMNI_STATE_COUNT - 1);
    robot.control.tracking = any_bool();
    const int last_tick = config.original.period_ticks - 1;
    const omni_int_t most_counts = last_tick * OMNI_ORIGINAL_LARGEST_DELTA; /* proof original */
    robot.control.original.tick = (uint16_t)Frama_C_interval(0, last_tick);
    for (int i = 0; i < OMNI_MAX_WHEELS; ++i) {
        robot.control.original.moved_counts[i] = Frama_C_interval(-most_counts, most_counts);
    }
    robot.control.original.next = (uint8_t)Frama_C_interval(0, OMNI_ORIGINAL_WINDOW - 1);
    for (int i = 0; i < OMNI_MAX_WHEELS; ++i) {
        robot.control.wheel_speed.pid[i].primed = any_bool();
    }
    robot.estimator.primed = any_bool();
    robot.applied.saturated = any_bool();
    robot.margin.violated = any_bool();
    robot.applied.tracking_error_exceeded = any_bool();
    robot.supervisor.speeds.overspeed_fault =
        (uint32_t)any_bool() * (uint32_t)OMNI_FAULT_OVERSPEED; /* no case of its own */
    robot.supervisor.speeds.armed = any_bool();
    robot.excitation.started = any_bool();
    robot.supervisor.current.overheated = any_bool();
    omni_gyro_state_t *gyro = &robot.estimator.gyro;
    gyro->ready = any_bool();
    gyro->faulty = any_bool();
    gyro->rejected = any_bool();
    gyro->turn.overrides_wheels = any_bool();
    gyro->turn.at_rest = any_bool();
    robot.estimator.flow.faulty = any_bool();
    robot.estimator.flow.stuck = any_bool();
    robot.estimator.flow.timed_out = any_bool();
    robot.estimator.flow.qualified = any_bool();
    robot.estimator.flow.direction_known = any_bool();
    robot.estimator.flow.misaligned = any_bool();
    robot.estimator.flow.alignment_verified = any_bool();
    robot.estimator.flow.overriding = any_bool();
}

/* What make_state takes for granted holds again. */
static void check_state(void) {
    /*@ check open_slot: robot.estimator.pose_ekf.open_slot < OMNI_EKF_HISTORY; */
    /*@ check complete_slots: robot.estimator.pose_ekf.complete_slots < OMNI_EKF_HISTORY; */
    /*@ check slot_ticks: robot.estimator.pose_ekf.slot_ticks < OMNI_EKF_SLOT_TICKS; */
    /*@ check window: robot.control.original.next < OMNI_ORIGINAL_WINDOW; */
    /*@ check original_tick: robot.control.original.tick < config.original.period_ticks; */
    /*@ check robot_state: robot.supervisor.state < OMNI_STATE_COUNT; */
}

static void make_inputs(void) {
    ANYTHING(inputs);
    inputs.has_fix = any_bool();
    inputs.trajectory = NULL;
}

static void tick(int wheels, omni_real_t ekf_mode) {
    if (!make_config(wheels, ekf_mode)) {
        return;
    }
    make_state();
    make_inputs();
    omni_robot_tick(&robot, &inputs, &outputs);
    check_state();
}

/* The numbers of states with and without slip are kept apart. */
static void with_wheels(int wheels) {
    tick(wheels, Frama_C_float_interval((omni_real_t)OMNI_EKF_MODE_ODOMETRY, (omni_real_t)OMNI_EKF_MODE_POSE));
    tick(wheels, (omni_real_t)OMNI_EKF_MODE_SLIP);
}

void proof_tick_three(void) {
    with_wheels(3);
}

void proof_tick_four(void) {
    with_wheels(4);
}

void proof_start(void) {
    for (int wheels = 3; wheels <= OMNI_MAX_WHEELS; ++wheels) {
        if (make_config(wheels, any_real())) {
            omni_robot_init(&robot, &config);
            check_state();
            omni_robot_set_config(&robot, &config);
            check_state();
            robot.supervisor.faults = (omni_uint_t)Frama_C_unsigned_int_interval(0, UINT32_MAX);
            (void)omni_robot_arming_faults(&robot);
        }
    }
}
