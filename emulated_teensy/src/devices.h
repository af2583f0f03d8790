/* SPDX-License-Identifier: MIT */
/**
 * @file devices.h
 * The peripherals that there are. A new one: its declaration here, a line in the table of bus.c, its state in state.h.
 */
#ifndef EMULATED_TEENSY_DEVICES_H
#define EMULATED_TEENSY_DEVICES_H

#include "machine.h"

extern const rt_device_t rt_scs;     /* scs.c */
extern const rt_device_t rt_dwt;     /* dwt.c */
extern const rt_device_t rt_ccm;     /* clocks.c */
extern const rt_device_t rt_analog;  /* analog.c */
extern const rt_device_t rt_dcdc;    /* analog.c */
extern const rt_device_t rt_ocotp;   /* fuses.c */
extern const rt_device_t rt_snvs;    /* snvs.c */
extern const rt_device_t rt_src;     /* reset.c */
extern const rt_device_t rt_wdog3;   /* watchdog.c */
extern const rt_device_t rt_flexspi; /* flexspi.c */
extern const rt_device_t rt_lpuart6; /* lpuart.c */
extern const rt_device_t rt_usb;     /* usb.c */
extern const rt_device_t rt_usb_phy; /* usb_phy.c */

extern const rt_device_t rt_iomuxc;      /* pads.c */
extern const rt_device_t rt_iomuxc_gpr;  /* gpr.c */
extern const rt_device_t rt_gpio_slow;   /* gpio.c */
extern const rt_device_t rt_gpio_fast;   /* gpio.c */
extern const rt_device_t rt_xbar1;       /* xbar.c */
extern const rt_device_t rt_enc;         /* enc.c */
extern const rt_device_t rt_pit;         /* pit.c */
extern const rt_device_t rt_adc;         /* adc.c */
extern const rt_device_t rt_flexpwm;     /* pwm.c */
extern const rt_device_t rt_quad_timers; /* pwm.c */
extern const rt_device_t rt_lpi2c1;      /* lpi2c.c */
extern const rt_device_t rt_lpi2c3;      /* lpi2c.c */
extern const rt_device_t rt_lpi2c4;      /* lpi2c.c */
extern const rt_device_t rt_wires;       /* pins.c: last in the table */

#endif
