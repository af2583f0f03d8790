// SPDX-License-Identifier: MIT
// The filter study for eight seeds at once, or sixteen with AVX-512: the sources of hil_sim/src, lanes for numbers.
#include <math.h>
#include <string.h>

#include <cstdlib>

#include "../src/filter_study_lanes.h"
#include "bit_access.hpp"
#include "divergence.h"
#include "filters.hpp"

namespace { // NOLINT(cert-dcl59-cpp): each CPU level has its own copy
namespace core {

typedef lanes::wide_t hil_real_t;
typedef lanes::int_t hil_int_t;
#define HIL_OWN_NUMBERS
#define hil_select lanes::select
#define hil_bits lanes::bits
#define hil_of_bits lanes::of_bits
#define hil_product lanes::product

#include "../src/filter_study_stack.c"
#include "../src/filter_study_sums.c"
#include "../src/filter_study_truth.c"

/* Steps between two looks at whether the lanes have parted. */
constexpr uint32_t steps_per_look = 1024;

/* In one function gcc's code takes 7 % less time with AVX2, and 10 % less with AVX-512. With SSE2 it gains 3 %, and
 * takes long to compile. */
#if defined(__AVX2__)
#define RUN_IN_ONE __attribute__((flatten))
#else
#define RUN_IN_ONE
#endif

RUN_IN_ONE
bool run_all(hil_filter_run_t *run, const hil_filter_config_t *config, const double *reference, const double *rate,
             const omni_uint_t *seed) {
    (void)hil_lanes_take_diverged();
    if (!hil_filter_begin(run, config, reference, seed)) {
        return false;
    }
    for (uint32_t step = 0; step < config->steps; ++step) {
        hil_real_t fix[3];
        hil_filter_step(run, config, reference, rate, step, fix);
        if (step % steps_per_look == 0 && hil_lanes_take_diverged()) {
            return false;
        }
    }
    hil_filter_end(run);
    return !hil_lanes_take_diverged();
}

/* Lane by lane: sums are nothing but numbers. */
void unpack(const hil_filter_sums_t *from, ::hil_filter_sums_t *to) {
    constexpr size_t numbers = sizeof *from / sizeof(hil_real_t);
    static_assert(numbers == sizeof(hil_filter_result_t) / sizeof(double), "a sum per figure");
    const auto *wide = reinterpret_cast<const hil_real_t *>(from);
    auto *narrow = reinterpret_cast<double *>(to);
    for (size_t lane = 0; lane < lanes::count; ++lane) {
        for (size_t i = 0; i < numbers; ++i) {
            narrow[lane * numbers + i] = wide[i].get(static_cast<int>(lane));
        }
    }
}

} // namespace core
} // namespace

#define LANES_NAME_OF(name, level) name##_##level
#define LANES_NAME(name, level) LANES_NAME_OF(name, level)

extern "C" bool LANES_NAME(hil_filter_lanes, OMNI_LANES_LEVEL)(const hil_filter_config_t *config,
                                                               const double *reference, const double *rate,
                                                               const uint64_t *seeds, hil_filter_sums_t *sums) {
#ifdef LANES_SIXTEEN
    static_assert(lanes::count == HIL_FILTER_MOST_LANES);
#else
    static_assert(lanes::count == HIL_FILTER_LANES);
#endif
    void *room = std::aligned_alloc(alignof(core::hil_filter_run_t), sizeof(core::hil_filter_run_t));
    if (room == nullptr) {
        return false;
    }
    core::omni_uint_t words[2];
    for (int lane = 0; lane < lanes::count; ++lane) {
        words[0].set(lane, static_cast<uint32_t>(seeds[lane]));
        words[1].set(lane, static_cast<uint32_t>(seeds[lane] >> 32));
    }
    auto *run = static_cast<core::hil_filter_run_t *>(room);
    const bool together = core::run_all(run, config, reference, rate, words);
    if (together) {
        core::unpack(&run->sums, sums);
    }
    std::free(room);
    return together;
}
