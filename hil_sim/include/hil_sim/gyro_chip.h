/* SPDX-License-Identifier: MIT */
/**
 * @file gyro_chip.h
 * Register models of gyros' chips at their I2C pins, written from their data sheets.
 *
 * Whoever plays the world tells a chip time and turn rates (hil_gyro_chip_sense); whoever plays the bus hands on START,
 * bytes and STOP. A chip measures at its data rate, by the time it is told. Its filters do nothing: the world's rates
 * are those behind them. What is special to each chip stands at the head of its source: icm42688.c, lsm6dso.c,
 * bmi270.c.
 *
 * Not modelled: accelerometers, FIFOs, interrupt pins, SPI, I3C, self-test, the motion functions.
 */
#ifndef HIL_SIM_GYRO_CHIP_H
#define HIL_SIM_GYRO_CHIP_H

#include <stdbool.h>
#include <stdint.h>

enum { HIL_GYRO_BANKS = 5, HIL_GYRO_REGISTERS = 128, HIL_GYRO_AXES = 3, HIL_GYRO_UPLOAD = 8192 };

/** The chips, in the order of gyro_chips in shared/params.toml. */
typedef enum hil_gyro_kind_t {
    HIL_GYRO_ICM42688 = 0,
    HIL_GYRO_LSM6DSO,
    HIL_GYRO_ISM330DHCX,
    HIL_GYRO_BMI270,
    HIL_GYRO_KINDS
} hil_gyro_kind_t;

/** What is wrong with it; all zero: nothing. */
typedef struct hil_gyro_faults_t {
    bool absent;       /**< not there: it acknowledges nothing */
    bool silent;       /**< it answers, but the gyro never starts */
    bool stuck;        /**< it goes on giving the reading before the fault, and says that it is new */
    bool refuses;      /**< it does not take its configuration file, if it needs one */
    uint8_t other_id;  /**< another chip's identity; 0: its own */
    double bit_errors; /**< probability that a byte from it has one bit wrong */
    uint64_t seed;     /**< of those */
} hil_gyro_faults_t;

/** What it was told since the last START. */
typedef enum hil_gyro_talk_t {
    HIL_GYRO_SILENT = 0, /**< nothing that concerns it */
    HIL_GYRO_ADDRESSED,  /**< its address, for writing: the register comes next */
    HIL_GYRO_WRITTEN,    /**< register and perhaps bytes */
    HIL_GYRO_READ        /**< its address, for reading */
} hil_gyro_talk_t;

typedef struct hil_gyro_chip_t {
    uint8_t kind;    /**< hil_gyro_kind_t */
    uint8_t address; /**< 7 bit */
    uint8_t registers[HIL_GYRO_BANKS][HIL_GYRO_REGISTERS];
    uint8_t pointer; /**< register that the next byte goes to or comes from */
    uint8_t talk;    /**< hil_gyro_talk_t */
    uint64_t time_us;
    uint64_t reset_until_us;  /**< it resets itself: it acknowledges nothing */
    uint64_t locked_until_us; /**< nothing may be written */
    uint64_t starts_until_us; /**< the gyro has been switched on: no readings yet */
    uint64_t loads_until_us;  /**< it works on its configuration file */
    uint64_t next_sample_us;
    int16_t sample[HIL_GYRO_AXES]; /**< the newest; a chip may keep older ones in its registers */
    uint8_t held;                  /**< bit per axis: half of its reading has been read */
    uint8_t upload[HIL_GYRO_UPLOAD];
    uint8_t uploaded[HIL_GYRO_UPLOAD / 8]; /**< bit per byte: it has been written */
    uint32_t ignored_writes;               /**< to read-only registers, or at a time when nothing may be written */
    uint64_t bytes_given;                  /**< counts the bits to be drawn */
    hil_gyro_faults_t faults;
} hil_gyro_chip_t;

/** Power-up: registers as after reset. Time and faults stay. `*chip` must be initialised, to zero at first.
 *  @param kind hil_gyro_kind_t. */
void hil_gyro_chip_reset(hil_gyro_chip_t *chip, uint8_t kind, uint8_t address);

/** Time goes on. @param time_us must not go back. @param rad_s turn rates about its x, y, z. */
void hil_gyro_chip_sense(hil_gyro_chip_t *chip, uint64_t time_us, const double *rad_s);

/** START or repeated START and an address byte. @param address 7 bit. @return true if acknowledged. */
bool hil_gyro_chip_start(hil_gyro_chip_t *chip, uint8_t address, bool read);
/** A byte from the master. @return true if acknowledged. */
bool hil_gyro_chip_put(hil_gyro_chip_t *chip, uint8_t byte);
/** A byte for the master; 0xFF unless addressed for reading. */
uint8_t hil_gyro_chip_get(hil_gyro_chip_t *chip);
/** STOP. */
void hil_gyro_chip_stop(hil_gyro_chip_t *chip);

#endif
