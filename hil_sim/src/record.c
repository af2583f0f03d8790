/* SPDX-License-Identifier: MIT */
#include "record.h"

#include <math.h>
#include <string.h>

hil_sample_t *hil_record_row(hil_record_t *record, const hil_world_t *world) {
    if (record == NULL || record->count >= record->capacity || record->every == 0 ||
        world->steps % record->every != 0) {
        return NULL;
    }
    hil_sample_t *row = &record->samples[record->count++];
    memset(row, 0, sizeof *row);
    row->time_s = 1e-6 * (double)world->time_us;
    memcpy(row->truth, world->pose, sizeof row->truth);
    memcpy(row->wheel_rad_s, world->wheel_rad_s, sizeof row->wheel_rad_s);
    memcpy(row->current_A, world->current_A, sizeof row->current_A);
    memcpy(row->slip_ratio, world->slip_ratio, sizeof row->slip_ratio);
    for (uint32_t i = 0; i < world->config.wheels; i++) {
        row->duty[i] = world->bridge[i].drive * world->config.motor_direction[i];
    }
    row->supply_V = world->supply_V;
    return row;
}

static void copy_pose(double *to, const omni_pose_t *pose) {
    to[0] = (double)pose->x;
    to[1] = (double)pose->y;
    to[2] = (double)pose->theta;
}

void hil_record_tick(hil_record_t *record, const hil_world_t *world, const omni_outputs_t *outputs) {
    hil_sample_t *row = hil_record_row(record, world);
    if (row == NULL) {
        return;
    }
    copy_pose(row->reference, &outputs->reference.pose);
    copy_pose(row->estimate, &outputs->pose);
    for (uint32_t i = 0; i < world->config.wheels; i++) {
        row->wheel_reference[i] = (double)outputs->wheel_reference[i];
    }
    row->wheel_scale = (double)outputs->wheel_scale;
    row->duty_scale = (double)outputs->duty_scale;
    row->faults = outputs->faults;
    row->config_sequence = outputs->config_sequence;
    row->state = outputs->state;
    row->phase = outputs->reference.phase;
}

void hil_milestones_from_record(hil_milestones_t *milestones, const hil_sample_t *samples, uint64_t count) {
    for (const hil_sample_t *row = samples; row < samples + count; row++) {
        hil_milestones_tick(milestones, (uint64_t)rint(1e6 * row->time_s), row->state, row->phase);
    }
}
