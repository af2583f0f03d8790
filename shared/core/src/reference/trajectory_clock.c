/* SPDX-License-Identifier: MIT */
#include "../math/math_inline.h"
#include "trajectory_internal.h"

/* The clock's rate 1/scale as a fraction of 2^24: exact in a float, and products with it are exact in integers. */
enum { RATE_BITS = 24 };

static const uint64_t one = (uint64_t)1 << RATE_BITS;

omni_ns_t omni_nanoseconds(omni_real_t seconds) {
    const omni_uint_t whole = (omni_uint_t)seconds;
    const omni_real_t rest =
        omni_clampf(seconds - (omni_real_t)whole, 0.0f, 1.0f); /* no effect; states the range for the proof */
    return (omni_ns_t)whole * 1000000000u + (omni_ns_t)(rest * 1e9f);
}

static omni_ns_t path_time_of(omni_ns_t ns, omni_ns_t rate) {
    return (ns >> RATE_BITS) * rate + (((ns & (one - 1)) * rate) >> RATE_BITS);
}

static omni_ns_t real_time_of(omni_ns_t ns, omni_ns_t rate) {
    const uint64_t most = (uint64_t)1 << 62; /* 146 years */
    if (ns / rate >= most >> RATE_BITS) {
        return most;
    }
    return ((ns / rate) << RATE_BITS) + (((ns % rate) << RATE_BITS) / rate);
}

void omni_path_set_lengths(omni_trajectory_t *plan) {
    plan->timing.period_ns = omni_path_period_ns(plan);
    plan->timing.lap_ns = omni_path_lap_ns(plan);
    plan->timing.duration_ns = omni_path_duration_ns(plan);
    plan->timing.period_s = omni_real_of(plan->timing.period_ns) * 1e-9f;
    plan->timing.lap_s = omni_real_of(plan->timing.lap_ns) * 1e-9f;
}

void omni_path_set_clock(omni_trajectory_t *plan) {
    omni_trajectory_timing_t *t = &plan->timing;
    const omni_real_t rate = omni_clampf((omni_real_t)one / plan->scale, 1.0f, (omni_real_t)one);
    t->rate = (omni_ns_t)rate;
    t->ramp_ns = omni_nanoseconds(plan->config.ramp_s);
    if (t->duration_ns == OMNI_ENDLESS_NS) {
        t->ramp_path_ns = path_time_of(t->ramp_ns, t->rate) / 2;
        t->cruise_ns = OMNI_ENDLESS_NS;
        return;
    }
    /* A short path has shorter ramps and no cruise. */
    const omni_ns_t longest_ns = real_time_of(t->duration_ns, t->rate);
    t->ramp_ns = omni_select(t->ramp_ns < longest_ns, t->ramp_ns, longest_ns);
    t->ramp_path_ns = path_time_of(t->ramp_ns, t->rate) / 2;
    t->cruise_ns = real_time_of(t->duration_ns - 2 * t->ramp_path_ns, t->rate);
}

omni_ns_t omni_path_real_ns(const omni_trajectory_t *plan) {
    const omni_trajectory_timing_t *t = &plan->timing;
    return omni_select(t->cruise_ns == OMNI_ENDLESS_NS, OMNI_ENDLESS_NS, 2 * t->ramp_ns + t->cruise_ns);
}

/* The rising ramp at time_ns < ramp_ns; path_ns counts from the ramp's start. */
static omni_path_clock_t ramp_clock(const omni_trajectory_timing_t *t, omni_ns_t time_ns) {
    const omni_real_t full = (omni_real_t)(omni_uint_t)t->rate / (omni_real_t)one;
    const omni_real_t length_ns = omni_real_of(t->ramp_ns);
    const omni_real_t p = omni_real_of(time_ns) / length_ns;
    const omni_jet_t rise = omni_quintic(p);
    /* Twice the integral of the quintic. */
    const omni_real_t covered = p * p * p * p * (5.0f + p * (-6.0f + 2.0f * p));
    omni_path_clock_t clock = {0, full * rise.d[0], full * rise.d[1] / (length_ns * 1e-9f), false};
    clock.path_ns = (omni_ns_t)(covered * omni_real_of(t->ramp_path_ns));
    return clock;
}

omni_path_clock_t omni_path_clock(const omni_trajectory_t *plan, omni_ns_t time_ns) {
    const omni_trajectory_timing_t *t = &plan->timing;
    const omni_real_t full = (omni_real_t)(omni_uint_t)t->rate / (omni_real_t)one;
    if (time_ns < t->ramp_ns) {
        return ramp_clock(t, time_ns);
    }
    const omni_ns_t cruised_ns = time_ns - t->ramp_ns;
    if (cruised_ns < t->cruise_ns) {
        return (omni_path_clock_t){t->ramp_path_ns + path_time_of(cruised_ns, t->rate), full, 0.0f, false};
    }
    const omni_ns_t braked_ns = cruised_ns - t->cruise_ns;
    if (braked_ns < t->ramp_ns) {
        omni_path_clock_t clock = ramp_clock(t, t->ramp_ns - 1 - braked_ns);
        clock.path_ns = t->duration_ns - clock.path_ns;
        clock.rate_change = -clock.rate_change;
        return clock;
    }
    return (omni_path_clock_t){t->duration_ns, 0.0f, 0.0f, true};
}
