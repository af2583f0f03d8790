/* SPDX-License-Identifier: MIT */
#include <string.h>

#include "../math/math_inline.h"
#include "../tick/stages.h"

static const omni_real_t excess = 1.2f;     /* allowed wheel speed as a multiple of its reference, */
static const omni_real_t tolerance = 0.05f; /* plus this fraction of LIM_WHEEL, around standstill */
static const omni_real_t at_rest = 0.1f;    /* fraction of LIM_WHEEL below which the robot may be armed */
static const omni_real_t braked_to =
    0.75f; /* a wheel that slows down to this fraction within OMNI_OVERSPEED_CHECKS is being braked */

/* Mean speed since the last check, by the encoder only: the filter's depends on the motor model. */
static omni_real_t counted_speed(const omni_robot_config_t *config, omni_int_t now, omni_int_t before, uint8_t wheel,
                                 omni_real_t per_count) {
    const omni_uint_t moved = (omni_uint_t)now - (omni_uint_t)before;
    omni_int_t delta;
    memcpy(&delta, &moved, sizeof delta);
    const omni_real_t speed = (omni_real_t)delta * per_count;
    return config->encoder_direction[wheel] < 0 ? -speed : speed;
}

static void start_overspeed_interval(omni_speed_watch_t *watch, const omni_estimator_t *estimator,
                                     const omni_actuation_t *actuation) {
    memcpy(watch->counts, estimator->last_counts, sizeof watch->counts);
    for (int i = 0; i < OMNI_MAX_WHEELS; ++i) {
        watch->peak_reference_rad_s[i] = omni_absf(actuation->wheel_reference[i]);
    }
    watch->ticks_left = OMNI_OVERSPEED_CHECK_TICKS;
}

/* Count checks with overspeed in one direction. @return true: OMNI_OVERSPEED_CHECKS of them without being braked. */
static bool update_overspeed_duration(omni_speed_watch_t *watch, uint8_t wheel, bool beyond, omni_real_t speed) {
    const omni_real_t first = watch->initial_speed_rad_s[wheel];
    const bool goes_on = beyond && first * speed > 0.0f;
    const bool over = goes_on && (watch->overspeed_checks[wheel] >= (omni_real_t)OMNI_OVERSPEED_CHECKS);
    const bool braked = over && (omni_absf(speed) <= braked_to * omni_absf(first));
    const bool begins = (beyond && first * speed <= 0.0f) || braked;
    const omni_real_t longer = goes_on ? watch->overspeed_checks[wheel] + 1.0f : 0.0f;
    watch->overspeed_checks[wheel] = begins ? 1.0f : longer;
    watch->initial_speed_rad_s[wheel] = begins ? speed : (goes_on ? first : 0.0f);
    return over && (omni_absf(speed) > braked_to * omni_absf(first));
}

static void check_overspeed(omni_speed_watch_t *watch, const omni_robot_config_t *config,
                            const omni_estimator_t *estimator, const omni_estimate_t *estimate,
                            const omni_actuation_t *actuation) {
    const omni_real_t limit = config->limits.wheel_rad_s;
    const omni_real_t ticks =
        (omni_real_t)OMNI_OVERSPEED_CHECK_TICKS + ((omni_real_t)estimate->steps - (omni_real_t)watch->ticks_left);
    const omni_real_t per_count = config->rad_per_count / (config->step_s * ticks);
    omni_uint_t fault = 0;
    for (uint8_t i = 0; i < config->kinematics.wheels; ++i) {
        const omni_real_t speed = counted_speed(config, estimator->last_counts[i], watch->counts[i], i, per_count);
        const omni_real_t now = omni_absf(actuation->wheel_reference[i]);
        const omni_real_t peak = watch->peak_reference_rad_s[i]; /* a chattering reference may be low at the check */
        const omni_real_t reference = omni_maxf(now, peak);
        const omni_real_t bound = watch->armed ? excess * reference + tolerance * limit : at_rest * limit;
        /* Margin of one count: quantisation. */
        const bool beyond = omni_absf(speed) > bound + per_count;
        const bool fast = watch->armed ? update_overspeed_duration(watch, i, beyond, speed) : beyond;
        fault |= fast ? (uint32_t)OMNI_FAULT_OVERSPEED : 0u;
    }
    watch->overspeed_fault = fault;
}

/* On disarming: until the next check the filter's speed decides whether the robot may be armed again. */
static void check_speed_on_disarm(omni_speed_watch_t *watch, const omni_robot_config_t *config,
                                  const omni_estimate_t *estimate) {
    for (uint8_t i = 0; i < config->kinematics.wheels; ++i) {
        const bool turns = omni_absf(estimate->wheel_rad_s[i]) > at_rest * config->limits.wheel_rad_s;
        watch->overspeed_fault |= turns ? (uint32_t)OMNI_FAULT_OVERSPEED : 0u;
    }
}

void omni_robot_watch_speeds(omni_speed_watch_t *watch, const omni_robot_config_t *config,
                             const omni_estimator_t *estimator, const omni_estimate_t *estimate,
                             const omni_target_t *target, const omni_actuation_t *actuation) {
    const bool begins = target->armed != watch->armed;
    if (begins || target->kind == OMNI_SETPOINT_DUTY) {
        memset(watch, 0, sizeof *watch);
        watch->armed = target->armed;
        if (begins && !target->armed) {
            check_speed_on_disarm(watch, config, estimate);
        }
    } else {
        check_overspeed(watch, config, estimator, estimate, actuation);
    }
    start_overspeed_interval(watch, estimator, actuation);
}
