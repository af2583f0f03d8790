// SPDX-License-Identifier: MIT
/**
 * @file core_types.hpp
 * The types of the control core for eight runs at once. They are its very headers, with lanes for numbers, in namespace
 * `core` of the including file. And where their members lie, to pack and unpack them: `layout_omni_robot_t` and so on.
 */
#ifndef HIL_LANES_CORE_TYPES_HPP
#define HIL_LANES_CORE_TYPES_HPP

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include "lanes.hpp"
#include "layout.h"

#define OMNI_OWN_NUMBERS
#define OMNI_FABSF lanes::abs
#define OMNI_SQRTF lanes::sqrt
#define omni_select lanes::select
#define omni_all lanes::all
#define omni_any lanes::any
#define omni_real_of(whole) ((omni_real_t)(whole))

namespace { // NOLINT(cert-dcl59-cpp): each file and CPU level has its own
namespace core {

typedef lanes::real_t omni_real_t;
typedef lanes::int_t omni_int_t;
typedef lanes::int_t omni_steps_t;
typedef lanes::uint_t omni_uint_t;
typedef lanes::ns_t omni_ns_t;
typedef lanes::mask_t omni_flag_t;

#include "omni/omni.h"

/* A stretch has no holes in lanes either. */
constexpr size_t stretch_bytes(hil_stretch_kind_t kind) {
    return kind == HIL_STRETCH_SAME ? 0 : kind == HIL_STRETCH_WIDE ? sizeof(lanes::wide_t) : sizeof(lanes::real_t);
}
#define LANES_CHECK(kind, type, first, last, count)                                                                    \
    static_assert(offsetof(type, last) == offsetof(type, first) + (count - 1) * stretch_bytes(HIL_STRETCH_##kind));

/** How a type of the core lies in memory: `layout_omni_robot_t` and so on. */
#define LANES_LAYOUT(type)                                                                                             \
    HIL_LAYOUT_##type(LANES_CHECK) const hil_stretch_t stretches_##type[] = {HIL_LAYOUT_##type(HIL_STRETCH)};          \
    const hil_layout_t layout_##type = {hil_stretches_##type, stretches_##type,                                        \
                                        sizeof stretches_##type / sizeof(hil_stretch_t)};

LANES_LAYOUT(omni_robot_t)
LANES_LAYOUT(omni_robot_config_t)
LANES_LAYOUT(omni_inputs_t)
LANES_LAYOUT(omni_outputs_t)
LANES_LAYOUT(omni_reference_t)
LANES_LAYOUT(omni_trajectory_t)

} // namespace core
} // namespace

#endif
