/* SPDX-License-Identifier: MIT */
/**
 * @file patience.h
 * How an end of a lockstep link waits for the other one: by looking again and again for a short while, then asleep.
 *
 * Waking a sleeping process on another processor takes ten to a hundred times as long as a control tick. In lockstep
 * the answer comes within microseconds, so it is looked for before going to sleep. That costs a processor's time, which
 * others may need, and helps only while the other end runs at the same time. Whoever waits in vain sleeps at once for
 * more and more of the following waits. It goes on doing so while they are long. A link that is idle or paced in real
 * time is therefore never looked at.
 *
 * Which of the two ways is taken never changes what is exchanged.
 */
#ifndef OMNI_LINK_PATIENCE_H
#define OMNI_LINK_PATIENCE_H

#include <stdbool.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

enum {
    OMNI_PATIENCE_LOOK_us =
        200, /**< longest look; more than waking the other end takes, or two sleepers would never meet awake */
    OMNI_PATIENCE_NEAR_us = 500, /**< a longer wait has another reason than the other end's tick */
    OMNI_PATIENCE_SLEEPS = 254   /**< most waits asleep between two looks in vain */
};

/** One end's experience. Zero with `looks` set is a good start. */
typedef struct omni_patience_t {
    bool looks;        /**< false: always asleep */
    uint8_t failures;  /**< looks in vain; they wear off with success */
    uint8_t successes; /**< since a failure last wore off */
    uint16_t sleeps;   /**< waits still to be slept through */
    uint64_t looked;   /**< waits that ended while looking */
    uint64_t in_vain;  /**< looks after which it had to sleep all the same */
    uint64_t slept;    /**< waits without a look */
} omni_patience_t;

/** Start anew. Looking is for two processors: with one, the other end could not run meanwhile. */
void omni_patience_init(omni_patience_t *patience, bool looks);

/** Whether to look during the wait that begins now. */
bool omni_patience_looks(const omni_patience_t *patience);

/** Learn from a wait. @param looked what omni_patience_looks() said. @param waited_us wall time until bytes came. */
void omni_patience_learn(omni_patience_t *patience, bool looked, uint64_t waited_us);

/** Processors that this thread may run on, at least 1. */
uint32_t omni_patience_processors(void);

/** What stands between two looks: a fraction of a microsecond that leaves the processor's other thread its share. */
void omni_patience_pause(void);

#ifdef __cplusplus
}
#endif

#endif
