/* SPDX-License-Identifier: MIT */
/**
 * @file fuses.h
 * What is burnt into the chip (OCOTP).
 */
#ifndef EMULATED_TEENSY_FUSES_H
#define EMULATED_TEENSY_FUSES_H

/* Calibration of the temperature sensor: 1195 counts at 105 degC, 1454 at 25 degC; every chip has its own. */
#define RT_FUSE_ANA1 0x5AE4AB69u

#endif
