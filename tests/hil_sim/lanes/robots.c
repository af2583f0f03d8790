/* SPDX-License-Identifier: MIT */
/*
 * The parity program's scene drives one robot. Eight more get its inputs with noise of their own, and parameters a
 * little apart. They tick twice: each for itself, and together in lanes. What the two say must be the same bits. Where
 * the lanes part, they are filled again from the single robots.
 */
/* -Domni_robot_tick=lanes_scene_tick is for scene.c. */
#undef omni_robot_tick

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "divergence.h"
#include "layout_headers.h"
#include "processor.h"
#include "scene.h"

typedef struct lanes_tally_t {
    uint32_t ticks;        /* of the scene */
    uint32_t compared;     /* of them in lanes */
    uint32_t parted;       /* the lanes parted */
    uint32_t unequal;      /* something common to all differed, so they could not be filled */
    uint32_t wrong;        /* words that differed */
    uint32_t armed[8];     /* compared while armed, per controller */
    uint32_t kinds[8];     /* compared per kind of set-point */
    uint32_t fixes;        /* compared ticks with a fix */
    uint32_t in_a_row;     /* longest stretch in lanes without filling them again */
    uint32_t hot;          /* ticks without the sensors whose files are plain C: gyro, floor odometry, motor currents */
    uint32_t hot_compared; /* of them in lanes */
} lanes_tally_t;

typedef struct bench_t {
    const hil_lanes_core_t *core;
    lanes_tally_t tally;
    random_t random;
    omni_robot_t robots[HIL_LANES];
    omni_robot_config_t configs[HIL_LANES];
    omni_inputs_t inputs[HIL_LANES];
    omni_outputs_t outputs[HIL_LANES];
    omni_robot_t robots_again[HIL_LANES];
    omni_outputs_t outputs_again[HIL_LANES];
    int32_t drift[HIL_LANES][OMNI_MAX_WHEELS];
    const omni_robot_config_t *leader_config;
    omni_trajectory_t plans[2][HIL_LANES];
    const omni_trajectory_t *leader_plan;
    int plan;
    hil_lanes_plans_t following[2];
    void *lanes_robot;
    void *lanes_config;
    void *lanes_inputs;
    void *lanes_outputs;
    bool filled;
    uint32_t row;
} bench_t;

static bench_t bench;

static void fill_configs(const omni_robot_config_t *leader) {
    for (int lane = 0; lane < HIL_LANES; ++lane) {
        omni_robot_config_t *c = &bench.configs[lane];
        const omni_real_t factor = 1.0f + 0.01f * (omni_real_t)lane;
        *c = *leader;
        c->ismc.k[0] *= factor;
        c->fl.kp[1] *= factor;
        c->wheel_speed.pid.kp *= factor;
        c->pose_ekf.q_xy *= factor;
        c->direct_torque.kp[0] *= factor;
        c->motor.viscous_N_m_s *= factor;
        bench.robots[lane].config = c;
    }
    bench.leader_config = leader;
    bench.filled = false;
}

/* Each robot follows a plan of its own: the leader's, a little stretched. */
static void fill_plans(const omni_trajectory_t *leader) {
    bench.plan ^= 1;
    const void *each[HIL_LANES];
    for (int lane = 0; lane < HIL_LANES; ++lane) {
        omni_trajectory_t *p = &bench.plans[bench.plan][lane];
        memcpy(p, leader, sizeof *p);
        p->origin.x += 0.001f * (omni_real_t)(lane % 4);
        p->config.size_m *= 1.0f + 0.001f * (omni_real_t)(lane % 4);
        each[lane] = p;
    }
    hil_lanes_plans_set(&bench.following[bench.plan], each);
    bench.leader_plan = leader;
}

static omni_real_t noisy(omni_real_t value, omni_real_t sd) {
    return value + sd * random_normal(&bench.random);
}

static void fill_inputs(const omni_inputs_t *leader) {
    for (int lane = 0; lane < HIL_LANES; ++lane) {
        omni_inputs_t *in = &bench.inputs[lane];
        *in = *leader;
        for (int i = 0; i < OMNI_MAX_WHEELS; ++i) {
            bench.drift[lane][i] += (int32_t)random_below(&bench.random, 3) - 1;
            const uint32_t moved = (uint32_t)in->counts[i] + (uint32_t)bench.drift[lane][i];
            memcpy(&in->counts[i], &moved, sizeof moved);
        }
        in->fix.pose.x = noisy(in->fix.pose.x, 0.003f);
        in->fix.pose.y = noisy(in->fix.pose.y, 0.003f);
        in->fix.pose.theta = noisy(in->fix.pose.theta, 0.003f);
        in->battery_V = in->battery_V > 0.0f ? noisy(in->battery_V, 0.05f) : in->battery_V;
        in->setpoint.twist.vx = noisy(in->setpoint.twist.vx, 0.05f);
        in->setpoint.pose.theta = noisy(in->setpoint.pose.theta, 0.1f);
        in->setpoint.duty[1] = noisy(in->setpoint.duty[1], 0.1f);
        in->trajectory = leader->trajectory != NULL ? &bench.plans[bench.plan][lane] : NULL;
    }
}

static bool fill_lanes(void) {
    const void *robots[HIL_LANES];
    const void *configs[HIL_LANES];
    hil_lanes_plans_t *plans = NULL;
    bool same = true;
    for (int lane = 0; lane < HIL_LANES; ++lane) {
        robots[lane] = &bench.robots[lane];
        configs[lane] = &bench.configs[lane];
    }
    for (int i = 0; i < 2; ++i) {
        plans = bench.robots[0].reference_generator.trajectory == &bench.plans[i][0] ? &bench.following[i] : plans;
    }
    for (int lane = 0; lane < HIL_LANES; ++lane) {
        same = same && bench.robots[lane].reference_generator.trajectory == (plans != NULL ? plans->plan[lane] : NULL);
    }
    same = same && hil_lanes_pack(&bench.core->robot, robots, bench.lanes_robot) &&
           hil_lanes_pack(&bench.core->config, configs, bench.lanes_config);
    bench.core->connect(bench.lanes_robot, bench.lanes_config, plans);
    bench.row = 0;
    return same;
}

static bool is_nan(uint32_t word) {
    return (word & 0x7fffffffu) > 0x7f800000u;
}

/* Words in which two structs differ. A NaN is a NaN. */
static uint32_t differences(const char *name, int lane, const void *a, const void *b, size_t bytes) {
    uint32_t wrong = 0;
    for (size_t i = 0; i < bytes; i += sizeof(uint32_t)) {
        uint32_t p = 0;
        uint32_t q = 0;
        memcpy(&p, (const char *)a + i, sizeof p);
        memcpy(&q, (const char *)b + i, sizeof q);
        if (p != q && !(is_nan(p) && is_nan(q))) {
            if (bench.tally.wrong + wrong < 20) {
                (void)fprintf(stderr, "tick %u lane %d %s + %u: %08x alone, %08x in lanes\n", bench.tally.ticks, lane,
                              name, (unsigned)i, p, q);
            }
            ++wrong;
        }
    }
    return wrong;
}

static void compare(void) {
    void *robots[HIL_LANES];
    void *outputs[HIL_LANES];
    const hil_lanes_plans_t *plans = bench.core->plans_of(bench.lanes_robot);
    for (int lane = 0; lane < HIL_LANES; ++lane) {
        memcpy(&bench.robots_again[lane], &bench.robots[lane], sizeof(omni_robot_t)); /* padding and pointers */
        memcpy(&bench.outputs_again[lane], &bench.outputs[lane], sizeof(omni_outputs_t));
        robots[lane] = &bench.robots_again[lane];
        outputs[lane] = &bench.outputs_again[lane];
    }
    hil_lanes_unpack(&bench.core->robot, bench.lanes_robot, robots);
    hil_lanes_unpack(&bench.core->outputs, bench.lanes_outputs, outputs);
    for (int lane = 0; lane < HIL_LANES; ++lane) {
        bench.robots_again[lane].reference_generator.trajectory = plans != NULL ? plans->plan[lane] : NULL;
        bench.tally.wrong +=
            differences("robot", lane, &bench.robots[lane], &bench.robots_again[lane], sizeof(omni_robot_t));
        bench.tally.wrong +=
            differences("outputs", lane, &bench.outputs[lane], &bench.outputs_again[lane], sizeof(omni_outputs_t));
    }
}

static void tick_lanes(hil_lanes_plans_t *offered) {
    const void *inputs[HIL_LANES];
    for (int lane = 0; lane < HIL_LANES; ++lane) {
        inputs[lane] = &bench.inputs[lane];
    }
    (void)hil_lanes_take_diverged();
    if (!hil_lanes_pack(&bench.core->inputs, inputs, bench.lanes_inputs)) {
        bench.filled = false;
        ++bench.tally.unequal;
        return;
    }
    bench.core->offer(bench.lanes_inputs, offered);
    bench.core->tick(bench.lanes_robot, bench.lanes_inputs, bench.lanes_outputs);
    bench.filled = !hil_lanes_take_diverged();
    bench.tally.parted += bench.filled ? 0u : 1u;
}

static void note(const omni_inputs_t *leader) {
    lanes_tally_t *tally = &bench.tally;
    ++tally->compared;
    ++bench.row;
    tally->in_a_row = bench.row > tally->in_a_row ? bench.row : tally->in_a_row;
    tally->fixes += leader->has_fix ? 1u : 0u;
    if (bench.outputs[0].state == OMNI_STATE_ARMED) {
        ++tally->armed[bench.outputs[0].controller];
        ++tally->kinds[bench.outputs[0].setpoint_kind];
    }
}

/* In place of omni_robot_tick in scene.c. */
void lanes_scene_tick(omni_robot_t *robot, const omni_inputs_t *inputs, omni_outputs_t *outputs);
void lanes_scene_tick(omni_robot_t *robot, const omni_inputs_t *inputs, omni_outputs_t *outputs) {
    if (!robot->estimator.primed) { /* it has just been started anew */
        for (int lane = 0; lane < HIL_LANES; ++lane) {
            memcpy(&bench.robots[lane], robot, sizeof *robot);
        }
        bench.leader_config = NULL;
    }
    if (robot->config != bench.leader_config) {
        fill_configs(robot->config);
    }
    if (inputs->trajectory != NULL && (inputs->events & OMNI_EVENT_TRAJECTORY_START) != 0) {
        fill_plans(inputs->trajectory);
    }
    fill_inputs(inputs);
    if (!bench.filled) {
        bench.filled = fill_lanes();
        bench.tally.unequal += bench.filled ? 0u : 1u;
    }
    const bool together = bench.filled;
    if (together) {
        tick_lanes(inputs->trajectory != NULL ? &bench.following[bench.plan] : NULL);
    }
    for (int lane = 0; lane < HIL_LANES; ++lane) {
        omni_robot_tick(&bench.robots[lane], &bench.inputs[lane], &bench.outputs[lane]);
    }
    omni_robot_tick(robot, inputs, outputs);
    const omni_robot_config_t *c = robot->config;
    const bool hot = !c->pose_ekf.has_gyro && c->flow.axes == 0 && !c->current.enabled;
    bench.tally.hot += hot ? 1u : 0u;
    if (together && bench.filled) {
        compare();
        note(inputs);
        bench.tally.hot_compared += hot ? 1u : 0u;
    }
    ++bench.tally.ticks;
}

static void *room(size_t bytes) {
    return aligned_alloc(HIL_LANES_ALIGNMENT,
                         (bytes + HIL_LANES_ALIGNMENT - 1) / HIL_LANES_ALIGNMENT * HIL_LANES_ALIGNMENT);
}

/** Run a seeded scene. @param level hil_lanes_level_t. */
void lanes_scene(uint32_t seed, uint32_t ticks, int32_t level, lanes_tally_t *tally);
void lanes_scene(uint32_t seed, uint32_t ticks, int32_t level, lanes_tally_t *tally) {
    static scene_t scene;
    memset(&bench, 0, sizeof bench);
    bench.core = hil_lanes_runs((hil_lanes_level_t)level)->core;
    bench.random.state = seed + 1000;
    bench.lanes_robot = room(bench.core->robot_bytes);
    bench.lanes_config = room(bench.core->config_bytes);
    bench.lanes_inputs = room(bench.core->inputs_bytes);
    bench.lanes_outputs = room(bench.core->outputs_bytes);
    scene_init(&scene, seed);
    for (uint32_t i = 0; i < ticks; ++i) {
        scene_step(&scene);
    }
    free(bench.lanes_robot);
    free(bench.lanes_config);
    free(bench.lanes_inputs);
    free(bench.lanes_outputs);
    *tally = bench.tally;
}
