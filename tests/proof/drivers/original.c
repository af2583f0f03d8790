/* SPDX-License-Identifier: MIT */
/* The original law's counters of moved counts: after `tick` ticks of a period they hold at most `tick` times the
 * largest step. */
#include "any.h"

static omni_original_state_t state;
static omni_original_config_t config;
static omni_kinematics_t kinematics;
static omni_int_t delta[OMNI_MAX_WHEELS];

static void after(int ticks) {
    omni_pose_t pose, reference;
    omni_twist_t rate;
    ANYTHING(state);
    state.next = (uint8_t)Frama_C_interval(0, OMNI_ORIGINAL_WINDOW - 1);
    state.tick = (uint16_t)ticks;
    for (int i = 0; i < OMNI_MAX_WHEELS; ++i) {
        state.moved_counts[i] =
            Frama_C_interval(-ticks * OMNI_ORIGINAL_LARGEST_DELTA, ticks * OMNI_ORIGINAL_LARGEST_DELTA);
        delta[i] = Frama_C_interval(-OMNI_ORIGINAL_LARGEST_DELTA, OMNI_ORIGINAL_LARGEST_DELTA);
    }
    ANYTHING(pose);
    ANYTHING(reference);
    ANYTHING(rate);
    omni_original_step(&state, &config, &kinematics, delta, &pose, &reference, &rate, any_real());
    /*@ check next: state.next < OMNI_ORIGINAL_WINDOW; */
    /*@ check tick: state.tick == (ticks + 1) % config.period_ticks; */
    for (int i = 0; i < OMNI_MAX_WHEELS; ++i) {
        const int most = state.tick * OMNI_ORIGINAL_LARGEST_DELTA;
        /*@ check moved: -most <= state.moved_counts[i] <= most; */
    }
}

void proof_original(void) {
    ANYTHING(kinematics);
    kinematics.has_null = any_bool();
    kinematics.wheels = OMNI_MAX_WHEELS;
    config = omni_original_defaults(0.001f, any_real());
    for (int ticks = 0; ticks < config.period_ticks; ++ticks) {
        after(ticks);
    }
}
