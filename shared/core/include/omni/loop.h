/* SPDX-License-Identifier: MIT */
/**
 * @file loop.h
 * Rules of the loop around omni_robot_tick(): motor power and trajectory start and stop.
 *
 * Why: they decide whether a motor has power, so firmware and simulator share one implementation.
 */
#ifndef OMNI_LOOP_H
#define OMNI_LOOP_H

#include "omni/robot.h"

/**
 * May the motors have power after this tick? A motor driver that does not respond may still hold the duties of before
 * the last stop: so power is not switched on while it fails. Power that is on stays on until the core stops the robot
 * (SAFE_I2C_N).
 * @param drive omni_outputs_t.drive. @param was_on result of the last tick. @param failures consecutive driver
 * failures.
 */
bool omni_may_power_motors(bool drive, bool was_on, uint16_t failures);

/** failures + more, saturated at UINT16_MAX. */
uint16_t omni_add_failures(uint16_t failures, uint32_t more);

/** Start following a planned trajectory in this tick. Overrides a trajectory stop in the same tick. */
void omni_start_trajectory(omni_inputs_t *inputs, const omni_trajectory_t *plan);

/** Stop the trajectory in this tick and hold the pose; clears the setpoint. */
void omni_stop_trajectory(omni_inputs_t *inputs);

#endif
