/* SPDX-License-Identifier: MIT */
#include "processor.h"

bool hil_lanes_has_avx2(void) {
#ifdef HIL_LANES_X86
    return __builtin_cpu_supports("avx2");
#else
    return false;
#endif
}

bool hil_lanes_has_avx512(void) {
#ifdef HIL_LANES_X86
    return __builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512dq") &&
           __builtin_cpu_supports("avx512bw") && __builtin_cpu_supports("avx512vl");
#else
    return false;
#endif
}

const hil_lanes_runs_t *hil_lanes_runs(hil_lanes_level_t most) {
#ifdef HIL_LANES_X86
    if (most >= HIL_LANES_BEST && hil_lanes_has_avx512()) {
        return &hil_lanes_runs_avx512_eight;
    }
    if (most >= HIL_LANES_AVX2 && hil_lanes_has_avx2()) {
        return &hil_lanes_runs_avx2;
    }
#else
    (void)most;
#endif
    return &hil_lanes_runs_baseline;
}
