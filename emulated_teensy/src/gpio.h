/* SPDX-License-Identifier: MIT */
/**
 * @file gpio.h
 * GPIO1..4 and their fast twins GPIO6..9 (i.MX RT1060 RM, chapter GPIO). IOMUXC_GPR26..29 say bit by bit which twin
 * owns a pin; the other one sees 0 and drives nothing. GPIO5 (pads that a Teensy 4.0 does not bring out) is not
 * modelled.
 */
#ifndef EMULATED_TEENSY_GPIO_H
#define EMULATED_TEENSY_GPIO_H

#include <stdbool.h>
#include <stdint.h>

#include "emulated_teensy/rt1062.h"

enum { RT_GPIO_SLOW = 4, RT_GPIO_PORTS = 8 }; /* 0..3: GPIO1..4, 4..7: GPIO6..9 */

typedef struct rt_gpio_t {
    uint32_t data; /* DR */
    uint32_t direction;
    uint32_t condition[2]; /* ICR1, ICR2 */
    uint32_t on_low;       /* pins whose condition is a low level, as ICR1 and ICR2 say */
    uint32_t on_high;
    uint32_t mask;
    uint32_t status;
    uint32_t both_edges;
    uint32_t input; /* levels at the pads, as far as they come in */
} rt_gpio_t;

/* What the GPIO that owns the pad drives: 0, 1, or -1: it is an input. */
int rt_gpio_drives(const rt1062_t *m, uint32_t pad);
/* The pad's level or the way to it may have changed. */
void rt_gpio_input_changed(rt1062_t *m, uint32_t pad);
/* IOMUXC_GPR26..29 were written. */
void rt_gpio_owners_changed(rt1062_t *m);

#endif
