/* SPDX-License-Identifier: MIT */
/**
 * @file numbers.h
 * The single bits of the core's numbers, in C. For sources that are compiled for one run and for eight runs at once.
 * The folder hil_sim/lanes has its own for eight.
 */
#ifndef HIL_SIM_NUMBERS_H
#define HIL_SIM_NUMBERS_H

#include <string.h>

#include "omni/types.h"

#ifndef OMNI_OWN_NUMBERS
/** The bits of a number. */
static inline omni_uint_t hil_bits(omni_real_t value) {
    omni_uint_t bits;
    memcpy(&bits, &value, sizeof bits);
    return bits;
}

/** The number of some bits. */
static inline omni_real_t hil_of_bits(omni_uint_t bits) {
    omni_real_t value;
    memcpy(&value, &bits, sizeof value);
    return value;
}

/** factor * a: both words of it. */
static inline void hil_product(uint32_t factor, omni_uint_t a, omni_uint_t *high, omni_uint_t *low) {
    const uint64_t product = (uint64_t)factor * a;
    *high = (omni_uint_t)(product >> 32);
    *low = (omni_uint_t)product;
}
#endif

#endif
