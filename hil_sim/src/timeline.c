/* SPDX-License-Identifier: MIT */
#include "hil_sim/timeline.h"

#include <math.h>
#include <string.h>

typedef enum stage_t { STAGE_FIRST_TICK = 0, STAGE_PLACE, STAGE_PLAY, STAGE_DISARMED, STAGE_OVER } stage_t;

static const uint64_t NEVER = UINT64_MAX;

/* Behind the moments that are due no later. */
static void insert(hil_timeline_t *t, uint32_t event, uint64_t due_tick) {
    uint32_t at = t->known++;
    for (; at > t->applied && t->moments[at - 1].due_tick > due_tick; at--) {
        t->moments[at] = t->moments[at - 1];
    }
    t->moments[at] = (hil_moment_t){.event = event, .due_tick = due_tick};
}

void hil_timeline_init(hil_timeline_t *timeline, const hil_event_t *events, uint32_t event_count, uint64_t end_tick,
                       hil_moment_t *moments) {
    memset(timeline, 0, sizeof *timeline);
    timeline->events = events;
    timeline->event_count = event_count;
    timeline->end_tick = end_tick;
    timeline->moments = moments;
    timeline->path_start = NEVER;
    timeline->done = NEVER;
    timeline->stopped = NEVER;
    for (uint32_t i = 0; i < event_count; i++) {
        if (!events[i].on_path) {
            insert(timeline, i, events[i].tick);
        }
    }
    timeline->start_limit = HIL_START_TICKS + (timeline->known > 0 ? moments[timeline->known - 1].due_tick : 0);
}

static uint64_t earlier(uint64_t a, uint64_t b) {
    return a < b ? a : b;
}

/* As far as is known now. */
static uint64_t end_of(const hil_timeline_t *t) {
    if (t->end_tick != NEVER) {
        return t->end_tick;
    }
    uint64_t end = HIL_MAX_TICKS;
    end = t->done == NEVER ? end : earlier(end, t->done + HIL_AFTER_TICKS);
    end = t->stopped == NEVER ? end : earlier(end, t->stopped + HIL_AFTER_TICKS);
    return t->was_armed ? end : earlier(end, t->start_limit);
}

static uint64_t next_stop(const hil_timeline_t *t, uint64_t now) {
    const uint64_t look = (now / HIL_UPDATE_TICKS + 1) * HIL_UPDATE_TICKS;
    const uint64_t stop = earlier(look, end_of(t));
    return t->applied < t->known ? earlier(stop, t->moments[t->applied].due_tick) : stop;
}

static hil_step_t run(uint64_t ticks) {
    return (hil_step_t){.kind = HIL_STEP_RUN, .ticks = ticks};
}

/* Shares of the path become ticks once the path's start is known. */
static bool to_locate(hil_timeline_t *t) {
    while (t->path_start != NEVER && t->located < t->event_count && !t->events[t->located].on_path) {
        t->located++;
    }
    return t->path_start != NEVER && t->located < t->event_count;
}

static hil_step_t play(hil_timeline_t *t, uint64_t now) {
    if (to_locate(t)) {
        return (hil_step_t){.kind = HIL_STEP_LOCATE, .event = t->located};
    }
    if (!t->applying && now >= end_of(t)) {
        t->stage = STAGE_DISARMED;
        return (hil_step_t){.kind = HIL_STEP_DISARM};
    }
    t->applying = t->applied < t->known && t->moments[t->applied].due_tick <= now;
    if (t->applying) {
        return (hil_step_t){.kind = HIL_STEP_APPLY, .event = t->moments[t->applied].event};
    }
    const uint64_t stop = next_stop(t, now);
    return run(stop > now ? stop - now : 1);
}

static hil_step_t next(hil_timeline_t *t, uint64_t now) {
    switch (t->stage) {
    case STAGE_FIRST_TICK:
        t->stage = STAGE_PLACE;
        return run(1);
    case STAGE_PLACE:
        t->stage = STAGE_PLAY;
        return (hil_step_t){.kind = HIL_STEP_PLACE};
    case STAGE_PLAY:
        return play(t, now);
    case STAGE_DISARMED:
        t->stage = STAGE_OVER;
        return run(HIL_DISARMED_TICKS);
    default:
        return (hil_step_t){.kind = HIL_STEP_OVER};
    }
}

hil_step_t hil_timeline_next(hil_timeline_t *timeline, uint64_t now) {
    if (timeline->last == HIL_STEP_APPLY) {
        timeline->moments[timeline->applied++].applied_tick = now;
    }
    const hil_step_t step = next(timeline, now);
    timeline->last = (uint8_t)step.kind;
    return step;
}

void hil_timeline_set_offset(hil_timeline_t *timeline, uint64_t ticks) {
    insert(timeline, timeline->located, timeline->path_start + ticks);
    timeline->located++;
}

static uint64_t tick_of(uint64_t time_us) {
    return time_us == NEVER ? NEVER : (uint64_t)rint(1e-6 * (double)time_us * 1000.0);
}

void hil_timeline_update(hil_timeline_t *timeline, const hil_milestones_t *milestones) {
    if (timeline->stage != STAGE_PLAY) {
        return;
    }
    timeline->path_start = tick_of(milestones->path_start_us);
    timeline->done = tick_of(milestones->done_us);
    timeline->stopped = tick_of(milestones->stopped_us);
    timeline->was_armed = milestones->was_armed;
}

uint64_t hil_timeline_expected_end(const hil_timeline_t *timeline, uint64_t path_ticks) {
    if (timeline->end_tick != NEVER) {
        return timeline->end_tick + HIL_DISARMED_TICKS;
    }
    if (timeline->path_start == NEVER || path_ticks == NEVER) {
        return NEVER;
    }
    return timeline->path_start + path_ticks + HIL_AFTER_TICKS + HIL_DISARMED_TICKS;
}
