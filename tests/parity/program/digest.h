/* SPDX-License-Identifier: MIT */
/** @file digest.h  Every field of omni_outputs_t by name: for a hash over its bits, a dump of its bits, and the promise
 * of finite numbers. */
#ifndef PARITY_DIGEST_H
#define PARITY_DIGEST_H

#include "omni/robot.h"

/** False if omni_outputs_t has a field that the table of fields does not know. */
bool digest_is_complete(void);

/** Mix 32 bits into a hash. */
uint64_t digest_word(uint64_t hash, uint32_t word);

/** Mix the bits of `count` numbers into a hash. */
uint64_t digest_reals(uint64_t hash, const omni_real_t *values, size_t count);

/** Mix all fields into a hash. */
uint64_t digest_outputs(uint64_t hash, const omni_outputs_t *outputs);

/** Name of the first field that holds a NaN or an infinity, or NULL. */
const char *digest_not_finite(const omni_outputs_t *outputs);

/** Print "tick field hex hex ...", a line per field. */
void digest_print(uint32_t tick, const omni_outputs_t *outputs);

#endif
