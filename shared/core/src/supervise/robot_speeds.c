/* SPDX-License-Identifier: MIT */
#include <string.h>

#include "../math/math_inline.h"
#include "../tick/stages.h"

static const omni_real_t excess = 1.2f;     /* times its reference: a wheel may turn so fast */
static const omni_real_t tolerance = 0.05f; /* and by this share of LIM_WHEEL faster, around standstill */
static const omni_real_t at_rest = 0.1f;    /* share of LIM_WHEEL: a slower wheel lets the robot be armed */
static const omni_real_t braked_to = 0.75f; /* a wheel that slows down to this share in OMNI_SPEED_LOOKS is braked */

/* A wheel's speed since the last look, by its encoder alone: the filter believes its motor model, too. */
static omni_real_t counted_speed(const omni_robot_config_t *config, omni_int_t now, omni_int_t before, uint8_t wheel,
                                 omni_real_t per_count) {
    const omni_uint_t moved = (omni_uint_t)now - (omni_uint_t)before;
    omni_int_t delta;
    memcpy(&delta, &moved, sizeof delta);
    const omni_real_t speed = (omni_real_t)delta * per_count;
    return config->encoder_direction[wheel] < 0 ? -speed : speed;
}

static void begin_look(omni_speed_watch_t *watch, const omni_estimator_t *estimator,
                       const omni_actuation_t *actuation) {
    memcpy(watch->counts, estimator->last_counts, sizeof watch->counts);
    for (int i = 0; i < OMNI_MAX_WHEELS; ++i) {
        watch->reference[i] = omni_absf(actuation->wheel_reference[i]);
    }
    watch->left = OMNI_SPEED_TICKS;
}

/* Too fast, the same way, and not slower than at first: that long, and the loop does not hold the wheel. */
static omni_flag_t stays_fast(omni_speed_watch_t *watch, uint8_t wheel, omni_flag_t beyond, omni_real_t speed) {
    const omni_real_t first = watch->first[wheel];
    const omni_flag_t goes_on = beyond & (first * speed > 0.0f);
    const omni_flag_t over = goes_on & (watch->looks[wheel] >= (omni_real_t)OMNI_SPEED_LOOKS);
    const omni_flag_t braked = over & (omni_absf(speed) <= braked_to * omni_absf(first));
    const omni_flag_t begins = (beyond & (first * speed <= 0.0f)) | braked;
    const omni_real_t longer = omni_select(goes_on, watch->looks[wheel] + 1.0f, 0.0f);
    watch->looks[wheel] = omni_select(begins, 1.0f, longer);
    watch->first[wheel] = omni_select(begins, speed, omni_select(goes_on, first, 0.0f));
    return over & (omni_absf(speed) > braked_to * omni_absf(first));
}

static void look_at_wheels(omni_speed_watch_t *watch, const omni_robot_config_t *config,
                           const omni_estimator_t *estimator, const omni_estimate_t *estimate,
                           const omni_actuation_t *actuation) {
    const omni_real_t limit = config->limits.wheel_rad_s;
    const omni_real_t ticks = (omni_real_t)OMNI_SPEED_TICKS + ((omni_real_t)estimate->steps - (omni_real_t)watch->left);
    const omni_real_t per_count = config->rad_per_count / (config->step_s * ticks);
    omni_uint_t fault = 0;
    for (uint8_t i = 0; i < config->kinematics.wheels; ++i) {
        const omni_real_t speed = counted_speed(config, estimator->last_counts[i], watch->counts[i], i, per_count);
        const omni_real_t now = omni_absf(actuation->wheel_reference[i]);
        const omni_real_t peak = watch->reference[i]; /* a reference that chatters is low in half of the ticks */
        const omni_real_t reference = omni_select(now > peak, now, peak);
        const omni_real_t bound = watch->armed ? excess * reference + tolerance * limit : at_rest * limit;
        /* A count is more than its share of the time. */
        const omni_flag_t beyond = omni_absf(speed) > bound + per_count;
        const omni_flag_t fast = watch->armed ? stays_fast(watch, i, beyond, speed) : beyond;
        fault |= omni_select(fast, (uint32_t)OMNI_FAULT_OVERSPEED, 0u);
    }
    watch->fault = fault;
}

/* Just disarmed: until the next look, what the filter says of the wheels decides whether it may be armed again. */
static void begin_unarmed(omni_speed_watch_t *watch, const omni_robot_config_t *config,
                          const omni_estimate_t *estimate) {
    for (uint8_t i = 0; i < config->kinematics.wheels; ++i) {
        const omni_flag_t turns = omni_absf(estimate->wheel_rad_s[i]) > at_rest * config->limits.wheel_rad_s;
        watch->fault |= omni_select(turns, (uint32_t)OMNI_FAULT_OVERSPEED, 0u);
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
            begin_unarmed(watch, config, estimate);
        }
    } else {
        look_at_wheels(watch, config, estimator, estimate, actuation);
    }
    begin_look(watch, estimator, actuation);
}
