/* SPDX-License-Identifier: MIT */
/**
 * @file links.h
 * Bytes from outside into the machine, by link. See rt1062_send() and rt1062_receive().
 */
#ifndef EMULATED_TEENSY_LINKS_H
#define EMULATED_TEENSY_LINKS_H

#include "machine.h"

/* @return bytes taken. */
uint32_t rt_uart_send(rt1062_t *m, const uint8_t *bytes, uint32_t count);
uint32_t rt_usb_send(rt1062_t *m, const uint8_t *bytes, uint32_t count);

#endif
