/* SPDX-License-Identifier: MIT */
#include "hil_sim/player.h"

#include <string.h>

#include "omni/loop.h"

static const uint64_t NEVER = UINT64_MAX;

static void fail(hil_player_t *p, hil_run_status_t status, int32_t detail) {
    p->status = status;
    p->detail = detail;
}

void hil_player_init(hil_player_t *player, const hil_scenario_t *scenario, uint64_t seed, hil_run_t *run,
                     hil_moment_t *moments, hil_path_t *path) {
    memset(player, 0, sizeof *player);
    player->scenario = scenario;
    player->run = run;
    player->path = path;
    memcpy(player->values, scenario->values, sizeof player->values);
    hil_timeline_init(&player->timeline, scenario->events, scenario->event_count, scenario->end_tick, moments);
    hil_world_config_t world = *scenario->world;
    world.seed = seed;
    hil_apply_dispersion(&world, scenario->dispersion, scenario->dispersion_count, seed);
    if (hil_run_init(run, &world, scenario->robot, player->why, HIL_WHY_SIZE) != HIL_OK) {
        fail(player, HIL_RUN_WORLD, 0);
    }
}

/* The robot is told where it was meant to stand. */
static void place(hil_player_t *p) {
    const double *pose = p->scenario->world->start_pose;
    p->run->inputs.pose = (omni_pose_t){(omni_real_t)pose[0], (omni_real_t)pose[1], (omni_real_t)pose[2]};
    p->run->inputs.events |= OMNI_EVENT_SET_POSE;
}

static void set(hil_player_t *p, const hil_event_t *event) {
    const hil_setting_t *settings = p->scenario->settings + event->first_setting;
    for (uint32_t i = 0; i < event->setting_count; i++) {
        p->values[settings[i].parameter] = settings[i].value;
    }
    omni_robot_config_t config;
    int32_t bad_index = -1;
    if (omni_robot_config(&config, p->values, &bad_index) != OMNI_OK) {
        fail(p, HIL_RUN_PARAMETERS, bad_index);
        return;
    }
    config.sequence = ++p->sequence;
    hil_run_set_config(p->run, &config);
}

static void arm(hil_player_t *p) {
    const uint32_t faults = omni_robot_arming_faults(&p->run->robot);
    if (faults != 0) {
        fail(p, HIL_RUN_ARMING, (int32_t)faults);
    }
    p->run->inputs.events |= OMNI_EVENT_ARM;
}

static void apply(hil_player_t *p, const hil_event_t *event) {
    omni_inputs_t *inputs = &p->run->inputs;
    switch (event->action) {
    case HIL_ACTION_SET:
        set(p, event);
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
        arm(p);
        break;
    case HIL_ACTION_DISARM:
        inputs->events |= OMNI_EVENT_DISARM;
        break;
    case HIL_ACTION_ESTOP:
        inputs->events |= OMNI_EVENT_ESTOP;
        break;
    case HIL_ACTION_TRAJECTORY_START:
        if (hil_run_start_trajectory(p->run) != OMNI_OK) {
            fail(p, HIL_RUN_TRAJECTORY, 0);
        }
        break;
    default: /* HIL_ACTION_TRAJECTORY_STOP */
        omni_stop_trajectory(inputs);
        break;
    }
}

static void locate(hil_player_t *p, const hil_event_t *event) {
    const uint64_t ticks = hil_path_ticks(p->path, hil_run_config(p->run), event->share);
    if (ticks == NEVER) {
        fail(p, HIL_RUN_ENDLESS, 0);
        return;
    }
    hil_timeline_set_offset(&p->timeline, ticks);
}

uint64_t hil_player_due(hil_player_t *player) {
    while (player->status == HIL_RUN_OK) {
        const hil_step_t step = hil_timeline_next(&player->timeline, player->run->ticks);
        switch (step.kind) {
        case HIL_STEP_RUN:
            return step.ticks;
        case HIL_STEP_PLACE:
            place(player);
            break;
        case HIL_STEP_APPLY:
            apply(player, &player->scenario->events[step.event]);
            break;
        case HIL_STEP_LOCATE:
            locate(player, &player->scenario->events[step.event]);
            break;
        case HIL_STEP_DISARM:
            player->run->inputs.events |= OMNI_EVENT_DISARM;
            break;
        default: /* HIL_STEP_OVER */
            return 0;
        }
    }
    return 0;
}

void hil_player_update(hil_player_t *player) {
    hil_timeline_update(&player->timeline, &player->run->metrics.milestones);
}

bool hil_player_play(hil_player_t *player, uint64_t ticks) {
    const uint64_t enough = player->run->ticks + ticks;
    while (player->run->ticks < enough) {
        const uint64_t due = hil_player_due(player);
        if (due == 0) {
            return false;
        }
        hil_run_advance(player->run, due);
        hil_player_update(player);
    }
    return true;
}

uint64_t hil_player_expected_end(const hil_player_t *player) {
    const bool matters = player->timeline.end_tick == NEVER && player->timeline.path_start != NEVER;
    const uint64_t path = matters ? hil_path_ticks(player->path, hil_run_config(player->run), 1.0) : NEVER;
    return hil_timeline_expected_end(&player->timeline, path);
}
