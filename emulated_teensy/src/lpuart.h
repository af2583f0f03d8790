/* SPDX-License-Identifier: MIT */
/**
 * @file lpuart.h
 * LPUART6, Teensyduino's Serial1: 8 data bits, no parity, one stop bit, FIFOs of four, and the line to the radio.
 *
 * What comes from outside is sent at the image's own baud rate. A byte is lost, as on the chip, while the receiver or
 * its clock is off, or its FIFO is full. It is lost, too, while the pad is not connected to the receiver.
 */
#ifndef EMULATED_TEENSY_LPUART_H
#define EMULATED_TEENSY_LPUART_H

#include <stdbool.h>
#include <stdint.h>

enum { RT_UART_FIFO = 4, RT_UART_LINE = 16384 };

typedef struct rt_uart_fifo_t {
    uint16_t words[RT_UART_FIFO]; /* as DATA shows them */
    uint8_t count;
} rt_uart_fifo_t;

typedef struct rt_lpuart_t {
    uint32_t baud;
    uint32_t flags; /* bits of STAT that stay until a one is written */
    uint32_t ctrl;
    uint32_t fifo; /* enable bits, and the two error flags */
    uint32_t water;
    rt_uart_fifo_t sending;
    rt_uart_fifo_t received;
    bool shifting;  /* a frame or a preamble leaves */
    bool preamble;  /* ... a preamble: the line stays high */
    bool arriving;  /* a frame arrives */
    bool listening; /* receiver was able to hear the frame from its start */
    bool was_idle;  /* the line was idle before the frame that arrives */
    uint8_t shifter;
    uint8_t frame;
    uint64_t sent_ns;    /* when the frame that leaves has left */
    uint64_t arrived_ns; /* when the one that arrives is there */
    uint64_t
        idle_ns; /* when the line will have been idle for a character; RT_NEVER: it was told, or nothing has come yet */
    uint8_t line[RT_UART_LINE]; /* on the way to the robot; a ring */
    uint32_t line_begin;
    uint32_t line_count;
} rt_lpuart_t;

#endif
