/* SPDX-License-Identifier: MIT */
/**
 * @file handlers.h
 * What happens at the deadlines of state.h; each is called with its deadline already forgotten.
 */
#ifndef EMULATED_TEENSY_RT1062_HANDLERS_H
#define EMULATED_TEENSY_RT1062_HANDLERS_H

#include "machine.h"

void rt_systick_event(rt1062_t *m);
void rt_nor_event(rt1062_t *m);
void rt_watchdog_event(rt1062_t *m);
void rt_pit0_event(rt1062_t *m);
void rt_pit1_event(rt1062_t *m);
void rt_pit2_event(rt1062_t *m);
void rt_pit3_event(rt1062_t *m);
void rt_i2c_event(rt1062_t *m);
void rt_circuit_event(rt1062_t *m);
void rt_encoder_event(rt1062_t *m);
void rt_noise_event(rt1062_t *m);
void rt_uart_send_event(rt1062_t *m);
void rt_uart_receive_event(rt1062_t *m);
void rt_usb_event(rt1062_t *m);

#endif
