/* SPDX-License-Identifier: MIT */
#include "hil_sim/timeline.h"

#include <math.h>
#include <string.h>

static const uint64_t NEVER = UINT64_MAX;

/* Behind the moments that are due no later. */
static void insert(hil_timeline_t *t, uint32_t event, uint64_t due_tick) {
    uint32_t at = t->known++;
    for (; at > t->applied && t->moments[at - 1].due_tick > due_tick; at--) {
        t->moments[at] = t->moments[at - 1];
    }
    t->moments[at] = (hil_moment_t){.event = event, .due_tick = due_tick};
}

static void insert_timed(hil_timeline_t *t) {
    const hil_scenario_t *s = t->scenario;
    for (uint32_t i = 0; i < s->event_count; i++) {
        if (!s->events[i].on_path) {
            insert(t, i, s->events[i].tick);
        }
    }
    t->start_limit = HIL_START_TICKS + (t->known > 0 ? t->moments[t->known - 1].due_tick : 0);
}

static void fail(hil_timeline_t *t, hil_run_status_t status, int32_t detail) {
    t->status = status;
    t->detail = detail;
    t->stage = HIL_STAGE_OVER;
}

void hil_timeline_init(hil_timeline_t *timeline, const hil_scenario_t *scenario, uint64_t seed, hil_run_t *run,
                       hil_moment_t *moments, hil_path_t *path) {
    memset(timeline, 0, sizeof *timeline);
    timeline->scenario = scenario;
    timeline->run = run;
    timeline->moments = moments;
    timeline->path = path;
    timeline->path_start = NEVER;
    timeline->done = NEVER;
    timeline->stopped = NEVER;
    memcpy(timeline->values, scenario->values, sizeof timeline->values);
    insert_timed(timeline);
    hil_world_config_t world = *scenario->world;
    world.seed = seed;
    hil_disperse(&world, scenario->dispersion, scenario->dispersion_count, seed);
    if (hil_run_init(run, &world, scenario->robot, timeline->why, HIL_WHY_SIZE) != HIL_OK) {
        fail(timeline, HIL_RUN_WORLD, 0);
    }
}

/* The robot is told where it was meant to stand. */
static void place(hil_timeline_t *t) {
    const double *pose = t->scenario->world->start_pose;
    t->run->inputs.pose = (omni_pose_t){(omni_real_t)pose[0], (omni_real_t)pose[1], (omni_real_t)pose[2]};
    t->run->inputs.events |= OMNI_EVENT_SET_POSE;
}

static void set(hil_timeline_t *t, const hil_event_t *event) {
    const hil_setting_t *settings = t->scenario->settings + event->first_setting;
    for (uint32_t i = 0; i < event->setting_count; i++) {
        t->values[settings[i].parameter] = settings[i].value;
    }
    omni_robot_config_t config;
    int32_t bad_index = -1;
    if (omni_robot_config(&config, t->values, &bad_index) != OMNI_OK) {
        fail(t, HIL_RUN_PARAMETERS, bad_index);
        return;
    }
    config.sequence = ++t->sequence;
    hil_run_set_config(t->run, &config);
}

static void arm(hil_timeline_t *t) {
    const uint32_t faults = omni_robot_arming_faults(&t->run->robot, &t->run->outputs);
    if (faults != 0) {
        fail(t, HIL_RUN_ARMING, (int32_t)faults);
    }
    t->run->inputs.events |= OMNI_EVENT_ARM;
}

static void apply(hil_timeline_t *t, const hil_event_t *event) {
    omni_inputs_t *inputs = &t->run->inputs;
    switch (event->action) {
    case HIL_ACTION_SET:
        set(t, event);
        break;
    case HIL_ACTION_VELOCITY:
        inputs->setpoint.kind = OMNI_SETPOINT_VELOCITY_BODY;
        inputs->setpoint.twist = (omni_twist_t){event->value[0], event->value[1], event->value[2]};
        break;
    case HIL_ACTION_DUTY:
        inputs->setpoint.kind = OMNI_SETPOINT_DUTY;
        memcpy(inputs->setpoint.duty, event->value, sizeof inputs->setpoint.duty);
        break;
    case HIL_ACTION_ARM:
        arm(t);
        break;
    case HIL_ACTION_DISARM:
        inputs->events |= OMNI_EVENT_DISARM;
        break;
    case HIL_ACTION_ESTOP:
        inputs->events |= OMNI_EVENT_ESTOP;
        break;
    case HIL_ACTION_TRAJECTORY_START:
        if (hil_run_start_trajectory(t->run) != OMNI_OK) {
            fail(t, HIL_RUN_TRAJECTORY, 0);
        }
        break;
    default: /* HIL_ACTION_TRAJECTORY_STOP */
        inputs->setpoint.kind = OMNI_SETPOINT_NONE;
        inputs->events |= OMNI_EVENT_TRAJECTORY_STOP;
        break;
    }
}

static void apply_due(hil_timeline_t *t) {
    while (t->applied < t->known && t->moments[t->applied].due_tick <= t->run->ticks && t->stage != HIL_STAGE_OVER) {
        hil_moment_t *moment = &t->moments[t->applied];
        apply(t, &t->scenario->events[moment->event]);
        moment->applied_tick = t->run->ticks;
        t->applied++;
    }
}

static uint64_t earlier(uint64_t a, uint64_t b) {
    return a < b ? a : b;
}

/* As far as is known now. */
static uint64_t end_of(const hil_timeline_t *t) {
    if (t->scenario->end_tick != NEVER) {
        return t->scenario->end_tick;
    }
    uint64_t end = HIL_MAX_TICKS;
    end = t->done == NEVER ? end : earlier(end, t->done + HIL_AFTER_TICKS);
    end = t->stopped == NEVER ? end : earlier(end, t->stopped + HIL_AFTER_TICKS);
    return t->was_armed ? end : earlier(end, t->start_limit);
}

static uint64_t next_stop(const hil_timeline_t *t) {
    const uint64_t look = (t->run->ticks / HIL_LOOK_TICKS + 1) * HIL_LOOK_TICKS;
    const uint64_t stop = earlier(look, end_of(t));
    return t->applied < t->known ? earlier(stop, t->moments[t->applied].due_tick) : stop;
}

uint64_t hil_timeline_due(hil_timeline_t *timeline) {
    const uint64_t now = timeline->run->ticks;
    if (timeline->stage == HIL_STAGE_PLACE) {
        return 1;
    }
    if (timeline->stage == HIL_STAGE_PLAY && now < end_of(timeline)) {
        apply_due(timeline);
        const uint64_t stop = next_stop(timeline);
        return timeline->stage == HIL_STAGE_OVER ? 0 : stop > now ? stop - now : 1;
    }
    if (timeline->stage == HIL_STAGE_PLAY) {
        timeline->stage = HIL_STAGE_DISARMED;
        timeline->run->inputs.events |= OMNI_EVENT_DISARM;
        return HIL_DISARMED_TICKS;
    }
    timeline->stage = HIL_STAGE_OVER;
    return 0;
}

static uint64_t tick_of(uint64_t time_us) {
    return time_us == NEVER ? NEVER : (uint64_t)rint(1e-6 * (double)time_us * 1000.0);
}

/* Shares of the path become ticks once the path's start is known. */
static void resolve(hil_timeline_t *t) {
    const hil_scenario_t *s = t->scenario;
    t->path_resolved = true;
    for (uint32_t i = 0; i < s->event_count; i++) {
        if (s->events[i].on_path) {
            const uint64_t ticks = hil_path_ticks(t->path, hil_run_config(t->run), s->events[i].share);
            if (ticks == NEVER) {
                fail(t, HIL_RUN_ENDLESS, 0);
                return;
            }
            insert(t, i, t->path_start + ticks);
        }
    }
}

void hil_timeline_look(hil_timeline_t *timeline) {
    if (timeline->stage == HIL_STAGE_PLACE) {
        place(timeline);
        timeline->stage = HIL_STAGE_PLAY;
        return;
    }
    if (timeline->stage != HIL_STAGE_PLAY) {
        return;
    }
    const hil_metrics_t *seen = &timeline->run->metrics;
    timeline->path_start = tick_of(seen->path_start_us);
    timeline->done = tick_of(seen->done_us);
    timeline->stopped = tick_of(seen->stopped_us);
    timeline->was_armed = seen->was_armed;
    if (timeline->path_start != NEVER && !timeline->path_resolved) {
        resolve(timeline);
    }
}

bool hil_timeline_play(hil_timeline_t *timeline, uint64_t ticks) {
    const uint64_t enough = timeline->run->ticks + ticks;
    while (timeline->run->ticks < enough) {
        const uint64_t due = hil_timeline_due(timeline);
        if (due == 0) {
            return false;
        }
        hil_run_advance(timeline->run, due);
        hil_timeline_look(timeline);
    }
    return true;
}

uint64_t hil_timeline_expected_end(const hil_timeline_t *timeline) {
    if (timeline->scenario->end_tick != NEVER) {
        return timeline->scenario->end_tick + HIL_DISARMED_TICKS;
    }
    if (timeline->path_start == NEVER) {
        return NEVER;
    }
    const uint64_t ticks = hil_path_ticks(timeline->path, hil_run_config(timeline->run), 1.0);
    return ticks == NEVER ? NEVER : timeline->path_start + ticks + HIL_AFTER_TICKS + HIL_DISARMED_TICKS;
}
