/* SPDX-License-Identifier: MIT */
#include "record.h"

#include <string.h>

hil_sample_t *hil_record_row(hil_record_t *record, const hil_world_t *world) {
    if (record == NULL || record->count >= record->capacity || record->every == 0 || world->steps % record->every != 0) {
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
