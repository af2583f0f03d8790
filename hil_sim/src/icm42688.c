/* SPDX-License-Identifier: MIT */
/*
 * Model of the gyro in an ICM-42688-P (TDK data sheet DS-000347): register banks, and the soft reset, which takes 1 ms.
 * After the gyro is switched on nothing may be written for 200 us, and it takes 30 ms to start. While it does not
 * measure, it says -32768 in each axis.
 */
#include <math.h>

#include "gyro_models.h"

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
    LOWEST = -32767 /* -32768 says that there is none */
};

static const double DEGREE_rad = 0.017453292519943295;

/* GYRO_ODR 1..15 [Hz]; 0: reserved, or a rate of the low-power mode. */
static const double RATES_Hz[16] = {0, 32000, 16000, 8000, 4000, 2000, 1000, 200, 100, 50, 25, 12.5, 0, 0, 0, 500};

static uint8_t bank_of(const hil_gyro_chip_t *chip, uint8_t reg) {
    return reg == REG_BANK_SEL ? 0 : chip->registers[0][REG_BANK_SEL] & BANK;
}

static bool gyro_on(const hil_gyro_chip_t *chip) {
    return (chip->registers[0][PWR_MGMT0] & GYRO_MODE) == GYRO_MODE;
}

static double rate(const hil_gyro_chip_t *chip) {
    return RATES_Hz[chip->registers[0][GYRO_CONFIG0] & 0xF];
}

static double step(const hil_gyro_chip_t *chip) {
    return ldexp(2000.0, -(chip->registers[0][GYRO_CONFIG0] >> 5)) * DEGREE_rad / 32768.0;
}

static void show_none(hil_gyro_chip_t *chip) {
    for (uint32_t reg = TEMP_DATA1; reg <= GYRO_DATA_Z0; reg++) {
        chip->registers[0][reg] = (reg - TEMP_DATA1) % 2 == 0 ? 0x80 : 0x00;
    }
}

static void show(hil_gyro_chip_t *chip) {
    for (uint32_t axis = 0; axis < HIL_GYRO_AXES; axis++) {
        chip->registers[0][GYRO_DATA_X1 + 2 * axis] = (uint8_t)((uint16_t)chip->sample[axis] >> 8);
        chip->registers[0][GYRO_DATA_X1 + 2 * axis + 1] = (uint8_t)((uint16_t)chip->sample[axis] & 0xFF);
    }
    chip->registers[0][INT_STATUS] |= DATA_READY;
}

static void set_reset_values(hil_gyro_chip_t *chip) {
    show_none(chip);
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
}

static bool read_only(uint8_t bank, uint8_t reg) {
    return bank == 0 && ((reg >= TEMP_DATA1 && reg <= INT_STATUS) || reg == WHO_AM_I);
}

static void write_power(hil_gyro_chip_t *chip, uint8_t value) {
    const bool was_on = gyro_on(chip);
    chip->registers[0][PWR_MGMT0] = value;
    if (gyro_on(chip) && !was_on) {
        chip->locked_until_us = chip->time_us + LOCKED_us;
        chip->starts_until_us = chip->time_us + START_us;
    }
}

static bool write(hil_gyro_chip_t *chip, uint8_t bank, uint8_t reg, uint8_t value) {
    if (read_only(bank, reg)) {
        return false;
    }
    if (bank == 0 && reg == DEVICE_CONFIG && (value & SOFT_RESET) != 0) {
        hil_gyro_reset_registers(chip);
        chip->reset_until_us = chip->time_us + RESET_us;
    } else if (bank == 0 && reg == PWR_MGMT0) {
        write_power(chip, value);
    } else {
        chip->registers[bank][reg] = value;
    }
    return true;
}

/* Read to clear. */
static void after_read(hil_gyro_chip_t *chip, uint8_t bank, uint8_t reg) {
    if (bank == 0 && reg == INT_STATUS) {
        chip->registers[0][INT_STATUS] = 0;
    }
}

const hil_gyro_model_t hil_gyro_icm42688 = {
    .identity_reg = WHO_AM_I,
    .set_reset_values = set_reset_values,
    .bank = bank_of,
    .write = write,
    .before_read = hil_gyro_before_nothing,
    .after_read = after_read,
    .next = hil_gyro_next_register,
    .measures = gyro_on,
    .rate_Hz = rate,
    .rad_s_per_step = step,
    .lowest = LOWEST,
    .show = show,
    .show_none = show_none,
};
