/* SPDX-License-Identifier: MIT */
/**
 * @file rom.h
 * The boot ROM, as far as a Teensy 4.0 uses it. It looks at what is in flash memory, sets up the flash controller and
 * jumps.
 */
#ifndef EMULATED_TEENSY_ROM_H
#define EMULATED_TEENSY_ROM_H

#include "machine.h"

/* Boot from flash memory; m->s.reset_flags tells after what. Refuses (rt_refuse) an image that the ROM would not start.
 */
void rt_rom_boot(rt1062_t *m);

#endif
