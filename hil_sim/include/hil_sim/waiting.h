/* SPDX-License-Identifier: MIT */
/**
 * @file waiting.h
 * Selects busy polling or blocking waits for the two ends of a lockstep link, from round-trip times measured at run
 * time.
 *
 * Polling avoids the wake-up latency of a sleeping process (omni_link/poll_backoff.h). It is faster while each end has
 * a processor of its own, and may be slower when other programs compete for one. The load changes during a run.
 *
 * So the world's end compares both. It measures the wall time of whole round trips, from one tick's sensors to the
 * next tick's. At intervals both ends switch to the alternative for a short trial. If the alternative is faster in two
 * consecutive trials, it is kept. Polling must save a sixteenth of the time, since it occupies one more processor. The
 * decision is sent in OMNI_HIL_SENSORS. Only one end decides, since each end's round trips depend on both. A firmware
 * process follows the decision; a board ignores it.
 *
 * Nothing here reads a clock. The wait mode changes nothing in the exchanged data except that one field.
 */
#ifndef HIL_SIM_WAITING_H
#define HIL_SIM_WAITING_H

#include <stdbool.h>
#include <stdint.h>

#include "omni_link/poll_backoff.h"

#ifdef __cplusplus
extern "C" {
#endif

enum {
    HIL_WAITING_FIRST_us = 250000,    /**< from the start, or a change, to the next trial */
    HIL_WAITING_LONGEST_us = 4000000, /**< most between trials; each one that changes nothing doubles the time */
    HIL_WAITING_AGAIN_us = 100000,    /**< from a trial that was faster to the one that must confirm it */
    HIL_WAITING_MEASURED_us = 64000,  /**< of the usual way, right before a trial */
    HIL_WAITING_SETTLE_us = 8000,     /**< not measured after each change: the system moves processes meanwhile */
    HIL_WAITING_SLEEP_us = 16000,     /**< length of a trial of sleeping, whose turns are much alike */
    HIL_WAITING_LOOK_us = 48000,      /**< of looking: other programs take a processor for milliseconds at a time */
    HIL_WAITING_TURNS = 16,           /**< fewest turns of either way that are compared; a trial goes on until ... */
    HIL_WAITING_EXTRA_us = 500000,    /**< ... there are as many, but so much longer at most */
    HIL_WAITING_TURN_us = 10000,      /**< a longer turn counts as one of this length: it had another reason, too */
    HIL_WAITING_INTERRUPTED_us = 1000000, /**< after so long a turn everything is another time's: it begins anew */
    HIL_WAITING_GAIN = 16                 /**< looking must save this part of the time: a sixteenth */
};

/** Wall time of turns. */
typedef struct hil_waiting_sum_t {
    int64_t us;
    uint32_t turns;
} hil_waiting_sum_t;

/** State of the selection at the simulator's end. */
typedef struct hil_waiting_t {
    bool may_change;         /**< false: fixed mode, no trials */
    bool prefers_looking;    /**< the usual mode is polling */
    bool tries;              /**< a trial of the other mode is running */
    bool was_faster;         /**< the last trial was faster; needs confirmation by a second one */
    int64_t between_us;      /**< length of the usual way until the next trial */
    int64_t since_us;        /**< begin of this trial, or of the usual way after the trial before; -1: no turn yet */
    int64_t turn_us;         /**< begin of this turn */
    hil_waiting_sum_t usual; /**< latest turns of the usual way */
    hil_waiting_sum_t tried; /**< turns of the trial */
    uint32_t trials;         /**< all so far */
    uint32_t changes;        /**< how often the usual way changed */
    omni_poll_backoff_t poll_backoff; /**< waiting strategy of this end */
} hil_waiting_t;

/** Reset. @param looks poll; false, or with one processor: always sleep. */
void hil_waiting_init(hil_waiting_t *waiting, bool looks);

/** Start a turn: call it once per tick before the sensors are sent. @param now_us a monotonic clock. */
void hil_waiting_turn(hil_waiting_t *waiting, int64_t now_us);

/** Should both ends poll in this turn? */
bool hil_waiting_looks(const hil_waiting_t *waiting);

#ifdef __cplusplus
}
#endif

#endif
