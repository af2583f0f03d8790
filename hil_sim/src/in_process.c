/* SPDX-License-Identifier: MIT */
#include "in_process.h"
#include "omni/bridge.h"
#include "omni/loop.h"
#include "take_readings_gen.h"

static omni_pose_t to_pose(const hil_real_t *pose) {
    return (omni_pose_t){(omni_real_t)pose[0], (omni_real_t)pose[1], (omni_real_t)pose[2]};
}

static void take_sensors(omni_inputs_t *inputs, const hil_sensors_t *sensors) {
    inputs->time_us = sensors->time_us;
    take_readings(inputs, sensors);
    const bool failed = sensors->i2c_status != 0;
    inputs->driver_failures = failed ? omni_add_failures(inputs->driver_failures, 1) : 0;
    inputs->events |= sensors->stop_button ? (uint32_t)OMNI_EVENT_ESTOP : 0u;
    inputs->has_fix = sensors->has_fix && !sensors->link_silent;
    if (inputs->has_fix) {
        inputs->fix = (omni_pose_fix_t){.time_us = sensors->fix.taken_us, .pose = to_pose(sensors->fix.pose)};
    }
    if (!sensors->link_silent) {
        inputs->heartbeat_us = sensors->time_us;
        inputs->setpoint.time_us = sensors->time_us;
    }
}

/* The pin as the firmware sets it. */
static void enable(hil_world_t *world, const omni_inputs_t *inputs, const omni_outputs_t *outputs) {
    const bool was_on = !world->chip.output_enable_high;
    const bool on = omni_may_power_motors(outputs->drive, was_on, inputs->driver_failures);
    hil_world_output_enable(world, on ? HIL_OE_ON : HIL_OE_OFF);
}

static void drive(hil_world_t *world, const omni_outputs_t *outputs) {
    hil_steps_t in1[HIL_MAX_WHEELS];
    hil_steps_t in2[HIL_MAX_WHEELS];
    for (uint32_t i = 0; i < HIL_MAX_WHEELS; i++) {
        const omni_bridge_counts_t counts = omni_bridge_counts(outputs->duty[i], outputs->drive);
        in1[i] = counts.in1;
        in2[i] = counts.in2;
    }
    hil_world_bridge(world, in1, in2);
}

void hil_in_process_tick(hil_world_t *world, omni_robot_t *robot, omni_inputs_t *inputs, omni_outputs_t *outputs) {
    hil_sensors_t sensors;
    hil_world_sense(world, &sensors);
    take_sensors(inputs, &sensors);
    omni_robot_tick(robot, inputs, outputs);
    inputs->events = 0;
    enable(world, inputs, outputs);
    drive(world, outputs);
}

void hil_in_process_step(hil_world_t *world) {
    hil_world_step(world, hil_world_tick_us(world, OMNI_TICK_US));
}
