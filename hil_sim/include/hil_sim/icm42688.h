/* SPDX-License-Identifier: MIT */
/**
 * @file icm42688.h
 * Register model of the gyro in an ICM-42688-P (TDK data sheet DS-000347) at its I2C pins.
 *
 * Whoever plays the world tells it time and turn rates (hil_icm42688_sense); whoever plays the bus hands on START,
 * bytes and STOP. It has the register banks and the soft reset, which takes 1 ms. After the gyro is switched on nothing
 * may be written for 200 us, and it takes 30 ms to start. It measures at its data rate, by the time
 * it is told. Its filters do nothing: the world's rates are those behind them.
 *
 * Not modelled: the accelerometer, FIFO, interrupt pins, SPI, I3C, self-test, the motion functions.
 */
#ifndef HIL_SIM_ICM42688_H
#define HIL_SIM_ICM42688_H

#include <stdbool.h>
#include <stdint.h>

enum { HIL_ICM42688_BANKS = 5, HIL_ICM42688_REGISTERS = 128, HIL_ICM42688_AXES = 3 };

/** What is wrong with it; all zero: nothing. */
typedef struct hil_icm42688_faults_t {
    bool absent;       /**< not there: it acknowledges nothing */
    bool silent;       /**< it answers, but the gyro never starts */
    bool stuck;        /**< it goes on giving the reading before the fault */
    uint8_t other_id;  /**< another chip's WHO_AM_I; 0: its own */
    double bit_errors; /**< probability that a byte from it has one bit wrong */
    uint64_t seed;     /**< of those */
} hil_icm42688_faults_t;

/** What it was told since the last START. */
typedef enum hil_icm42688_talk_t {
    HIL_ICM42688_SILENT = 0, /**< nothing that concerns it */
    HIL_ICM42688_ADDRESSED,  /**< its address, for writing: the register comes next */
    HIL_ICM42688_WRITTEN,    /**< register and perhaps bytes */
    HIL_ICM42688_READ        /**< its address, for reading */
} hil_icm42688_talk_t;

typedef struct hil_icm42688_t {
    uint8_t address; /**< 7 bit */
    uint8_t registers[HIL_ICM42688_BANKS][HIL_ICM42688_REGISTERS];
    uint8_t pointer; /**< register that the next byte goes to or comes from */
    uint8_t talk;    /**< hil_icm42688_talk_t */
    uint64_t time_us;
    uint64_t reset_until_us;  /**< it resets itself: it acknowledges nothing */
    uint64_t locked_until_us; /**< the gyro has been switched on: nothing may be written */
    uint64_t starts_until_us; /**< the gyro has been switched on: no readings yet */
    uint64_t next_sample_us;
    uint32_t ignored_writes; /**< to read-only registers, or at a time when nothing may be written */
    uint64_t bytes_given;    /**< counts the bits to be drawn */
    hil_icm42688_faults_t faults;
} hil_icm42688_t;

/** Power-up: registers as after reset. Time and faults stay. `*chip` must be initialised, to zero at first. */
void hil_icm42688_reset(hil_icm42688_t *chip, uint8_t address);

/** Time goes on. @param time_us must not go back. @param rad_s turn rates about its x, y, z. */
void hil_icm42688_sense(hil_icm42688_t *chip, uint64_t time_us, const double *rad_s);

/** START or repeated START and an address byte. @param address 7 bit. @return true if acknowledged. */
bool hil_icm42688_start(hil_icm42688_t *chip, uint8_t address, bool read);
/** A byte from the master. @return true if acknowledged. */
bool hil_icm42688_put(hil_icm42688_t *chip, uint8_t byte);
/** A byte for the master; 0xFF unless addressed for reading. */
uint8_t hil_icm42688_get(hil_icm42688_t *chip);
/** STOP. */
void hil_icm42688_stop(hil_icm42688_t *chip);

/** Full range of the gyro as it is set [rad/s]. */
double hil_icm42688_range_rad_s(const hil_icm42688_t *chip);

#endif
