/* SPDX-License-Identifier: MIT */
/**
 * @file pose_ekf_window.h
 * From the motion history to what happened since a fix was taken. Two sources include it, for robots with and without a
 * gyro: see pose_ekf_motion.h. Not part of the API.
 */
#ifndef OMNI_POSE_EKF_WINDOW_H
#define OMNI_POSE_EKF_WINDOW_H

#include <string.h>

#include "../math/math_inline.h"
#include "pose_ekf_internal.h"

/* Slot motion with the slip ratios known now, and its sensitivity, turned into the world frame. */
typedef struct slot_motion_t {
    omni_real_t move[OMNI_AXES];
    omni_real_t gain[OMNI_AXES][OMNI_EKF_COLUMNS];
} slot_motion_t;

static inline void rotate_pair(omni_real_t cosine, omni_real_t sine, omni_real_t *x, omni_real_t *y) {
    const omni_real_t turned = cosine * *x - sine * *y;
    *y = sine * *x + cosine * *y;
    *x = turned;
}

/* The last `share` of a slot that ended with heading `theta`. Of `s` it writes `columns` columns. */
static inline void find_slot_motion(const omni_pose_ekf_state_t *state, const omni_ekf_slot_t *slot, uint8_t columns,
                                    omni_real_t theta, omni_real_t share, slot_motion_t *s) {
    memcpy(s->move, slot->move, sizeof s->move);
    for (uint8_t i = 0; i < columns; ++i) {
        const omni_real_t change = state->slip[i] - slot->slip[i];
        for (int axis = 0; axis < OMNI_AXES; ++axis) {
            s->gain[axis][i] = slot->gain[axis][i];
            s->move[axis] += slot->gain[axis][i] * change;
        }
    }
    omni_real_t sine;
    omni_real_t cosine;
    omni_sincosf(theta - s->move[2], &sine, &cosine);
    rotate_pair(cosine * share, sine * share, &s->move[0], &s->move[1]);
    s->move[2] *= share;
    for (uint8_t i = 0; i < columns; ++i) {
        rotate_pair(cosine * share, sine * share, &s->gain[0][i], &s->gain[1][i]);
        s->gain[2][i] *= share;
    }
}

/* window->gain += F g, where F carries a pose change at the slot's end over `after`, the motion since. */
static inline void carry_gain(omni_ekf_window_t *window, const omni_real_t *after, const slot_motion_t *s,
                              uint8_t columns, omni_real_t factor) {
    for (uint8_t i = 0; i < columns; ++i) {
        const omni_real_t turned = factor * s->gain[2][i];
        window->gain[0][i] += factor * s->gain[0][i] - after[1] * turned;
        window->gain[1][i] += factor * s->gain[1][i] + after[0] * turned;
        window->gain[2][i] += turned;
    }
}

/* Noise of the pose that entered with lever arm (ax, ay) to the pose of now. */
static inline void add_pose_noise(omni_ekf_window_t *window, omni_real_t xy, omni_real_t theta, omni_real_t ax,
                                  omni_real_t ay) {
    window->noise[0][0] += xy + theta * ay * ay;
    window->noise[0][1] -= theta * ax * ay;
    window->noise[0][2] -= theta * ay;
    window->noise[1][1] += xy + theta * ax * ax;
    window->noise[1][2] += theta * ax;
    window->noise[2][2] += theta;
}

/* Noise of slip ratio i that entered when its effect on the pose of now was column i of window->gain. */
static inline void add_slip_noise(omni_ekf_window_t *window, uint8_t i, omni_real_t variance) {
    for (int a = 0; a < OMNI_AXES; ++a) {
        const omni_real_t product = variance * window->gain[a][i];
        for (int b = a; b < OMNI_AXES; ++b) {
            window->noise[a][b] += product * window->gain[b][i];
        }
        window->noise[a][OMNI_AXES + i] += product;
    }
    window->noise[OMNI_AXES + i][OMNI_AXES + i] += variance;
}

/* Put one slot in front of the window. A tick's noise enters after its motion: on average it sees `later` of the slot.
 */
static inline void prepend_slot(const omni_pose_ekf_config_t *config, const omni_ekf_slot_t *slot,
                                const slot_motion_t *s, omni_real_t share, uint8_t columns, bool slip_noise,
                                const omni_real_t *known, omni_ekf_window_t *window) {
    const omni_real_t later = omni_ekf_noise_share(slot->ticks > 0 ? slot->ticks : (uint32_t)OMNI_EKF_SLOT_TICKS);
    const omni_real_t after[2] = {window->move[0], window->move[1]};
    const omni_real_t steps = slot->steps * share;
    omni_real_t xy_noise = config->q_xy * steps;
    omni_real_t turn_noise =
        columns == OMNI_EKF_COLUMNS && config->gyro ? slot->turn_noise * share : config->q_theta * steps;
    if (known != NULL) {
        xy_noise *= 1.0f - known[0];
        turn_noise *= 1.0f - known[1];
    }
    add_pose_noise(window, xy_noise, turn_noise, after[0] + later * s->move[0], after[1] + later * s->move[1]);
    carry_gain(window, after, s, columns, later);
    for (uint8_t i = 0; slip_noise && i < columns && i < OMNI_MAX_WHEELS; ++i) {
        add_slip_noise(window, i, slot->noise[i] * share);
    }
    carry_gain(window, after, s, columns, 1.0f - later);
    for (int axis = 0; axis < OMNI_AXES; ++axis) {
        window->move[axis] += s->move[axis];
    }
}

/* What `columns` slip ratios use of a window. */
static inline void clear_window(omni_ekf_window_t *window, uint8_t columns) {
    for (int axis = 0; axis < OMNI_AXES; ++axis) {
        window->move[axis] = 0.0f;
        for (uint8_t i = 0; i < columns; ++i) {
            window->gain[axis][i] = 0.0f;
        }
    }
    for (int a = 0; a < OMNI_AXES + columns; ++a) {
        for (int b = a; b < OMNI_AXES + columns; ++b) {
            window->noise[a][b] = 0.0f;
        }
    }
}

/* @param known what a sensor of motion over the floor has taken of each slot's noise; NULL: there is none. */
static inline __attribute__((always_inline)) bool
fill_window(const omni_pose_ekf_state_t *state, const omni_pose_ekf_config_t *config, const omni_kinematics_t *k,
            uint32_t age_us, omni_ekf_window_t *window, uint8_t columns, const omni_real_t (*known)[2]) {
    /* Null space, gyro or motion over the floor have measured the slip since t_f. Most of its noise is no longer in P,
     * see the derivation. */
    const bool slip_noise = columns != OMNI_EKF_COLUMNS && known == NULL && !(k->has_null && config->r_null > 0.0f);
    clear_window(window, columns);
    uint32_t left_us = age_us;
    for (uint8_t back = 0; left_us > 0; ++back) {
        if (back > state->filled) {
            return false;
        }
        const int index = (state->newest + OMNI_EKF_HISTORY - back) % OMNI_EKF_HISTORY;
        const omni_ekf_slot_t *slot = &state->history[index];
        /* The slot being filled may be empty: it moved nothing, whatever its share. */
        const uint32_t used_us = left_us < slot->duration_us ? left_us : slot->duration_us;
        const omni_real_t share = (omni_real_t)used_us / (omni_real_t)(slot->duration_us > 0 ? slot->duration_us : 1u);
        slot_motion_t s;
        find_slot_motion(state, slot, columns, state->pose.theta - window->move[2], share, &s);
        prepend_slot(config, slot, &s, share, columns, slip_noise, known != NULL ? known[index] : NULL, window);
        left_us -= used_us;
    }
    return true;
}

#endif
