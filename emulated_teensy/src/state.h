/* SPDX-License-Identifier: MIT */
/**
 * @file state.h
 * Everything of the machine that changes, memories and processor registers apart: plain data without pointers, copied
 * whole by a snapshot. A peripheral brings a header with its part and a line in rt_state_t.
 */
#ifndef EMULATED_TEENSY_STATE_H
#define EMULATED_TEENSY_STATE_H

#include "emulated_teensy/rt1062.h"

#include "adc.h"
#include "analog.h"
#include "clocks.h"
#include "flexspi.h"
#include "gpio.h"
#include "gpr.h"
#include "i2c_chip.h"
#include "lpi2c.h"
#include "lpuart.h"
#include "nor.h"
#include "pads.h"
#include "pins.h"
#include "pit.h"
#include "pwm.h"
#include "scs.h"
#include "snvs.h"
#include "src.h"
#include "usb.h"
#include "watchdog.h"
#include "xbar.h"

/* Deadlines: who has one. */
typedef enum rt_event_t {
    RT_EVENT_SYSTICK = 0,
    RT_EVENT_PIT0,
    RT_EVENT_PIT1,
    RT_EVENT_PIT2,
    RT_EVENT_PIT3,
    RT_EVENT_I2C,
    RT_EVENT_UART_SEND,
    RT_EVENT_UART_RECEIVE,
    RT_EVENT_USB,
    RT_EVENT_FLASH,
    RT_EVENT_WATCHDOG,
    RT_EVENT_CIRCUIT, /* the circuit's next step */
    RT_EVENT_ENCODER, /* the next edge of an encoder */
    RT_EVENT_NOISE,   /* the next edge of a loose wire's noise */
    RT_EVENT_COUNT
} rt_event_t;

/* Bits of SRC_SRSR [RM 21.8.3]. */
enum {
    RT_RESET_POWER = 1 << 0,  /* IPP_RESET_B: power-on here */
    RT_RESET_LOCKUP = 1 << 1, /* LOCKUP_SYSRESETREQ: program's request or lock-up */
    RT_RESET_WDOG12 = 1 << 4, /* WDOG_RST_B */
    RT_RESET_WDOG3 = 1 << 7,  /* WDOG3_RST_B */
    RT_RESET_HOT = 1 << 8     /* TEMPSENSE_RST_B */
};

enum { RT_BLOCKS = 1 << 15, RT_BREAKS = 8 };

/* A basic block met before. */
typedef struct rt_block_t {
    uint32_t address;
    uint16_t size;
    uint16_t instructions;
} rt_block_t;

typedef struct rt_state_t {
    uint64_t now_ns; /* when the processor last looked up */
    uint64_t instructions;
    uint64_t deadline_ns[RT_EVENT_COUNT];
    uint32_t reset_flags;  /* RT_RESET_...: of the last reset */
    uint32_t reset_wanted; /* RT_RESET_...: of the one asked for */
    uint32_t ipsr;         /* number of the exception under way, 0: none */
    uint32_t itcm_size;    /* bytes, as the FlexRAM is partitioned */
    uint32_t dtcm_size;
    bool powered;
    bool sleeping;            /* WFI */
    bool locked_up;           /* a fault within the fault handler: only a reset helps [V7M B1.5.15] */
    uint32_t fault_exception; /* 3..6: to be taken before the next instruction, at fault_pc */
    uint32_t fault_pc;
    bool past_break; /* the break point at broken_at has been reported, and nothing was executed since */
    uint32_t broken_at;
    uint32_t image_length; /* bytes of flash memory that the boot ROM takes for the program */
    uint32_t finding_count;
    rt1062_finding_t finding[RT1062_FINDINGS];
    rt_scs_t scs;
    rt_ccm_t ccm;
    rt_analog_t analog;
    rt_snvs_t snvs;
    rt_src_t src;
    rt_watchdog_t watchdog;
    rt_flexspi_t flexspi;
    rt_nor_t nor;
    rt_flexpwm_t flexpwm[RT_FLEXPWMS];
    rt_quad_timer_t quad_timer[RT_QUAD_TIMERS];
    rt_pads_t pads;
    rt_gpr_t gpr;
    rt_gpio_t gpio[RT_GPIO_PORTS];
    rt_xbar_t xbar;
    rt_enc_t enc[RT_ENCODERS];
    rt_pit_t pit;
    rt_adc_t adc[RT_ADCS];
    rt_i2c_t i2c[RT_I2C_UNITS];
    rt_i2c_chip_t i2c_chip[RT_I2C_UNITS];
    rt_pins_t pins;
    rt_lpuart_t lpuart;
    rt_usb_t usb;
} rt_state_t;

/* Bytes on their way to the caller. */
typedef struct rt1062_output_t {
    uint32_t count;
    uint8_t bytes[RT1062_OUTPUT_SIZE];
} rt1062_output_t;

#endif
