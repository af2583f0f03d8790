/* SPDX-License-Identifier: MIT */
/**
 * @file pca9685.h
 * Register model of the PCA9685 PWM chip (NXP datasheet rev. 4), fed with the bytes of I2C transactions.
 *
 * The chip has no clock here: the 500 us that its oscillator takes to start are not modelled, and outputs follow the registers at once. With
 * MODE2.OCH = 0 (change on STOP) read them after the last transaction of a batch. EXTCLK stops the outputs: nothing drives that pin.
 */
#ifndef HIL_SIM_PCA9685_H
#define HIL_SIM_PCA9685_H

#include <stdbool.h>
#include <stdint.h>

enum { HIL_PCA9685_CHANNELS = 16 };

typedef struct hil_pca9685_t {
    uint8_t address; /**< 7 bit */
    uint8_t registers[256];
    uint8_t pointer;         /**< register the next byte goes to */
    bool output_enable_high; /**< level of the OE pin: high switches the outputs to what MODE2.OUTNE says */
    uint32_t ignored_writes; /**< writes to read-only or locked registers (PRESCALE while awake), TestMode */
} hil_pca9685_t;

/** Power-up state: asleep, every channel full off. The OE pin keeps its level. `*chip` must be initialised, to zero at first. */
void hil_pca9685_reset(hil_pca9685_t *chip, uint8_t address);

/** One write: the register, then its bytes; no bytes at all: the address alone is acknowledged. @return true if acknowledged (own address, ALLCALL while enabled, or the general call's software reset). */
bool hil_pca9685_write(hil_pca9685_t *chip, uint8_t address, const uint8_t *data, uint32_t length);

/** One read from the register pointer on. @return true if acknowledged. */
bool hil_pca9685_read(hil_pca9685_t *chip, uint8_t address, uint8_t *data, uint32_t length);

/**
 * Share of the period a channel is high, 0..1; 0 while asleep or while an interrupted PWM waits for RESTART. Channel outside 0..15: 0. With OE
 * high MODE2.OUTNE decides: 0, or 1 (OUTNE 01 with totem-pole outputs); high impedance reads 0, as an H-bridge's pull-down makes it.
 */
double hil_pca9685_duty(const hil_pca9685_t *chip, uint32_t channel);

/** Phase of the channel's rising edge within the period, 0..1. */
double hil_pca9685_phase(const hil_pca9685_t *chip, uint32_t channel);

/** PWM frequency [Hz] from PRESCALE and the 25 MHz oscillator. */
double hil_pca9685_frequency_Hz(const hil_pca9685_t *chip);

#endif
