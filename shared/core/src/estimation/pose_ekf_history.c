/* SPDX-License-Identifier: MIT */
#include <string.h>

#include "../math/invariant.h"
#include "../math/math_inline.h"
#include "pose_ekf_internal.h"

/* Slot motion with the slip ratios known now, and its sensitivity, turned into the world frame. */
typedef struct slot_motion_t {
    omni_real_t move[OMNI_AXES];
    omni_real_t gain[OMNI_AXES][OMNI_MAX_WHEELS];
} slot_motion_t;

static void rotate_pair(omni_real_t cosine, omni_real_t sine, omni_real_t *x, omni_real_t *y) {
    const omni_real_t turned = cosine * *x - sine * *y;
    *y = sine * *x + cosine * *y;
    *x = turned;
}

static inline void add_motion(omni_ekf_slot_t *slot, const omni_pose_ekf_state_t *state,
                              const omni_ekf_motion_t *motion, uint8_t slips) {
    const omni_real_t cosine = motion->cosine * state->slot_cosine + motion->sine * state->slot_sine;
    const omni_real_t sine = motion->sine * state->slot_cosine - motion->cosine * state->slot_sine;
    omni_real_t dx = motion->move[0];
    omni_real_t dy = motion->move[1];
    rotate_pair(cosine, sine, &dx, &dy);
    for (uint8_t i = 0; i < slips; ++i) {
        omni_real_t gx = motion->gain[0][i];
        omni_real_t gy = motion->gain[1][i];
        rotate_pair(cosine, sine, &gx, &gy);
        slot->gain[0][i] += gx - dy * slot->gain[2][i];
        slot->gain[1][i] += gy + dx * slot->gain[2][i];
        slot->gain[2][i] += motion->gain[2][i];
        slot->noise[i] += motion->noise[i];
    }
    slot->move[0] += dx;
    slot->move[1] += dy;
    slot->move[2] += motion->move[2];
    slot->steps += motion->steps;
    slot->duration_us += motion->duration_us;
}

bool omni_ekf_history_add(omni_pose_ekf_state_t *state, const omni_ekf_motion_t *motion, uint8_t slips) {
    OMNI_INVARIANT(state->newest < OMNI_EKF_HISTORY && state->slot_tick < OMNI_EKF_SLOT_TICKS);
    omni_ekf_slot_t *slot = &state->history[state->newest];
    if (slips == 3) {
        add_motion(slot, state, motion, 3);
    } else if (slips == 0) {
        add_motion(slot, state, motion, 0);
    } else {
        add_motion(slot, state, motion, slips);
    }
    ++state->slot_tick;
    return state->slot_tick >= OMNI_EKF_SLOT_TICKS;
}

void omni_ekf_history_next(omni_pose_ekf_state_t *state) {
    state->newest = (uint16_t)((state->newest + 1) % OMNI_EKF_HISTORY);
    state->filled = (uint8_t)(state->filled < OMNI_EKF_HISTORY - 1 ? state->filled + 1 : state->filled);
    state->slot_tick = 0;
    omni_ekf_slot_t *slot = &state->history[state->newest];
    memset(slot, 0, sizeof *slot);
    memset(state->wheel_m, 0, sizeof state->wheel_m);
    memcpy(slot->slip, state->slip, sizeof slot->slip);
    omni_sincosf(state->pose.theta, &state->slot_sine, &state->slot_cosine);
}

void omni_ekf_history_rebase(omni_pose_ekf_state_t *state, uint8_t slips) {
    omni_ekf_slot_t *slot = &state->history[state->newest];
    for (uint8_t i = 0; i < slips; ++i) {
        const omni_real_t change = state->slip[i] - slot->slip[i];
        for (int axis = 0; axis < OMNI_AXES; ++axis) {
            slot->move[axis] += slot->gain[axis][i] * change;
        }
    }
    memcpy(slot->slip, state->slip, sizeof slot->slip);
    omni_sincosf(state->pose.theta - slot->move[2], &state->slot_sine, &state->slot_cosine);
}

/* The last `share` of a slot that ended with heading `theta`. */
static inline slot_motion_t slot_motion(const omni_pose_ekf_state_t *state, const omni_ekf_slot_t *slot, uint8_t slips,
                                        omni_real_t theta, omni_real_t share) {
    slot_motion_t s;
    memcpy(s.move, slot->move, sizeof s.move);
    memcpy(s.gain, slot->gain, sizeof s.gain);
    for (uint8_t i = 0; i < slips; ++i) {
        const omni_real_t change = state->slip[i] - slot->slip[i];
        for (int axis = 0; axis < OMNI_AXES; ++axis) {
            s.move[axis] += slot->gain[axis][i] * change;
        }
    }
    omni_real_t sine;
    omni_real_t cosine;
    omni_sincosf(theta - s.move[2], &sine, &cosine);
    rotate_pair(cosine * share, sine * share, &s.move[0], &s.move[1]);
    s.move[2] *= share;
    for (uint8_t i = 0; i < slips; ++i) {
        rotate_pair(cosine * share, sine * share, &s.gain[0][i], &s.gain[1][i]);
        s.gain[2][i] *= share;
    }
    return s;
}

/* window->gain += F g, where F carries a pose change at the slot's end over `after`, the motion since. */
static inline void carry_gain(omni_ekf_window_t *window, const omni_real_t *after, const slot_motion_t *s,
                              uint8_t slips, omni_real_t factor) {
    for (uint8_t i = 0; i < slips; ++i) {
        const omni_real_t turned = factor * s->gain[2][i];
        window->gain[0][i] += factor * s->gain[0][i] - after[1] * turned;
        window->gain[1][i] += factor * s->gain[1][i] + after[0] * turned;
        window->gain[2][i] += turned;
    }
}

/* Noise of the pose that entered with lever arm (ax, ay) to the pose of now. */
static void add_pose_noise(omni_ekf_window_t *window, omni_real_t xy, omni_real_t theta, omni_real_t ax,
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
                                const slot_motion_t *s, omni_real_t share, uint8_t slips, bool slip_noise,
                                omni_ekf_window_t *window) {
    const omni_real_t later = 0.5f - 0.5f / (omni_real_t)OMNI_EKF_SLOT_TICKS;
    const omni_real_t after[2] = {window->move[0], window->move[1]};
    const omni_real_t steps = slot->steps * share;
    add_pose_noise(window, config->q_xy * steps, config->q_theta * steps, after[0] + later * s->move[0],
                   after[1] + later * s->move[1]);
    carry_gain(window, after, s, slips, later);
    for (uint8_t i = 0; slip_noise && i < slips; ++i) {
        add_slip_noise(window, i, slot->noise[i] * share);
    }
    carry_gain(window, after, s, slips, 1.0f - later);
    for (int axis = 0; axis < OMNI_AXES; ++axis) {
        window->move[axis] += s->move[axis];
    }
}

/* What `slips` slip ratios use of a window. */
static inline void clear_window(omni_ekf_window_t *window, uint8_t slips) {
    for (int axis = 0; axis < OMNI_AXES; ++axis) {
        window->move[axis] = 0.0f;
        for (uint8_t i = 0; i < slips; ++i) {
            window->gain[axis][i] = 0.0f;
        }
    }
    for (int a = 0; a < OMNI_AXES + slips; ++a) {
        for (int b = 0; b < OMNI_AXES + slips; ++b) {
            window->noise[a][b] = 0.0f;
        }
    }
}

static inline void mirror_window(omni_ekf_window_t *window, uint8_t slips) {
    for (int a = 1; a < OMNI_AXES + slips; ++a) {
        for (int b = 0; b < a; ++b) {
            window->noise[a][b] = window->noise[b][a];
        }
    }
}

static inline bool fill_window(const omni_pose_ekf_state_t *state, const omni_pose_ekf_config_t *config,
                               const omni_kinematics_t *k, uint32_t age_us, omni_ekf_window_t *window, uint8_t slips) {
    /* The null-space measurements since t_f have already taken most of the slip noise out of P: see the derivation. */
    const bool slip_noise = !(k->has_null && config->r_null > 0.0f);
    clear_window(window, slips);
    uint32_t left_us = age_us;
    for (uint8_t back = 0; left_us > 0; ++back) {
        if (back > state->filled) {
            return false;
        }
        const omni_ekf_slot_t *slot = &state->history[(state->newest + OMNI_EKF_HISTORY - back) % OMNI_EKF_HISTORY];
        if (slot->duration_us == 0) {
            continue;
        }
        const uint32_t used_us = left_us < slot->duration_us ? left_us : slot->duration_us;
        const omni_real_t share = (omni_real_t)used_us / (omni_real_t)slot->duration_us;
        const slot_motion_t s = slot_motion(state, slot, slips, state->pose.theta - window->move[2], share);
        prepend_slot(config, slot, &s, share, slips, slip_noise, window);
        left_us -= used_us;
    }
    mirror_window(window, slips);
    return true;
}

bool omni_ekf_history_window(const omni_pose_ekf_state_t *state, const omni_pose_ekf_config_t *config,
                             const omni_kinematics_t *k, uint32_t age_us, omni_ekf_window_t *window) {
    /* The count as a constant lets the compiler unroll the loops; three wheels and no slip are the ones to be fast. */
    const uint8_t slips = omni_ekf_slips(config, k);
    if (slips == 3) {
        return fill_window(state, config, k, age_us, window, 3);
    }
    return slips == 0 ? fill_window(state, config, k, age_us, window, 0)
                      : fill_window(state, config, k, age_us, window, slips);
}
