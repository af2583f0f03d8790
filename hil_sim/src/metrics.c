/* SPDX-License-Identifier: MIT */
/* Compiled for lanes too: branches depend on state and phase only. */
#include "hil_sim/metrics.h"

#include <string.h>

static const double TURN = 6.28318530717958647692;

void hil_metrics_init(hil_metrics_t *metrics) {
    memset(metrics, 0, sizeof *metrics);
    hil_milestones_init(&metrics->milestones);
}

static hil_real_t larger(hil_real_t a, hil_real_t b) {
    return hil_select(a > b, a, b);
}

static hil_real_t magnitude(hil_real_t a) {
    return hil_select(a < 0.0, -a, a);
}

/* To the nearest whole turn; adding 1.5 * 2^52 rounds a small number to a whole one. */
static hil_real_t wrap(hil_real_t angle_rad) {
    const hil_real_t shifted = angle_rad * (1.0 / TURN) + 0x1.8p52;
    return angle_rad - TURN * (shifted - 0x1.8p52);
}

static void add_squares(hil_real_t *sums, const hil_real_t *error) {
    for (uint32_t axis = 0; axis < 3; axis++) {
        sums[axis] += error[axis] * error[axis];
    }
}

static void tracking_error(hil_real_t *error, const hil_world_t *world, const omni_pose_t *reference) {
    error[0] = world->pose[0] - (hil_real_t)reference->x;
    error[1] = world->pose[1] - (hil_real_t)reference->y;
    error[2] = wrap(world->pose[2] - (hil_real_t)reference->theta);
}

static void add_tracking(hil_metrics_t *metrics, const hil_real_t *error) {
    add_squares(metrics->tracking_square, error);
    metrics->distance_square_max = larger(metrics->distance_square_max, error[0] * error[0] + error[1] * error[1]);
    metrics->turn_max = larger(metrics->turn_max, magnitude(error[2]));
}

static void add_estimate(hil_metrics_t *metrics, const hil_world_t *world, const omni_pose_t *estimate) {
    const hil_real_t error[3] = {(hil_real_t)estimate->x - world->pose[0], (hil_real_t)estimate->y - world->pose[1],
                                 wrap((hil_real_t)estimate->theta - world->pose[2])};
    add_squares(metrics->estimate_square, error);
}

static void add_wheels(hil_metrics_t *metrics, const hil_world_t *world) {
    const bool first = metrics->path_ticks == 0;
    for (uint32_t i = 0; i < world->config.wheels; i++) {
        const hil_real_t duty = world->bridge[i].drive * world->config.motor_direction[i];
        const hil_real_t size = magnitude(duty);
        metrics->wheel_peak = larger(metrics->wheel_peak, magnitude(world->wheel_rad_s[i]));
        metrics->duty_peak = larger(metrics->duty_peak, size);
        metrics->duty_sum += size;
        metrics->duty_square += duty * duty;
        if (!first) {
            metrics->duty_change += magnitude(duty - metrics->duty_last[i]);
        }
        metrics->duty_last[i] = duty;
    }
}

static void add_path_tick(hil_metrics_t *metrics, const hil_world_t *world, const omni_outputs_t *outputs) {
    add_tracking(metrics, metrics->final_error);
    add_estimate(metrics, world, &outputs->pose);
    add_wheels(metrics, world);
    const omni_real_t scale =
        hil_select(outputs->wheel_scale < outputs->duty_scale, outputs->wheel_scale, outputs->duty_scale);
    metrics->cut_ticks += hil_select((hil_real_t)scale < 1.0, (hil_real_t)1.0, (hil_real_t)0.0);
    const hil_real_t accepted = (hil_real_t)outputs->fixes_accepted - metrics->fixes_last;
    metrics->nis += accepted * (hil_real_t)outputs->nis;
    metrics->fixes += accepted;
    metrics->path_ticks += 1;
}

static void add_armed_tick(hil_metrics_t *metrics, const hil_world_t *world, const omni_outputs_t *outputs) {
    metrics->faults = metrics->milestones.was_armed ? metrics->faults | outputs->faults : outputs->faults;
    const omni_uint_t phase = outputs->reference.phase;
    if (phase == OMNI_PHASE_PATH || phase == OMNI_PHASE_DONE) {
        tracking_error(metrics->final_error, world, &outputs->reference.pose);
    }
    if (phase == OMNI_PHASE_PATH) {
        add_path_tick(metrics, world, outputs);
    }
}

void hil_metrics_tick(hil_metrics_t *metrics, const hil_world_t *world, const omni_outputs_t *outputs) {
    if (outputs->state == OMNI_STATE_ARMED) {
        add_armed_tick(metrics, world, outputs);
    } else {
        metrics->faults |= outputs->faults;
    }
    hil_milestones_tick(&metrics->milestones, world->time_us, outputs->state, outputs->reference.phase);
    metrics->fixes_last = (hil_real_t)outputs->fixes_accepted;
}
