/* SPDX-License-Identifier: MIT */
/*
 * Model of goBILDA's Pinpoint (public driver). A register holds 32 bits, the low byte first. It computes its pose from
 * two wheels and its gyro:
 *
 *   x wheel: w_x = v_x - r y_x      (y_x: how far left of the centre it is)
 *   y wheel: w_y = v_y + r x_y      (x_y: how far in front)
 *   v_x = w_x + r y_x,  v_y = w_y - r x_y,  with what it has been told of both
 */
#include <math.h>
#include <string.h>

#include "flow_models.h"

enum {
    DEVICE_ID = 1,
    VERSION = 2,
    STATUS = 3,
    CONTROL = 4,
    LOOP_TIME = 5,
    X_ENCODER = 6,
    X_POSITION = 8,
    HEADING = 10,
    H_VELOCITY = 13,
    STEPS_PER_MM = 14,
    X_WHEEL = 15,
    Y_WHEEL = 16,
    YAW_SCALE = 17,
    BULK_READ = 18,

    READY = 0x01,
    CALIBRATING = 0x02,
    X_WHEEL_MISSING = 0x04,
    IMU_RUNAWAY = 0x10,

    RECALIBRATE = 0x01,
    RESET_POSE = 0x02,
    Y_REVERSED = 0x04,
    Y_FORWARD = 0x08,
    X_REVERSED = 0x10,
    X_FORWARD = 0x20,

    CALIBRATION_us = 250000,
    LOOP_us = 660,
    WORD = 4,
    WORDS_OF_BULK = 10
};

static const float FOUR_BAR_STEPS_PER_MM = 19.894367f; /* after a reset: goBILDA's own wheel */

static void set_reset_values(hil_flow_chip_t *chip) {
    chip->settings[STEPS_PER_MM] = FOUR_BAR_STEPS_PER_MM;
    chip->settings[YAW_SCALE] = 1.0f;
    chip->busy_until_us = chip->time_us + CALIBRATION_us;
}

static uint32_t bits_of(float value) {
    uint32_t bits;
    memcpy(&bits, &value, sizeof bits);
    return bits;
}

static uint32_t status_of(const hil_flow_chip_t *chip) {
    const bool busy = chip->time_us < chip->busy_until_us;
    return (busy ? CALIBRATING : READY) | (chip->faults.unplugged ? X_WHEEL_MISSING : 0) |
           (chip->faults.broken ? IMU_RUNAWAY : 0);
}

static uint32_t word_of(const hil_flow_chip_t *chip, uint8_t reg) {
    switch (reg) {
    case DEVICE_ID:
        return chip->faults.other_id != 0 ? chip->faults.other_id : 1;
    case VERSION:
        return 1;
    case STATUS:
        return status_of(chip);
    case LOOP_TIME:
        return LOOP_us;
    case X_POSITION:
    case X_POSITION + 1:
        return bits_of((float)(chip->pose[reg - X_POSITION] * 1e3));
    case HEADING:
        return bits_of((float)chip->pose[2]);
    default:
        return reg >= STEPS_PER_MM && reg <= YAW_SCALE ? bits_of(chip->settings[reg]) : 0;
    }
}

static void give_word(hil_flow_chip_t *chip, uint32_t place, uint32_t word) {
    for (uint32_t i = 0; i < WORD; i++) {
        chip->given[WORD * place + i] = (uint8_t)(word >> 8 * i);
    }
}

static void show(hil_flow_chip_t *chip, uint8_t reg) {
    static const uint8_t bulk[WORDS_OF_BULK] = {STATUS,         LOOP_TIME, X_ENCODER,   X_ENCODER + 1, X_POSITION,
                                                X_POSITION + 1, HEADING,   HEADING + 1, HEADING + 2,   H_VELOCITY};
    if (reg != BULK_READ) {
        give_word(chip, 0, word_of(chip, reg));
        return;
    }
    for (uint32_t i = 0; i < WORDS_OF_BULK; i++) {
        give_word(chip, i, word_of(chip, bulk[i]));
    }
}

static void control(hil_flow_chip_t *chip, uint32_t bits) {
    if ((bits & (RECALIBRATE | RESET_POSE)) != 0) {
        chip->busy_until_us = chip->time_us + (chip->calibration_us > 0 ? chip->calibration_us : CALIBRATION_us);
        chip->calibrations++;
    }
    if ((bits & RESET_POSE) != 0) {
        memset(chip->pose, 0, sizeof chip->pose);
    }
    chip->counts_backwards[0] = (bits & X_REVERSED) != 0 || (chip->counts_backwards[0] && (bits & X_FORWARD) == 0);
    chip->counts_backwards[1] = (bits & Y_REVERSED) != 0 || (chip->counts_backwards[1] && (bits & Y_FORWARD) == 0);
}

static void write_word(hil_flow_chip_t *chip, uint8_t reg, uint32_t word) {
    float value;
    memcpy(&value, &word, sizeof value);
    if (reg == CONTROL) {
        control(chip, word);
    } else if (reg >= X_POSITION && reg <= HEADING) {
        chip->pose[reg - X_POSITION] = reg == HEADING ? (double)value : (double)value * 1e-3;
    } else if (reg >= STEPS_PER_MM && reg <= YAW_SCALE) {
        chip->settings[reg] = value;
    } else {
        chip->ignored_writes++;
    }
}

static bool take(hil_flow_chip_t *chip, uint8_t byte) {
    chip->taken[chip->count++ % WORD] = byte;
    if (chip->count == WORD) {
        uint32_t word = 0;
        for (uint32_t i = 0; i < WORD; i++) {
            word |= (uint32_t)chip->taken[i] << 8 * i;
        }
        write_word(chip, chip->pointer, word);
    }
    return true;
}

/* What a wheel has rolled [mm], as it comes from its encoder and what the chip has been told of it. */
static double rolled_mm(const hil_flow_chip_t *chip, uint32_t axis, double way_mm) {
    const double sign = chip->wheels.reversed[axis] == chip->counts_backwards[axis] ? 1.0 : -1.0;
    return sign * way_mm * chip->wheels.steps_per_mm / (double)chip->settings[STEPS_PER_MM];
}

static void count(hil_flow_chip_t *chip, const double *moved) {
    const double turn = moved[2];
    const double x_mm = moved[0] * 1e3 - turn * chip->wheels.x_wheel_mm;
    const double y_mm = moved[1] * 1e3 + turn * chip->wheels.y_wheel_mm;
    const double x = (chip->faults.unplugged ? 0.0 : rolled_mm(chip, 0, x_mm)) + turn * (double)chip->settings[X_WHEEL];
    const double y = rolled_mm(chip, 1, y_mm) - turn * (double)chip->settings[Y_WHEEL];
    hil_flow_add(chip, x * 1e-3, y * 1e-3, turn * (double)chip->settings[YAW_SCALE]);
}

const hil_flow_model_t hil_flow_pinpoint = {
    .set_reset_values = set_reset_values, .show = show, .take = take, .count = count};
