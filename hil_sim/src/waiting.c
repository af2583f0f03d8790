/* SPDX-License-Identifier: MIT */
#include "hil_sim/waiting.h"

#include <string.h>

void hil_waiting_init(hil_waiting_t *waiting, bool looks) {
    memset(waiting, 0, sizeof *waiting);
    omni_poll_backoff_init(&waiting->poll_backoff, looks);
    waiting->may_change = waiting->poll_backoff.enabled;
    waiting->prefers_looking = waiting->poll_backoff.enabled;
    waiting->between_us = HIL_WAITING_FIRST_us;
    waiting->since_us = -1;
}

bool hil_waiting_looks(const hil_waiting_t *waiting) {
    return waiting->prefers_looking != waiting->tries;
}

static bool has_enough(const hil_waiting_sum_t *sum) {
    return sum->turns >= HIL_WAITING_TURNS;
}

static bool other_is_faster(const hil_waiting_t *waiting) {
    const double usual_us = (double)waiting->usual.us / (double)waiting->usual.turns;
    const double tried_us = (double)waiting->tried.us / (double)waiting->tried.turns;
    const double looking_us = waiting->prefers_looking ? usual_us : tried_us;
    const double asleep_us = waiting->prefers_looking ? tried_us : usual_us;
    const bool looking_pays = looking_us * HIL_WAITING_GAIN <= asleep_us * (HIL_WAITING_GAIN - 1);
    return looking_pays != waiting->prefers_looking;
}

static void judge(hil_waiting_t *waiting) {
    const bool comparable = has_enough(&waiting->usual) && has_enough(&waiting->tried);
    const bool faster = comparable && other_is_faster(waiting);
    const bool changes = faster && waiting->was_faster;
    if (changes) {
        waiting->prefers_looking = !waiting->prefers_looking;
        waiting->changes++;
        waiting->between_us = HIL_WAITING_FIRST_us;
    } else if (!faster && !waiting->was_faster) {
        const int64_t twice_us = 2 * waiting->between_us;
        waiting->between_us = twice_us < HIL_WAITING_LONGEST_us ? twice_us : HIL_WAITING_LONGEST_us;
    }
    waiting->was_faster = faster && !changes;
}

/* What was learned of looking before belongs to another time. */
static void begin(hil_waiting_t *waiting, bool tries, int64_t now_us) {
    waiting->tries = tries;
    waiting->since_us = now_us;
    memset(tries ? &waiting->tried : &waiting->usual, 0, sizeof waiting->usual);
    waiting->poll_backoff.enabled = hil_waiting_looks(waiting);
    waiting->poll_backoff.failures = 0;
    waiting->poll_backoff.successes = 0;
    waiting->poll_backoff.sleeps_left = 0;
}

static int64_t length_us(const hil_waiting_t *waiting) {
    if (waiting->tries) {
        return waiting->prefers_looking ? HIL_WAITING_SLEEP_us : HIL_WAITING_LOOK_us;
    }
    return waiting->was_faster ? HIL_WAITING_AGAIN_us : waiting->between_us;
}

static int64_t measured_from_us(const hil_waiting_t *waiting) {
    return waiting->tries ? HIL_WAITING_SETTLE_us : length_us(waiting) - HIL_WAITING_MEASURED_us;
}

/* Slow turns, and those of which a part does not count, get more time until there are enough of them. */
static bool is_over(const hil_waiting_t *waiting, const hil_waiting_sum_t *sum, int64_t passed_us) {
    const int64_t length = length_us(waiting);
    const bool enough = has_enough(sum) && sum->us >= length - measured_from_us(waiting);
    return passed_us >= (enough ? length : length + HIL_WAITING_EXTRA_us);
}

static void count_turn(const hil_waiting_t *waiting, hil_waiting_sum_t *sum, int64_t turn_us) {
    if (waiting->turn_us - waiting->since_us >= measured_from_us(waiting)) {
        sum->us += turn_us < HIL_WAITING_TURN_us ? turn_us : HIL_WAITING_TURN_us;
        sum->turns++;
    }
}

void hil_waiting_turn(hil_waiting_t *waiting, int64_t now_us) {
    if (!waiting->may_change) {
        return;
    }
    const int64_t turn_us = now_us - waiting->turn_us;
    if (waiting->since_us < 0 || turn_us >= HIL_WAITING_INTERRUPTED_us) {
        waiting->turn_us = now_us;
        waiting->was_faster = false;
        begin(waiting, false, now_us);
        return;
    }
    hil_waiting_sum_t *sum = waiting->tries ? &waiting->tried : &waiting->usual;
    count_turn(waiting, sum, turn_us);
    waiting->turn_us = now_us;
    if (!is_over(waiting, sum, now_us - waiting->since_us)) {
        return;
    }
    if (waiting->tries) {
        waiting->trials++;
        judge(waiting);
    }
    begin(waiting, !waiting->tries, now_us);
}
