// SPDX-License-Identifier: MIT
/**
 * @file world_types.hpp
 * The types of the simulated world for eight runs at once. They are its very headers, with lanes for numbers, in
 * namespace `core` of the including file, beside those of the control core.
 */
#ifndef HIL_LANES_WORLD_TYPES_HPP
#define HIL_LANES_WORLD_TYPES_HPP

#include <cmath>

/* Drawn lane by lane; the header is C. */
extern "C" {
#include "hil_sim/random.h"
}

#include "core_types.hpp"

#define HIL_OWN_NUMBERS
#define hil_select lanes::select
#define hil_sqrt lanes::sqrt
#define hil_abs lanes::abs

namespace { // NOLINT(cert-dcl59-cpp): each file and CPU level has its own
namespace core {

typedef lanes::wide_t hil_real_t;
typedef lanes::int_t hil_int_t;
typedef lanes::int_t hil_steps_t;
typedef lanes::mask_t hil_flag_t;
typedef lanes::number<uint64_t> hil_time_t;

struct hil_seed_t {
    uint64_t lane[lanes::count];
};

/* function(lane), lane by lane: for what is rare. */
template <typename Function>
inline hil_real_t each_lane(Function function) {
    hil_real_t result;
    for (int lane = 0; lane < lanes::count; ++lane) {
        result.set(lane, function(lane));
    }
    return result;
}

inline hil_real_t hil_copysign(hil_real_t a, hil_real_t b) {
    return each_lane([&](int lane) { return std::copysign(a.get(lane), b.get(lane)); });
}

inline hil_real_t hil_exp(hil_real_t a) {
    return each_lane([&](int lane) { return std::exp(a.get(lane)); });
}

inline hil_real_t hil_log1p(hil_real_t a) {
    return each_lane([&](int lane) { return std::log1p(a.get(lane)); });
}

inline hil_real_t hil_uniform(const hil_seed_t &seed, uint32_t stream, uint64_t index) {
    return each_lane([&](int lane) { return ::hil_uniform(seed.lane[lane], stream, index); });
}

inline hil_real_t hil_normal(const hil_seed_t &seed, uint32_t stream, uint64_t index) {
    return each_lane([&](int lane) { return ::hil_normal(seed.lane[lane], stream, index); });
}

/* A vector's conversion ends at 32 bits where C's goes on and wraps. */
inline hil_int_t hil_count_on(hil_int_t count, hil_real_t edges) {
    if (!lanes::all(lanes::abs(edges) < 0x1p31)) {
        hil_lanes_diverge();
    }
    return hil_int_t(lanes::uint_t(count) + lanes::uint_t(hil_int_t(edges)));
}

#include "hil_sim/metrics.h"
#include "hil_sim/world.h"

LANES_LAYOUT(hil_world_t)
LANES_LAYOUT(hil_metrics_t)

} // namespace core
} // namespace

#endif
