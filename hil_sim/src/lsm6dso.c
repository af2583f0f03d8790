/* SPDX-License-Identifier: MIT */
/*
 * Model of the gyro in an LSM6DSO (ST data sheet DS12140) or ISM330DHCX (DS13012). The reset takes 50 us. The gyro
 * starts 70 ms after its data rate was set. With BDU an axis's reading stands still between its two bytes. Without it
 * both change at any time. Without IF_INC the register stays the same from byte to byte. A reading that was not read
 * yet shows as GDA.
 */
#include "gyro_models.h"

enum {
    WHO_AM_I = 0x0F,
    CTRL2_G = 0x11,
    CTRL3_C = 0x12,
    CTRL9_XL = 0x18,
    STATUS_REG = 0x1E,
    OUTX_L_G = 0x22,
    OUTZ_H_A = 0x2D,

    LSM6DSO = 0x6C,
    ISM330DHCX = 0x6B,
    SW_RESET = 0x01,
    IF_INC = 0x04,
    BDU = 0x40,
    GDA = 0x02,

    RESET_us = 50,
    START_us = 70000,
    LOWEST = -32768
};

static const double MDPS_rad_s = 1.7453292519943295e-5;

/* ODR_G 0..15 [Hz]; 0: off, or reserved. */
static const double RATES_Hz[16] = {0, 12.5, 26, 52, 104, 208, 416, 833, 1667, 3333, 6667};
/* FS_G [mdps per step]: 250, 500, 1000, 2000 dps; then the bit for 125 dps. */
static const double STEPS_mdps[4] = {8.75, 17.5, 35.0, 70.0};

static bool measures(const hil_gyro_chip_t *chip) {
    return chip->registers[0][CTRL2_G] >> 4 != 0;
}

static double rate(const hil_gyro_chip_t *chip) {
    return RATES_Hz[chip->registers[0][CTRL2_G] >> 4];
}

static double step(const hil_gyro_chip_t *chip) {
    const uint8_t value = chip->registers[0][CTRL2_G];
    return ((value & 0x02) != 0 ? 4.375 : STEPS_mdps[value >> 2 & 3]) * MDPS_rad_s;
}

static void show(hil_gyro_chip_t *chip) {
    const bool block = (chip->registers[0][CTRL3_C] & BDU) != 0;
    for (uint32_t axis = 0; axis < HIL_GYRO_AXES; axis++) {
        if (!block || (chip->held >> axis & 1) == 0) {
            hil_gyro_put_low_first(chip, (uint8_t)(OUTX_L_G + 2 * axis), chip->sample[axis]);
        }
    }
    chip->registers[0][STATUS_REG] |= GDA;
}

/* The last reading stays. */
static void show_none(hil_gyro_chip_t *chip) {
    chip->registers[0][STATUS_REG] &= (uint8_t)~GDA;
}

static void reset_values(hil_gyro_chip_t *chip, uint8_t identity) {
    chip->registers[0][WHO_AM_I] = identity;
    chip->registers[0][CTRL3_C] = IF_INC;
    chip->registers[0][CTRL9_XL] = 0xE0;
}

static void reset_lsm6dso(hil_gyro_chip_t *chip) {
    reset_values(chip, LSM6DSO);
}

static void reset_ism330dhcx(hil_gyro_chip_t *chip) {
    reset_values(chip, ISM330DHCX);
}

static bool write(hil_gyro_chip_t *chip, uint8_t bank, uint8_t reg, uint8_t value) {
    const bool was_on = measures(chip);
    if (reg == WHO_AM_I || (reg >= STATUS_REG && reg <= OUTZ_H_A)) {
        return false;
    }
    if (reg == CTRL3_C && (value & SW_RESET) != 0) {
        hil_gyro_reset_registers(chip);
        chip->reset_until_us = chip->time_us + RESET_us;
        return true;
    }
    chip->registers[bank][reg] = value;
    if (reg == CTRL2_G && measures(chip) && !was_on) {
        chip->starts_until_us = chip->time_us + START_us;
    }
    return true;
}

static void after_read(hil_gyro_chip_t *chip, uint8_t bank, uint8_t reg) {
    (void)bank;
    if (reg < OUTX_L_G || reg >= OUTX_L_G + 2 * HIL_GYRO_AXES) {
        return;
    }
    chip->held ^= (uint8_t)(1u << ((reg - OUTX_L_G) / 2));
    chip->registers[0][STATUS_REG] &= (uint8_t)~GDA;
}

static uint8_t next(const hil_gyro_chip_t *chip, uint8_t reg) {
    return (chip->registers[0][CTRL3_C] & IF_INC) != 0 ? hil_gyro_next_register(chip, reg) : reg;
}

#define ST_MODEL(reset)                                                                                                \
    {                                                                                                                  \
        .identity_reg = WHO_AM_I, .set_reset_values = (reset), .bank = hil_gyro_one_bank, .write = write,              \
        .before_read = hil_gyro_before_nothing, .after_read = after_read, .next = next, .measures = measures,          \
        .rate_Hz = rate, .rad_s_per_step = step, .lowest = LOWEST, .show = show, .show_none = show_none,               \
    }

const hil_gyro_model_t hil_gyro_lsm6dso = ST_MODEL(reset_lsm6dso);
const hil_gyro_model_t hil_gyro_ism330dhcx = ST_MODEL(reset_ism330dhcx);
