/* SPDX-License-Identifier: MIT */
#ifdef __linux__
#include <sched.h>
#endif
#include "omni_link/poll_backoff.h"

#include <string.h>
#ifndef _WIN32
#include <unistd.h>
#endif

enum {
    MOST_FAILURES = 8,          /* 2^8 - 2 is OMNI_POLL_MAX_SLEEPS */
    SUCCESSES_PER_FAILURE = 16, /* successes that cancel a failure */
    PAUSES = 8
};

void omni_poll_backoff_init(omni_poll_backoff_t *backoff, bool enabled) {
    memset(backoff, 0, sizeof *backoff);
    backoff->enabled = enabled && omni_poll_processors() > 1;
}

bool omni_poll_backoff_should_poll(const omni_poll_backoff_t *backoff) {
    return backoff->enabled && backoff->sleeps_left == 0;
}

static void record_success(omni_poll_backoff_t *backoff) {
    backoff->polled++;
    if (backoff->failures > 0 && ++backoff->successes == SUCCESSES_PER_FAILURE) {
        backoff->successes = 0;
        backoff->failures--;
    }
}

static void record_failure(omni_poll_backoff_t *backoff) {
    backoff->failed_polls++;
    backoff->successes = 0;
    backoff->failures = (uint8_t)(backoff->failures + (backoff->failures < MOST_FAILURES));
    backoff->sleeps_left = (uint16_t)((1u << backoff->failures) - 2);
}

void omni_poll_backoff_record(omni_poll_backoff_t *backoff, bool polled, uint64_t waited_us) {
    if (!polled) {
        backoff->slept++;
        if (backoff->sleeps_left > 0 && waited_us < OMNI_POLL_SHORT_WAIT_us) {
            backoff->sleeps_left--;
        }
    } else if (waited_us <= OMNI_POLL_MAX_us) {
        record_success(backoff);
    } else {
        record_failure(backoff);
    }
}

uint32_t omni_poll_processors(void) {
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

void omni_poll_pause(void) {
    for (int i = 0; i < PAUSES; i++) {
#if defined(__x86_64__) || defined(__i386__)
        __builtin_ia32_pause();
#elif defined(__aarch64__)
        __asm__ volatile("yield");
#endif
    }
}
