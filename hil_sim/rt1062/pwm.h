/* SPDX-License-Identifier: MIT */
/**
 * @file pwm.h
 * FlexPWM1..4 and quad timers 1..3, as far as pwm_init() of the core sets them up: it does so at every start, and the image then uses none.
 * What is written goes nowhere; reading it back is not modelled, so a program that wants pulses is refused.
 */
#ifndef HIL_SIM_RT1062_PWM_H
#define HIL_SIM_RT1062_PWM_H

#include <stdint.h>

enum { RT_FLEXPWMS = 4 };

typedef struct rt_flexpwm_t {
    uint32_t control; /* MCTRL */
} rt_flexpwm_t;

#endif
