/* SPDX-License-Identifier: MIT */
#include "omni/torque_curve.h"

#include "../math/math_inline.h"

enum { KNOTS = OMNI_CURVE_POINTS + 3 };

/* Fraction of tau_max over which the deadband is crossed. */
static const omni_real_t crossing = 0.01f;

typedef struct knot_t {
    omni_real_t share; /* of tau_max */
    omni_real_t duty;
} knot_t;

/* Origin, edge of the deadband, the points, full duty. */
static void curve_knots(const omni_torque_curve_t *curve, knot_t knot[KNOTS]) {
    const omni_real_t spacing = 1.0f / (omni_real_t)(OMNI_CURVE_POINTS + 1);
    knot[0] = (knot_t){0.0f, 0.0f};
    knot[1] = (knot_t){crossing, curve->deadband_duty + (curve->duty[0] - curve->deadband_duty) * crossing / spacing};
    for (int i = 0; i < OMNI_CURVE_POINTS; ++i) {
        knot[i + 2].share = spacing * (omni_real_t)(i + 1);
        knot[i + 2].duty = curve->duty[i];
    }
    knot[KNOTS - 1] = (knot_t){1.0f, 1.0f};
}

bool omni_torque_curve_is_valid(const omni_torque_curve_t *curve, int32_t *bad_point) {
    omni_real_t before = curve->deadband_duty;
    for (int32_t i = 0; i <= OMNI_CURVE_POINTS; ++i) {
        const omni_real_t duty = i < OMNI_CURVE_POINTS ? curve->duty[i] : 1.0f;
        if (!(duty > before) || !(before >= 0.0f)) {
            if (bad_point != NULL) {
                *bad_point = i;
            }
            return false;
        }
        before = duty;
    }
    return true;
}

omni_real_t omni_torque_curve_duty(const omni_torque_curve_t *curve, omni_real_t torque_N_m) {
    knot_t knot[KNOTS];
    const omni_real_t share = omni_absf(torque_N_m) / curve->torque_max_N_m;
    if (!omni_is_finite(share)) {
        return share > 0.0f ? omni_signf(torque_N_m) : 0.0f;
    }
    curve_knots(curve, knot);
    knot_t low = knot[0];
    knot_t high = knot[1];
    for (int i = 1; i < KNOTS - 1 && !omni_all(share <= knot[i].share); ++i) {
        const omni_flag_t beyond = share > knot[i].share;
        low.share = omni_select(beyond, knot[i].share, low.share);
        low.duty = omni_select(beyond, knot[i].duty, low.duty);
        high.share = omni_select(beyond, knot[i + 1].share, high.share);
        high.duty = omni_select(beyond, knot[i + 1].duty, high.duty);
    }
    const omni_real_t way = (share - low.share) / (high.share - low.share);
    const omni_real_t duty = low.duty + way * (high.duty - low.duty);
    return omni_signf(torque_N_m) * omni_select(share <= 1.0f, duty, 1.0f);
}

omni_real_t omni_torque_curve_torque(const omni_torque_curve_t *curve, omni_real_t duty) {
    knot_t knot[KNOTS];
    const omni_real_t magnitude = omni_absf(duty);
    curve_knots(curve, knot);
    for (int i = 1; i < KNOTS; ++i) {
        if (magnitude <= knot[i].duty) {
            const omni_real_t way = (magnitude - knot[i - 1].duty) / (knot[i].duty - knot[i - 1].duty);
            return omni_signf(duty) * curve->torque_max_N_m *
                   (knot[i - 1].share + way * (knot[i].share - knot[i - 1].share));
        }
    }
    return omni_signf(duty) * curve->torque_max_N_m;
}
