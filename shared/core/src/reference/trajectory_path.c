/* SPDX-License-Identifier: MIT */
#include <string.h>

#include "../math/math_inline.h"
#include "trajectory_internal.h"

omni_jet_t omni_quintic(omni_real_t p) {
    const omni_real_t q = 1.0f - p;
    omni_jet_t jet;
    jet.d[0] = p * p * p * (10.0f + p * (-15.0f + 6.0f * p));
    jet.d[1] = 30.0f * p * p * q * q;
    jet.d[2] = 60.0f * p * q * (q - p);
    jet.d[3] = 60.0f * (1.0f - 6.0f * p * q);
    return jet;
}

omni_ns_t omni_path_period_ns(const omni_trajectory_t *plan) {
    const omni_ns_t ns = omni_nanoseconds(plan->config.period_s);
    return omni_select(ns > 0u, ns, 1u);
}

omni_ns_t omni_path_lap_ns(const omni_trajectory_t *plan) {
    const omni_path_row_t *row = omni_path_row(plan);
    if (row->round_ns != NULL) {
        return row->round_ns(plan);
    }
    return omni_path_period_ns(plan) * (omni_path_has_legs(row) ? plan->waypoints.count : 1u);
}

omni_ns_t omni_path_duration_ns(const omni_trajectory_t *plan) {
    if (!(plan->config.laps > 0.0f)) {
        return OMNI_ENDLESS_NS;
    }
    const omni_ns_t lap_ns = omni_path_lap_ns(plan);
    if (omni_path_row(plan)->round_ns != NULL) {
        return lap_ns;
    }
    const omni_uint_t whole = (omni_uint_t)plan->config.laps;
    const omni_real_t rest = omni_clampf(plan->config.laps - (omni_real_t)whole, 0.0f, 1.0f);
    const omni_ns_t laps_ns = (omni_ns_t)whole * lap_ns + (omni_ns_t)(rest * (omni_real_t)lap_ns);
    /* A tour of n points has n - 1 legs if it does not come back to the first. */
    const omni_ns_t back_ns = omni_path_has_legs(omni_path_row(plan)) ? omni_path_period_ns(plan) : (omni_ns_t)0;
    return omni_select(laps_ns > back_ns, laps_ns - back_ns, 0u);
}

void omni_jet_add_sine(omni_jet_t *jet, omni_real_t amplitude, omni_real_t turns, omni_real_t omega) {
    omni_real_t sine;
    omni_real_t cosine;
    omni_sincosf(omni_two_pi * turns, &sine, &cosine);
    jet->d[0] += amplitude * sine;
    jet->d[1] += amplitude * omega * cosine;
    jet->d[2] -= amplitude * omega * omega * sine;
    jet->d[3] -= amplitude * omega * omega * omega * cosine;
}

/* (x, y) += amplitude exp(i phase), the phase growing by half_turns per period. */
static void add_phasor(omni_jet_t *x, omni_jet_t *y, omni_real_t amplitude, int32_t half_turns, omni_ns_t ns,
                       const omni_trajectory_timing_t *timing) {
    const omni_ns_t lap_ns = timing->period_ns;
    const uint64_t count = (uint64_t)(half_turns < 0 ? -half_turns : half_turns);
    const omni_real_t sign = half_turns < 0 ? -1.0f : 1.0f;
    const omni_real_t turns = omni_phase(omni_modulo(ns, 2 * lap_ns) * count, 2 * lap_ns);
    const omni_real_t omega = 0.5f * omni_two_pi * (omni_real_t)half_turns / timing->period_s;
    omni_real_t sine;
    omni_real_t cosine;
    omni_sincosf(omni_two_pi * (sign * turns), &sine, &cosine);
    const omni_real_t first = amplitude * omega;
    const omni_real_t second = first * omega;
    const omni_real_t third = second * omega;
    x->d[0] += amplitude * cosine;
    x->d[1] -= first * sine;
    x->d[2] -= second * cosine;
    x->d[3] += third * sine;
    y->d[0] += amplitude * sine;
    y->d[1] += first * cosine;
    y->d[2] -= second * sine;
    y->d[3] -= third * cosine;
}

static void path_half_turns_rose(const omni_trajectory_config_t *config, int32_t *sum, int32_t *difference) {
    const int32_t petals = config->petals;
    const int32_t bearing = petals % 2 == 1 ? 1 : (petals % 4 == 0 ? 2 : 4);
    *sum = bearing + petals;
    *difference = bearing - petals;
}

/* r = a cos(k f) at bearing f: half the sum of a exp(i (1 + k) f) and a exp(i (1 - k) f). */
static void path_jets_rose(const omni_trajectory_t *plan, omni_ns_t ns, omni_jet_t *x, omni_jet_t *y,
                           omni_jet_t *theta) {
    int32_t sum;
    int32_t difference;
    (void)theta;
    path_half_turns_rose(&plan->config, &sum, &difference);
    add_phasor(x, y, 0.5f * plan->config.size_m, sum, ns, &plan->timing);
    add_phasor(x, y, 0.5f * plan->config.size_m, difference, ns, &plan->timing);
}

/* sin(2 pi u / sine_s) + cos(2 pi u / cosine_s), times the amplitude. */
static void add_pair(omni_jet_t *jet, omni_real_t amplitude, omni_ns_t ns, uint32_t sine_s, uint32_t cosine_s) {
    const uint64_t second_ns = 1000000000u;
    omni_jet_add_sine(jet, amplitude, omni_phase(ns, sine_s * second_ns), omni_two_pi / (omni_real_t)sine_s);
    omni_jet_add_sine(jet, amplitude, omni_phase(ns, cosine_s * second_ns) + 0.25f,
                      omni_two_pi / (omni_real_t)cosine_s);
}

/* [report eq. 81] */
static void path_jets_report(const omni_trajectory_t *plan, omni_ns_t ns, omni_jet_t *x, omni_jet_t *y,
                             omni_jet_t *theta) {
    add_pair(x, plan->config.size_m, ns, 12, 14);
    add_pair(y, plan->config.size_m, ns, 5, 4);
    add_pair(theta, 0.5f, ns, 16, 8);
}

/* Share of the leg done, derivatives by path time. */
static omni_jet_t leg_share(omni_ns_t ns, const omni_trajectory_timing_t *timing) {
    omni_jet_t jet = omni_quintic(omni_phase(ns, timing->period_ns));
    omni_real_t factor = 1.0f;
    for (int i = 1; i < OMNI_JET_LENGTH; ++i) {
        factor /= timing->period_s;
        jet.d[i] *= factor;
    }
    return jet;
}

static omni_jet_t leg_jet(omni_real_t from, omni_real_t to, const omni_jet_t *share) {
    omni_jet_t jet;
    for (int i = 0; i < OMNI_JET_LENGTH; ++i) {
        jet.d[i] = (to - from) * share->d[i];
    }
    jet.d[0] += from;
    return jet;
}

static void path_jets_line(const omni_trajectory_t *plan, omni_ns_t ns, omni_jet_t *x, omni_jet_t *y,
                           omni_jet_t *theta) {
    (void)y;
    (void)theta;
    const omni_ns_t leg_ns = plan->timing.period_ns;
    const omni_jet_t share = leg_share(ns, &plan->timing);
    const bool back = ns / leg_ns % 2 == 1;
    *x = leg_jet(back ? plan->config.size_m : 0.0f, back ? 0.0f : plan->config.size_m, &share);
}

static void path_jets_points(const omni_trajectory_t *plan, omni_ns_t ns, omni_jet_t *x, omni_jet_t *y,
                             omni_jet_t *theta) {
    const omni_ns_t leg_ns = plan->timing.period_ns;
    const omni_jet_t share = leg_share(ns, &plan->timing);
    const uint8_t count = plan->waypoints.count;
    const uint64_t leg = (uint64_t)(ns / leg_ns);
    const omni_pose_t *from = &plan->waypoints.pose[leg % count];
    const omni_pose_t *to = &plan->waypoints.pose[(leg + 1) % count];
    *x = leg_jet(from->x, to->x, &share);
    *y = leg_jet(from->y, to->y, &share);
    *theta = leg_jet(from->theta, from->theta + omni_wrap_pi(to->theta - from->theta), &share);
}

static void path_jets_hold(const omni_trajectory_t *plan, omni_ns_t ns, omni_jet_t *x, omni_jet_t *y,
                           omni_jet_t *theta) {
    (void)ns;
    (void)theta;
    x->d[0] = plan->origin.x;
    y->d[0] = plan->origin.y;
}

static void path_half_turns_circle(const omni_trajectory_config_t *config, int32_t *sum, int32_t *difference) {
    (void)config;
    *sum = 2;
    *difference = 0;
}

static void path_jets_circle(const omni_trajectory_t *plan, omni_ns_t ns, omni_jet_t *x, omni_jet_t *y,
                             omni_jet_t *theta) {
    (void)theta;
    add_phasor(x, y, plan->config.size_m, 2, ns, &plan->timing);
}

static bool path_accepts_rose(const omni_trajectory_config_t *config) {
    return config->petals >= 1 && config->petals <= 32;
}

const omni_path_row_t omni_path_row_hold = {path_jets_hold, false, OMNI_POINTS_NONE, 0, NULL, NULL, NULL};
const omni_path_row_t omni_path_row_waypoints = {path_jets_points, true, OMNI_POINTS_GIVEN, 0, NULL, NULL, NULL};
const omni_path_row_t omni_path_row_random = {path_jets_points, true, OMNI_POINTS_DRAWN, 0, NULL, NULL, NULL};
const omni_path_row_t omni_path_row_line = {path_jets_line, false, OMNI_POINTS_NONE, 0, NULL, NULL, NULL};
const omni_path_row_t omni_path_row_circle = {path_jets_circle,       false, OMNI_POINTS_NONE, 0, NULL,
                                              path_half_turns_circle, NULL};
const omni_path_row_t omni_path_row_rose = {path_jets_rose,   false, OMNI_POINTS_NONE, 0, NULL, path_half_turns_rose,
                                            path_accepts_rose};
/* eq. 81 repeats after the least common multiple of its six periods. */
const omni_path_row_t omni_path_row_report = {path_jets_report, true, OMNI_POINTS_NONE, 1680, NULL, NULL, NULL};

void omni_path_at(const omni_trajectory_t *plan, omni_ns_t path_ns, omni_pose_t *pose, omni_twist_t *first,
                  omni_twist_t *second) {
    omni_jet_t x = {{0}};
    omni_jet_t y = {{0}};
    omni_jet_t theta = {{0}};
    const omni_path_row_t *row = omni_path_row(plan);
    row->jets(plan, path_ns, &x, &y, &theta);
    if (!row->has_heading) {
        theta = omni_path_rotation(plan, path_ns, &x, &y);
    }
    *pose = (omni_pose_t){x.d[0], y.d[0], theta.d[0] + plan->heading_offset_rad};
    *first = (omni_twist_t){x.d[1], y.d[1], theta.d[1]};
    *second = (omni_twist_t){x.d[2], y.d[2], theta.d[2]};
}

void omni_path_evaluate(const omni_trajectory_t *plan, omni_real_t path_time_s, omni_pose_t *pose, omni_twist_t *first,
                        omni_twist_t *second) {
    const omni_ns_t duration_ns = plan->timing.duration_ns;
    const omni_ns_t ns = omni_nanoseconds(omni_clampf(path_time_s, 0.0f, 1e9f));
    omni_path_at(plan, omni_select(ns < duration_ns, ns, duration_ns), pose, first, second);
}
