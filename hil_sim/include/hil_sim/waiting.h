/* SPDX-License-Identifier: MIT */
/**
 * @file waiting.h
 * Whether the two ends of a lockstep link look for each other's bytes or sleep until they come, measured while it runs.
 *
 * Looking saves the time in which a sleeping process wakes up (omni_link/patience.h). It is faster while each end has a
 * processor for itself, and may be slower where another program needs one, too. That changes while a run goes on.
 *
 * So the world's end compares. It takes the wall time of whole turns, from one tick's sensors to the next one's. Now
 * and then both ends wait in the other way for a moment. If that is faster twice in a row, they go on in it. Looking
 * must save a sixteenth of the time, since it uses up a processor more. The robot's end is told by OMNI_HIL_SENSORS.
 * Only one end decides, since each one's turns depend on both. A firmware process obeys. A board has nothing to choose.
 *
 * Nothing here reads a clock. How the ends wait never changes what they exchange, but for that one field.
 */
#ifndef HIL_SIM_WAITING_H
#define HIL_SIM_WAITING_H

#include <stdbool.h>
#include <stdint.h>

#include "omni_link/patience.h"

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

/** What the world's end of a link knows of both ways. */
typedef struct hil_waiting_t {
    bool may_change;          /**< false: always as it began, nothing is tried */
    bool prefers_looking;     /**< the usual way */
    bool tries;               /**< the other way is being tried */
    bool was_faster;          /**< the trial before found the other way faster; it needs a second one */
    int64_t between_us;       /**< length of the usual way until the next trial */
    int64_t since_us;         /**< begin of this trial, or of the usual way after the trial before; -1: no turn yet */
    int64_t turn_us;          /**< begin of this turn */
    hil_waiting_sum_t usual;  /**< latest turns of the usual way */
    hil_waiting_sum_t tried;  /**< turns of the trial */
    uint32_t trials;          /**< all so far */
    uint32_t changes;         /**< how often the usual way changed */
    omni_patience_t patience; /**< how this end waits */
} hil_waiting_t;

/** Start anew: looking, or asleep for good if it is not to look or there is one processor only. */
void hil_waiting_init(hil_waiting_t *waiting, bool looks);

/** A turn begins: call it once per tick before the sensors are sent. @param now_us a monotonic clock. */
void hil_waiting_turn(hil_waiting_t *waiting, int64_t now_us);

/** Whether both ends are to look in this turn. */
bool hil_waiting_looks(const hil_waiting_t *waiting);

#ifdef __cplusplus
}
#endif

#endif
