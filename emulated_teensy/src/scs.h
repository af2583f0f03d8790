/* SPDX-License-Identifier: MIT */
/**
 * @file scs.h
 * System control space of the Cortex-M7 [V7M B3]: interrupt controller, system control block, SysTick, memory
 * protection unit, cycle counter. Register addresses 0xE0000000 to 0xE00FFFFF.
 */
#ifndef EMULATED_TEENSY_SCS_H
#define EMULATED_TEENSY_SCS_H

#include <stdbool.h>
#include <stdint.h>

enum { RT_IRQS = 160, RT_EXCEPTIONS = 16 + RT_IRQS, RT_MPU_REGIONS = 16, RT_NESTING = 32 };

typedef struct rt_mpu_region_t {
    uint32_t base;       /* RBAR, region number left out */
    uint32_t attributes; /* RASR */
} rt_mpu_region_t;

typedef struct rt_scs_t {
    bool line[RT_IRQS];          /* level of the peripheral's line */
    bool enabled[RT_EXCEPTIONS]; /* interrupts; always true for system exceptions */
    bool pending[RT_EXCEPTIONS];
    bool active[RT_EXCEPTIONS];
    uint8_t priority[RT_EXCEPTIONS];
    uint32_t vtor;
    uint32_t aircr_group; /* PRIGROUP */
    uint32_t shcsr;       /* enable bits of the fault exceptions */
    uint32_t ccr;
    uint32_t cpacr;
    uint32_t scr;
    uint32_t cfsr;
    uint32_t hfsr;
    uint32_t mmfar;
    uint32_t bfar;
    uint32_t demcr;
    uint32_t dwt_ctrl;
    uint64_t cyccnt_base; /* cycles since power-on when CYCCNT was 0 */
    uint32_t csselr;
    uint32_t systick_ctrl;
    uint32_t systick_reload;
    uint64_t systick_begin_ns; /* when the count was last reloaded */
    uint32_t mpu_ctrl;
    uint32_t mpu_number;
    rt_mpu_region_t mpu[RT_MPU_REGIONS];
    uint32_t storm_exception; /* taken again and again with nothing between */
    uint32_t storm_count;
    uint64_t storm_instructions; /* executed when the last handler ended */
    uint32_t fpccr;
} rt_scs_t;

#endif
