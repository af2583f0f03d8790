/* SPDX-License-Identifier: MIT */
/* Encoders and the pose sensor. */
#include <stddef.h>
#include <string.h>

#include "hil_sim/random.h"
#include "parts.h"

static int32_t count_direction(const hil_world_t *world, uint32_t wheel) {
    if (hil_fault_find(world, HIL_FAULT_ENCODER_STUCK, wheel) != NULL) {
        return 0;
    }
    const int32_t direction = world->config.encoder_direction[wheel];
    return hil_fault_find(world, HIL_FAULT_ENCODER_REVERSED, wheel) != NULL ? -direction : direction;
}

void hil_encoders_update(hil_world_t *world) {
    const double edges_per_rad = world->config.counts_per_revolution / (2.0 * HIL_PI);
    for (uint32_t i = 0; i < world->config.wheels; i++) {
        const hil_real_t edges = hil_floor(world->wheel_angle_rad[i] * edges_per_rad);
        const hil_real_t passed = (edges - world->encoder_edges[i]) * count_direction(world, i);
        world->encoder_edges[i] = edges;
        world->counts[i] = hil_count_on(world->counts[i], passed);
    }
}

static hil_int_t read_counter(const hil_world_t *world, uint32_t wheel) {
    hil_int_t count = world->counts[wheel];
    const hil_fault_t *noisy = hil_fault_find(world, HIL_FAULT_ENCODER_NOISY, wheel);
    if (noisy != NULL) {
        const hil_real_t u = hil_uniform(world->config.seed, HIL_STREAM_ENCODER + wheel, world->steps);
        count = hil_count_on(count, hil_floor((2.0 * u - 1.0) * noisy->value + 0.5));
    }
    const hil_fault_t *stuck = hil_fault_find(world, HIL_FAULT_ENCODER_BIT, wheel);
    if (stuck != NULL) {
        count = count | (int32_t)(UINT32_C(1) << (uint32_t)stuck->value);
    }
    return count;
}

void hil_world_counts(const hil_world_t *world, hil_int_t *counts) {
    for (uint32_t i = 0; i < world->config.wheels; i++) {
        counts[i] = read_counter(world, i);
    }
}

static hil_real_t wrap_angle(hil_real_t angle_rad) {
    return angle_rad - 2.0 * HIL_PI * hil_floor(angle_rad / (2.0 * HIL_PI) + 0.5);
}

static void measure(const hil_world_t *world, uint64_t sample, double age_s, hil_real_t *pose) {
    const hil_world_config_t *config = &world->config;
    const hil_real_t sd[3] = {config->fix_sd_xy_m, config->fix_sd_xy_m, config->fix_sd_theta_rad};
    for (uint32_t axis = 0; axis < 3; axis++) {
        const hil_real_t noise = sd[axis] * hil_normal(config->seed, HIL_STREAM_FIX_X + axis, sample);
        pose[axis] = world->pose[axis] - age_s * world->twist[axis] + noise;
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
            world->frozen_pose[axis] = hil_select(fix->lost, world->frozen_pose[axis], fix->pose[axis]);
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

static hil_flag_t lost(const hil_world_t *world, uint64_t sample) {
    const hil_world_config_t *config = &world->config;
    if (hil_fault_find(world, HIL_FAULT_POSE_LOSS, HIL_MAX_WHEELS) != NULL) {
        return true;
    }
    return (hil_flag_t)(hil_uniform(config->seed, HIL_STREAM_FIX_DROP, sample) < config->fix_drop_probability);
}

static void take_sample(hil_world_t *world, uint64_t sample, uint64_t due_us) {
    const hil_fault_t *late = hil_fault_find(world, HIL_FAULT_POSE_DELAY, HIL_MAX_WHEELS);
    const double late_s = late != NULL ? late->value : 0.0;
    hil_fix_t fix;
    memset(&fix, 0, sizeof fix);
    fix.taken_us = due_us + (uint64_t)(late_s * 1e6 + 0.5);
    fix.arrives_us = due_us + (uint64_t)((world->config.fix_delay_s + late_s) * 1e6 + 0.5);
    fix.lost = lost(world, sample);
    measure(world, sample, 1e-6 * (double)(world->time_us - due_us), fix.pose);
    freeze(world, &fix);
    queue(world, &fix);
}

/* Samples are due at k / rate, which need not fall on a tick: the pose is carried back to that time. */
void hil_pose_sensor_update(hil_world_t *world) {
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
