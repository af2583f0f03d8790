/* SPDX-License-Identifier: MIT */
/*
 * Model of the gyro in a BMI270 (Bosch data sheet BST-BMI270-DS000). The soft reset takes 2 ms. Then it saves power:
 * most registers cannot be written, and after a write nothing may be written for 450 us. The configuration file goes to
 * INIT_DATA, at the place that INIT_ADDR names, in words of two bytes. INIT_CTRL is then set to 1. After 20 ms
 * INTERNAL_STATUS says whether all 8192 bytes have come. Only then does the gyro start, 45 ms after it was switched on.
 * The six bytes of a reading belong together.
 *
 * Not known from the data sheet: what it says of a file with wrong bytes. The model does not look at them.
 */
#include <string.h>

#include "gyro_models.h"

enum {
    CHIP_ID = 0x00,
    STATUS = 0x03,
    GYR_X_LSB = 0x12,
    GYR_Z_MSB = 0x17,
    INTERNAL_STATUS = 0x21,
    LAST_READ_ONLY = 0x2E,
    ACC_CONF = 0x40,
    ACC_RANGE = 0x41,
    GYR_CONF = 0x42,
    GYR_RANGE = 0x43,
    INIT_CTRL = 0x59,
    INIT_ADDR_0 = 0x5B,
    INIT_ADDR_1 = 0x5C,
    INIT_DATA = 0x5E,
    PWR_CONF = 0x7C,
    PWR_CTRL = 0x7D,
    CMD = 0x7E,

    IDENTITY = 0x24,
    DRDY_GYR = 0x40,
    GYR_EN = 0x02,
    SAVES_POWER = 0x01,
    SOFT_RESET = 0xB6,
    INIT_OK = 0x01,
    INIT_ERROR = 0x02,
    LOADS = 1,

    RESET_us = 2000,
    SLOW_us = 450,
    LOAD_us = 20000,
    START_us = 45000,
    LOWEST = -32768
};

static const double DEGREE_rad = 0.017453292519943295;

static bool saves_power(const hil_gyro_chip_t *chip) {
    return (chip->registers[0][PWR_CONF] & SAVES_POWER) != 0;
}

static bool gyro_on(const hil_gyro_chip_t *chip) {
    return (chip->registers[0][PWR_CTRL] & GYR_EN) != 0 && chip->registers[0][INTERNAL_STATUS] == INIT_OK;
}

/* gyr_odr 6..13: 25 Hz to 3.2 kHz. */
static double rate(const hil_gyro_chip_t *chip) {
    const uint32_t odr = chip->registers[0][GYR_CONF] & 0xF;
    return odr < 6 || odr > 13 ? 0.0 : 25.0 * (double)(1u << (odr - 6));
}

static double step(const hil_gyro_chip_t *chip) {
    return 2000.0 / (double)(1u << (chip->registers[0][GYR_RANGE] & 0x7)) * DEGREE_rad / 32768.0;
}

static bool whole(const hil_gyro_chip_t *chip) {
    for (uint32_t i = 0; i < sizeof chip->uploaded; i++) {
        if (chip->uploaded[i] != 0xFF) {
            return false;
        }
    }
    return true;
}

static void end_load(hil_gyro_chip_t *chip) {
    if (chip->loads_until_us != 0 && chip->time_us >= chip->loads_until_us) {
        chip->registers[0][INTERNAL_STATUS] = whole(chip) && !chip->faults.refuses ? INIT_OK : INIT_ERROR;
        chip->loads_until_us = 0;
    }
}

static void show(hil_gyro_chip_t *chip) {
    chip->registers[0][STATUS] |= DRDY_GYR;
}

static void show_none(hil_gyro_chip_t *chip) {
    chip->registers[0][STATUS] &= (uint8_t)~DRDY_GYR;
}

static void set_reset_values(hil_gyro_chip_t *chip) {
    chip->registers[0][CHIP_ID] = IDENTITY;
    chip->registers[0][STATUS] = 0x10;
    chip->registers[0][ACC_CONF] = 0xA8;
    chip->registers[0][ACC_RANGE] = 0x02;
    chip->registers[0][GYR_CONF] = 0xA9;
    chip->registers[0][PWR_CONF] = 0x03;
}

static void begin_load(hil_gyro_chip_t *chip, uint8_t value) {
    if (value == LOADS) {
        chip->loads_until_us = chip->time_us + LOAD_us;
    } else {
        chip->registers[0][INTERNAL_STATUS] = 0;
        memset(chip->uploaded, 0, sizeof chip->uploaded);
    }
}

/* INIT_ADDR is the place of the burst's first byte; it goes on by itself. */
static void take_data(hil_gyro_chip_t *chip, uint8_t value) {
    const uint32_t word = (chip->registers[0][INIT_ADDR_0] & 0xFu) | (uint32_t)chip->registers[0][INIT_ADDR_1] << 4;
    const uint32_t place = 2 * word + chip->held;
    if (place < HIL_GYRO_UPLOAD && chip->registers[0][INIT_CTRL] != LOADS) {
        chip->upload[place] = value;
        chip->uploaded[place / 8] |= (uint8_t)(1u << place % 8);
    }
    chip->held ^= 1;
    if (chip->held == 0) {
        chip->registers[0][INIT_ADDR_0] = (uint8_t)((word + 1) & 0xF);
        chip->registers[0][INIT_ADDR_1] = (uint8_t)((word + 1) >> 4);
    }
}

static void write_power(hil_gyro_chip_t *chip, uint8_t value) {
    const bool was_on = gyro_on(chip);
    chip->registers[0][PWR_CTRL] = value;
    if (gyro_on(chip) && !was_on) {
        chip->starts_until_us = chip->time_us + START_us;
    }
}

static bool write(hil_gyro_chip_t *chip, uint8_t bank, uint8_t reg, uint8_t value) {
    const bool slow = saves_power(chip);
    if (reg <= LAST_READ_ONLY || reg >= HIL_GYRO_REGISTERS || (slow && reg != PWR_CONF && reg != CMD)) {
        return false;
    }
    if (reg == CMD) {
        if (value == SOFT_RESET) {
            hil_gyro_reset_registers(chip);
            chip->reset_until_us = chip->time_us + RESET_us;
        }
        return true;
    }
    if (reg == INIT_DATA) {
        take_data(chip, value);
    } else if (reg == PWR_CTRL) {
        write_power(chip, value);
    } else {
        chip->registers[bank][reg] = value;
    }
    if (reg == INIT_ADDR_0 || reg == INIT_ADDR_1) {
        chip->held = 0;
    } else if (reg == INIT_CTRL) {
        begin_load(chip, value);
    }
    if (slow) {
        chip->locked_until_us = chip->time_us + SLOW_us;
    }
    return true;
}

/* A burst that begins with the first byte of a reading gets the newest one. */
static void before_read(hil_gyro_chip_t *chip, uint8_t reg) {
    end_load(chip);
    if (reg == GYR_X_LSB) {
        for (uint32_t axis = 0; axis < HIL_GYRO_AXES; axis++) {
            hil_gyro_put_low_first(chip, (uint8_t)(GYR_X_LSB + 2 * axis), chip->sample[axis]);
        }
    }
}

static void after_read(hil_gyro_chip_t *chip, uint8_t bank, uint8_t reg) {
    (void)bank;
    if (reg >= GYR_X_LSB && reg <= GYR_Z_MSB) {
        chip->registers[0][STATUS] &= (uint8_t)~DRDY_GYR;
    }
}

static uint8_t next(const hil_gyro_chip_t *chip, uint8_t reg) {
    return reg == INIT_DATA ? reg : hil_gyro_next_register(chip, reg);
}

const hil_gyro_model_t hil_gyro_bmi270 = {
    .identity_reg = CHIP_ID,
    .set_reset_values = set_reset_values,
    .bank = hil_gyro_one_bank,
    .write = write,
    .before_read = before_read,
    .after_read = after_read,
    .next = next,
    .measures = gyro_on,
    .rate_Hz = rate,
    .rad_s_per_step = step,
    .lowest = LOWEST,
    .show = show,
    .show_none = show_none,
};
