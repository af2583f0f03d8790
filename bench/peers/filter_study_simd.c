/* SPDX-License-Identifier: MIT */
/**
 * @file filter_study_simd.c
 * The filter study as a program of its own for vector instructions: a run per lane, and only what this study needs.
 *
 * What makes it fast, beyond the lanes:
 * - Motor filters' gains do not depend on the data: one table serves all motors of all runs.
 * - Covariances of the pose are six numbers. P (P + R)^-1 = I - R (P + R)^-1, so one inverse gives gain and covariance.
 * - Noise is drawn in floats for a block of runs at once, by xoshiro128+ (Blackman and Vigna) in each lane. Logarithm,
 *   sine and cosine are polynomials (minimax, own fits). A normal is at most 6.6; beyond that lie 4e-11 of them.
 *
 * Left out: checks of the inputs, late fixes, gates, wrapped angles.
 */
#include <stdlib.h>

#include "filter_study_peer.h"
#include "filter_study_vectors.h"

/* Steps whose squares are added up before they go into doubles. */
enum { STEPS_PER_SUM = 64 };

/** A step's numbers that all runs share. */
typedef struct shared_t {
    number_t pose[3];
    number_t rate[3];
    number_t gain[2]; /**< of the motor filters */
} shared_t;

/** The model in the study's numbers, with what can be multiplied beforehand. */
typedef struct constants_t {
    number_t a[2][2];
    number_t b[2];
    number_t motor_sd[2];
    number_t measured_sd;
    number_t pose_sd[3];
    number_t fix_sd[3];
    number_t r[3];
    number_t rr[3][3]; /**< r_i r_j */
    number_t q[2][3];
    number_t to_moved[3][STUDY_WHEELS];
    number_t to_wheels[STUDY_WHEELS][3];
    number_t lambda[3];
    number_t lambda_step[3]; /**< lambda T */
    number_t k[3];
    int drive_true;
    int raw_measured;
    int stale;
} constants_t;

typedef struct motors_t {
    numbers_t w[STUDY_WHEELS];
    numbers_t i[STUDY_WHEELS];
} motors_t;

/** Upper triangle of a covariance. */
typedef struct covariance_t {
    numbers_t p00, p01, p02, p11, p12, p22;
} covariance_t;

/** State of a group of runs. */
typedef struct group_t {
    motors_t motors;
    motors_t open_loop;
    motors_t filter;
    numbers_t integral[3]; /**< times lambda */
    numbers_t truth[3];
    numbers_t x[STUDY_ESTIMATES][3];
    covariance_t p[2];
    numbers_t square[STUDY_ESTIMATES][3];
} group_t;

typedef struct random_t {
    words_t s[4];
} random_t;

STUDY_INLINE words_t draw_words(random_t *random) {
    words_t *s = random->s;
    const words_t result = s[0] + s[3];
    const words_t t = s[1] << 9;
    s[2] ^= s[0];
    s[3] ^= s[1];
    s[1] ^= s[2];
    s[0] ^= s[3];
    s[2] ^= t;
    s[3] = s[3] << 11 | s[3] >> 21;
    return result;
}

/* -2 ln((word / 2 + 1/2) / 2^31), relative error 2e-7 */
STUDY_INLINE floats_t minus_two_log(words_t word) {
    const ints_t u = (ints_t)(to_floats((ints_t)(word >> 1)) + 0.5f);
    const ints_t exponent = (u - 0x3F3504F3) >> 23; /* of u = 2^exponent m, sqrt(1/2) <= m < sqrt(2) */
    const floats_t f = (floats_t)(u - (exponent << 23)) - 1.0f;
    floats_t tail = f * 0.20757167f - 0.32676186f;
    tail = tail * f + 0.34424892f;
    tail = tail * f - 0.39768485f;
    tail = tail * f + 0.49943119f;
    tail = tail * f - 0.66671215f;
    tail = tail * f + 1.00000689f;
    tail = tail * f - 1.99999984f;
    return tail * f + to_floats(31 - exponent) * 1.38629436f;
}

/* Box and Muller. 31 bits of the second word are an angle in (-pi/2, pi/2), the one left mirrors it. */
STUDY_INLINE void draw_pair(random_t *random, float *pair) {
    const floats_t radius = float_root(minus_two_log(draw_words(random)));
    const words_t word = draw_words(random);
    const floats_t x = to_floats((ints_t)(word << 1)) * 7.3145906e-10f; /* pi / 2^32 */
    const floats_t z = x * x;
    floats_t s = z * 2.5909324e-06f - 1.9801161e-04f;
    s = s * z + 8.3329052e-03f;
    s = s * z - 1.6666648e-01f;
    s = s * z + 9.9999998e-01f;
    floats_t c = z * 2.3153931e-05f - 1.3853704e-03f;
    c = c * z + 4.1663585e-02f;
    c = c * z - 4.9999905e-01f;
    c = c * z + 9.9999995e-01f;
    const words_t mirrored = (words_t)(radius * c) ^ (word & 0x80000000u);
    const floats_t other = radius * (s * x);
    memcpy(pair, &mirrored, sizeof mirrored);
    memcpy(pair + LANES, &other, sizeof other);
}

/* Angle up to a million radians, error 5e-14. In floats: up to a hundred thousand, error 1e-7 plus the angle's own.
 * Half turns are taken away, each changes both signs. */
STUDY_INLINE void cos_sin(numbers_t angle, numbers_t *cosine, numbers_t *sine) {
#ifdef STUDY_SINGLE
    const number_t whole = 0x1.8p23f;
    const number_t parts[3] = {0x1.92p1f, 0x1.fb4p-11f, 0x1.4442d2p-23f}; /* of pi */
#else
    const number_t whole = 0x1.8p52;
    const number_t parts[2] = {0x1.921fb544p1, 0x1.0b4611a626331p-33};
#endif
    const numbers_t counted = angle * (number_t)0.31830988618379067 + whole;
    const numbers_t turns = counted - whole;
    const number_bits_v flip = (number_bits_v)counted << (8 * (int)sizeof(number_t) - 1);
    numbers_t x = angle - turns * parts[0];
    x -= turns * parts[1];
#ifdef STUDY_SINGLE
    x -= turns * parts[2];
    const numbers_t z = x * x;
    numbers_t s = z * 2.5909324e-06f - 1.9801161e-04f;
    s = s * z + 8.3329052e-03f;
    s = s * z - 1.6666648e-01f;
    numbers_t c = z * -2.6051495e-07f + 2.4760161e-05f;
    c = c * z - 1.3888361e-03f;
    c = c * z + 4.1666636e-02f;
#else
    const numbers_t z = x * x;
    numbers_t s = z * 1.5387691559883645e-10 - 2.5028483689969857e-08;
    s = s * z + 2.7556902130718814e-06;
    s = s * z - 1.9841266021091298e-04;
    s = s * z + 8.3333333165894e-03;
    s = s * z - 0.16666666666404142;
    numbers_t c = z * -1.1032426957959117e-11 + 2.0860518566833555e-09;
    c = c * z - 2.7557013828229845e-07;
    c = c * z + 2.48015842708145e-05;
    c = c * z - 1.388888887412154e-03;
    c = c * z + 4.1666666666398296e-02;
#endif
    c = (c * z - (number_t)0.5) * z + (number_t)1;
    s = x + x * z * s;
    *cosine = (numbers_t)((number_bits_v)c ^ flip);
    *sine = (numbers_t)((number_bits_v)s ^ flip);
}

/* eq. 39 to 43 */
STUDY_INLINE void control(const constants_t *is, group_t *group, const shared_t *now, numbers_t *voltage) {
    numbers_t wanted[3], c, s;
    for (int axis = 0; axis < 3; axis++) {
        const numbers_t error = group->x[3][axis] - now->pose[axis];
        const numbers_t surface = error + group->integral[axis];
        wanted[axis] = now->rate[axis] - is->lambda[axis] * error - with_sign_of(surface, is->k[axis]);
        group->integral[axis] += error * is->lambda_step[axis];
    }
    cos_sin(group->x[3][2], &c, &s);
    const numbers_t ahead = c * wanted[0] + s * wanted[1];
    const numbers_t left = c * wanted[1] - s * wanted[0];
    for (int wheel = 0; wheel < STUDY_WHEELS; wheel++) {
        const number_t *to = is->to_wheels[wheel];
        voltage[wheel] = to[0] * ahead + to[1] * left + to[2] * wanted[2];
    }
}

/* eq. 45 without noise */
STUDY_INLINE void advance(const constants_t *is, motors_t *motors, int wheel, numbers_t voltage) {
    const numbers_t w = motors->w[wheel];
    const numbers_t i = motors->i[wheel];
    motors->w[wheel] = is->a[0][0] * w + is->a[0][1] * i + is->b[0] * voltage;
    motors->i[wheel] = is->a[1][0] * w + is->a[1][1] * i + is->b[1] * voltage;
}

/* eq. 45 to 56. @param raw speeds that stand for "no filter". */
STUDY_INLINE void drive_motors(const constants_t *is, group_t *group, const shared_t *now, const numbers_t *voltage,
                               const numbers_t *noise, numbers_t *raw) {
    for (int wheel = 0; wheel < STUDY_WHEELS; wheel++) {
        advance(is, &group->motors, wheel, voltage[wheel]);
        group->motors.w[wheel] += is->motor_sd[0] * noise[STUDY_MOTOR + 2 * wheel];
        group->motors.i[wheel] += is->motor_sd[1] * noise[STUDY_MOTOR + 2 * wheel + 1];
        const numbers_t measured = group->motors.w[wheel] + is->measured_sd * noise[STUDY_MEASURED + wheel];
        advance(is, &group->filter, wheel, voltage[wheel]);
        const numbers_t innovation = measured - group->filter.w[wheel];
        group->filter.w[wheel] += now->gain[0] * innovation;
        group->filter.i[wheel] += now->gain[1] * innovation;
        if (is->raw_measured) {
            raw[wheel] = measured;
        } else {
            advance(is, &group->open_loop, wheel, voltage[wheel]);
            raw[wheel] = group->open_loop.w[wheel];
        }
    }
}

STUDY_INLINE void body_of(const constants_t *is, const numbers_t *speeds, numbers_t *body) {
    for (int axis = 0; axis < 3; axis++) {
        const number_t *to = is->to_moved[axis];
        body[axis] = to[0] * speeds[0] + to[1] * speeds[1] + to[2] * speeds[2] + to[3] * speeds[3];
    }
}

/* Adds a displacement with the heading of mid-step to a pose, and gives it. */
STUDY_INLINE void roll(const numbers_t *body, numbers_t *pose, numbers_t *moved) {
    numbers_t c, s;
    cos_sin(pose[2] + (number_t)0.5 * body[2], &c, &s);
    moved[0] = c * body[0] - s * body[1];
    moved[1] = s * body[0] + c * body[1];
    pose[0] += moved[0];
    pose[1] += moved[1];
    pose[2] += body[2];
}

/* eq. 59 to 69. With S = P + R: gain I - R S^-1, covariance R - R S^-1 R. */
STUDY_INLINE void correct(const constants_t *is, numbers_t *x, covariance_t *p, const numbers_t *moved,
                          const number_t *q, const numbers_t *fix) {
    const numbers_t a = -moved[1];
    const numbers_t b = moved[0];
    const numbers_t p02 = p->p02 + a * p->p22;
    const numbers_t p12 = p->p12 + b * p->p22;
    const numbers_t s00 = p->p00 + a * (p->p02 + p02) + (q[0] + is->r[0]);
    const numbers_t s01 = p->p01 + a * p->p12 + b * p02;
    const numbers_t s11 = p->p11 + b * (p->p12 + p12) + (q[1] + is->r[1]);
    const numbers_t s22 = p->p22 + (q[2] + is->r[2]);
    const numbers_t c00 = s11 * s22 - p12 * p12;
    const numbers_t c01 = p02 * p12 - s01 * s22;
    const numbers_t c02 = s01 * p12 - p02 * s11;
    const numbers_t c11 = s00 * s22 - p02 * p02;
    const numbers_t c12 = s01 * p02 - s00 * p12;
    const numbers_t c22 = s00 * s11 - s01 * s01;
    const numbers_t scale = (number_t)1 / (s00 * c00 + s01 * c01 + p02 * c02);
    const numbers_t y0 = (fix[0] - x[0]) * scale;
    const numbers_t y1 = (fix[1] - x[1]) * scale;
    const numbers_t y2 = (fix[2] - x[2]) * scale;
    x[0] = fix[0] - is->r[0] * (c00 * y0 + c01 * y1 + c02 * y2);
    x[1] = fix[1] - is->r[1] * (c01 * y0 + c11 * y1 + c12 * y2);
    x[2] = fix[2] - is->r[2] * (c02 * y0 + c12 * y1 + c22 * y2);
    p->p00 = is->r[0] - is->rr[0][0] * (c00 * scale);
    p->p01 = -is->rr[0][1] * (c01 * scale);
    p->p02 = -is->rr[0][2] * (c02 * scale);
    p->p11 = is->r[1] - is->rr[1][1] * (c11 * scale);
    p->p12 = -is->rr[1][2] * (c12 * scale);
    p->p22 = is->r[2] - is->rr[2][2] * (c22 * scale);
}

STUDY_INLINE void step(const constants_t *is, group_t *group, const shared_t *now, const numbers_t *noise) {
    numbers_t voltage[STUDY_WHEELS], raw[STUDY_WHEELS], body[2][3], fix[3], moved[3];
    control(is, group, now, voltage);
    drive_motors(is, group, now, voltage, noise, raw);
    body_of(is, raw, body[0]);
    body_of(is, group->filter.w, body[1]);

    /* eq. 57 and 58 */
    const numbers_t before[3] = {group->truth[0], group->truth[1], group->truth[2]};
    if (is->drive_true) {
        numbers_t true_body[3];
        body_of(is, group->motors.w, true_body);
        roll(true_body, group->truth, moved);
    } else {
        roll(body[1], group->truth, moved);
    }
    for (int axis = 0; axis < 3; axis++) {
        group->truth[axis] += is->pose_sd[axis] * noise[STUDY_POSE + axis];
        fix[axis] = (is->stale ? before : group->truth)[axis] + is->fix_sd[axis] * noise[STUDY_FIX + axis];
    }
    for (int number = 0; number < STUDY_ESTIMATES; number++) {
        numbers_t *x = group->x[number];
        roll(body[number % 2], x, moved);
        if (number >= 2) {
            correct(is, x, &group->p[number - 2], moved, is->q[number - 2], fix);
        }
        for (int axis = 0; axis < 3; axis++) {
            const numbers_t error = x[axis] - group->truth[axis];
            group->square[number][axis] += error * error;
        }
    }
}

static constants_t constants_of(const study_numbers_t *from) {
    constants_t is;
    for (int i = 0; i < 2; i++) {
        is.a[i][0] = (number_t)from->motor_a[i][0];
        is.a[i][1] = (number_t)from->motor_a[i][1];
        is.b[i] = (number_t)from->motor_b[i];
        is.motor_sd[i] = (number_t)from->motor_sd[i];
    }
    for (int axis = 0; axis < 3; axis++) {
        const double r = from->fix_sd[axis] * from->fix_sd[axis];
        is.pose_sd[axis] = (number_t)from->pose_sd[axis];
        is.fix_sd[axis] = (number_t)from->fix_sd[axis];
        is.r[axis] = (number_t)r;
        is.lambda[axis] = (number_t)from->ismc_lambda[axis];
        is.lambda_step[axis] = (number_t)(from->ismc_lambda[axis] * from->step_s);
        is.k[axis] = (number_t)from->ismc_k[axis];
        for (int other = 0; other < 3; other++) {
            is.rr[axis][other] = (number_t)(r * from->fix_sd[other] * from->fix_sd[other]);
        }
        for (int wheel = 0; wheel < STUDY_WHEELS; wheel++) {
            is.to_moved[axis][wheel] = (number_t)(from->to_body[axis][wheel] * from->step_s);
            is.to_wheels[wheel][axis] = (number_t)from->to_wheels[wheel][axis];
        }
        is.q[0][axis] = (number_t)from->ekf_q[0][axis];
        is.q[1][axis] = (number_t)from->ekf_q[1][axis];
    }
    is.measured_sd = (number_t)from->measured_sd;
    is.drive_true = from->drive_true != 0.0;
    is.raw_measured = from->raw_measured != 0.0;
    is.stale = from->stale != 0.0;
    return is;
}

/* The motor filter's gain after its prediction `p`, which becomes the next step's. eq. 53 to 56 */
static void next_gain(const study_numbers_t *is, double p[2][2], number_t *gain) {
    const double(*a)[2] = is->motor_a;
    double left[2][2];
    for (int i = 0; i < 2; i++) {
        left[0][i] = a[0][0] * p[0][i] + a[0][1] * p[1][i];
        left[1][i] = a[1][0] * p[0][i] + a[1][1] * p[1][i];
    }
    const double p00 = left[0][0] * a[0][0] + left[0][1] * a[0][1] + is->kf_q[0];
    const double p01 = left[0][0] * a[1][0] + left[0][1] * a[1][1];
    const double p11 = left[1][0] * a[1][0] + left[1][1] * a[1][1] + is->kf_q[1];
    const double variance = p00 + is->measured_sd * is->measured_sd;
    p[0][0] = p00 - p00 / variance * p00;
    p[0][1] = p[1][0] = p01 - p00 / variance * p01;
    p[1][1] = p11 - p01 / variance * p01;
    gain[0] = (number_t)(p00 / variance);
    gain[1] = (number_t)(p01 / variance);
}

static void tabulate(const study_model_t *model, shared_t *shared) {
    double p[2][2] = {{1.0, 0.0}, {0.0, 1.0}};
    for (size_t k = 0; k < model->steps; k++) {
        for (int axis = 0; axis < 3; axis++) {
            shared[k].pose[axis] = (number_t)model->poses[k][axis];
            shared[k].rate[axis] = (number_t)model->rates[k][axis];
        }
        next_gain(&model->is, p, shared[k].gain);
    }
}

static void begin(const study_model_t *model, group_t *group) {
    memset(group, 0, sizeof *group);
    for (int axis = 0; axis < 3; axis++) {
        group->truth[axis] = all((number_t)model->poses[0][axis]);
        for (int number = 0; number < STUDY_ESTIMATES; number++) {
            group->x[number][axis] = group->truth[axis];
        }
    }
}

static void random_begin(random_t *random, uint64_t seed, size_t first) {
    for (int lane = 0; lane < LANES; lane++) {
        uint64_t state = study_run_seed(seed, first + (size_t)lane);
        for (int i = 0; i < 4; i += 2) {
            const uint64_t word = study_seed_word(&state);
            random->s[i][lane] = (uint32_t)word;
            random->s[i + 1][lane] = (uint32_t)(word >> 32);
        }
    }
}

STUDY_INLINE void draw(random_t *random, float *block) {
    for (int i = 0; i < STUDY_NORMALS; i += 2) {
        draw_pair(random, block + i * LANES);
    }
}

/* A row of each run; lanes without a run get none. @param normals those of the group's first run. */
static void gather(const double *normals, size_t row_step, size_t runs, numbers_t *noise) {
    memset(noise, 0, STUDY_NORMALS * sizeof *noise);
    for (size_t lane = 0; lane < runs && lane < WIDTH; lane++) {
        for (int i = 0; i < STUDY_NORMALS; i++) {
            noise[i][lane] = (number_t)normals[lane * row_step + (size_t)i];
        }
    }
}

/* Moves the sums into doubles. @param runs of this group that are wanted */
static void collect(group_t *group, size_t runs, study_square_t *square) {
    for (size_t lane = 0; lane < runs && lane < WIDTH; lane++) {
        for (int i = 0; i < STUDY_ESTIMATES * 3; i++) {
            square[lane][i / 3][i % 3] += (double)group->square[i / 3][i % 3][lane];
        }
    }
    memset(group->square, 0, sizeof group->square);
}

/* The numbers of `wanted` runs, of which those of group g begin at g WIDTH. */
static size_t left_for(size_t wanted, int group) {
    const size_t before = (size_t)group * WIDTH;
    return wanted > before ? wanted - before : 0;
}

/* Own noise: the block of floats is drawn for all groups at once. */
static void own_steps(const constants_t *is, group_t *groups, const shared_t *shared, size_t steps, random_t *random) {
    for (size_t k = 0; k < steps; k++) {
        float block[STUDY_NORMALS * LANES] __attribute__((aligned(STUDY_BYTES)));
        draw(random, block);
        for (int g = 0; g < GROUPS; g++) {
            numbers_t noise[STUDY_NORMALS];
            for (int i = 0; i < STUDY_NORMALS; i++) {
                noise[i] = group_of(block + i * LANES, g);
            }
            step(is, &groups[g], &shared[k], noise);
        }
    }
}

/* Given noise. @param normals row of the first run and step, @param wanted runs */
static void given_steps(const constants_t *is, group_t *groups, const shared_t *shared, size_t steps,
                        const double *normals, size_t row_step, size_t wanted) {
    for (size_t k = 0; k < steps; k++, normals += STUDY_ROW) {
        for (int g = 0; g < GROUPS; g++) {
            numbers_t noise[STUDY_NORMALS];
            gather(normals + (size_t)g * WIDTH * row_step, row_step, left_for(wanted, g), noise);
            step(is, &groups[g], &shared[k], noise);
        }
    }
}

void study_run(const study_model_t *model, size_t runs, uint64_t seed, const double *normals, study_square_t *square) {
    const constants_t is = constants_of(&model->is);
    const size_t row_step = model->steps * STUDY_ROW;
    shared_t *shared = malloc(model->steps * sizeof *shared);
    if (shared == NULL) {
        abort();
    }
    tabulate(model, shared);
    memset(square, 0, runs * sizeof *square);
    for (size_t first = 0; first < runs; first += LANES) {
        const size_t wanted = runs - first;
        group_t groups[GROUPS];
        random_t random;
        random_begin(&random, seed, first);
        for (int g = 0; g < GROUPS; g++) {
            begin(model, &groups[g]);
        }
        for (size_t k = 0; k < model->steps; k += STEPS_PER_SUM) {
            const size_t steps = model->steps - k < STEPS_PER_SUM ? model->steps - k : STEPS_PER_SUM;
            if (normals == NULL) {
                own_steps(&is, groups, shared + k, steps, &random);
            } else {
                given_steps(&is, groups, shared + k, steps, normals + first * row_step + k * STUDY_ROW, row_step,
                            wanted);
            }
            for (int g = 0; g < GROUPS; g++) {
                const size_t left = left_for(wanted, g);
                collect(&groups[g], left, square + first + (left > 0 ? (size_t)g * WIDTH : 0));
            }
        }
    }
    free(shared);
}

void study_draw(const study_model_t *model, size_t runs, uint64_t seed, double *normals) {
    memset(normals, 0, runs * model->steps * STUDY_ROW * sizeof *normals);
    for (size_t first = 0; first < runs; first += LANES) {
        random_t random;
        random_begin(&random, seed, first);
        for (size_t k = 0; k < model->steps; k++) {
            float block[STUDY_NORMALS * LANES];
            draw(&random, block);
            for (size_t lane = 0; lane < LANES && first + lane < runs; lane++) {
                for (size_t i = 0; i < STUDY_NORMALS; i++) {
                    normals[((first + lane) * model->steps + k) * STUDY_ROW + i] = (double)block[i * LANES + lane];
                }
            }
        }
    }
}

study_width_t study_width(void) {
    const study_width_t width = {LANES, sizeof(number_t)};
    return width;
}
