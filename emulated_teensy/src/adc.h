/* SPDX-License-Identifier: MIT */
/**
 * @file adc.h
 * Analog-digital converters ADC1 and ADC2 (i.MX RT1060 RM, chapter ADC), started by software: calibration, HC0, HS,
 * R0, averaging. Hardware triggers, interrupts, compare functions and continuous conversion are not modelled.
 */
#ifndef EMULATED_TEENSY_ADC_H
#define EMULATED_TEENSY_ADC_H

#include <stdbool.h>
#include <stdint.h>

enum { RT_ADCS = 2 };

typedef struct rt_adc_t {
    uint32_t channel; /* HC0 */
    uint32_t config;  /* CFG */
    uint32_t general; /* GC without CAL */
    bool converting;  /* until ready_ns */
    bool complete;    /* COCO0 */
    uint64_t ready_ns;
    uint64_t calibrated_ns; /* when the calibration under way ends */
    uint32_t sampled;       /* result of the conversion under way */
    uint32_t result;        /* R0 */
} rt_adc_t;

#endif
