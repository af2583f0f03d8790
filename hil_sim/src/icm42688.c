/* SPDX-License-Identifier: MIT */
#include "hil_sim/icm42688.h"

#include <math.h>
#include <string.h>

#include "hil_sim/random.h"

enum {
    /* bank 0 */
    DEVICE_CONFIG = 0x11,
    TEMP_DATA1 = 0x1D,
    GYRO_DATA_X1 = 0x25,
    GYRO_DATA_Z0 = 0x2A,
    INT_STATUS = 0x2D,
    INTF_CONFIG1 = 0x4D,
    PWR_MGMT0 = 0x4E,
    GYRO_CONFIG0 = 0x4F,
    ACCEL_CONFIG0 = 0x50,
    GYRO_CONFIG1 = 0x51,
    GYRO_ACCEL_CONFIG0 = 0x52,
    WHO_AM_I = 0x75,
    REG_BANK_SEL = 0x76, /* the same one in every bank */
    /* bank 1 */
    GYRO_CONFIG_STATIC2 = 0x0B,
    GYRO_CONFIG_STATIC3 = 0x0C,
    GYRO_CONFIG_STATIC4 = 0x0D,
    GYRO_CONFIG_STATIC5 = 0x0E,

    IDENTITY = 0x47,
    SOFT_RESET = 0x01,
    RESET_DONE = 0x10,
    DATA_READY = 0x08,
    GYRO_MODE = 0x0C, /* of PWR_MGMT0; both bits: low noise */
    BANK = 0x07,

    RESET_us = 1000,
    LOCKED_us = 200,
    START_us = 30000,
    HIGHEST = 32767,
    BIT_ERROR_STREAM = 60
};

static const double DEGREE_rad = 0.017453292519943295;

/* GYRO_ODR 1..15 [Hz]; 0: reserved, or a rate of the low-power mode. */
static const double RATES_Hz[16] = {0, 32000, 16000, 8000, 4000, 2000, 1000, 200, 100, 50, 25, 12.5, 0, 0, 0, 500};

static uint8_t bank(const hil_icm42688_t *chip) {
    return chip->registers[0][REG_BANK_SEL] & BANK;
}

static bool gyro_on(const hil_icm42688_t *chip) {
    return (chip->registers[0][PWR_MGMT0] & GYRO_MODE) == GYRO_MODE;
}

/* 0x8000 in every axis: no reading. */
static void clear_readings(hil_icm42688_t *chip) {
    for (uint32_t reg = TEMP_DATA1; reg <= GYRO_DATA_Z0; reg++) {
        chip->registers[0][reg] = (reg - TEMP_DATA1) % 2 == 0 ? 0x80 : 0x00;
    }
}

static void set_reset_values(hil_icm42688_t *chip) {
    memset(chip->registers, 0, sizeof chip->registers);
    clear_readings(chip);
    chip->registers[0][INT_STATUS] = RESET_DONE;
    chip->registers[0][INTF_CONFIG1] = 0x91;
    chip->registers[0][GYRO_CONFIG0] = 0x06;
    chip->registers[0][ACCEL_CONFIG0] = 0x06;
    chip->registers[0][GYRO_CONFIG1] = 0x16;
    chip->registers[0][GYRO_ACCEL_CONFIG0] = 0x11;
    chip->registers[0][WHO_AM_I] = IDENTITY;
    chip->registers[1][GYRO_CONFIG_STATIC2] = 0xA0;
    chip->registers[1][GYRO_CONFIG_STATIC3] = 0x0D;
    chip->registers[1][GYRO_CONFIG_STATIC4] = 0xAA;
    chip->registers[1][GYRO_CONFIG_STATIC5] = 0x80;
    chip->talk = HIL_ICM42688_SILENT;
    chip->pointer = 0;
    chip->locked_until_us = 0;
    chip->starts_until_us = 0;
}

void hil_icm42688_reset(hil_icm42688_t *chip, uint8_t address) {
    chip->address = address;
    chip->reset_until_us = 0;
    set_reset_values(chip);
}

double hil_icm42688_range_rad_s(const hil_icm42688_t *chip) {
    return ldexp(2000.0, -(chip->registers[0][GYRO_CONFIG0] >> 5)) * DEGREE_rad;
}

static void write_reading(hil_icm42688_t *chip, uint32_t axis, double rad_s) {
    const double steps = rint(rad_s / hil_icm42688_range_rad_s(chip) * (HIGHEST + 1));
    const double limited = fmax(fmin(steps, HIGHEST), -HIGHEST); /* -32768 says that there is none */
    const int32_t value = isnan(limited) ? 0 : (int32_t)limited;
    chip->registers[0][GYRO_DATA_X1 + 2 * axis] = (uint8_t)((uint32_t)value >> 8 & 0xFF);
    chip->registers[0][GYRO_DATA_X1 + 2 * axis + 1] = (uint8_t)((uint32_t)value & 0xFF);
}

void hil_icm42688_sense(hil_icm42688_t *chip, uint64_t time_us, const double *rad_s) {
    const double rate_Hz = RATES_Hz[chip->registers[0][GYRO_CONFIG0] & 0xF];
    chip->time_us = time_us;
    if (!gyro_on(chip) || chip->faults.silent || time_us < chip->starts_until_us || rate_Hz == 0.0) {
        clear_readings(chip);
        chip->next_sample_us = time_us;
        return;
    }
    if (time_us < chip->next_sample_us || chip->faults.stuck) {
        return;
    }
    for (uint32_t axis = 0; axis < HIL_ICM42688_AXES; axis++) {
        write_reading(chip, axis, rad_s[axis]);
    }
    chip->registers[0][INT_STATUS] |= DATA_READY;
    chip->next_sample_us = time_us + (uint64_t)(1e6 / rate_Hz);
}

static bool present(const hil_icm42688_t *chip) {
    return !chip->faults.absent && chip->time_us >= chip->reset_until_us;
}

bool hil_icm42688_start(hil_icm42688_t *chip, uint8_t address, bool read) {
    const bool own = present(chip) && address == chip->address;
    chip->talk = !own ? HIL_ICM42688_SILENT : read ? HIL_ICM42688_READ : HIL_ICM42688_ADDRESSED;
    return own;
}

static bool read_only(uint8_t in_bank, uint8_t reg) {
    return in_bank == 0 && ((reg >= TEMP_DATA1 && reg <= INT_STATUS) || reg == WHO_AM_I);
}

static void write_power(hil_icm42688_t *chip, uint8_t value) {
    const bool was_on = gyro_on(chip);
    chip->registers[0][PWR_MGMT0] = value;
    if (gyro_on(chip) && !was_on) {
        chip->locked_until_us = chip->time_us + LOCKED_us;
        chip->starts_until_us = chip->time_us + START_us;
    }
}

static void write_register(hil_icm42688_t *chip, uint8_t value) {
    const uint8_t reg = chip->pointer;
    const uint8_t in_bank = reg == REG_BANK_SEL ? 0 : bank(chip);
    if (read_only(in_bank, reg) || in_bank >= HIL_ICM42688_BANKS || chip->time_us < chip->locked_until_us) {
        chip->ignored_writes++;
    } else if (in_bank == 0 && reg == DEVICE_CONFIG && (value & SOFT_RESET) != 0) {
        set_reset_values(chip);
        chip->reset_until_us = chip->time_us + RESET_us;
    } else if (in_bank == 0 && reg == PWR_MGMT0) {
        write_power(chip, value);
    } else {
        chip->registers[in_bank][reg] = value;
    }
}

static void advance(hil_icm42688_t *chip) {
    chip->pointer = (uint8_t)((chip->pointer + 1) % HIL_ICM42688_REGISTERS);
}

bool hil_icm42688_put(hil_icm42688_t *chip, uint8_t byte) {
    if (chip->talk == HIL_ICM42688_ADDRESSED) {
        chip->pointer = byte % HIL_ICM42688_REGISTERS;
        chip->talk = HIL_ICM42688_WRITTEN;
        return true;
    }
    if (chip->talk == HIL_ICM42688_WRITTEN) {
        write_register(chip, byte);
        advance(chip);
        return true;
    }
    return false;
}

/* One bit of some bytes is wrong. */
static uint8_t on_the_wire(hil_icm42688_t *chip, uint8_t byte) {
    const uint64_t number = chip->bytes_given++;
    if (chip->faults.bit_errors <= 0.0) {
        return byte;
    }
    const double drawn = hil_uniform(chip->faults.seed, BIT_ERROR_STREAM, number) / chip->faults.bit_errors;
    const uint32_t wrong = drawn < 1.0 ? 1u << (uint32_t)(drawn * 8.0) : 0u;
    return (uint8_t)(byte ^ wrong);
}

uint8_t hil_icm42688_get(hil_icm42688_t *chip) {
    if (chip->talk != HIL_ICM42688_READ) {
        return 0xFF;
    }
    const uint8_t reg = chip->pointer;
    const uint8_t in_bank = reg == REG_BANK_SEL ? 0 : bank(chip);
    uint8_t byte = in_bank < HIL_ICM42688_BANKS ? chip->registers[in_bank][reg] : 0;
    if (in_bank == 0 && reg == WHO_AM_I && chip->faults.other_id != 0) {
        byte = chip->faults.other_id;
    } else if (in_bank == 0 && reg == INT_STATUS) {
        chip->registers[0][INT_STATUS] = 0; /* read to clear */
    }
    advance(chip);
    return on_the_wire(chip, byte);
}

void hil_icm42688_stop(hil_icm42688_t *chip) {
    chip->talk = HIL_ICM42688_SILENT;
}
