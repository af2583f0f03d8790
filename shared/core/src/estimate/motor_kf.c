/* SPDX-License-Identifier: MIT */
#include "omni/motor_kf.h"

#include <string.h>

#include "../math/math_inline.h"

void omni_motor_kf_reset(omni_motor_kf_state_t *state, const omni_motor_kf_config_t *config) {
    memset(state, 0, sizeof *state);
    state->p[0][0] = config->mode == OMNI_KF_MODE_ANGLE ? config->r_angle : 0.0f;
    state->p[1][1] = 1.0f;
    state->p[2][2] = 1.0f;
}

void omni_motor_kf_rebase(omni_motor_kf_state_t *state) {
    state->x[0] = 0.0f;
    state->missed = 0;
}

/* Time update of the angle, before that of (w, i): the first row and column of eq. 52 and 53; a[0][0] = 1. */
static void predict_angle(omni_motor_kf_state_t *state, const omni_motor_discrete_t *model, omni_real_t voltage_V) {
    const omni_real_t a01 = model->a[0][1];
    const omni_real_t a02 = model->a[0][2];
    const omni_real_t p01 = state->p[0][1];
    const omni_real_t p02 = state->p[0][2];
    const omni_real_t p12 = state->p[1][2];
    /* eq. 52 */
    state->x[0] += a01 * state->x[1] + a02 * state->x[2] + model->b[0] * voltage_V;
    /* eq. 53: first row of A P, then times the rows of A */
    const omni_real_t ap1 = p01 + a01 * state->p[1][1] + a02 * p12;
    const omni_real_t ap2 = p02 + a01 * p12 + a02 * state->p[2][2];
    state->p[0][0] += a01 * (p01 + ap1) + a02 * (p02 + ap2);
    state->p[0][1] = ap1 * model->a[1][1] + ap2 * model->a[1][2];
    state->p[0][2] = ap1 * model->a[2][1] + ap2 * model->a[2][2];
    state->p[1][0] = state->p[0][1];
    state->p[2][0] = state->p[0][2];
}

/* Time update of (w, i). */
static inline void predict_motor(omni_motor_kf_state_t *state, const omni_motor_kf_config_t *config,
                                 omni_real_t voltage_V) {
    const omni_motor_discrete_t *model = &config->model;
    const omni_real_t a11 = model->a[1][1];
    const omni_real_t a12 = model->a[1][2];
    const omni_real_t a21 = model->a[2][1];
    const omni_real_t a22 = model->a[2][2];
    const omni_real_t p11 = state->p[1][1];
    const omni_real_t p12 = state->p[1][2];
    const omni_real_t p22 = state->p[2][2];
    const omni_real_t w = state->x[1];
    const omni_real_t i = state->x[2];
    /* eq. 52 with the input: x = A x + B V */
    state->x[1] = a11 * w + a12 * i + model->b[1] * voltage_V;
    state->x[2] = a21 * w + a22 * i + model->b[2] * voltage_V;
    /* eq. 53: P = A P A^T + Q */
    const omni_real_t ap11 = a11 * p11 + a12 * p12;
    const omni_real_t ap12 = a11 * p12 + a12 * p22;
    const omni_real_t ap21 = a21 * p11 + a22 * p12;
    const omni_real_t ap22 = a21 * p12 + a22 * p22;
    state->p[1][1] = ap11 * a11 + ap12 * a12 + config->q_speed;
    state->p[1][2] = ap11 * a21 + ap12 * a22;
    state->p[2][2] = ap21 * a21 + ap22 * a22 + config->q_current;
    state->p[2][1] = state->p[1][2];
}

/*
 * Covariance after a measurement, Joseph form in place of eq. 56:
 *
 *   P = (I - K C) P (I - K C)^T + K R K^T,  C = [1 0 ..],  K = column / total,  total = C P C^T + R
 *
 * In the measured row 1 - K_0 = R / total leaves R K^T, without cancellation. This function is the change of the other
 * entries.
 */
static omni_real_t joseph_change(omni_real_t gain_i, omni_real_t gain_j, omni_real_t column_i, omni_real_t column_j,
                                 omni_real_t total) {
    return gain_i * (gain_j * total - column_j) - gain_j * column_i;
}

static bool record_innovation(omni_motor_kf_state_t *state, omni_real_t innovation, omni_real_t total) {
    state->innovation = innovation;
    state->innovation_variance = total;
    return total > 0.0f;
}

/* Measurement update of (w, i) with a measured w. */
static void correct_speed(omni_motor_kf_state_t *state, omni_real_t innovation, omni_real_t variance) {
    const omni_real_t c1 = state->p[1][1];
    const omni_real_t c2 = state->p[1][2];
    const omni_real_t total = c1 + variance;
    if (!record_innovation(state, innovation, total)) {
        return;
    }
    /* eq. 55: K = P C^T (C P C^T + R)^-1 */
    const omni_real_t inverse = 1.0f / total;
    const omni_real_t k1 = c1 * inverse;
    const omni_real_t k2 = c2 * inverse;
    /* eq. 54 */
    state->x[1] += k1 * innovation;
    state->x[2] += k2 * innovation;
    /* eq. 56, corrected */
    state->p[1][1] = variance * k1;
    state->p[1][2] = variance * k2;
    state->p[2][1] = state->p[1][2];
    state->p[2][2] += joseph_change(k2, k2, c2, c2, total);
}

/* Measurement update of (angle, w, i) with a measured angle. */
static void correct_angle(omni_motor_kf_state_t *state, omni_real_t innovation, omni_real_t variance) {
    const omni_real_t c0 = state->p[0][0];
    const omni_real_t c1 = state->p[0][1];
    const omni_real_t c2 = state->p[0][2];
    const omni_real_t total = c0 + variance;
    if (!record_innovation(state, innovation, total)) {
        return;
    }
    /* eq. 55 */
    const omni_real_t inverse = 1.0f / total;
    const omni_real_t k0 = c0 * inverse;
    const omni_real_t k1 = c1 * inverse;
    const omni_real_t k2 = c2 * inverse;
    /* eq. 54 */
    state->x[0] += k0 * innovation;
    state->x[1] += k1 * innovation;
    state->x[2] += k2 * innovation;
    /* eq. 56, corrected */
    state->p[0][0] = variance * k0;
    state->p[0][1] = variance * k1;
    state->p[0][2] = variance * k2;
    state->p[1][0] = state->p[0][1];
    state->p[2][0] = state->p[0][2];
    state->p[1][1] += joseph_change(k1, k1, c1, c1, total);
    state->p[1][2] += joseph_change(k1, k2, c1, c2, total);
    state->p[2][2] += joseph_change(k2, k2, c2, c2, total);
    state->p[2][1] = state->p[1][2];
}

/* Mean speed over the ticks since the latest valid count. */
static omni_real_t differenced_speed(const omni_motor_kf_state_t *state, const omni_motor_kf_config_t *config,
                                     omni_real_t moved_rad) {
    return moved_rad / (config->step_s * (omni_real_t)(state->missed + 1));
}

static void step_speed(omni_motor_kf_state_t *state, const omni_motor_kf_config_t *config, omni_real_t voltage_V,
                       omni_real_t speed_rad_s, bool valid) {
    predict_motor(state, config, voltage_V);
    if (valid) {
        correct_speed(state, speed_rad_s - state->x[1], config->r_speed);
    }
}

static void step_angle(omni_motor_kf_state_t *state, const omni_motor_kf_config_t *config, omni_real_t voltage_V,
                       omni_real_t moved_rad, bool valid) {
    predict_angle(state, &config->model, voltage_V);
    predict_motor(state, config, voltage_V);
    if (valid) {
        correct_angle(state, moved_rad - state->x[0], config->r_angle);
        state->x[0] -= moved_rad; /* from now on relative to the new count */
    }
}

static void count_missed_ticks(omni_motor_kf_state_t *state, bool valid) {
    if (valid) {
        state->missed = 0;
    } else if (state->missed < UINT16_MAX) {
        state->missed++;
    }
}

omni_real_t omni_motor_kf_step(omni_motor_kf_state_t *state, const omni_motor_kf_config_t *config,
                               omni_real_t voltage_V, omni_int_t delta_counts, bool valid) {
    const omni_real_t voltage = omni_is_finite(voltage_V) ? voltage_V : 0.0f;
    const omni_real_t moved_rad = (omni_real_t)delta_counts * config->rad_per_count;
    switch (config->mode) {
    case OMNI_KF_MODE_SPEED:
        step_speed(state, config, voltage, differenced_speed(state, config, moved_rad), valid);
        break;
    case OMNI_KF_MODE_ANGLE:
        step_angle(state, config, voltage, moved_rad, valid);
        break;
    default:
        state->x[1] = valid ? differenced_speed(state, config, moved_rad) : state->x[1];
        break;
    }
    count_missed_ticks(state, valid);
    return state->x[1];
}

omni_real_t omni_motor_kf_step_speed(omni_motor_kf_state_t *state, const omni_motor_kf_config_t *config,
                                     omni_real_t voltage_V, omni_real_t speed_rad_s) {
    const bool valid = omni_is_finite(speed_rad_s);
    step_speed(state, config, omni_is_finite(voltage_V) ? voltage_V : 0.0f, speed_rad_s, valid);
    count_missed_ticks(state, valid);
    return state->x[1];
}
