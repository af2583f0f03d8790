/* SPDX-License-Identifier: MIT */
/**
 * @file pose_ekf_window.h
 * Motion and noise since a fix was measured, from the motion history. Two sources include it, for robots with and
 * without a gyro: see pose_ekf_motion.h. Not part of the API.
 */
#ifndef OMNI_POSE_EKF_WINDOW_H
#define OMNI_POSE_EKF_WINDOW_H

#include <string.h>

#include "../math/math_inline.h"
#include "../model/kinematics_inline.h"
#include "pose_ekf_internal.h"

/* Motion of a slot with the current slip ratios, and its Jacobian, in the world frame. */
typedef struct slot_motion_t {
    omni_real_t move[OMNI_AXES];
    omni_real_t jacobian[OMNI_AXES][OMNI_EKF_ERROR_STATES];
} slot_motion_t;

static inline void rotate_pair(omni_real_t cosine, omni_real_t sine, omni_real_t *x, omni_real_t *y) {
    const omni_real_t turned = cosine * *x - sine * *y;
    *y = sine * *x + cosine * *y;
    *x = turned;
}

/* Motion of the last `share` (0..1) of a slot that ended with heading `theta`. */
static inline void find_slot_motion(const omni_pose_ekf_state_t *state, const omni_ekf_slot_t *slot,
                                    uint8_t error_states, omni_real_t theta, omni_real_t share, slot_motion_t *s) {
    memcpy(s->move, slot->move, sizeof s->move);
    for (uint8_t i = 0; i < error_states; ++i) {
        const omni_real_t change = state->error_state[i] - slot->error_state[i];
        for (int axis = 0; axis < OMNI_AXES; ++axis) {
            s->jacobian[axis][i] = slot->jacobian[axis][i];
            s->move[axis] += slot->jacobian[axis][i] * change;
        }
    }
    omni_real_t sine;
    omni_real_t cosine;
    omni_sincosf(theta - s->move[2], &sine, &cosine);
    rotate_pair(cosine * share, sine * share, &s->move[0], &s->move[1]);
    s->move[2] *= share;
    for (uint8_t i = 0; i < error_states; ++i) {
        rotate_pair(cosine * share, sine * share, &s->jacobian[0][i], &s->jacobian[1][i]);
        s->jacobian[2][i] *= share;
    }
}

/* window->gain += F g, where F carries a pose change at the slot's end over `after`, the motion since. */
static inline void propagate_jacobian(omni_ekf_window_t *window, const omni_real_t *after, const slot_motion_t *s,
                                      uint8_t error_states, omni_real_t factor) {
    for (uint8_t i = 0; i < error_states; ++i) {
        const omni_real_t turned = factor * s->jacobian[2][i];
        window->jacobian[0][i] += factor * s->jacobian[0][i] - after[1] * turned;
        window->jacobian[1][i] += factor * s->jacobian[1][i] + after[0] * turned;
        window->jacobian[2][i] += turned;
    }
}

/* Add pose noise that acts on the current pose with lever arm (ax, ay). */
static inline void add_pose_noise(omni_ekf_window_t *window, omni_real_t xy, omni_real_t theta, omni_real_t ax,
                                  omni_real_t ay) {
    window->noise[0][0] += xy + theta * ay * ay;
    window->noise[0][1] -= theta * ax * ay;
    window->noise[0][2] -= theta * ay;
    window->noise[1][1] += xy + theta * ax * ax;
    window->noise[1][2] += theta * ax;
    window->noise[2][2] += theta;
}

/* Add noise of slip ratio i, whose effect on the current pose is column i of window->jacobian. */
static inline void add_slip_noise(omni_ekf_window_t *window, uint8_t i, omni_real_t variance) {
    for (int a = 0; a < OMNI_AXES; ++a) {
        const omni_real_t product = variance * window->jacobian[a][i];
        for (int b = a; b < OMNI_AXES; ++b) {
            window->noise[a][b] += product * window->jacobian[b][i];
        }
        window->noise[a][OMNI_AXES + i] += product;
    }
    window->noise[OMNI_AXES + i][OMNI_AXES + i] += variance;
}

/* Extend the window by one slot to the past. A tick's noise is added after its motion: on average it is transported by
 * the fraction `later` of the slot. */
static inline void prepend_slot(const omni_pose_ekf_config_t *config, const omni_ekf_slot_t *slot,
                                const slot_motion_t *s, omni_real_t share, uint8_t error_states, bool slip_noise,
                                const omni_real_t *known, omni_ekf_window_t *window) {
    const omni_real_t later =
        omni_ekf_noise_motion_fraction(slot->ticks > 0 ? slot->ticks : (uint32_t)OMNI_EKF_SLOT_TICKS);
    const omni_real_t after[2] = {window->move[0], window->move[1]};
    const omni_real_t steps = slot->steps * share;
    omni_real_t xy_noise = config->q_xy * steps;
    omni_real_t turn_noise =
        error_states == OMNI_EKF_ERROR_STATES && config->has_gyro ? slot->turn_noise * share : config->q_theta * steps;
    if (known != NULL) {
        xy_noise *= 1.0f - known[0];
        turn_noise *= 1.0f - known[1];
    }
    add_pose_noise(window, xy_noise, turn_noise, after[0] + later * s->move[0], after[1] + later * s->move[1]);
    propagate_jacobian(window, after, s, error_states, later);
    for (uint8_t i = 0; slip_noise && i < error_states && i < OMNI_MAX_WHEELS; ++i) {
        add_slip_noise(window, i, slot->slip_noise[i] * share);
    }
    propagate_jacobian(window, after, s, error_states, 1.0f - later);
    for (int axis = 0; axis < OMNI_AXES; ++axis) {
        window->move[axis] += s->move[axis];
    }
}

/* What `error_states` slip ratios use of a window. */
static inline void clear_window(omni_ekf_window_t *window, uint8_t error_states) {
    for (int axis = 0; axis < OMNI_AXES; ++axis) {
        window->move[axis] = 0.0f;
        for (uint8_t i = 0; i < error_states; ++i) {
            window->jacobian[axis][i] = 0.0f;
        }
    }
    for (int a = 0; a < OMNI_AXES + error_states; ++a) {
        for (int b = a; b < OMNI_AXES + error_states; ++b) {
            window->noise[a][b] = 0.0f;
        }
    }
}

/* @param known fraction of each slot's noise that floor odometry has removed; NULL: no floor odometry. */
static inline __attribute__((always_inline)) bool
fill_window(const omni_pose_ekf_state_t *state, const omni_pose_ekf_config_t *config, const omni_kinematics_t *k,
            uint32_t age_us, omni_ekf_window_t *window, uint8_t error_states, const omni_real_t (*known)[2]) {
    /* Null direction, gyro or floor odometry have measured the slip since t_f. Most of its noise is no longer in P,
     * see the derivation. */
    const bool slip_noise =
        error_states != OMNI_EKF_ERROR_STATES && known == NULL && !(k->has_null && config->r_null > 0.0f);
    clear_window(window, error_states);
    uint32_t left_us = age_us;
    for (uint8_t back = 0; left_us > 0; ++back) {
        if (back > state->complete_slots) {
            return false;
        }
        const int index = (state->open_slot + OMNI_EKF_HISTORY - back) % OMNI_EKF_HISTORY;
        const omni_ekf_slot_t *slot = &state->history[index];
        /* The open slot may be empty, with a duration of 0. */
        const uint32_t used_us = left_us < slot->duration_us ? left_us : slot->duration_us;
        const omni_real_t share = (omni_real_t)used_us / (omni_real_t)(slot->duration_us > 0 ? slot->duration_us : 1u);
        slot_motion_t s;
        find_slot_motion(state, slot, error_states, state->pose.theta - window->move[2], share, &s);
        prepend_slot(config, slot, &s, share, error_states, slip_noise, known != NULL ? known[index] : NULL, window);
        left_us -= used_us;
    }
    return true;
}

#endif
