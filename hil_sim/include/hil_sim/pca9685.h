/* SPDX-License-Identifier: MIT */
/**
 * @file pca9685.h
 * Register model of the PCA9685 PWM chip (NXP datasheet rev. 4), driven by I2C transactions.
 *
 * Not modelled: the oscillator's start-up time of 500 us. Outputs follow the PWM
 * registers on STOP, or with MODE2.OCH = 1 on the acknowledge of a channel's last byte. The mode registers act at
 * once. EXTCLK stops the outputs: nothing drives that pin.
 */
#ifndef HIL_SIM_PCA9685_H
#define HIL_SIM_PCA9685_H

#include <stdbool.h>
#include <stdint.h>

enum { HIL_PCA9685_CHANNELS = 16, HIL_PCA9685_OUTPUT_BYTES = 64 };

/** Bus state since the last START. */
typedef enum hil_pca9685_talk_t {
    HIL_PCA9685_SILENT = 0,    /**< not addressed */
    HIL_PCA9685_ADDRESSED,     /**< its address, for writing: the register comes next */
    HIL_PCA9685_WRITTEN,       /**< register and perhaps bytes */
    HIL_PCA9685_READ,          /**< its address, for reading */
    HIL_PCA9685_CALLED,        /**< the general call's address */
    HIL_PCA9685_TOLD_TO_RESET, /**< and 0x06: software reset on STOP */
} hil_pca9685_talk_t;

typedef struct hil_pca9685_t {
    uint8_t address; /**< 7 bit */
    uint8_t registers[256];
    uint8_t pointer;                           /**< register the next byte goes to */
    bool output_enable_high;                   /**< level of the OE pin: high: outputs as defined by MODE2.OUTNE */
    uint8_t outputs[HIL_PCA9685_OUTPUT_BYTES]; /**< LED0_ON_L .. LED15_OFF_H as the outputs follow them */
    uint8_t talk;                              /**< hil_pca9685_talk_t */
    uint32_t led_writes;                       /**< PWM registers written since START */
    uint32_t ignored_writes; /**< writes to read-only or locked registers (PRESCALE while awake), TestMode */
} hil_pca9685_t;

/** Power-up state: asleep, every channel full off. The OE pin keeps its level. `*chip` must be initialised, to zero at
 * first. */
void hil_pca9685_reset(hil_pca9685_t *chip, uint8_t address);

/** START or repeated START and an address byte. @param address 7 bit. @return true if acknowledged. */
bool hil_pca9685_start(hil_pca9685_t *chip, uint8_t address, bool read);
/** A byte from the master. @return true if acknowledged. */
bool hil_pca9685_put(hil_pca9685_t *chip, uint8_t byte);
/** A byte for the master; 0xFF unless addressed for reading. */
uint8_t hil_pca9685_get(hil_pca9685_t *chip);
/** STOP. */
void hil_pca9685_stop(hil_pca9685_t *chip);

/** One write with START and STOP: the register, then its bytes; no bytes at all: the address alone is acknowledged.
 * @return true if acknowledged (own address, ALLCALL while enabled, or the general call: its address and the software
 * reset's 0x06). */
bool hil_pca9685_write(hil_pca9685_t *chip, uint8_t address, const uint8_t *data, uint32_t length);

/** One read with START and STOP, from the register pointer on. @return true if acknowledged. */
bool hil_pca9685_read(hil_pca9685_t *chip, uint8_t address, uint8_t *data, uint32_t length);

/**
 * Duty cycle of a channel, 0..1; 0 while asleep or while an interrupted PWM waits for RESTART. Channel
 * outside 0..15: 0. With OE high MODE2.OUTNE decides: 0, or 1 (OUTNE 01 with totem-pole outputs); high impedance reads
 * 0, as an H-bridge's pull-down makes it.
 */
double hil_pca9685_duty(const hil_pca9685_t *chip, uint32_t channel);

/** Phase of the channel's rising edge within the period, 0..1. */
double hil_pca9685_phase(const hil_pca9685_t *chip, uint32_t channel);

/** PWM frequency [Hz] from PRESCALE and the 25 MHz oscillator. */
double hil_pca9685_frequency_Hz(const hil_pca9685_t *chip);

#endif
