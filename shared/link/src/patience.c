/* SPDX-License-Identifier: MIT */
#ifdef __linux__
#include <sched.h>
#endif
#include "omni_link/patience.h"

#include <string.h>
#ifndef _WIN32
#include <unistd.h>
#endif

enum {
    MOST_FAILURES = 8, /* 2^8 - 2 is OMNI_PATIENCE_SLEEPS */
    WEARS_OFF = 16,    /* successes that make up for a failure */
    PAUSES = 8
};

void omni_patience_init(omni_patience_t *patience, bool looks) {
    memset(patience, 0, sizeof *patience);
    patience->looks = looks && omni_patience_processors() > 1;
}

bool omni_patience_looks(const omni_patience_t *patience) {
    return patience->looks && patience->sleeps == 0;
}

static void succeed(omni_patience_t *patience) {
    patience->looked++;
    if (patience->failures > 0 && ++patience->successes == WEARS_OFF) {
        patience->successes = 0;
        patience->failures--;
    }
}

static void fail(omni_patience_t *patience) {
    patience->in_vain++;
    patience->successes = 0;
    patience->failures = (uint8_t)(patience->failures + (patience->failures < MOST_FAILURES));
    patience->sleeps = (uint16_t)((1u << patience->failures) - 2);
}

void omni_patience_learn(omni_patience_t *patience, bool looked, uint64_t waited_us) {
    if (!looked) {
        patience->slept++;
        if (patience->sleeps > 0 && waited_us < OMNI_PATIENCE_NEAR_us) {
            patience->sleeps--;
        }
    } else if (waited_us <= OMNI_PATIENCE_LOOK_us) {
        succeed(patience);
    } else {
        fail(patience);
    }
}

uint32_t omni_patience_processors(void) {
#ifdef __linux__
    cpu_set_t allowed;
    if (sched_getaffinity(0, sizeof allowed, &allowed) == 0) {
        return (uint32_t)CPU_COUNT(&allowed);
    }
#endif
#ifdef _WIN32
    return 1; /* no lockstep there */
#else
    const long online = sysconf(_SC_NPROCESSORS_ONLN);
    return online > 1 ? (uint32_t)online : 1;
#endif
}

void omni_patience_pause(void) {
    for (int i = 0; i < PAUSES; i++) {
#if defined(__x86_64__) || defined(__i386__)
        __builtin_ia32_pause();
#elif defined(__aarch64__)
        __asm__ volatile("yield");
#endif
    }
}
