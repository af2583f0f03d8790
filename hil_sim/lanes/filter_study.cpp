// SPDX-License-Identifier: MIT
// The filter study for eight seeds at once: the very sources of hil_sim/src, with lanes for numbers.
#include <math.h>
#include <string.h>

#include <cstdlib>
#include <memory>
#include <new>

#include "../src/filter_study_lanes.h"
#include "filters.hpp"
#include "words.hpp"

namespace { // NOLINT(cert-dcl59-cpp): each CPU level has its own copy
namespace core {

typedef lanes::wide_t hil_real_t;
#define hil_bits lanes::bits
#define hil_of_bits lanes::of_bits
#define hil_product lanes::product

#include "../src/filter_study_stack.c"
#include "../src/filter_study_sums.c"
#include "../src/filter_study_truth.c"

} // namespace core

struct release {
    void operator()(core::hil_filter_run_t *run) const { std::free(run); }
};

/* Steps between two looks at whether the lanes have parted. */
constexpr uint32_t stretch = 1024;

bool run_steps(core::hil_filter_run_t *run, const hil_filter_config_t *config, const double *reference, const double *rate) {
    for (uint32_t step = 0; step < config->steps; ++step) {
        core::hil_real_t fix[3];
        core::hil_filter_step(run, config, reference, rate, step, fix);
        if (step % stretch == 0 && hil_lanes_take_parted()) {
            return false;
        }
    }
    core::hil_filter_end(run);
    return !hil_lanes_take_parted();
}

/* Lane by lane: the sums are nothing but numbers. */
void unpack(const core::hil_filter_sums_t &from, double *const *sums) {
    constexpr size_t numbers = sizeof from / sizeof(core::hil_real_t);
    static_assert(numbers == sizeof(hil_filter_result_t) / sizeof(double), "a sum per figure");
    const auto *wide = reinterpret_cast<const core::hil_real_t *>(&from);
    for (size_t i = 0; i < numbers; ++i) {
        for (int lane = 0; lane < lanes::count; ++lane) {
            sums[lane][i] = wide[i].get(lane);
        }
    }
}

} // namespace

#define JOINED(name, level) name##_##level
#define NAMED(name, level) JOINED(name, level)

extern "C" bool NAMED(hil_filter_eight, OMNI_LANES_LEVEL)(const hil_filter_config_t *config, const double *reference,
                                                          const double *rate, const uint64_t *seeds, double *const *sums) {
    static_assert(lanes::count == HIL_FILTER_LANES);
    void *room = std::aligned_alloc(alignof(core::hil_filter_run_t), sizeof(core::hil_filter_run_t));
    if (room == nullptr) {
        return false;
    }
    const std::unique_ptr<core::hil_filter_run_t, release> run(new (room) core::hil_filter_run_t);
    core::omni_uint_t words[2];
    for (int lane = 0; lane < lanes::count; ++lane) {
        words[0].set(lane, static_cast<uint32_t>(seeds[lane]));
        words[1].set(lane, static_cast<uint32_t>(seeds[lane] >> 32));
    }
    (void)hil_lanes_take_parted();
    if (!core::hil_filter_begin(run.get(), config, reference, words) || !run_steps(run.get(), config, reference, rate)) {
        return false;
    }
    unpack(run->sums, sums);
    return true;
}
