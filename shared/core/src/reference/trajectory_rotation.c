/* SPDX-License-Identifier: MIT */
#include "../math/math_inline.h"
#include "trajectory_internal.h"

omni_real_t omni_whole_laps(omni_real_t turns, omni_ns_t laps) {
    const omni_real_t unit = 4294967296.0f;
    const uint64_t per_lap = (uint64_t)(int64_t)(turns * unit);
    const uint32_t fraction = (uint32_t)(per_lap * laps);
    return (omni_real_t)(fraction >> 31 ? (int64_t)fraction - 4294967296 : (int64_t)fraction) / unit;
}

static omni_jet_t heading_of_spin(omni_real_t turn_rad, omni_ns_t path_ns, const omni_trajectory_timing_t *timing) {
    const omni_ns_t lap_ns = timing->lap_ns;
    omni_jet_t jet = {{0}};
    jet.d[0] = turn_rad * omni_phase(path_ns, lap_ns) +
               omni_two_pi * omni_whole_laps(turn_rad / omni_two_pi, path_ns / lap_ns);
    jet.d[1] = turn_rad / timing->lap_s;
    return jet;
}

static omni_jet_t heading_of_sine(omni_real_t amplitude, omni_real_t cycles, omni_ns_t path_ns,
                                  const omni_trajectory_timing_t *timing) {
    const omni_ns_t lap_ns = timing->lap_ns;
    const uint32_t whole = (uint32_t)cycles;
    const omni_real_t rest = cycles - (omni_real_t)whole;
    omni_real_t turns = omni_phase(omni_modulo(path_ns, lap_ns) * whole, lap_ns);
    if (rest > 0.0f) {
        turns = turns + rest * omni_phase(path_ns, lap_ns) + omni_whole_laps(rest, path_ns / lap_ns);
    }
    const omni_real_t omega = omni_two_pi * cycles / timing->lap_s;
    omni_real_t sine;
    omni_real_t cosine;
    omni_sincosf(omni_two_pi * turns, &sine, &cosine);
    return (omni_jet_t){{amplitude * sine, amplitude * omega * cosine, -amplitude * omega * omega * sine,
                         -amplitude * omega * omega * omega * cosine}};
}

/*
 * Direction of travel, without jumps. The derivative of a rose is the sum of two phasors. The longer one, exp(i sum
 * phi), carries the whole turns. The other swings the direction by less than a quarter turn. A lap adds whole turns
 * only.
 */
static omni_real_t direction_of_travel(const omni_trajectory_t *plan, omni_ns_t path_ns, omni_ns_t lap_ns) {
    int32_t sum;
    int32_t difference;
    omni_path_row(plan)->half_turns(&plan->config, &sum, &difference);
    const omni_real_t ratio = (omni_real_t)difference / (omni_real_t)sum;
    const uint64_t apart = difference == 0 ? 0 : (uint64_t)(sum - difference);
    omni_real_t sine;
    omni_real_t cosine;
    omni_sincosf(-omni_two_pi * omni_phase(omni_modulo(path_ns, 2 * lap_ns) * apart, 2 * lap_ns), &sine, &cosine);
    return 0.5f * omni_two_pi * ((omni_real_t)sum * omni_phase(path_ns, lap_ns) + 0.5f) +
           omni_atan2f(ratio * sine, 1.0f + ratio * cosine);
}

/* theta' = (x' y'' - y' x'') / |v|^2 and its derivative; roses and circles never stand still. */
static omni_jet_t heading_of_tangent(const omni_trajectory_t *plan, omni_ns_t path_ns, omni_ns_t lap_ns,
                                     const omni_jet_t *x, const omni_jet_t *y) {
    omni_jet_t jet = {{0}};
    const omni_real_t speed2 = x->d[1] * x->d[1] + y->d[1] * y->d[1];
    if (!(speed2 > 0.0f)) {
        return jet;
    }
    const omni_real_t cross = x->d[1] * y->d[2] - y->d[1] * x->d[2];
    const omni_real_t cross_change = x->d[1] * y->d[3] - y->d[1] * x->d[3];
    const omni_real_t speed2_change = 2.0f * (x->d[1] * x->d[2] + y->d[1] * y->d[2]);
    jet.d[0] = direction_of_travel(plan, path_ns, lap_ns);
    jet.d[1] = cross / speed2;
    jet.d[2] = (cross_change - jet.d[1] * speed2_change) / speed2;
    return jet;
}

omni_jet_t omni_path_rotation(const omni_trajectory_t *plan, omni_ns_t path_ns, const omni_jet_t *x,
                              const omni_jet_t *y) {
    const omni_trajectory_config_t *c = &plan->config;
    if (c->rotation == OMNI_TRJ_ROT_SPIN) {
        return heading_of_spin(c->rotation_amplitude_rad, path_ns, &plan->timing);
    }
    if (c->rotation == OMNI_TRJ_ROT_SINE) {
        return heading_of_sine(c->rotation_amplitude_rad, c->rotation_cycles, path_ns, &plan->timing);
    }
    /* A line is driven back in reverse: at its ends the speed vanishes and the direction is kept. */
    const bool curved = omni_path_row(plan)->half_turns != NULL;
    if (c->rotation == OMNI_TRJ_ROT_TANGENT && curved) {
        return heading_of_tangent(plan, path_ns, plan->timing.lap_ns, x, y);
    }
    return (omni_jet_t){{0}};
}
