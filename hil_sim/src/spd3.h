/* SPDX-License-Identifier: MIT */
/** @file spd3.h  Symmetric positive definite systems of three equations; in a header because they are in the innermost
 * loop. */
#ifndef HIL_SIM_SPD3_H
#define HIL_SIM_SPD3_H

#include "hil_sim/world.h"

/** @param m xx, xy, xt, yy, yt, tt of a symmetric positive definite matrix */
static inline void hil_spd3_factor(hil_spd3_t *spd, const hil_real_t *m) {
    spd->inv_d[0] = 1.0 / m[0];
    spd->l10 = m[1] * spd->inv_d[0];
    spd->l20 = m[2] * spd->inv_d[0];
    spd->inv_d[1] = 1.0 / (m[3] - spd->l10 * m[1]);
    const hil_real_t left = m[4] - spd->l10 * m[2];
    spd->l21 = left * spd->inv_d[1];
    spd->inv_d[2] = 1.0 / (m[5] - spd->l20 * m[2] - spd->l21 * left);
}

/** Solve for x. @param b overwritten */
static inline void hil_spd3_solve(const hil_spd3_t *spd, hil_real_t *b, hil_real_t *x) {
    b[1] -= spd->l10 * b[0];
    b[2] -= spd->l20 * b[0] + spd->l21 * b[1];
    x[2] = b[2] * spd->inv_d[2];
    x[1] = b[1] * spd->inv_d[1] - spd->l21 * x[2];
    x[0] = b[0] * spd->inv_d[0] - spd->l10 * x[1] - spd->l20 * x[2];
}

/** Add weight * (x, y, t)' (x, y, t) to the matrix m. */
static inline void hil_spd3_add(hil_real_t *m, hil_real_t weight, hil_real_t x, hil_real_t y, hil_real_t t) {
    m[0] += weight * x * x;
    m[1] += weight * x * y;
    m[2] += weight * x * t;
    m[3] += weight * y * y;
    m[4] += weight * y * t;
    m[5] += weight * t * t;
}

#endif
