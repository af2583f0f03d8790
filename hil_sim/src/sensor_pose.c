/* SPDX-License-Identifier: MIT */
/* Sensor pose: a motion-capture system, whose fixes are taken now and arrive later. */
#include <stddef.h>
#include <string.h>

#include "hil_sim/random.h"
#include "sensor.h"

static hil_real_t wrap_angle(hil_real_t angle_rad) {
    return angle_rad - 2.0 * HIL_PI * hil_floor(angle_rad / (2.0 * HIL_PI) + 0.5);
}

static void measure(const hil_world_t *world, uint64_t sample, double age_s, hil_real_t *pose) {
    const hil_world_config_t *config = &world->config;
    const hil_real_t sd[3] = {config->fix_sd_xy_m, config->fix_sd_xy_m, config->fix_sd_theta_rad};
    hil_real_t heading[2];
    hil_cos_sin(world->pose[2] - age_s * world->twist[2], heading);
    const hil_real_t arm[3] = {heading[0] * config->tracked_x_m - heading[1] * config->tracked_y_m,
                               heading[1] * config->tracked_x_m + heading[0] * config->tracked_y_m,
                               config->tracked_heading_rad};
    for (uint32_t axis = 0; axis < 3; axis++) {
        const hil_real_t noise = sd[axis] * hil_normal(config->seed, HIL_STREAM_FIX_X + axis, sample);
        pose[axis] = world->pose[axis] - age_s * world->twist[axis] + noise + arm[axis];
    }
    pose[0] += hil_fault_value(world, HIL_FAULT_POSE_JUMP, 0.0);
    pose[2] = wrap_angle(pose[2]);
}

static void freeze(hil_world_t *world, hil_fix_t *fix) {
    const bool frozen = hil_fault_find(world, HIL_FAULT_POSE_FREEZE, HIL_MAX_WHEELS) != NULL;
    for (uint32_t axis = 0; axis < 3; axis++) {
        if (frozen) {
            fix->pose[axis] = world->frozen_pose[axis];
        } else {
            world->frozen_pose[axis] = hil_select(fix->dropped, world->frozen_pose[axis], fix->pose[axis]);
        }
    }
}

static void queue(hil_world_t *world, const hil_fix_t *fix) {
    if (world->fix_count == HIL_MAX_FIXES) { /* nobody asked for the oldest: it is lost */
        world->fix_head = (world->fix_head + 1) % HIL_MAX_FIXES;
        world->fix_count--;
    }
    world->fix[(world->fix_head + world->fix_count) % HIL_MAX_FIXES] = *fix;
    world->fix_count++;
}

static hil_flag_t is_dropped(const hil_world_t *world, uint64_t sample) {
    const hil_world_config_t *config = &world->config;
    if (hil_fault_find(world, HIL_FAULT_POSE_LOSS, HIL_MAX_WHEELS) != NULL) {
        return true;
    }
    return (hil_flag_t)(hil_uniform(config->seed, HIL_STREAM_FIX_DROP, sample) < config->fix_drop_probability);
}

static double late_by_s(const hil_world_t *world) {
    const hil_fault_t *late = hil_fault_find(world, HIL_FAULT_POSE_DELAY, HIL_MAX_WHEELS);
    return late != NULL ? late->value : 0.0;
}

static void take_sample(hil_world_t *world, uint64_t sample, uint64_t due_us) {
    const double late_s = late_by_s(world);
    hil_fix_t fix;
    memset(&fix, 0, sizeof fix);
    fix.taken_us = due_us + (uint64_t)(late_s * 1e6 + 0.5);
    fix.arrives_us = due_us + (uint64_t)((world->config.fix_delay_s + late_s) * 1e6 + 0.5);
    fix.dropped = is_dropped(world, sample);
    measure(world, sample, 1e-6 * (double)(world->time_us - due_us), fix.pose);
    freeze(world, &fix);
    queue(world, &fix);
}

/* Samples are due at k / rate, which need not fall on a tick: the pose is carried back to that time. */
static void take_fixes(hil_world_t *world) {
    const hil_world_config_t *config = &world->config;
    if (config->fix_rate_Hz <= 0.0) {
        return;
    }
    for (;;) {
        const uint64_t sample = world->fixes_taken;
        const uint64_t due_us = (uint64_t)((double)sample * 1e6 / config->fix_rate_Hz + 0.5);
        if (due_us > world->time_us) {
            return;
        }
        world->fixes_taken++;
        take_sample(world, sample, due_us);
    }
}

void hil_pose_queue_fix(hil_world_t *world, uint64_t taken_us, const double *pose) {
    const uint64_t late_us = (uint64_t)(late_by_s(world) * 1e6 + 0.5);
    hil_fix_t fix;
    memset(&fix, 0, sizeof fix);
    fix.taken_us = taken_us + late_us;
    fix.arrives_us = world->time_us + late_us;
    fix.dropped = hil_fault_find(world, HIL_FAULT_POSE_LOSS, HIL_MAX_WHEELS) != NULL;
    fix.pose[0] = pose[0] + hil_fault_value(world, HIL_FAULT_POSE_JUMP, 0.0);
    fix.pose[1] = pose[1];
    fix.pose[2] = wrap_angle(pose[2]);
    freeze(world, &fix);
    queue(world, &fix);
}

static void show_due_fix(hil_world_t *world, hil_sensors_t *sensors) {
    while (!sensors->has_fix && world->fix_count > 0 && world->fix[world->fix_head].arrives_us <= world->time_us) {
        sensors->fix = world->fix[world->fix_head];
        sensors->has_fix = !sensors->fix.dropped;
        world->fix_head = (world->fix_head + 1) % HIL_MAX_FIXES;
        world->fix_count--;
    }
}

const hil_sensor_t hil_sensor_pose = {.sample = take_fixes, .show = show_due_fix};
