/* SPDX-License-Identifier: MIT */
/**
 * @file tiny_ekf.c
 * An EKF in the manner of small C libraries for microcontrollers such as TinyEKF. It has matrices of any size as float
 * arrays, multiplied by loops. The user computes f, F, h and H. The library does P = F P F^T + Q and the update with a
 * Cholesky inverse. Own writing. Left out, as there: late fixes, gates, checks of the inputs, Joseph form, wrapped
 * angles, compensated sums.
 */
#include <math.h>
#include <string.h>

#include "estimators.h"

enum { MOST = 3, CELLS = MOST * MOST };

typedef struct filter_t {
    int n;
    int m;
    float x[MOST];
    float p[CELLS];
} filter_t;

/* c (rows x columns) = a (rows x inner) b (inner x columns) */
static void multiply(const float *a, const float *b, float *c, int rows, int inner, int columns) {
    for (int i = 0; i < rows; i++) {
        for (int j = 0; j < columns; j++) {
            float sum = 0.0f;
            for (int k = 0; k < inner; k++) {
                sum += a[i * inner + k] * b[k * columns + j];
            }
            c[i * columns + j] = sum;
        }
    }
}

static void transpose(const float *a, float *at, int rows, int columns) {
    for (int i = 0; i < rows; i++) {
        for (int j = 0; j < columns; j++) {
            at[j * rows + i] = a[i * columns + j];
        }
    }
}

/* Lower triangle of the factor. @return false if a is not positive definite. */
static int factorise(const float *a, float *l, int n) {
    memset(l, 0, CELLS * sizeof *l);
    for (int i = 0; i < n; i++) {
        for (int j = 0; j <= i; j++) {
            float sum = a[i * n + j];
            for (int k = 0; k < j; k++) {
                sum -= l[i * n + k] * l[j * n + k];
            }
            if (i == j && !(sum > 0.0f)) {
                return 0;
            }
            l[i * n + j] = i == j ? sqrtf(sum) : sum / l[j * n + j];
        }
    }
    return 1;
}

/* inverse of a through its Cholesky factor: L y = e, L^T z = y for each column */
static int invert(const float *a, float *inverse, int n) {
    float l[CELLS];
    if (!factorise(a, l, n)) {
        return 0;
    }
    for (int column = 0; column < n; column++) {
        float y[MOST];
        for (int i = 0; i < n; i++) {
            float sum = i == column ? 1.0f : 0.0f;
            for (int k = 0; k < i; k++) {
                sum -= l[i * n + k] * y[k];
            }
            y[i] = sum / l[i * n + i];
        }
        for (int i = n - 1; i >= 0; i--) {
            float sum = y[i];
            for (int k = i + 1; k < n; k++) {
                sum -= l[k * n + i] * inverse[k * n + column];
            }
            inverse[i * n + column] = sum / l[i * n + i];
        }
    }
    return 1;
}

static void predict(filter_t *ekf, const float *fx, const float *f, const float *q) {
    const int n = ekf->n;
    float fp[CELLS];
    float ft[CELLS];
    memcpy(ekf->x, fx, (size_t)n * sizeof *fx);
    multiply(f, ekf->p, fp, n, n, n);
    transpose(f, ft, n, n);
    multiply(fp, ft, ekf->p, n, n, n);
    for (int i = 0; i < n; i++) {
        ekf->p[i * n + i] += q[i];
    }
}

static void update(filter_t *ekf, const float *z, const float *hx, const float *h, const float *r) {
    const int n = ekf->n;
    const int m = ekf->m;
    float ht[CELLS];
    float pht[CELLS];
    float s[CELLS];
    float inverse[CELLS];
    float gain[CELLS];
    transpose(h, ht, m, n);
    multiply(ekf->p, ht, pht, n, n, m);
    multiply(h, pht, s, m, n, m);
    for (int i = 0; i < m; i++) {
        s[i * m + i] += r[i];
    }
    if (!invert(s, inverse, m)) {
        return;
    }
    multiply(pht, inverse, gain, n, m, m);
    float innovation[MOST];
    float change[MOST];
    for (int i = 0; i < m; i++) {
        innovation[i] = z[i] - hx[i];
    }
    multiply(gain, innovation, change, n, m, 1);
    for (int i = 0; i < n; i++) {
        ekf->x[i] += change[i];
    }
    float keep[CELLS] = {0};
    float before[CELLS];
    multiply(gain, h, keep, n, m, n);
    for (int i = 0; i < n * n; i++) {
        keep[i] = (i % (n + 1) == 0 ? 1.0f : 0.0f) - keep[i];
    }
    memcpy(before, ekf->p, sizeof before);
    multiply(keep, before, ekf->p, n, n, n);
}

void tiny_pose(const bench_model_t *model, const bench_input_t *inputs, uint32_t steps, bench_output_t *output) {
    filter_t ekf = {.n = 3, .m = 3};
    const float h[9] = {1, 0, 0, 0, 1, 0, 0, 0, 1};
    for (uint32_t k = 0; k < steps; k++) {
        float body[3];
        multiply(&model->to_body[0][0], inputs[k].turned_rad, body, 3, BENCH_WHEELS, 1);
        const float heading = ekf.x[2] + 0.5f * body[2];
        const float sine = sinf(heading);
        const float cosine = cosf(heading);
        const float dx = cosine * body[0] - sine * body[1];
        const float dy = sine * body[0] + cosine * body[1];
        const float fx[3] = {ekf.x[0] + dx, ekf.x[1] + dy, ekf.x[2] + body[2]};
        const float f[9] = {1, 0, -dy, 0, 1, dx, 0, 0, 1};
        predict(&ekf, fx, f, model->pose_q);
        update(&ekf, inputs[k].fix, ekf.x, h, model->fix_r);
    }
    memcpy(output->pose, ekf.x, sizeof output->pose);
    memcpy(output->pose_p, ekf.p, sizeof output->pose_p);
}

void tiny_motor(const bench_model_t *model, const bench_input_t *inputs, uint32_t steps, bench_output_t *output) {
    filter_t kf = {.n = 2, .m = 1, .p = {1.0f, 0.0f, 0.0f, 1.0f}};
    const float h[2] = {1, 0};
    const float *a = &model->motor_a[0][0];
    for (uint32_t k = 0; k < steps; k++) {
        const float voltage = inputs[k].voltage_V;
        const float fx[2] = {a[0] * kf.x[0] + a[1] * kf.x[1] + model->motor_b[0] * voltage,
                             a[2] * kf.x[0] + a[3] * kf.x[1] + model->motor_b[1] * voltage};
        predict(&kf, fx, a, model->motor_q);
        update(&kf, &inputs[k].speed_rad_s, kf.x, h, &model->motor_r);
    }
    memcpy(output->motor, kf.x, sizeof output->motor);
    memcpy(output->motor_p, kf.p, sizeof output->motor_p);
}
