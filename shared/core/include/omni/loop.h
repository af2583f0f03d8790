/* SPDX-License-Identifier: MIT */
/**
 * @file loop.h
 * What every loop around omni_robot_tick() does in the same way: the firmware's, and the simulator's without a
 * firmware.
 *
 * Why: these rules decide whether a motor has power. So they stand here once, and each loop calls them.
 */
#ifndef OMNI_LOOP_H
#define OMNI_LOOP_H

#include "omni/robot.h"

/**
 * Whether the motors get power after this tick.
 * A motor driver that does not answer now may still hold what it was told before the last stop. So power is not
 * switched on over it; a drive that is under way goes on until the core stops it (SAFE_I2C_N).
 * @param drive omni_outputs_t.drive. @param was_on the last tick's answer. @param failures of the driver in a row.
 */
bool omni_motor_power(bool drive, bool was_on, uint16_t failures);

/** Failed updates in a row after `more` of them: it stays at its largest value. */
uint16_t omni_more_failures(uint16_t failures, uint32_t more);

/** Follow a plan from this tick on. It cancels a stop of the former path that came in the same
 * tick. */
void omni_follow_plan(omni_inputs_t *inputs, const omni_trajectory_t *plan);

/** Leave the path in this tick and hold the pose; earlier set-points no longer count. */
void omni_leave_plan(omni_inputs_t *inputs);

#endif
