/* SPDX-License-Identifier: MIT */
/**
 * @file filter_study_plain.c
 * The filter study in plain C: double precision, one run after the other, small matrices in loops, sine and cosine from
 * libm. What an engineer writes who translates the report's equations. Each motor has a filter of two states: the joint
 * filter of eight falls apart into these. Normals come from xoshiro256++ by Marsaglia's polar method. Left out: checks
 * of the inputs, late fixes, gates, wrapped angles.
 */
#include <math.h>
#include <string.h>

#include "filter_study_peer.h"

typedef double vec3_t[3];
typedef double mat3_t[3][3];

/** xoshiro256++ by Blackman and Vigna, and the second normal of a pair. */
typedef struct random_t {
    uint64_t word[4];
    double kept;
    int has_kept;
} random_t;

typedef struct motor_t {
    double w; /* rad/s */
    double i; /* A */
} motor_t;

typedef struct motor_filter_t {
    motor_t x;
    double p[2][2];
} motor_filter_t;

typedef struct run_t {
    motor_t motor[STUDY_WHEELS];
    motor_t open_loop[STUDY_WHEELS];
    motor_filter_t filter[STUDY_WHEELS];
    double voltage[STUDY_WHEELS];
    double measured[STUDY_WHEELS];
    double raw[STUDY_WHEELS];
    double filtered[STUDY_WHEELS];
    vec3_t integral;
    vec3_t truth;
    vec3_t x[STUDY_ESTIMATES];
    mat3_t p[2];
} run_t;

static void random_begin(random_t *random, uint64_t seed) {
    memset(random, 0, sizeof *random);
    for (int i = 0; i < 4; i++) {
        random->word[i] = study_seed_word(&seed);
    }
}

static uint64_t rotated(uint64_t word, int by) {
    return word << by | word >> (64 - by);
}

static double uniform(random_t *random) {
    uint64_t *s = random->word;
    const uint64_t result = rotated(s[0] + s[3], 23) + s[0];
    const uint64_t t = s[1] << 17;
    s[2] ^= s[0];
    s[3] ^= s[1];
    s[1] ^= s[2];
    s[0] ^= s[3];
    s[2] ^= t;
    s[3] = rotated(s[3], 45);
    return (double)(result >> 11) * 0x1p-53;
}

static double normal(random_t *random) {
    if (random->has_kept) {
        random->has_kept = 0;
        return random->kept;
    }
    double u, v, s;
    do {
        u = 2.0 * uniform(random) - 1.0;
        v = 2.0 * uniform(random) - 1.0;
        s = u * u + v * v;
    } while (s >= 1.0 || s == 0.0);
    const double factor = sqrt(-2.0 * log(s) / s);
    random->kept = v * factor;
    random->has_kept = 1;
    return u * factor;
}

static double sign(double value) {
    return value > 0.0 ? 1.0 : value < 0.0 ? -1.0 : 0.0;
}

static void turn(const vec3_t in, double angle, vec3_t out) {
    const double s = sin(angle);
    const double c = cos(angle);
    const double x = c * in[0] - s * in[1];
    out[1] = s * in[0] + c * in[1];
    out[0] = x;
    out[2] = in[2];
}

/* Displacement over a step with the heading of its middle. */
static void roll(const study_numbers_t *is, double heading, const double *speeds, vec3_t moved) {
    vec3_t body = {0.0, 0.0, 0.0};
    for (int axis = 0; axis < 3; axis++) {
        for (int wheel = 0; wheel < STUDY_WHEELS; wheel++) {
            body[axis] += is->to_body[axis][wheel] * speeds[wheel];
        }
        body[axis] *= is->step_s;
    }
    turn(body, heading + 0.5 * body[2], moved);
}

/* eq. 39 to 43, on KF + EKF */
static void control(const study_numbers_t *is, run_t *run, const vec3_t pose, const vec3_t rate) {
    vec3_t wanted;
    for (int axis = 0; axis < 3; axis++) {
        const double error = run->x[3][axis] - pose[axis];
        const double surface = error + is->ismc_lambda[axis] * run->integral[axis];
        wanted[axis] = rate[axis] - is->ismc_lambda[axis] * error - is->ismc_k[axis] * sign(surface);
        run->integral[axis] += error * is->step_s;
    }
    turn(wanted, -run->x[3][2], wanted);
    for (int wheel = 0; wheel < STUDY_WHEELS; wheel++) {
        run->voltage[wheel] = is->to_wheels[wheel][0] * wanted[0] + is->to_wheels[wheel][1] * wanted[1] +
                              is->to_wheels[wheel][2] * wanted[2];
    }
}

/* eq. 45 without noise */
static motor_t advanced(const study_numbers_t *is, motor_t m, double voltage) {
    const motor_t next = {is->motor_a[0][0] * m.w + is->motor_a[0][1] * m.i + is->motor_b[0] * voltage,
                          is->motor_a[1][0] * m.w + is->motor_a[1][1] * m.i + is->motor_b[1] * voltage};
    return next;
}

/* eq. 52 to 56 */
static void filter_motor(const study_numbers_t *is, motor_filter_t *filter, double voltage, double measured) {
    double ap[2][2], p[2][2];
    filter->x = advanced(is, filter->x, voltage);
    for (int row = 0; row < 2; row++) {
        for (int column = 0; column < 2; column++) {
            ap[row][column] = is->motor_a[row][0] * filter->p[0][column] + is->motor_a[row][1] * filter->p[1][column];
        }
    }
    for (int row = 0; row < 2; row++) {
        for (int column = 0; column < 2; column++) {
            p[row][column] = ap[row][0] * is->motor_a[column][0] + ap[row][1] * is->motor_a[column][1];
        }
        p[row][row] += is->kf_q[row];
    }
    const double variance = p[0][0] + is->measured_sd * is->measured_sd;
    const double gain[2] = {p[0][0] / variance, p[1][0] / variance};
    const double innovation = measured - filter->x.w;
    filter->x.w += gain[0] * innovation;
    filter->x.i += gain[1] * innovation;
    for (int row = 0; row < 2; row++) {
        for (int column = 0; column < 2; column++) {
            filter->p[row][column] = p[row][column] - gain[row] * p[0][column];
        }
    }
}

static void drive_motors(const study_numbers_t *is, run_t *run, const double *normals) {
    for (int wheel = 0; wheel < STUDY_WHEELS; wheel++) {
        motor_t *motor = &run->motor[wheel];
        const double voltage = run->voltage[wheel];
        run->open_loop[wheel] = advanced(is, run->open_loop[wheel], voltage);
        *motor = advanced(is, *motor, voltage);
        motor->w += is->motor_sd[0] * normals[STUDY_MOTOR + 2 * wheel];
        motor->i += is->motor_sd[1] * normals[STUDY_MOTOR + 2 * wheel + 1];
        run->measured[wheel] = motor->w + is->measured_sd * normals[STUDY_MEASURED + wheel];
        filter_motor(is, &run->filter[wheel], voltage, run->measured[wheel]);
        run->filtered[wheel] = run->filter[wheel].x.w;
        run->raw[wheel] = is->raw_measured != 0.0 ? run->measured[wheel] : run->open_loop[wheel].w;
    }
}

static void multiply(const mat3_t a, const mat3_t b, mat3_t product) {
    for (int row = 0; row < 3; row++) {
        for (int column = 0; column < 3; column++) {
            product[row][column] = a[row][0] * b[0][column] + a[row][1] * b[1][column] + a[row][2] * b[2][column];
        }
    }
}

static void transpose(const mat3_t a, mat3_t t) {
    for (int row = 0; row < 3; row++) {
        for (int column = 0; column < 3; column++) {
            t[row][column] = a[column][row];
        }
    }
}

static void invert(const mat3_t a, mat3_t inverse) {
    for (int row = 0; row < 3; row++) {
        const int r1 = (row + 1) % 3, r2 = (row + 2) % 3;
        for (int column = 0; column < 3; column++) {
            const int c1 = (column + 1) % 3, c2 = (column + 2) % 3;
            inverse[column][row] = a[r1][c1] * a[r2][c2] - a[r1][c2] * a[r2][c1];
        }
    }
    const double determinant = a[0][0] * inverse[0][0] + a[0][1] * inverse[1][0] + a[0][2] * inverse[2][0];
    for (int i = 0; i < 9; i++) {
        inverse[i / 3][i % 3] /= determinant;
    }
}

/* eq. 59 to 69, after the state has moved */
static void correct(const study_numbers_t *is, vec3_t x, mat3_t p, const vec3_t moved, const vec3_t q,
                    const vec3_t fix) {
    const mat3_t f = {{1.0, 0.0, -moved[1]}, {0.0, 1.0, moved[0]}, {0.0, 0.0, 1.0}};
    mat3_t fp, ft, predicted, variance, inverse, gain, taken;
    multiply(f, (const double(*)[3])p, fp);
    transpose(f, ft);
    multiply((const double(*)[3])fp, (const double(*)[3])ft, predicted);
    for (int axis = 0; axis < 3; axis++) {
        predicted[axis][axis] += q[axis];
    }
    memcpy(variance, predicted, sizeof variance);
    for (int axis = 0; axis < 3; axis++) {
        variance[axis][axis] += is->fix_sd[axis] * is->fix_sd[axis];
    }
    invert((const double(*)[3])variance, inverse);
    multiply((const double(*)[3])predicted, (const double(*)[3])inverse, gain);
    const vec3_t innovation = {fix[0] - x[0], fix[1] - x[1], fix[2] - x[2]};
    multiply((const double(*)[3])gain, (const double(*)[3])predicted, taken);
    for (int row = 0; row < 3; row++) {
        x[row] += gain[row][0] * innovation[0] + gain[row][1] * innovation[1] + gain[row][2] * innovation[2];
        for (int column = 0; column < 3; column++) {
            p[row][column] = predicted[row][column] - taken[row][column];
        }
    }
}

static void step(const study_model_t *model, run_t *run, size_t k, const double *normals, study_square_t square) {
    const study_numbers_t *is = &model->is;
    vec3_t before, fix, moved;
    control(is, run, model->poses[k], model->rates[k]);
    drive_motors(is, run, normals);

    /* eq. 57 and 58 */
    double true_speeds[STUDY_WHEELS];
    for (int wheel = 0; wheel < STUDY_WHEELS; wheel++) {
        true_speeds[wheel] = is->drive_true != 0.0 ? run->motor[wheel].w : run->filtered[wheel];
    }
    memcpy(before, run->truth, sizeof before);
    roll(is, run->truth[2], true_speeds, moved);
    for (int axis = 0; axis < 3; axis++) {
        run->truth[axis] += moved[axis] + is->pose_sd[axis] * normals[STUDY_POSE + axis];
        fix[axis] = (is->stale != 0.0 ? before : run->truth)[axis] + is->fix_sd[axis] * normals[STUDY_FIX + axis];
    }
    for (int number = 0; number < STUDY_ESTIMATES; number++) {
        double *x = run->x[number];
        roll(is, x[2], number % 2 ? run->filtered : run->raw, moved);
        for (int axis = 0; axis < 3; axis++) {
            x[axis] += moved[axis];
        }
        if (number >= 2) {
            correct(is, x, run->p[number - 2], moved, is->ekf_q[number - 2], fix);
        }
        for (int axis = 0; axis < 3; axis++) {
            const double error = x[axis] - run->truth[axis];
            square[number][axis] += error * error;
        }
    }
}

static void begin(const study_model_t *model, run_t *run) {
    memset(run, 0, sizeof *run);
    memcpy(run->truth, model->poses[0], sizeof run->truth);
    for (int number = 0; number < STUDY_ESTIMATES; number++) {
        memcpy(run->x[number], model->poses[0], sizeof run->x[number]);
    }
    for (int wheel = 0; wheel < STUDY_WHEELS; wheel++) {
        run->filter[wheel].p[0][0] = 1.0;
        run->filter[wheel].p[1][1] = 1.0;
    }
}

static void draw(random_t *random, double *normals) {
    for (int i = 0; i < STUDY_NORMALS; i++) {
        normals[i] = normal(random);
    }
}

void study_run(const study_model_t *model, size_t runs, uint64_t seed, const double *normals, study_square_t *square) {
    memset(square, 0, runs * sizeof *square);
    for (size_t number = 0; number < runs; number++) {
        run_t run;
        random_t random;
        begin(model, &run);
        random_begin(&random, study_run_seed(seed, number));
        for (size_t k = 0; k < model->steps; k++) {
            double drawn[STUDY_NORMALS];
            if (normals == NULL) {
                draw(&random, drawn);
            }
            step(model, &run, k, normals == NULL ? drawn : normals + (number * model->steps + k) * STUDY_ROW,
                 square[number]);
        }
    }
}

void study_draw(const study_model_t *model, size_t runs, uint64_t seed, double *normals) {
    for (size_t number = 0; number < runs; number++) {
        random_t random;
        random_begin(&random, study_run_seed(seed, number));
        for (size_t k = 0; k < model->steps; k++, normals += STUDY_ROW) {
            draw(&random, normals);
            normals[STUDY_NORMALS] = normals[STUDY_NORMALS + 1] = 0.0;
        }
    }
}

study_width_t study_width(void) {
    const study_width_t width = {1, sizeof(double)};
    return width;
}
