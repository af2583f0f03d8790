/* SPDX-License-Identifier: MIT */
#include "../math/math_inline.h"
#include "trajectory_internal.h"

enum { SEGMENTS = 4 }; /* circle and spin, both ways each */

/* Laps of a segment: `whole` ones and the rest with its derivatives, which may lie a bit beyond 0..1. */
typedef struct laps_t {
    omni_ns_t whole;
    omni_jet_t rest;
} laps_t;

static omni_real_t laps_each_way(const omni_trajectory_t *plan) {
    return plan->config.laps > 0.0f ? plan->config.laps : 1.0f;
}

static omni_ns_t path_round_identify(const omni_trajectory_t *plan) {
    const omni_real_t laps = laps_each_way(plan);
    const omni_ns_t period_ns = omni_nanoseconds(plan->config.period_s);
    const omni_uint_t whole = (omni_uint_t)laps;
    const omni_real_t rest = omni_clampf(laps - (omni_real_t)whole, 0.0f, 1.0f);
    const omni_ns_t segment_ns = (omni_ns_t)whole * period_ns + (omni_ns_t)(rest * (omni_real_t)period_ns);
    return (omni_ns_t)SEGMENTS * omni_select(segment_ns > 0u, segment_ns, 1u);
}

/* The rate rises from rest with a quintic over the ramp, to full_per_s laps per second. */
static omni_jet_t rising_ramp(omni_real_t full_per_s, omni_ns_t ns, omni_ns_t ramp_ns) {
    const omni_real_t ramp_s = (omni_real_t)ramp_ns * 1e-9f;
    const omni_real_t p = (omni_real_t)ns / (omni_real_t)ramp_ns;
    const omni_jet_t rise = omni_quintic(p);
    omni_jet_t laps;
    laps.d[0] = full_per_s * ramp_s * p * p * p * p * (2.5f + p * (p - 3.0f));
    laps.d[1] = full_per_s * rise.d[0];
    laps.d[2] = full_per_s * rise.d[1] / ramp_s;
    laps.d[3] = full_per_s * rise.d[2] / (ramp_s * ramp_s);
    return laps;
}

/* Laps done ns after the segment began: from rest to rest, in between a constant rate. */
static laps_t laps_at(omni_real_t count, omni_ns_t ns, omni_ns_t segment_ns) {
    laps_t laps = {0, {{0.0f}}};
    if (segment_ns < 2u) {
        return laps; /* less than a nanosecond, and the time of a lap may overflow */
    }
    const omni_real_t period_ns = (omni_real_t)segment_ns / count;
    const omni_ns_t quarter_ns = (omni_ns_t)(0.25f * period_ns) + 1;
    const omni_ns_t ramp_ns = omni_select(quarter_ns < segment_ns / 2u, quarter_ns, segment_ns / 2u);
    const omni_ns_t lap_ns = (omni_ns_t)((omni_real_t)(segment_ns - ramp_ns) / count) + 1;
    const omni_real_t full_per_s = 1e9f / (omni_real_t)lap_ns;
    if (ns < ramp_ns) {
        laps.rest = rising_ramp(full_per_s, ns, ramp_ns);
    } else if (ns <= segment_ns - ramp_ns) {
        laps.whole = (ns - ramp_ns) / lap_ns;
        laps.rest.d[0] = omni_phase(ns - ramp_ns, lap_ns) + 0.5f * full_per_s * (omni_real_t)ramp_ns * 1e-9f;
        laps.rest.d[1] = full_per_s;
    } else {
        const omni_jet_t left = rising_ramp(full_per_s, segment_ns - ns, ramp_ns);
        laps.whole = (omni_ns_t)count;
        laps.rest.d[0] = count - (omni_real_t)laps.whole - left.d[0];
        laps.rest.d[1] = left.d[1];
        laps.rest.d[2] = -left.d[2];
        laps.rest.d[3] = left.d[3];
    }
    return laps;
}

static void identify_circle(omni_real_t radius_m, const omni_jet_t *laps, omni_jet_t *x, omni_jet_t *y) {
    const omni_real_t rate = omni_two_pi * laps->d[1];
    const omni_real_t change = omni_two_pi * laps->d[2];
    omni_real_t sine;
    omni_real_t cosine;
    omni_sincosf(omni_two_pi * laps->d[0], &sine, &cosine);
    x->d[0] = radius_m * cosine;
    x->d[1] = -radius_m * rate * sine;
    x->d[2] = -radius_m * (rate * rate * cosine + change * sine);
    y->d[0] = radius_m * sine;
    y->d[1] = radius_m * rate * cosine;
    y->d[2] = radius_m * (change * cosine - rate * rate * sine);
}

static void identify_spin(omni_real_t turn_rad, const laps_t *laps, omni_jet_t *theta) {
    for (int i = 0; i < OMNI_JET_LENGTH; ++i) {
        theta->d[i] = turn_rad * laps->rest.d[i];
    }
    theta->d[0] += omni_two_pi * omni_whole_laps(turn_rad / omni_two_pi, laps->whole);
}

static void path_jets_identify(const omni_trajectory_t *plan, omni_ns_t path_ns, omni_jet_t *x, omni_jet_t *y,
                               omni_jet_t *theta) {
    const omni_ns_t round_ns = plan->timing.lap_ns;
    const omni_ns_t segment_ns = round_ns / SEGMENTS;
    const omni_ns_t ns = path_ns % round_ns;
    const omni_ns_t segment = ns / segment_ns;
    const bool back = segment % 2 == 1;
    const omni_ns_t since_ns = ns - segment * segment_ns;
    /* The clockwise segment is the counter-clockwise one reversed in time. */
    laps_t laps = laps_at(laps_each_way(plan), back ? segment_ns - since_ns : since_ns, segment_ns);
    if (back) {
        laps.rest.d[1] = -laps.rest.d[1];
        laps.rest.d[3] = -laps.rest.d[3];
    }
    if (segment < 2) {
        identify_circle(plan->config.size_m, &laps.rest, x, y);
    } else {
        x->d[0] = plan->config.size_m;
        identify_spin(plan->config.rotation_amplitude_rad, &laps, theta);
    }
}

const omni_path_row_t omni_path_row_identify = {
    path_jets_identify, true, OMNI_POINTS_NONE, 0, path_round_identify, NULL, NULL};
