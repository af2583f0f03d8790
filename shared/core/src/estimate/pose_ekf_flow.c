/* SPDX-License-Identifier: MIT */
/*
 * What a sensor of motion over the floor and the wheels say of the same motion corrects the estimate: see
 * omni/pose_ekf.h and docs/concepts/derivations/floor_motion.md.
 */
#include "pose_ekf_window.h"

enum { FLOW_ROWS = OMNI_AXES };

static const omni_real_t largest_nis = 1e9f;

/* One reading on its way into the estimate. Of arrays with FLOW_ROWS rows, `rows` are used. The rest stays zero, so
 * that all of it can be proved to be written before it is read. */
typedef struct flow_update_t {
    uint8_t rows; /* 2, or 3 with the turn */
    uint8_t columns;
    uint8_t states;
    bool gyro;
    uint32_t span_us;                              /* of the slots, as far as they count */
    omni_real_t move[OMNI_AXES];                   /* what the wheels say: dx, dy, dtheta in body axes of mid-way */
    omni_real_t gain[OMNI_AXES][OMNI_EKF_COLUMNS]; /* how that changes with each slip ratio */
    omni_real_t cosine;                            /* of the heading of mid-way */
    omni_real_t sine;
    omni_real_t theta;        /* that heading */
    omni_real_t since[2];     /* motion from mid-way to now, world frame */
    omni_real_t w[OMNI_AXES]; /* noise of the motion, which the pose has, too: m^2, m^2, rad^2 */
    omni_real_t c[OMNI_AXES]; /* variance of the counts' rounding */
    omni_real_t r[OMNI_AXES]; /* of the reading */
    omni_real_t innovation[FLOW_ROWS];
    omni_real_t h[FLOW_ROWS][OMNI_EKF_COLUMNS];
    omni_real_t factor[FLOW_ROWS][FLOW_ROWS];      /* Cholesky factor of S */
    omni_real_t white[FLOW_ROWS];                  /* innovation over it */
    omni_real_t share[FLOW_ROWS][OMNI_EKF_STATES]; /* covariance of the state with the innovation, over it */
} flow_update_t;

/* The slots of a reading, from now back. */
typedef struct flow_part_t {
    uint32_t skip_us; /* still to be passed over: from the end of the reading to now */
    uint32_t left_us; /* of the reading, still to come */
    uint16_t index;   /* of the slot */
    uint8_t back;     /* slots so far */
    uint32_t used_us; /* of the slot, within the reading */
    omni_real_t used; /* the same as a share of the slot */
    omni_real_t skipped;
    bool whole; /* a slot counts if it ended within the reading, and then all of it */
} flow_part_t;

static void first_part(flow_part_t *part, const omni_ekf_flow_t *flow, bool whole) {
    part->whole = whole;
    part->skip_us = flow->age_us;
    part->left_us = flow->span_us;
    part->back = 0;
}

/* @return false if the reading or the history has no more; `left_us` tells them apart. */
static bool next_part(const omni_pose_ekf_state_t *state, flow_part_t *part) __attribute__((noinline));

static bool next_part(const omni_pose_ekf_state_t *state, flow_part_t *part) {
    if (part->left_us == 0 || part->back > state->filled) {
        return false;
    }
    part->index = (uint16_t)((state->newest + OMNI_EKF_HISTORY - part->back) % OMNI_EKF_HISTORY);
    const uint32_t duration_us = state->history[part->index].duration_us;
    const uint32_t skipped_us = part->skip_us < duration_us ? part->skip_us : duration_us;
    const uint32_t rest_us = duration_us - skipped_us;
    const omni_real_t all_us = (omni_real_t)(duration_us > 0 ? duration_us : 1u);
    part->used_us = part->left_us < rest_us ? part->left_us : rest_us;
    part->used = (omni_real_t)part->used_us / all_us;
    part->skipped = (omni_real_t)skipped_us / all_us;
    part->skip_us -= skipped_us;
    part->left_us -= part->used_us;
    if (part->whole) {
        const bool ended = skipped_us == 0 && part->back > 0;
        part->used_us = ended ? duration_us : 0;
        part->used = ended ? 1.0f : 0.0f;
        part->skipped = 1.0f - part->used;
    }
    ++part->back;
    return true;
}

/* Motion of the slots from span_us + age_us ago to age_us ago, world frame. @param whole of those that ended then, as a
 * whole. @return false beyond the history. */
static bool gather_motion(flow_update_t *u, const omni_pose_ekf_state_t *state, const omni_pose_ekf_config_t *config,
                          const omni_ekf_flow_t *flow, omni_ekf_window_t *window, bool whole) {
    flow_part_t part;
    omni_real_t theta = state->pose.theta; /* at the end of the slot that is looked at */
    omni_real_t later[OMNI_AXES] = {0.0f, 0.0f, 0.0f};
    memset(window->move, 0, sizeof window->move);
    memset(window->gain, 0, sizeof window->gain);
    memset(u->w, 0, sizeof u->w);
    u->span_us = 0;
    first_part(&part, flow, whole);
    while (next_part(state, &part)) {
        const omni_ekf_slot_t *slot = &state->history[part.index];
        slot_motion_t motion = {{0.0f}, {{0.0f}}};
        find_slot_motion(state, slot, u->columns, theta, 1.0f, &motion);
        theta -= motion.move[2];
        u->span_us += part.used_us;
        for (int axis = 0; axis < OMNI_AXES; ++axis) {
            later[axis] += part.skipped * motion.move[axis];
            motion.move[axis] *= part.used;
            for (uint8_t i = 0; i < u->columns; ++i) {
                motion.gain[axis][i] *= part.used;
            }
        }
        carry_gain(window, window->move, &motion, u->columns, 1.0f);
        for (int axis = 0; axis < OMNI_AXES; ++axis) {
            window->move[axis] += motion.move[axis];
        }
        u->w[0] += config->q_xy * slot->steps * part.used;
        u->w[2] += (config->gyro ? slot->turn_noise : config->q_theta * slot->steps) * part.used;
    }
    u->w[1] = u->w[0];
    u->theta = state->pose.theta - later[2] - 0.5f * window->move[2];
    u->since[0] = later[0] + 0.5f * window->move[0];
    u->since[1] = later[1] + 0.5f * window->move[1];
    return part.left_us == 0;
}

/* The same in body axes of mid-way. Slip that turns the body turns these axes by half of it. */
static void see_from_body(flow_update_t *u, const omni_ekf_window_t *window) {
    omni_sincosf(u->theta, &u->sine, &u->cosine);
    memcpy(u->move, window->move, sizeof u->move);
    rotate_pair(u->cosine, -u->sine, &u->move[0], &u->move[1]);
    for (uint8_t i = 0; i < u->columns; ++i) {
        const omni_real_t turned = window->gain[2][i];
        omni_real_t gx = window->gain[0][i];
        omni_real_t gy = window->gain[1][i];
        rotate_pair(u->cosine, -u->sine, &gx, &gy);
        u->gain[0][i] = gx + 0.5f * u->move[1] * turned;
        u->gain[1][i] = gy - 0.5f * u->move[0] * turned;
        u->gain[2][i] = turned;
    }
}

/* Variance of the counts' rounding at both ends of the motion, in body axes. A gyro's turn has none. */
static void find_noise(flow_update_t *u, const omni_pose_ekf_config_t *config, const omni_kinematics_t *k,
                       const omni_ekf_flow_t *flow) {
    for (int axis = 0; axis < OMNI_AXES; ++axis) {
        u->c[axis] = 0.0f;
        for (uint8_t i = 0; i < k->wheels; ++i) {
            u->c[axis] += k->b_pinv[axis][i] * k->b_pinv[axis][i] * config->r_count;
        }
        u->r[axis] = axis < 2 ? flow->r_xy : flow->r_turn;
    }
    if (config->gyro) {
        u->c[2] = 0.0f;
    }
}

/* What the sensor's point moves more than the wheels say. */
static void find_innovation(flow_update_t *u, const omni_pose_ekf_state_t *state, const omni_ekf_flow_t *flow,
                            omni_ekf_flow_result_t *result) {
    const omni_real_t x = u->move[0] - flow->arm_m[1] * u->move[2];
    const omni_real_t y = u->move[1] + flow->arm_m[0] * u->move[2];
    u->innovation[0] = flow->move[0] - x;
    u->innovation[1] = flow->move[1] - y;
    u->innovation[2] = flow->move[2] - u->move[2];
    result->expected_m = omni_sqrtf(x * x + y * y);
    result->noise_m2 = u->w[0] + u->c[0] + u->r[0];
    result->apart_m = omni_sqrtf(u->innovation[0] * u->innovation[0] + u->innovation[1] * u->innovation[1]);
    const omni_real_t turn = u->rows > 2 ? u->innovation[2] : 0.0f;
    const omni_real_t more[OMNI_AXES] = {u->innovation[0] + flow->arm_m[1] * turn,
                                         u->innovation[1] - flow->arm_m[0] * turn, turn};
    for (int axis = 0; axis < OMNI_AXES; ++axis) {
        result->moved[axis] = u->move[axis];
        result->seen[axis] = u->move[axis] + more[axis];
        result->rolled[axis] = u->move[axis];
        for (uint8_t i = 0; i < u->columns && i < OMNI_MAX_WHEELS; ++i) {
            result->rolled[axis] -= u->gain[axis][i] * state->slip[i];
        }
    }
}

/*
 * The sensitivity to a slip ratio is the wheel's motion. The counts' rounding in that is in the innovation, too, and
 * the product would not average out. So the motion is taken that counts and reading agree on: its error has nothing to
 * do with the innovation.
 */
static void agree_on_motion(flow_update_t *u, const omni_pose_ekf_config_t *config, const omni_kinematics_t *k,
                            const omni_ekf_flow_result_t *result) {
    omni_real_t moved[OMNI_AXES];
    for (int axis = 0; axis < OMNI_AXES; ++axis) {
        moved[axis] = (result->seen[axis] - result->moved[axis]) * u->c[axis] / (u->c[axis] + u->w[axis] + u->r[axis]);
    }
    const uint8_t slips = omni_ekf_slips(config, k);
    for (uint8_t i = 0; i < slips; ++i) {
        const omni_real_t rolled = k->b[i][0] * moved[0] + k->b[i][1] * moved[1] + k->b[i][2] * moved[2];
        for (int axis = 0; axis < (config->gyro ? 2 : OMNI_AXES); ++axis) {
            u->gain[axis][i] -= k->b_pinv[axis][i] * rolled;
        }
    }
}

static void find_sensitivity(flow_update_t *u, const omni_ekf_flow_t *flow) {
    for (uint8_t i = 0; i < u->columns; ++i) {
        u->h[0][i] = u->gain[0][i] - flow->arm_m[1] * u->gain[2][i];
        u->h[1][i] = u->gain[1][i] + flow->arm_m[0] * u->gain[2][i];
        u->h[2][i] = u->gain[2][i];
    }
}

/* Covariance of the state with the innovation: what the slip ratios do to both, and the motion's noise in both. */
static void find_shares(flow_update_t *u, const omni_pose_ekf_state_t *state, const omni_real_t *lever,
                        bool noise_is_shared) {
    for (uint8_t row = 0; row < u->rows; ++row) {
        for (uint8_t a = 0; a < u->states; ++a) {
            omni_real_t sum = 0.0f;
            for (uint8_t i = 0; i < u->columns; ++i) {
                sum += state->p[a][OMNI_AXES + i] * u->h[row][i];
            }
            u->share[row][a] = sum;
        }
    }
    if (noise_is_shared) {
        u->share[0][0] += u->w[0] * u->cosine;
        u->share[0][1] += u->w[0] * u->sine;
        u->share[1][0] -= u->w[0] * u->sine;
        u->share[1][1] += u->w[0] * u->cosine;
        for (uint8_t row = 0; row < u->rows; ++row) {
            const omni_real_t turned = u->w[2] * lever[row];
            u->share[row][0] -= u->since[1] * turned;
            u->share[row][1] += u->since[0] * turned;
            u->share[row][2] += turned;
        }
    }
}

/* S = H P H^T + W + C + R = L L^T. */
static void factor_flow(flow_update_t *u, const omni_pose_ekf_state_t *state, const omni_real_t *lever) {
    for (uint8_t i = 0; i < u->rows; ++i) {
        for (uint8_t j = 0; j <= i; ++j) {
            omni_real_t sum = lever[i] * lever[j] * (u->w[2] + u->c[2]);
            if (i == j) {
                sum += u->r[i] + (i < 2 ? u->w[i] + u->c[i] : 0.0f);
            }
            for (uint8_t m = 0; m < u->columns; ++m) {
                for (uint8_t n = 0; n < u->columns; ++n) {
                    sum += u->h[i][m] * state->p[OMNI_AXES + m][OMNI_AXES + n] * u->h[j][n];
                }
            }
            for (uint8_t c = 0; c < j; ++c) {
                sum -= u->factor[i][c] * u->factor[j][c];
            }
            u->factor[i][j] = i == j ? omni_sqrtf(sum) : sum / u->factor[j][j];
        }
    }
}

static void whiten_flow(const flow_update_t *u, omni_real_t *v, ptrdiff_t stride) {
    for (int i = 0; i < u->rows; ++i) {
        for (int c = 0; c < i; ++c) {
            v[i * stride] -= u->factor[i][c] * v[c * stride];
        }
        v[i * stride] /= u->factor[i][i];
    }
}

/* The motion's noise is better known now: the history has what moved, and less noise. */
static void teach_history(const flow_update_t *u, omni_pose_ekf_state_t *state, const omni_ekf_flow_t *flow,
                          const omni_real_t *lever, omni_flag_t fits) {
    omni_real_t more[FLOW_ROWS] = {0.0f, 0.0f, 0.0f}; /* S^-1 y */
    for (int i = u->rows - 1; i >= 0; --i) {
        more[i] = u->white[i];
        for (int c = i + 1; c < u->rows; ++c) {
            more[i] -= u->factor[c][i] * more[c];
        }
        more[i] /= u->factor[i][i];
    }
    const omni_real_t noise = u->gyro ? 0.0f : u->w[2]; /* a gyro's turn stays as it is */
    const omni_real_t turn = noise * (lever[0] * more[0] + lever[1] * more[1] + lever[2] * more[2]);
    const omni_real_t known_xy = u->w[0] / (u->w[0] + u->c[0] + u->r[0]);
    const omni_real_t known_turn = u->rows > 2 ? u->w[2] / (u->w[2] + u->c[2] + u->r[2]) : 0.0f;
    flow_part_t part;
    omni_real_t theta = state->pose.theta;
    first_part(&part, flow, false);
    while (next_part(state, &part)) {
        omni_ekf_slot_t *slot = &state->history[part.index];
        const omni_real_t of_span = (omni_real_t)part.used_us / (omni_real_t)flow->span_us;
        theta -= slot->move[2];
        omni_real_t sine;
        omni_real_t cosine;
        omni_sincosf(u->theta - theta, &sine, &cosine);
        omni_real_t x = u->w[0] * more[0] * of_span;
        omni_real_t y = u->w[1] * more[1] * of_span;
        rotate_pair(cosine, sine, &x, &y);
        slot->move[0] += omni_select(fits, x, 0.0f);
        slot->move[1] += omni_select(fits, y, 0.0f);
        slot->move[2] += omni_select(fits, turn * of_span, 0.0f);
        omni_real_t *known = state->flow_known[part.index];
        known[0] = omni_clampf(known[0] + omni_select(fits, known_xy * part.used, 0.0f), 0.0f, 1.0f);
        known[1] = omni_clampf(known[1] + omni_select(fits, known_turn * part.used, 0.0f), 0.0f, 1.0f);
    }
    memcpy(state->settled.move, state->history[state->newest].move, sizeof state->settled.move);
}

/* Is it the gyro's: heading, bias, scale? Slip that lasts would teach it what is not so. */
static bool is_of_gyro(const omni_pose_ekf_config_t *config, uint8_t a) {
    return config->gyro && (a == 2 || a >= (uint8_t)(OMNI_AXES + (int)OMNI_EKF_BIAS));
}

/* x += K y and P -= K S K^T, with K = share S^-1; nothing changes unless it fits. What is the gyro's is not taught, but
 * what is not known of it counts (Schmidt's filter). */
static void correct_by_flow(flow_update_t *u, omni_pose_ekf_state_t *state, const omni_pose_ekf_config_t *config,
                            omni_flag_t fits) {
    omni_real_t delta[OMNI_EKF_STATES] = {0.0f};
    for (uint8_t a = 0; a < u->states; ++a) {
        for (uint8_t row = 0; row < u->rows; ++row) {
            u->share[row][a] = omni_select(fits, u->share[row][a], 0.0f);
            const omni_real_t white = omni_select(fits, u->white[row], 0.0f); /* or it would make NaN of nothing */
            delta[a] += is_of_gyro(config, a) ? 0.0f : u->share[row][a] * white;
        }
    }
    for (uint8_t a = 0; a < u->states; ++a) {
        for (uint8_t b = a; b < u->states; ++b) {
            const bool both = is_of_gyro(config, a) && is_of_gyro(config, b);
            for (uint8_t row = 0; row < u->rows && !both; ++row) {
                state->p[a][b] -= u->share[row][a] * u->share[row][b];
            }
            state->p[b][a] = state->p[a][b];
        }
    }
    omni_ekf_shift(state, delta, u->columns);
}

/* pose -= gain slip, in the covariance: the pose no longer depends on how far the wheels slipped during the reading. */
static void forget_slip(const flow_update_t *u, omni_pose_ekf_state_t *state,
                        omni_real_t gain[OMNI_AXES][OMNI_MAX_WHEELS]) {
    omni_real_t(*p)[OMNI_EKF_STATES] = state->p;
    for (int a = 0; a < OMNI_AXES; ++a) {
        for (int i = 0; i < OMNI_MAX_WHEELS; ++i) {
            for (uint8_t b = 0; b < u->states; ++b) {
                p[a][b] -= gain[a][i] * p[OMNI_AXES + i][b];
            }
        }
    }
    for (int a = 0; a < OMNI_AXES; ++a) {
        for (int b = a; b < OMNI_AXES; ++b) {
            for (int i = 0; i < OMNI_MAX_WHEELS; ++i) {
                p[a][b] -= p[a][OMNI_AXES + i] * gain[b][i];
            }
        }
        for (uint8_t b = (uint8_t)a; b < u->states; ++b) {
            p[b][a] = p[a][b];
        }
    }
}

/* The slots of the reading have its motion, and none that depends on slip. */
static void lead_history(const flow_update_t *u, omni_pose_ekf_state_t *state, const omni_ekf_flow_t *flow,
                         const omni_real_t *more, omni_flag_t led) {
    flow_part_t part;
    omni_real_t theta = state->pose.theta;
    first_part(&part, flow, true);
    while (next_part(state, &part)) {
        omni_ekf_slot_t *slot = &state->history[part.index];
        const omni_real_t of_span = (omni_real_t)part.used_us / (omni_real_t)(u->span_us > 0 ? u->span_us : 1u);
        theta -= slot->move[2];
        omni_real_t sine;
        omni_real_t cosine;
        omni_sincosf(u->theta - theta, &sine, &cosine);
        omni_real_t change[OMNI_AXES] = {more[0] * of_span, more[1] * of_span, more[2] * of_span};
        rotate_pair(cosine, sine, &change[0], &change[1]);
        for (int axis = 0; axis < OMNI_AXES; ++axis) {
            slot->move[axis] += omni_select(led, change[axis], 0.0f);
            const omni_real_t kept = omni_select(led && axis < u->rows, 1.0f - part.used, 1.0f);
            for (int i = 0; i < OMNI_MAX_WHEELS; ++i) {
                slot->gain[axis][i] *= kept;
            }
        }
    }
}

/* The wheels spin, or slide: the reading takes the place of what they have said. If nothing measures the turn, it is as
 * unsure as the way is long that they were wrong by. */
static void lead_motion(const flow_update_t *u, omni_pose_ekf_state_t *state, const omni_kinematics_t *k,
                        const omni_ekf_flow_t *flow, const omni_ekf_window_t *window,
                        const omni_ekf_flow_result_t *result) {
    const omni_flag_t led = result->led;
    const omni_real_t turned = omni_select(led && u->rows > 2, u->innovation[2], 0.0f);
    const omni_real_t later[2] = {u->since[0] - 0.5f * window->move[0], u->since[1] - 0.5f * window->move[1]};
    omni_real_t more[OMNI_AXES] = {result->seen[0] - u->move[0], result->seen[1] - u->move[1], turned};
    omni_real_t gain[OMNI_AXES][OMNI_MAX_WHEELS] = {{0.0f}};
    for (uint8_t i = 0; i < u->columns && i < OMNI_MAX_WHEELS; ++i) {
        const omni_real_t turn = omni_select(led, window->gain[2][i], 0.0f);
        gain[0][i] = omni_select(led, window->gain[0][i], 0.0f) - later[1] * turn;
        gain[1][i] = omni_select(led, window->gain[1][i], 0.0f) + later[0] * turn;
        gain[2][i] = u->rows > 2 ? turn : 0.0f;
    }
    forget_slip(u, state, gain);
    /* What turns the body unseen has the same sign for many readings: its deviations add up, not their squares. */
    const omni_flag_t by_gyro = u->gyro && window->gain[2][OMNI_EKF_BIAS] != 0.0f;
    const omni_real_t unseen = omni_select(by_gyro, 0.0f, result->apart_m / omni_absf(k->b[0][2]));
    const omni_real_t unseen_noise = unseen * (unseen + 2.0f * omni_sqrtf(state->p[2][2]));
    const omni_real_t arm2 = flow->arm_m[0] * flow->arm_m[0] + flow->arm_m[1] * flow->arm_m[1];
    const omni_real_t turn_noise = u->rows > 2 ? u->r[2] : unseen_noise;
    const omni_real_t xy = omni_select(led, u->r[0] + arm2 * turn_noise, 0.0f);
    const omni_real_t theta = omni_select(led, turn_noise, 0.0f);
    const omni_real_t lever[OMNI_AXES] = {-u->since[1], u->since[0], 1.0f};
    for (int a = 0; a < OMNI_AXES; ++a) {
        for (int b = 0; b < OMNI_AXES; ++b) {
            state->p[a][b] += theta * lever[a] * lever[b] + (a == b && a < 2 ? xy : 0.0f);
        }
    }
    lead_history(u, state, flow, more, led);
    omni_real_t sine;
    omni_real_t cosine;
    omni_sincosf(u->theta + 0.5f * turned, &sine, &cosine);
    omni_real_t x = result->seen[0];
    omni_real_t y = result->seen[1];
    rotate_pair(cosine, sine, &x, &y);
    omni_real_t delta[OMNI_EKF_STATES] = {0.0f};
    delta[0] = omni_select(led, x - window->move[0] - later[1] * turned, 0.0f);
    delta[1] = omni_select(led, y - window->move[1] + later[0] * turned, 0.0f);
    delta[2] = turned;
    omni_ekf_shift(state, delta, u->columns);
}

bool omni_pose_ekf_correct_flow(omni_pose_ekf_state_t *state, const omni_pose_ekf_config_t *config,
                                const omni_kinematics_t *k, const omni_ekf_flow_t *flow,
                                omni_ekf_flow_result_t *result) {
    flow_update_t u;
    omni_ekf_window_t window;
    memset(&u, 0, sizeof u);
    u.gyro = config->gyro;
    u.rows = flow->turns && !config->gyro ? 3 : 2;
    u.columns = omni_ekf_columns(config, k);
    u.states = (uint8_t)(OMNI_AXES + u.columns);
    omni_pose_ekf_settle(state, config, k);
    if (config->gyro) {
        omni_ekf_settle_turn_noise(state);
    }
    if (state->time_us <= (uint64_t)flow->age_us + flow->span_us ||
        !gather_motion(&u, state, config, flow, &window, false)) {
        return false;
    }
    const omni_real_t lever[FLOW_ROWS] = {-flow->arm_m[1], flow->arm_m[0], 1.0f};
    const bool shared = state->last_taken_us <= state->time_us - flow->age_us - flow->span_us;
    see_from_body(&u, &window);
    find_noise(&u, config, k, flow);
    find_innovation(&u, state, flow, result);
    agree_on_motion(&u, config, k, result);
    find_sensitivity(&u, flow);
    factor_flow(&u, state, lever);
    find_shares(&u, state, lever, shared);
    memcpy(u.white, u.innovation, sizeof u.white);
    whiten_flow(&u, u.white, 1);
    for (uint8_t a = 0; a < u.states; ++a) {
        whiten_flow(&u, &u.share[0][a], OMNI_EKF_STATES);
    }
    const omni_real_t nis =
        u.white[0] * u.white[0] + u.white[1] * u.white[1] + (u.rows > 2 ? u.white[2] * u.white[2] : 0.0f);
    const omni_flag_t known = nis < largest_nis; /* false for NaN: rounding has spoilt the covariance */
    result->nis = omni_select(known, nis, largest_nis);
    const omni_real_t turned_m = u.move[2] * k->b[0][2];
    const omni_flag_t moves = result->expected_m * result->expected_m + turned_m * turned_m > 16.0f * flow->r_xy;
    const omni_flag_t may_lead = flow->counts && flow->lead_nis > 0.0f && moves;
    const omni_flag_t led = known && shared && may_lead && nis > flow->lead_nis;
    result->led = led;
    result->fits = known && !led && (config->flow_gate == 0.0f || nis <= config->flow_gate);
    const omni_flag_t counts = flow->counts && result->fits;
    state->flow_slots = omni_select(counts || led, (omni_int_t)OMNI_EKF_HISTORY, state->flow_slots);
    if (!omni_all(led)) {
        if (shared) {
            teach_history(&u, state, flow, lever, counts);
        }
        correct_by_flow(&u, state, config, counts);
    }
    if (omni_any(led)) {
        omni_ekf_flow_result_t whole = *result;
        (void)gather_motion(&u, state, config, flow, &window, true);
        see_from_body(&u, &window);
        find_innovation(&u, state, flow, &whole);
        lead_motion(&u, state, k, flow, &window, &whole);
    }
    return true;
}
