/* SPDX-License-Identifier: MIT */
#include <string.h>

/* External definitions of the inline functions. */
#define OMNI_KINEMATICS_INLINE
#include "kinematics_inline.h"

/* Relative length of a column of B orthogonal to the other columns below which the layout is singular. */
static const omni_real_t smallest_independent = 1e-3f;

/* Range of omni_sincosf. */
static const omni_real_t largest_bearing = 1e6f;

typedef omni_real_t column_t[OMNI_MAX_WHEELS];

static omni_real_t dot_product(const omni_real_t *a, const omni_real_t *b) {
    omni_real_t sum = 0.0f;
    for (int i = 0; i < OMNI_MAX_WHEELS; i++) {
        sum += a[i] * b[i];
    }
    return sum;
}

/* b := b - amount * a */
static void subtract_scaled(omni_real_t *b, omni_real_t amount, const omni_real_t *a) {
    for (int i = 0; i < OMNI_MAX_WHEELS; i++) {
        b[i] -= amount * a[i];
    }
}

static omni_result_t check_geometry(const omni_kinematics_config_t *config) {
    if (config->wheels != 3 && config->wheels != 4) {
        return OMNI_ERR_RANGE;
    }
    for (int i = 0; i < config->wheels; i++) {
        const omni_real_t radius = config->radius_m[i];
        const omni_real_t distance = config->distance_m[i];
        const omni_real_t angle = config->angle_rad[i];
        if (!omni_is_finite(radius) || !omni_is_finite(distance) || !omni_is_finite(angle)) {
            return OMNI_ERR_NOT_FINITE;
        }
        if (!(radius > 0.0f) || !(distance > 0.0f) || omni_absf(angle) > largest_bearing) {
            return OMNI_ERR_RANGE;
        }
    }
    return OMNI_OK;
}

/* The columns of B, the third in units of the mean distance so that all three are of one size. @return that mean. */
static omni_real_t fill_rows(omni_kinematics_t *k, const omni_kinematics_config_t *config, column_t q[OMNI_AXES]) {
    omni_real_t mean_distance = 0.0f;
    for (int i = 0; i < config->wheels; i++) {
        mean_distance += config->distance_m[i] / (omni_real_t)config->wheels;
    }
    for (int i = 0; i < config->wheels; i++) {
        omni_real_t sine;
        omni_real_t cosine;
        omni_sincosf(config->angle_rad[i], &sine, &cosine);
        k->radius_m[i] = config->radius_m[i];
        /* [report eq. 19] with our sign: row i = [-sin a_i, cos a_i, l_i] */
        k->b[i][0] = -sine;
        k->b[i][1] = cosine;
        k->b[i][2] = config->distance_m[i];
        q[0][i] = -sine;
        q[1][i] = cosine;
        q[2][i] = config->distance_m[i] / mean_distance;
    }
    return mean_distance;
}

/*
 * B = Q R by modified Gram-Schmidt, every column orthogonalised twice. In single precision this loses only the
 * condition number of B, where inverting B^T B would lose its square. Q replaces the columns. @return false if B is
 * singular.
 */
static bool orthogonalise_columns(column_t q[OMNI_AXES], omni_real_t r[OMNI_AXES][OMNI_AXES]) {
    for (int j = 0; j < OMNI_AXES; j++) {
        const omni_real_t length = omni_sqrtf(dot_product(q[j], q[j]));
        for (int pass = 0; pass < 2; pass++) {
            for (int i = 0; i < j; i++) {
                const omni_real_t share = dot_product(q[i], q[j]);
                r[i][j] += share;
                subtract_scaled(q[j], share, q[i]);
            }
        }
        r[j][j] = omni_sqrtf(dot_product(q[j], q[j]));
        if (!(r[j][j] > smallest_independent * length)) {
            return false;
        }
        for (int i = 0; i < OMNI_MAX_WHEELS; i++) {
            q[j][i] /= r[j][j];
        }
    }
    return true;
}

/* [report eq. 22]: B+ = (B^T B)^-1 B^T = R^-1 Q^T, by back substitution, column by column. */
static void pseudo_inverse(omni_kinematics_t *k, const column_t q[OMNI_AXES], const omni_real_t r[OMNI_AXES][OMNI_AXES],
                           omni_real_t mean_distance) {
    for (int i = 0; i < k->wheels; i++) {
        const omni_real_t wz = q[2][i] / r[2][2];
        const omni_real_t vy = (q[1][i] - r[1][2] * wz) / r[1][1];
        const omni_real_t vx = (q[0][i] - r[0][1] * vy - r[0][2] * wz) / r[0][0];
        k->b_pinv[0][i] = vx;
        k->b_pinv[1][i] = vy;
        k->b_pinv[2][i] = wz / mean_distance;
    }
}

/* Determinant of the rows i, j, l of the three columns. */
static omni_real_t minor_of_columns(const column_t q[OMNI_AXES], int i, int j, int l) {
    return q[0][i] * (q[1][j] * q[2][l] - q[1][l] * q[2][j]) - q[1][i] * (q[0][j] * q[2][l] - q[0][l] * q[2][j]) +
           q[2][i] * (q[0][j] * q[1][l] - q[0][l] * q[1][j]);
}

/* Null vector n: the cofactors of a fourth one. Q's columns are orthonormal, so its length is 1. */
static void null_vector(omni_kinematics_t *k, const column_t q[OMNI_AXES]) {
    k->null[0] = minor_of_columns(q, 1, 2, 3);
    k->null[1] = -minor_of_columns(q, 0, 2, 3);
    k->null[2] = minor_of_columns(q, 0, 1, 3);
    k->null[3] = -minor_of_columns(q, 0, 1, 2);
    const omni_real_t length = omni_sqrtf(dot_product(k->null, k->null));
    const omni_real_t sign = k->null[0] < 0.0f ? -1.0f : 1.0f;
    for (int i = 0; i < OMNI_MAX_WHEELS; i++) {
        k->null[i] *= sign / length;
    }
    k->has_null = true;
}

omni_result_t omni_kinematics_init(omni_kinematics_t *k, const omni_kinematics_config_t *config) {
    column_t q[OMNI_AXES] = {{0.0f}};
    omni_real_t r[OMNI_AXES][OMNI_AXES] = {{0.0f}};
    memset(k, 0, sizeof *k);
    const omni_result_t result = check_geometry(config);
    if (result != OMNI_OK) {
        return result;
    }
    k->wheels = config->wheels;
    const omni_real_t mean_distance = fill_rows(k, config, q);
    if (!orthogonalise_columns(q, r)) {
        memset(k, 0, sizeof *k);
        return OMNI_ERR_SINGULAR;
    }
    pseudo_inverse(k, q, r, mean_distance);
    if (k->wheels == 4) {
        null_vector(k, q);
    }
    return OMNI_OK;
}

omni_real_t omni_kinematics_slip_residual(const omni_kinematics_t *k, const omni_real_t *wheel_rad_s) {
    omni_real_t residual = 0.0f;
    /* n^T B = 0 in [report eq. 20] leaves n^T r phi' = n^T v_s */
    for (int i = 0; i < k->wheels; i++) {
        residual += k->null[i] * k->radius_m[i] * wheel_rad_s[i];
    }
    return residual;
}

omni_twist_t omni_twist_to_body(const omni_twist_t *world, omni_real_t theta) {
    const omni_rotation_t r = omni_rotation(theta);
    return omni_rotate_to_body(world, &r);
}

omni_twist_t omni_twist_to_world(const omni_twist_t *body, omni_real_t theta) {
    const omni_rotation_t r = omni_rotation(theta);
    return omni_rotate_to_world(body, &r);
}
