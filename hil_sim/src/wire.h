/* SPDX-License-Identifier: MIT */
/** @file wire.h  Bytes over a POSIX descriptor with deadlines, and the wall clock. */
#ifndef HIL_SIM_WIRE_H
#define HIL_SIM_WIRE_H

#include "hil_sim/world.h"
#include "omni_link/poll_backoff.h"

/** Monotonic wall time [us]. */
int64_t hil_wire_now_us(void);

/** Sleep until that wall time; at once if it has passed. */
void hil_wire_sleep_until(int64_t wall_us);

/** Write all bytes. @return HIL_OK, HIL_ERR_LINK or HIL_ERR_TIMEOUT. */
hil_result_t hil_wire_write(int32_t fd, const uint8_t *data, uint32_t length, int64_t deadline_us);

/**
 * Wait for bytes and read what there is.
 * @param poll_backoff how to wait; it learns from it. NULL: asleep. @param got out, at least 1 if HIL_OK.
 */
hil_result_t hil_wire_read(int32_t fd, omni_poll_backoff_t *poll_backoff, uint8_t *data, uint32_t capacity,
                           int64_t deadline_us, uint32_t *got);

#endif
