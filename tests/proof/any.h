/* SPDX-License-Identifier: MIT */
/** @file any.h  Values that may be anything, for the drivers that Frama-C Eva runs. */
#ifndef OMNI_PROOF_ANY_H
#define OMNI_PROOF_ANY_H

#include "__fc_builtin.h"
#include "omni/omni.h"

/** Every bit pattern: numbers of any size, infinities, NaN. A bool inside must be given any_bool() afterwards. */
#define ANYTHING(object) Frama_C_make_unknown((char *)&(object), sizeof(object))

static inline bool any_bool(void) {
    return Frama_C_interval(0, 1) == 1;
}

static inline omni_real_t any_real(void) {
    omni_real_t value;
    ANYTHING(value);
    return value;
}

#endif
