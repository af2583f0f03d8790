/* SPDX-License-Identifier: MIT */
/** @file gyro_models.h  What a model of a gyro's chip is made of. Not part of the API. */
#ifndef HIL_SIM_GYRO_MODELS_H
#define HIL_SIM_GYRO_MODELS_H

#include "hil_sim/gyro_chip.h"

typedef struct hil_gyro_model_t {
    uint8_t identity_reg; /* in bank 0 */
    /* Registers as after power-up; all are 0 before. */
    void (*set_reset_values)(hil_gyro_chip_t *chip);
    uint8_t (*bank)(const hil_gyro_chip_t *chip, uint8_t reg);
    /* A byte comes for this register. It may be written: the chip is not locked. @return false: it is ignored. */
    bool (*write)(hil_gyro_chip_t *chip, uint8_t bank, uint8_t reg, uint8_t value);
    /* Just before a byte of this register is given, and just after. */
    void (*before_read)(hil_gyro_chip_t *chip, uint8_t reg);
    void (*after_read)(hil_gyro_chip_t *chip, uint8_t bank, uint8_t reg);
    /* Register of the next byte. */
    uint8_t (*next)(const hil_gyro_chip_t *chip, uint8_t reg);
    /* The gyro is on and has started. */
    bool (*measures)(const hil_gyro_chip_t *chip);
    double (*rate_Hz)(const hil_gyro_chip_t *chip);
    double (*rad_s_per_step)(const hil_gyro_chip_t *chip);
    int32_t lowest; /* reading [steps]; the highest is 32767 */
    /* A reading stands in chip->sample. */
    void (*show)(hil_gyro_chip_t *chip);
    /* There is none. */
    void (*show_none)(hil_gyro_chip_t *chip);
} hil_gyro_model_t;

/* For models: one bank; nothing to do; the register behind; a reset. */
uint8_t hil_gyro_one_bank(const hil_gyro_chip_t *chip, uint8_t reg);
void hil_gyro_before_nothing(hil_gyro_chip_t *chip, uint8_t reg);
uint8_t hil_gyro_next_register(const hil_gyro_chip_t *chip, uint8_t reg);
void hil_gyro_reset_registers(hil_gyro_chip_t *chip);
/* Write `value` at reg and the one behind it, low byte first. */
void hil_gyro_put_low_first(hil_gyro_chip_t *chip, uint8_t reg, int16_t value);

#endif
