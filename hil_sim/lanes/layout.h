/* SPDX-License-Identifier: MIT */
/** @file layout.h  Where the members of the structs that go into lanes lie in the struct of one run. */
#ifndef HIL_LANES_LAYOUT_H
#define HIL_LANES_LAYOUT_H

#include "lanes_layout_gen.h"
#include "pack.h"

#ifdef __cplusplus
extern "C" {
#endif

#define HIL_LAYOUT_DECLARE(type) extern const hil_stretch_t hil_stretches_##type[];
HIL_LAYOUT_TYPES(HIL_LAYOUT_DECLARE)

#ifdef __cplusplus
}
#endif

#endif
