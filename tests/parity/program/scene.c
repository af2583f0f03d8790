/* SPDX-License-Identifier: MIT */
#include "scene.h"

#include <string.h>

#include "digest.h"
#include "draw.h"

enum { SHORTEST = 1000, LONGEST = 6000, LATEST_FIX = 300 };

typedef struct trouble_t {
    uint16_t longest;     /* ticks */
    uint16_t per_million; /* chance to begin, per tick of a rough episode */
} trouble_t;

static const trouble_t troubles[SCENE_TROUBLES] = {
    [SCENE_COUNT_LOST] = {6, 900},    [SCENE_COUNT_JUMP] = {2, 400},      [SCENE_TIME_JUMP] = {1, 300},
    [SCENE_TIME_BACK] = {2, 200},     [SCENE_TIME_UNEVEN] = {50, 300},    [SCENE_FIX_NAN] = {3, 500},
    [SCENE_FIX_JUMP] = {400, 300},    [SCENE_FIX_TIME] = {50, 300},       [SCENE_FIX_STOP] = {800, 200},
    [SCENE_BATTERY_SAG] = {200, 300}, [SCENE_BATTERY_NAN] = {2, 200},     [SCENE_DRIVER] = {20, 300},
    [SCENE_SETPOINT_NAN] = {2, 300},  [SCENE_SETPOINT_STOP] = {700, 600}, [SCENE_LINK_STOP] = {1200, 200},
    [SCENE_OVERRUN] = {2, 400},       [SCENE_BLOCKED] = {500, 900},       [SCENE_SLIP] = {500, 500},
    [SCENE_DISARM] = {1, 300},        [SCENE_ESTOP] = {1, 200},           [SCENE_SET_POSE] = {1, 300},
    [SCENE_PATH_STOP] = {1, 300},
};

static const omni_real_t largest = 3.402823466e38f;

static omni_real_t not_finite(random_t *random) {
    const omni_real_t infinity = largest * 2.0f;
    switch (random_below(random, 3)) {
    case 0:
        return infinity;
    case 1:
        return -infinity;
    default:
        return infinity - infinity;
    }
}

static const omni_robot_config_t *config_of(const scene_t *scene) {
    return &scene->configs[scene->config];
}

/* Offer a parameter set. @return false if the core refuses it; the old one stays in force then. */
static bool configure(scene_t *scene, const omni_real_t *values) {
    const uint8_t next = scene->config ^ 1u;
    int32_t bad = -1;
    const omni_result_t result = omni_robot_config(&scene->configs[next], values, &bad);
    scene->background = digest_word(digest_word(scene->background, (uint32_t)result), (uint32_t)bad);
    if (result != OMNI_OK) {
        ++scene->configs_refused;
        return false;
    }
    const omni_robot_config_t *c = &scene->configs[next];
    scene->background = digest_reals(scene->background, &c->kinematics.b_pinv[0][0], OMNI_AXES * OMNI_MAX_WHEELS);
    scene->background = digest_reals(scene->background, &c->motor_kf.model.a[0][0], 9);
    scene->configs[next].sequence = (uint16_t)(scene->configs[scene->config].sequence + 1);
    memmove(scene->values, values, sizeof scene->values);
    scene->config = next;
    return true;
}

static void plan(scene_t *scene) {
    omni_waypoints_t waypoints;
    omni_pose_t at = scene->outputs.pose;
    at.x = random_chance(&scene->random, 50000) ? not_finite(&scene->random) : at.x;
    const uint8_t next = scene->plan ^ 1u;
    omni_trajectory_t *p = &scene->plans[next];
    draw_waypoints(&scene->random, &waypoints);
    const omni_result_t result =
        omni_trajectory_plan(p, &config_of(scene)->trajectory, &config_of(scene)->kinematics, &waypoints, &at);
    scene->plans_refused += result != OMNI_OK ? 1u : 0u;
    const omni_real_t figures[] = {p->lead_in_s,        p->duration_s,     p->scale,
                                   p->peak_wheel_rad_s, p->peak_voltage_V, p->needed_scale};
    scene->background = digest_reals(scene->background, figures, sizeof figures / sizeof figures[0]);
    scene->plan = next;
    scene->inputs.trajectory = p;
    scene->inputs.events |= OMNI_EVENT_TRAJECTORY_START;
    scene->inputs.setpoint.kind = OMNI_SETPOINT_TRAJECTORY;
    scene->setpoint_ends = scene->tick + 400 + random_below(&scene->random, 3000);
}

static void restart(scene_t *scene) {
    random_t *random = &scene->random;
    const omni_pose_t start = {random_between(random, -1.0f, 1.0f), random_between(random, -1.0f, 1.0f),
                               random_between(random, -3.0f, 3.0f)};
    scene->now_us = ((uint64_t)random_below(random, 256) << 32) + random_u32(random);
    world_reset(&scene->world, random, &start);
    memset(&scene->inputs, 0, sizeof scene->inputs);
    memset(&scene->outputs, 0, sizeof scene->outputs);
    omni_robot_init(&scene->robot, config_of(scene));
    scene->inputs.pose = start;
    scene->inputs.events = OMNI_EVENT_SET_POSE;
}

/* The robot is carried to the start of a path, and follows it for the whole episode. */
static void begin_path(scene_t *scene) {
    plan(scene);
    omni_trajectory_t *path = &scene->plans[scene->plan];
    path->timing.lead_in_us = 0;
    scene->world.pose = path->start;
    scene->fix_offset = (omni_pose_t){0.0f, 0.0f, 0.0f};
    scene->inputs.pose = path->start;
    scene->inputs.events |= OMNI_EVENT_SET_POSE;
    scene->setpoint_ends = scene->episode_ends;
}

static void begin_episode(scene_t *scene) {
    static const draw_style_t styles[] = {DRAW_OWN, DRAW_NEAR, DRAW_NEAR, DRAW_ANYWHERE};
    random_t *random = &scene->random;
    omni_real_t values[OMNI_PARAM_COUNT];
    draw_style_t style = styles[random_below(random, 4)];
    draw_parameters(random, scene->episode, style, values);
    gyro_draw(&scene->gyro, scene->episode, values);
    flow_draw(&scene->flow, scene->episode, values);
    current_draw(&scene->current, scene->episode, values);
    while (!configure(scene, values)) {
        style = DRAW_OWN;
        draw_parameters(random, scene->episode, style, values);
        gyro_draw(&scene->gyro, scene->episode, values);
        flow_draw(&scene->flow, scene->episode, values);
        current_draw(&scene->current, scene->episode, values);
    }
    scene->episode_ends = scene->tick + SHORTEST + random_below(random, LONGEST - SHORTEST);
    scene->setpoint_ends = scene->tick;
    scene->fix_period = 3 + random_below(random, 100);
    scene->fix_age = random_below(random, random_chance(random, 500000) ? 30 : LATEST_FIX);
    scene->rough = random_chance(random, 500000);
    if (scene->episode == 0 || random_chance(random, 400000)) {
        restart(scene);
    } else {
        omni_robot_set_config(&scene->robot, config_of(scene));
    }
    if (scene->episode % 2 == 1) {
        begin_path(scene);
    }
    ++scene->episode;
}

static bool hit(scene_t *scene, scene_trouble_t trouble) {
    return scene->left[trouble] > 0;
}

static void count_troubles(scene_t *scene) {
    for (int i = 0; i < SCENE_TROUBLES; ++i) {
        if (scene->left[i] > 0) {
            --scene->left[i];
        } else if (scene->rough && random_chance(&scene->random, troubles[i].per_million)) {
            scene->left[i] = (uint16_t)(1 + random_below(&scene->random, troubles[i].longest));
        }
    }
}

static void pass_time(scene_t *scene) {
    random_t *random = &scene->random;
    scene->now_us += OMNI_TICK_US;
    if (hit(scene, SCENE_TIME_UNEVEN)) {
        scene->now_us += random_below(random, random_chance(random, 100000) ? 12000 : 400);
    }
    if (hit(scene, SCENE_TIME_JUMP)) {
        scene->now_us += random_u32(random) >> random_below(random, 20);
    }
    if (hit(scene, SCENE_TIME_BACK)) {
        const uint64_t back = random_below(random, 5000);
        scene->now_us -= back < scene->now_us ? back : 0;
    }
    scene->inputs.time_us = scene->now_us;
}

static void move_world(scene_t *scene) {
    random_t *random = &scene->random;
    for (int i = 0; i < OMNI_MAX_WHEELS; ++i) {
        scene->world.blocked[i] = hit(scene, SCENE_BLOCKED) && i == (int)(scene->episode % OMNI_MAX_WHEELS);
        scene->world.slip[i] = hit(scene, SCENE_SLIP) ? 0.05f * (omni_real_t)i : 0.0f;
    }
    world_step(&scene->world, config_of(scene), scene->outputs.voltage_V, scene->now_us);
    memcpy(scene->inputs.counts, scene->world.counts, sizeof scene->inputs.counts);
    scene->inputs.counts_valid = (1u << OMNI_MAX_WHEELS) - 1u;
    if (hit(scene, SCENE_COUNT_LOST)) {
        scene->inputs.counts_valid = (uint8_t)random_below(random, 1u << OMNI_MAX_WHEELS);
    }
    if (hit(scene, SCENE_COUNT_JUMP)) {
        const uint32_t counter = random_u32(random);
        memcpy(&scene->inputs.counts[random_below(random, OMNI_MAX_WHEELS)], &counter, sizeof counter);
    }
}

static void see_pose(scene_t *scene) {
    random_t *random = &scene->random;
    omni_pose_fix_t *fix = &scene->inputs.fix;
    scene->inputs.has_fix = scene->tick % scene->fix_period == 0 && !hit(scene, SCENE_FIX_STOP);
    if (!scene->inputs.has_fix) {
        return;
    }
    if (hit(scene, SCENE_FIX_JUMP) && random_chance(random, 20000)) {
        scene->fix_offset = (omni_pose_t){random_between(random, -1.0f, 1.0f), random_between(random, -1.0f, 1.0f),
                                          random_between(random, -1.0f, 1.0f)};
    }
    const omni_pose_t pose = world_pose(&scene->world, scene->fix_age, &fix->time_us);
    fix->pose.x = pose.x + scene->fix_offset.x + 0.004f * random_normal(random);
    fix->pose.y = pose.y + scene->fix_offset.y + 0.004f * random_normal(random);
    fix->pose.theta = pose.theta + scene->fix_offset.theta + 0.004f * random_normal(random);
    fix->sd_xy = random_chance(random, 200000) ? random_between(random, 0.0f, 0.05f) : 0.0f;
    fix->sd_theta = random_chance(random, 200000) ? random_between(random, 0.0f, 0.05f) : 0.0f;
    if (hit(scene, SCENE_FIX_NAN)) {
        fix->pose.theta = not_finite(random);
    }
    if (hit(scene, SCENE_FIX_TIME)) {
        fix->time_us +=
            random_below(random, 2) ? (uint64_t)random_u32(random) : (uint64_t)0 - random_below(random, 1000000);
    }
}

static void read_supply(scene_t *scene) {
    omni_inputs_t *in = &scene->inputs;
    random_t *random = &scene->random;
    in->battery_V = scene->episode % 3 == 0 ? 0.0f : 12.0f + 0.1f * random_normal(random);
    if (hit(scene, SCENE_BATTERY_SAG)) {
        in->battery_V = random_between(random, -1.0f, 9.0f);
    }
    if (hit(scene, SCENE_BATTERY_NAN)) {
        in->battery_V = not_finite(random);
    }
    in->driver_failures = (uint16_t)(hit(scene, SCENE_DRIVER) ? in->driver_failures + 1 : 0);
    in->faults = hit(scene, SCENE_OVERRUN) ? OMNI_FAULT_OVERRUN : 0u;
}

/* The ground station: heartbeats, set-points, and a push where the robot has stopped. */
static void listen(scene_t *scene) {
    omni_inputs_t *in = &scene->inputs;
    random_t *random = &scene->random;
    if (!hit(scene, SCENE_LINK_STOP) && scene->tick % 100 == 0) {
        in->heartbeat_us = scene->now_us;
    }
    if (scene->tick >= scene->setpoint_ends) {
        draw_setpoint(random, &scene->world.pose, &in->setpoint);
        scene->setpoint_ends = scene->tick + 50 + random_below(random, 800);
        if (in->setpoint.kind == OMNI_SETPOINT_TRAJECTORY && random_chance(random, 400000)) {
            plan(scene);
        }
    }
    if (!hit(scene, SCENE_SETPOINT_STOP) && scene->tick % 20 == 0) {
        in->setpoint.time_us = scene->now_us;
    }
    const bool push = random_chance(random, 50000);
    if (push && scene->outputs.state == OMNI_STATE_DISARMED) {
        in->events |= OMNI_EVENT_ARM;
    } else if (push && scene->outputs.state == OMNI_STATE_FAILSAFE) {
        in->events |= OMNI_EVENT_DISARM;
    } else if (push && scene->outputs.state == OMNI_STATE_ESTOP) {
        in->events |= OMNI_EVENT_ESTOP_CLEAR;
    }
}

static void happen(scene_t *scene) {
    omni_inputs_t *in = &scene->inputs;
    random_t *random = &scene->random;
    in->events |= hit(scene, SCENE_DISARM) || scene->episode_ends - scene->tick < 3 ? (uint32_t)OMNI_EVENT_DISARM : 0u;
    in->events |= hit(scene, SCENE_ESTOP) ? (uint32_t)OMNI_EVENT_ESTOP : 0u;
    in->events |= hit(scene, SCENE_PATH_STOP) ? (uint32_t)OMNI_EVENT_TRAJECTORY_STOP : 0u;
    if (hit(scene, SCENE_SET_POSE)) {
        in->events |= OMNI_EVENT_SET_POSE;
        in->pose = scene->world.pose;
        in->pose.x = random_chance(random, 100000) ? not_finite(random) : in->pose.x;
    }
    if (random_chance(random, 1500)) {
        omni_real_t values[OMNI_PARAM_COUNT];
        memcpy(values, scene->values, sizeof values);
        draw_change(random, values);
        if (configure(scene, values)) {
            omni_robot_set_config(&scene->robot, config_of(scene));
            scene->changes_while_armed += scene->outputs.state == OMNI_STATE_ARMED ? 1u : 0u;
        }
    }
}

void scene_init(scene_t *scene, uint32_t seed) {
    memset(scene, 0, sizeof *scene);
    scene->random.state = seed;
    scene->gyro.random.state = seed + 1;
    scene->current.state = seed + 2;
    scene->flow.random.state = seed + 3;
}

void scene_step(scene_t *scene) {
    scene->inputs.events = 0;
    if (scene->tick >= scene->episode_ends) {
        begin_episode(scene);
    }
    count_troubles(scene);
    pass_time(scene);
    move_world(scene);
    gyro_read(&scene->gyro, &scene->world, config_of(scene), &scene->inputs);
    flow_read(&scene->flow, &scene->world, config_of(scene), &scene->inputs);
    see_pose(scene);
    read_supply(scene);
    listen(scene);
    happen(scene);
    /* The set-point of this tick only: what is sent is not what is kept. */
    omni_inputs_t inputs = scene->inputs;
    if (hit(scene, SCENE_SETPOINT_NAN)) {
        inputs.setpoint.twist.vx = not_finite(&scene->random);
        inputs.setpoint.kind = (uint8_t)random_below(&scene->random, 9);
    }
    omni_robot_tick(&scene->robot, &inputs, &scene->outputs);
    ++scene->tick;
}
