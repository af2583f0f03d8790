/* SPDX-License-Identifier: MIT */
/*
 * Model of SparkFun's Qwiic OTOS (public driver, firmware 1.0 of the sensor). Position: x, y in 10 m / 32768, heading
 * in pi / 32768, 16 bits each, the low byte first. A position that is written takes effect with the next cycle.
 */
#include <math.h>
#include <string.h>

#include "flow_models.h"

enum {
    PRODUCT_ID = 0x00,
    LINEAR_SCALAR = 0x04,
    ANGULAR_SCALAR = 0x05,
    IMU_CALIBRATION = 0x06,
    RESET = 0x07,
    SIGNAL_PROCESS = 0x0E,
    OFFSET_LAST = 0x15,
    STATUS = 0x1F,
    POSITION = 0x20,
    POSITION_LAST = 0x25,

    OTOS_ID = 0x5F,
    ALL_PROCESSING = 0x0F,
    WARN_TILT = 0x01,
    WARN_OPTICAL = 0x02,
    ERROR_IMU = 0x80,
    SAMPLE_us = 2400,
    FULL = 32767
};

static const double TURN_rad = 6.283185307179586;
static const double STEP_m = 10.0 / 32768.0;
static const double STEP_rad = 3.14159265358979324 / 32768.0;

static void set_reset_values(hil_flow_chip_t *chip) {
    chip->registers[SIGNAL_PROCESS] = ALL_PROCESSING;
}

static int16_t in_steps(double value) {
    const double steps = nearbyint(value);
    return (int16_t)(steps > FULL ? FULL : steps < -FULL - 1 ? -FULL - 1 : steps);
}

static void show_position(hil_flow_chip_t *chip) {
    const double heading = chip->pose[2] - TURN_rad * nearbyint(chip->pose[2] / TURN_rad);
    const int16_t steps[HIL_FLOW_AXES] = {in_steps(chip->pose[0] / STEP_m), in_steps(chip->pose[1] / STEP_m),
                                          in_steps(heading / STEP_rad)};
    for (uint32_t axis = 0; axis < HIL_FLOW_AXES; axis++) {
        chip->registers[POSITION + 2 * axis] = (uint8_t)((uint16_t)steps[axis] & 0xFF);
        chip->registers[POSITION + 2 * axis + 1] = (uint8_t)((uint16_t)steps[axis] >> 8);
    }
}

static void show(hil_flow_chip_t *chip, uint8_t reg) {
    const uint64_t left_us = chip->busy_until_us > chip->time_us ? chip->busy_until_us - chip->time_us : 0;
    chip->registers[PRODUCT_ID] = chip->faults.other_id != 0 ? chip->faults.other_id : (uint8_t)OTOS_ID;
    chip->registers[IMU_CALIBRATION] = (uint8_t)((left_us + SAMPLE_us - 1) / SAMPLE_us);
    chip->registers[STATUS] =
        (uint8_t)((chip->faults.tilted ? WARN_TILT : 0) | (chip->faults.blind ? WARN_OPTICAL : 0) |
                  (chip->faults.broken ? ERROR_IMU : 0));
    show_position(chip);
    for (uint32_t i = 0; i < HIL_FLOW_READ && reg + i < HIL_FLOW_REGISTERS; i++) {
        chip->given[i] = chip->registers[reg + i];
    }
}

static void set_position(hil_flow_chip_t *chip, uint32_t axis, uint8_t low, uint8_t high) {
    const int16_t steps = (int16_t)(uint16_t)(low | high << 8);
    if (chip->written_us == 0) {
        memcpy(chip->written, chip->pose, sizeof chip->written);
    }
    chip->written[axis] = (double)steps * (axis < 2 ? STEP_m : STEP_rad);
    chip->written_us = chip->time_us > 0 ? chip->time_us : 1;
}

static bool take(hil_flow_chip_t *chip, uint8_t byte) {
    const uint8_t reg = chip->pointer;
    if (reg == RESET) {
        if ((byte & 1) != 0) {
            chip->pose[0] = chip->pose[1] = chip->pose[2] = 0.0;
        }
    } else if (reg == IMU_CALIBRATION) {
        chip->busy_until_us = chip->time_us + (uint64_t)byte * SAMPLE_us;
        chip->calibrations++;
    } else if (reg >= POSITION && reg <= POSITION_LAST) {
        if ((reg & 1) != 0) {
            set_position(chip, (uint32_t)(reg - POSITION) / 2, chip->registers[reg - 1], byte);
        }
        chip->registers[reg] = byte;
    } else if (reg >= LINEAR_SCALAR && reg <= OFFSET_LAST) {
        chip->registers[reg] = byte;
    } else {
        chip->ignored_writes++;
    }
    chip->pointer = (uint8_t)((reg + 1) % HIL_FLOW_REGISTERS);
    return true;
}

static void count(hil_flow_chip_t *chip, const double *moved) {
    if (chip->written_us != 0 && chip->time_us - chip->written_us >= SAMPLE_us) {
        memcpy(chip->pose, chip->written, sizeof chip->pose);
        chip->written_us = 0;
    }
    const double seen = chip->faults.blind ? 0.0 : 1.0;
    hil_flow_add(chip, seen * moved[0], seen * moved[1], moved[2]);
}

const hil_flow_model_t hil_flow_otos = {
    .set_reset_values = set_reset_values, .show = show, .take = take, .count = count};
