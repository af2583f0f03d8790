/* SPDX-License-Identifier: MIT */
#include "omni/motor.h"

#include "../math/math_inline.h"

enum {
    TAYLOR_TERMS = 8, /* with a norm of at most 1/2 the next term is below half a unit in the last place */
    ROWS = 3,         /* angle, w, i */
    COLUMNS = 3       /* w, i, V: nothing depends on the angle */
};

static const omni_real_t largest_norm = 1e12f;

/*
 * The model as one 4 x 4 matrix over (angle, w, i, V) without its angle column and V row. These are zero in the
 * continuous model M, and therefore in exp(M T) - I and in all products.
 */
typedef omni_real_t model_t[ROWS][COLUMNS];

/* out = a * b */
static void multiply_models(const model_t a, const model_t b, model_t out) {
    for (int row = 0; row < ROWS; row++) {
        for (int column = 0; column < COLUMNS; column++) {
            out[row][column] = a[row][0] * b[1][column] + a[row][1] * b[2][column];
        }
    }
}

/* a = factor_a * a + b */
static void scale_and_add(model_t a, omni_real_t factor_a, const model_t b) {
    for (int row = 0; row < ROWS; row++) {
        for (int column = 0; column < COLUMNS; column++) {
            a[row][column] = factor_a * a[row][column] + b[row][column];
        }
    }
}

static omni_result_t check_motor(const omni_motor_config_t *motor, omni_real_t step_s) {
    if (!omni_is_finite(motor->inertia_kg_m2) || !omni_is_finite(motor->viscous_N_m_s) ||
        !omni_is_finite(motor->constant_N_m_A) || !omni_is_finite(motor->resistance_ohm) ||
        !omni_is_finite(motor->inductance_H) || !omni_is_finite(step_s)) {
        return OMNI_ERR_NOT_FINITE;
    }
    const bool in_range = motor->inertia_kg_m2 > 0.0f && motor->viscous_N_m_s >= 0.0f && motor->constant_N_m_A > 0.0f &&
                          motor->resistance_ohm > 0.0f && motor->inductance_H > 0.0f && step_s > 0.0f && step_s <= 1.0f;
    return in_range ? OMNI_OK : OMNI_ERR_RANGE;
}

/* [report eq. 26], corrected by an angle row, times the step: M T. @return its largest row sum over w and i. */
static omni_real_t continuous_model(const omni_motor_config_t *motor, omni_real_t step_s, model_t m) {
    m[0][0] = step_s;
    m[1][0] = -motor->viscous_N_m_s / motor->inertia_kg_m2 * step_s;
    m[1][1] = motor->constant_N_m_A / motor->inertia_kg_m2 * step_s;
    m[2][0] = -motor->constant_N_m_A / motor->inductance_H * step_s;
    m[2][1] = -motor->resistance_ohm / motor->inductance_H * step_s;
    m[2][2] = step_s / motor->inductance_H;
    const omni_real_t speed_row = omni_absf(m[1][0]) + omni_absf(m[1][1]);
    const omni_real_t current_row = omni_absf(m[2][0]) + omni_absf(m[2][1]);
    return speed_row > current_row ? speed_row : current_row;
}

/*
 * m := exp(m) - I. Carrying the difference to I instead of exp(m) itself keeps the slow modes exact through the
 * squarings: (I + D)^2 = I + 2 D + D^2.
 */
static void exponential_minus_one(model_t m, omni_real_t norm) {
    int squarings = 0;
    omni_real_t scale = 1.0f;
    while (norm * scale > 0.5f) {
        scale *= 0.5f;
        squarings++;
    }
    const model_t zero = {{0.0f}};
    scale_and_add(m, scale, zero);
    model_t sum = {{0.0f}};
    model_t product;
    /* Horner: D = m (I + m/2 (I + m/3 (...))), so sum = m/k (I + sum) from the last term on */
    for (int k = TAYLOR_TERMS; k >= 1; k--) {
        multiply_models(m, sum, product);
        scale_and_add(product, 1.0f, m);
        for (int row = 0; row < ROWS; row++) {
            for (int column = 0; column < COLUMNS; column++) {
                sum[row][column] = product[row][column] / (omni_real_t)k;
            }
        }
    }
    for (; squarings > 0; squarings--) {
        multiply_models(sum, sum, product);
        scale_and_add(sum, 2.0f, product);
    }
    scale_and_add(m, 0.0f, sum);
}

omni_result_t omni_motor_discretise(const omni_motor_config_t *motor, omni_real_t step_s, omni_motor_discrete_t *out) {
    const omni_result_t result = check_motor(motor, step_s);
    if (result != OMNI_OK) {
        return result;
    }
    model_t d = {{0.0f}};
    const omni_real_t norm = continuous_model(motor, step_s, d);
    if (!(norm <= largest_norm) || !omni_is_finite(d[2][2])) {
        return OMNI_ERR_RANGE;
    }
    exponential_minus_one(d, norm);
    /* [report eq. 45], corrected: exp([A B; 0 0] T) = [A_d B_d; 0 I] in place of A T + I */
    for (int row = 0; row < ROWS; row++) {
        out->a[row][0] = row == 0 ? 1.0f : 0.0f;
        out->a[row][1] = d[row][0] + (row == 1 ? 1.0f : 0.0f);
        out->a[row][2] = d[row][1] + (row == 2 ? 1.0f : 0.0f);
        out->b[row] = d[row][2];
    }
    return OMNI_OK;
}

omni_real_t omni_motor_speed_gain(const omni_motor_config_t *motor) {
    /* [report eq. 24 and 25] at rest: V = (K + R b / K) w */
    return motor->constant_N_m_A + motor->resistance_ohm * motor->viscous_N_m_s / motor->constant_N_m_A;
}

omni_real_t omni_motor_acceleration_gain(const omni_motor_config_t *motor) {
    /* [report eq. 24 and 25] without L: i = J w' / K, V = R i */
    return motor->resistance_ohm * motor->inertia_kg_m2 / motor->constant_N_m_A;
}
