// SPDX-License-Identifier: MIT
// extern "C" access to the firmware's small parts around the tick.
#include "app/services/status_light.h"
#include "app/tick/tick_jitter.h"

extern "C" {

/// Feed starts [ns] of ticks; out gets max_us() after each.
void jitter_run(const uint64_t *starts_ns, uint32_t count, float *out) {
    omni::TickJitter jitter;
    for (uint32_t i = 0; i < count; ++i) {
        jitter.record_start(starts_ns[i]);
        out[i] = jitter.max_us();
    }
}

uint32_t light_pattern(int state, bool ground_station) {
    return omni::light_pattern(static_cast<omni_safety_state_t>(state), ground_station);
}

bool light_on(int state, bool ground_station, uint64_t now_us) {
    return omni::light_on(static_cast<omni_safety_state_t>(state), ground_station, now_us);
}
}
