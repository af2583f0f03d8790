/* SPDX-License-Identifier: MIT */
/** @file flow_models.h  What is special to each sensor of motion over the floor; flow_pins.c does the rest. */
#ifndef HIL_SIM_FLOW_MODELS_H
#define HIL_SIM_FLOW_MODELS_H

#include "hil_sim/flow_chip.h"

typedef struct hil_flow_model_t {
    void (*set_reset_values)(hil_flow_chip_t *chip);
    /** Put what a read from `reg` gives into chip->given. */
    void (*show)(hil_flow_chip_t *chip, uint8_t reg);
    /** A byte is written; the register is chip->pointer, the bytes before are in chip->taken. @return acknowledged. */
    bool (*take)(hil_flow_chip_t *chip, uint8_t byte);
    /** Add a way and a turn to its pose. */
    void (*count)(hil_flow_chip_t *chip, const double *moved);
} hil_flow_model_t;

/** Add a way in axes of mid-way, and a turn. */
void hil_flow_add(hil_flow_chip_t *chip, double x, double y, double turn);

extern const hil_flow_model_t hil_flow_otos;
extern const hil_flow_model_t hil_flow_pinpoint;

#endif
