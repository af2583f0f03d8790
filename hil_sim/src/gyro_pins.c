/* SPDX-License-Identifier: MIT */
#include "hil_sim/gyro_chip.h"

#include <math.h>
#include <string.h>

#include "gyro_models.h"
#include "hil_sim/random.h"

enum { HIGHEST = 32767, BIT_ERROR_STREAM = 60 };

extern const hil_gyro_model_t hil_gyro_icm42688;
extern const hil_gyro_model_t hil_gyro_lsm6dso;
extern const hil_gyro_model_t hil_gyro_ism330dhcx;
extern const hil_gyro_model_t hil_gyro_bmi270;

static const hil_gyro_model_t *const MODELS[HIL_GYRO_KINDS] = {
    [HIL_GYRO_ICM42688] = &hil_gyro_icm42688,
    [HIL_GYRO_LSM6DSO] = &hil_gyro_lsm6dso,
    [HIL_GYRO_ISM330DHCX] = &hil_gyro_ism330dhcx,
    [HIL_GYRO_BMI270] = &hil_gyro_bmi270,
};

static const hil_gyro_model_t *model_of(const hil_gyro_chip_t *chip) {
    return MODELS[chip->kind < HIL_GYRO_KINDS ? chip->kind : 0];
}

uint8_t hil_gyro_one_bank(const hil_gyro_chip_t *chip, uint8_t reg) {
    (void)chip;
    (void)reg;
    return 0;
}

void hil_gyro_before_nothing(hil_gyro_chip_t *chip, uint8_t reg) {
    (void)chip;
    (void)reg;
}

uint8_t hil_gyro_next_register(const hil_gyro_chip_t *chip, uint8_t reg) {
    (void)chip;
    return (uint8_t)((reg + 1) % HIL_GYRO_REGISTERS);
}

void hil_gyro_put_low_first(hil_gyro_chip_t *chip, uint8_t reg, int16_t value) {
    chip->registers[0][reg] = (uint8_t)((uint16_t)value & 0xFF);
    chip->registers[0][reg + 1] = (uint8_t)((uint16_t)value >> 8);
}

void hil_gyro_reset_registers(hil_gyro_chip_t *chip) {
    memset(chip->registers, 0, sizeof chip->registers);
    memset(chip->sample, 0, sizeof chip->sample);
    memset(chip->upload, 0, sizeof chip->upload);
    memset(chip->uploaded, 0, sizeof chip->uploaded);
    chip->talk = HIL_GYRO_SILENT;
    chip->pointer = 0;
    chip->held = 0;
    chip->locked_until_us = 0;
    chip->starts_until_us = 0;
    chip->loads_until_us = 0;
    model_of(chip)->set_reset_values(chip);
}

void hil_gyro_chip_reset(hil_gyro_chip_t *chip, uint8_t kind, uint8_t address) {
    chip->kind = kind;
    chip->address = address;
    chip->reset_until_us = 0;
    hil_gyro_reset_registers(chip);
}

static void take_sample(hil_gyro_chip_t *chip, const double *rad_s) {
    const hil_gyro_model_t *model = model_of(chip);
    for (uint32_t axis = 0; axis < HIL_GYRO_AXES; axis++) {
        const double steps = rint(rad_s[axis] / model->rad_s_per_step(chip));
        const double limited = fmax(fmin(steps, HIGHEST), model->lowest);
        chip->sample[axis] = isnan(limited) ? 0 : (int16_t)limited;
    }
}

void hil_gyro_chip_sense(hil_gyro_chip_t *chip, uint64_t time_us, const double *rad_s) {
    const hil_gyro_model_t *model = model_of(chip);
    const double rate_Hz = model->rate_Hz(chip);
    chip->time_us = time_us;
    if (!model->measures(chip) || chip->faults.silent || time_us < chip->starts_until_us || rate_Hz == 0.0) {
        model->show_none(chip);
        chip->next_sample_us = time_us;
        return;
    }
    if (time_us < chip->next_sample_us) {
        return;
    }
    if (!chip->faults.stuck) {
        take_sample(chip, rad_s);
    }
    model->show(chip);
    chip->next_sample_us = time_us + (uint64_t)(1e6 / rate_Hz);
}

static bool present(const hil_gyro_chip_t *chip) {
    return !chip->faults.absent && chip->time_us >= chip->reset_until_us;
}

bool hil_gyro_chip_start(hil_gyro_chip_t *chip, uint8_t address, bool read) {
    const bool own = present(chip) && address == chip->address;
    chip->talk = !own ? HIL_GYRO_SILENT : read ? HIL_GYRO_READ : HIL_GYRO_ADDRESSED;
    return own;
}

static void write_register(hil_gyro_chip_t *chip, uint8_t value) {
    const hil_gyro_model_t *model = model_of(chip);
    const uint8_t reg = chip->pointer;
    const uint8_t bank = model->bank(chip, reg);
    if (chip->time_us < chip->locked_until_us || bank >= HIL_GYRO_BANKS || !model->write(chip, bank, reg, value)) {
        chip->ignored_writes++;
    }
}

bool hil_gyro_chip_put(hil_gyro_chip_t *chip, uint8_t byte) {
    if (chip->talk == HIL_GYRO_ADDRESSED) {
        chip->pointer = byte % HIL_GYRO_REGISTERS;
        chip->talk = HIL_GYRO_WRITTEN;
        return true;
    }
    if (chip->talk == HIL_GYRO_WRITTEN) {
        const uint8_t reg = chip->pointer;
        write_register(chip, byte);
        if (chip->talk == HIL_GYRO_WRITTEN) { /* not reset */
            chip->pointer = model_of(chip)->next(chip, reg);
        }
        return true;
    }
    return false;
}

/* One bit of some bytes is wrong. */
static uint8_t on_the_wire(hil_gyro_chip_t *chip, uint8_t byte) {
    const uint64_t number = chip->bytes_given++;
    if (chip->faults.bit_errors <= 0.0) {
        return byte;
    }
    const double drawn = hil_uniform(chip->faults.seed, BIT_ERROR_STREAM, number) / chip->faults.bit_errors;
    const uint32_t wrong = drawn < 1.0 ? 1u << (uint32_t)(drawn * 8.0) : 0u;
    return (uint8_t)(byte ^ wrong);
}

uint8_t hil_gyro_chip_get(hil_gyro_chip_t *chip) {
    if (chip->talk != HIL_GYRO_READ) {
        return 0xFF;
    }
    const hil_gyro_model_t *model = model_of(chip);
    const uint8_t reg = chip->pointer;
    const uint8_t bank = model->bank(chip, reg);
    model->before_read(chip, reg);
    uint8_t byte = bank < HIL_GYRO_BANKS ? chip->registers[bank][reg] : 0;
    if (bank == 0 && reg == model->identity_reg && chip->faults.other_id != 0) {
        byte = chip->faults.other_id;
    }
    model->after_read(chip, bank, reg);
    chip->pointer = model->next(chip, reg);
    return on_the_wire(chip, byte);
}

void hil_gyro_chip_stop(hil_gyro_chip_t *chip) {
    chip->talk = HIL_GYRO_SILENT;
}
