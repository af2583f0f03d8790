/* SPDX-License-Identifier: MIT */
/**
 * @file poll_backoff.h
 * Waiting strategy of one end of a lockstep link: busy-poll for a short time, or sleep, with exponential back-off.
 *
 * Why: waking a sleeping process on another processor takes ten to a hundred times as long as a control tick, while in
 * lockstep the answer arrives within microseconds. Polling costs processor time and helps only while the other end runs
 * at the same time. So after a poll without success the following waits sleep at once, in exponentially growing number,
 * as long as waits are long. An idle link, or one paced in real time, is therefore not polled.
 *
 * The strategy never changes the data exchanged.
 */
#ifndef OMNI_LINK_POLL_BACKOFF_H
#define OMNI_LINK_POLL_BACKOFF_H

#include <stdbool.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

enum {
    OMNI_POLL_MAX_us =
        200, /**< longest poll; more than the wake-up time, or two sleeping ends would never get to poll */
    OMNI_POLL_SHORT_WAIT_us = 500, /**< a longer wait is not due to the other end's tick */
    OMNI_POLL_MAX_SLEEPS = 254     /**< most waits asleep between two polls without success */
};

/** State of one end. Initialise with omni_poll_backoff_init, or with zero and `enabled`. */
typedef struct omni_poll_backoff_t {
    bool enabled;          /**< false: always sleep */
    uint8_t failures;      /**< polls without success; reduced by successes */
    uint8_t successes;     /**< since `failures` was last changed */
    uint16_t sleeps_left;  /**< waits to sleep until the next poll */
    uint64_t polled;       /**< number of waits that ended while polling */
    uint64_t failed_polls; /**< number of polls after which it had to sleep */
    uint64_t slept;        /**< number of waits without a poll */
} omni_poll_backoff_t;

/** Reset. @param enabled poll; ignored with one processor, on which the other end could not run meanwhile. */
void omni_poll_backoff_init(omni_poll_backoff_t *backoff, bool enabled);

/** Should the wait that starts now begin with a poll? */
bool omni_poll_backoff_should_poll(const omni_poll_backoff_t *backoff);

/** Record a wait. @param polled result of omni_poll_backoff_should_poll(). @param waited_us wall time until data. */
void omni_poll_backoff_record(omni_poll_backoff_t *backoff, bool polled, uint64_t waited_us);

/** Number of processors that this thread may run on, at least 1. */
uint32_t omni_poll_processors(void);

/** Pause between two polls: a fraction of a microsecond that yields the core to its other hardware thread. */
void omni_poll_pause(void);

#ifdef __cplusplus
}
#endif

#endif
