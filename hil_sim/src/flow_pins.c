/* SPDX-License-Identifier: MIT */
#include <math.h>
#include <string.h>

#include "flow_models.h"

enum { SILENT = 0, ADDRESSED, WRITTEN, READ };

static const hil_flow_model_t *model_of(const hil_flow_chip_t *chip) {
    static const hil_flow_model_t *const models[HIL_FLOW_KINDS] = {
        [HIL_FLOW_OTOS] = &hil_flow_otos,
        [HIL_FLOW_PINPOINT] = &hil_flow_pinpoint,
    };
    return models[chip->kind];
}

void hil_flow_add(hil_flow_chip_t *chip, double x, double y, double turn) {
    const double heading = chip->pose[2] + 0.5 * turn;
    chip->pose[0] += cos(heading) * x - sin(heading) * y;
    chip->pose[1] += sin(heading) * x + cos(heading) * y;
    chip->pose[2] += turn;
}

void hil_flow_chip_reset(hil_flow_chip_t *chip, uint8_t kind, uint8_t address) {
    chip->kind = kind;
    chip->address = address;
    chip->busy_until_us = 0;
    chip->written_us = 0;
    chip->talk = SILENT;
    memset(chip->pose, 0, sizeof chip->pose);
    memset(chip->registers, 0, sizeof chip->registers);
    memset(chip->settings, 0, sizeof chip->settings);
    memset(chip->counts_backwards, 0, sizeof chip->counts_backwards);
    model_of(chip)->set_reset_values(chip);
}

void hil_flow_chip_move(hil_flow_chip_t *chip, uint64_t time_us, const double *moved) {
    chip->time_us = time_us;
    if (time_us >= chip->busy_until_us) {
        model_of(chip)->count(chip, moved);
    }
}

bool hil_flow_chip_start(hil_flow_chip_t *chip, uint8_t address, bool read) {
    chip->talk = SILENT;
    if (chip->faults.absent || address != chip->address) {
        return false;
    }
    chip->count = 0;
    chip->talk = read ? READ : ADDRESSED;
    if (read) {
        memset(chip->given, 0, sizeof chip->given);
        model_of(chip)->show(chip, chip->pointer);
    }
    return true;
}

bool hil_flow_chip_put(hil_flow_chip_t *chip, uint8_t byte) {
    if (chip->talk == ADDRESSED) {
        chip->pointer = byte % HIL_FLOW_REGISTERS;
        chip->talk = WRITTEN;
        return true;
    }
    return chip->talk == WRITTEN && model_of(chip)->take(chip, byte);
}

uint8_t hil_flow_chip_get(hil_flow_chip_t *chip) {
    if (chip->talk != READ || chip->count >= HIL_FLOW_READ) {
        return 0xFF;
    }
    return chip->given[chip->count++];
}

void hil_flow_chip_stop(hil_flow_chip_t *chip) {
    chip->talk = SILENT;
}
