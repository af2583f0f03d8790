/* SPDX-License-Identifier: MIT */
/**
 * @file gpr.h
 * IOMUXC_GPR (i.MX RT1060 RM, chapter IOMUXC GPR): GPR6 directions of the crossbar's pads. GPR14, 16, 17 partition of
 * the FlexRAM. GPR26..29 which of two GPIO modules a pad belongs to.
 */
#ifndef EMULATED_TEENSY_GPR_H
#define EMULATED_TEENSY_GPR_H

#include <stdint.h>

enum { RT_GPRS = 35 };

typedef struct rt_gpr_t {
    uint32_t value[RT_GPRS];
} rt_gpr_t;

#endif
