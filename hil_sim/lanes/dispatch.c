/* SPDX-License-Identifier: MIT */
#include "core.h"
#include "runs.h"

const hil_lanes_core_t *hil_lanes_core(void) {
#ifdef HIL_LANES_AVX2
    if (__builtin_cpu_supports("avx2")) {
        return &hil_lanes_core_avx2;
    }
#endif
    return &hil_lanes_core_baseline;
}

const hil_lanes_runs_t *hil_lanes_runs(void) {
#ifdef HIL_LANES_AVX2
    if (__builtin_cpu_supports("avx2")) {
        return &hil_lanes_runs_avx2;
    }
#endif
    return &hil_lanes_runs_baseline;
}
