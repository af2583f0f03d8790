/* SPDX-License-Identifier: MIT */
/**
 * @file nor.h
 * The NOR flash chip of a Teensy 4.0: Winbond W25Q16JV, 2 MB (data sheet "W25Q16JV", revision H: chapters
 * "Instructions" and "AC electrical characteristics").
 *
 * Programming clears bits and wraps within a page of 256 bytes; erasing sets all bits of a sector or block. Meanwhile
 * the chip is busy: it answers nothing but the status, and whoever reads the memory then is refused. How long that
 * lasts is drawn between the data sheet's typical and maximal times. The contents change when the time is over; a power
 * cut in between leaves some of the bits done.
 */
#ifndef EMULATED_TEENSY_NOR_H
#define EMULATED_TEENSY_NOR_H

#include <stdbool.h>
#include <stdint.h>

#include "emulated_teensy/rt1062.h"

enum { RT_NOR_PAGE = 256, RT_NOR_SECTOR = 4096 };

typedef enum rt_nor_work_t { RT_NOR_IDLE = 0, RT_NOR_PROGRAM, RT_NOR_ERASE } rt_nor_work_t;

typedef struct rt_nor_t {
    bool write_enabled;
    uint32_t work; /* rt_nor_work_t: under way */
    uint32_t address;
    uint32_t size;             /* of an erase */
    uint8_t page[RT_NOR_PAGE]; /* of a program: 1 bits are left as they are */
    uint64_t begin_ns;
    uint64_t end_ns;
    uint64_t commands;  /* programs and erases since the machine was made; numbers what is drawn */
    uint32_t cut_after; /* programs and erases until the power is cut, 0: it isn't */
    double cut_share;   /* of that last one */
} rt_nor_t;

/*
 * A command with everything that the controller shifts out.
 * @param lanes bus lanes of command, address and data, in this order; 0: that part is absent.
 * @param in what the chip answers, `in_count` bytes.
 */
typedef struct rt_nor_command_t {
    uint8_t code;
    uint8_t lanes[3];
    uint32_t address;
    const uint8_t *out;
    uint32_t out_count;
    uint8_t *in;
    uint32_t in_count;
} rt_nor_command_t;

void rt_nor_command(rt1062_t *m, const rt_nor_command_t *command);
/* The memory can't be read because the chip is at work. */
bool rt_nor_busy(const rt1062_t *m);
/* Somebody reads the memory or runs code in it while the chip is at work. That is a finding, and the end of what the
 * model can say. */
void rt_nor_read_while_busy(rt1062_t *m, uint32_t address, bool fetch);
/* The power goes: what is under way stops where it is. */
void rt_nor_power_lost(rt1062_t *m);

#endif
