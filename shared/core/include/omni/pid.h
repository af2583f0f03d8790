/* SPDX-License-Identifier: MIT */
/** @file pid.h  PID with filtered derivative on the measurement, clamped integral and back-calculated anti-windup. */
#ifndef OMNI_PID_H
#define OMNI_PID_H

#include "omni/types.h"

typedef struct omni_pid_config_t {
    omni_real_t kp;
    omni_real_t ki;
    omni_real_t kd;
    omni_real_t derivative_time_s; /**< time constant of the derivative's first-order filter, > 0 */
    omni_real_t integral_limit;    /**< limit of the integral term, in output units, >= 0 */
    omni_real_t step_s;            /**< > 0 */
} omni_pid_config_t;

typedef struct omni_pid_state_t {
    omni_real_t integral;   /**< integral term, output units */
    omni_real_t derivative; /**< filtered rate of the measurement, measurement units per second */
    omni_real_t last_measurement;
    bool primed; /**< last_measurement is valid */
} omni_pid_state_t;

void omni_pid_reset(omni_pid_state_t *state);

/** One step. @param feed_forward added to the output. @return unlimited output; report the applied value with
 *  omni_pid_limited. If an input or the result isn't finite the state is unchanged and 0 is returned. */
omni_real_t omni_pid_step(omni_pid_state_t *state, const omni_pid_config_t *config, omni_real_t reference,
                          omni_real_t measurement, omni_real_t feed_forward);

/**
 * Anti-windup by back-calculation: `wanted` was returned by step, `applied` reached the actuator. The integral is
 * corrected by the difference with the time constant kp / ki (at once if that is shorter than a step), so that in
 * lasting saturation integral + feed-forward converge to the applied value. Values that aren't finite are ignored.
 */
void omni_pid_limited(omni_pid_state_t *state, const omni_pid_config_t *config, omni_real_t wanted,
                      omni_real_t applied);

#endif
