/* SPDX-License-Identifier: MIT */
/**
 * @file gyro_chip.h
 * Register models of gyro chips at their I2C pins, from their data sheets.
 *
 * The world provides time and angular rates (hil_gyro_chip_sense), the bus START, bytes and STOP. A chip samples at its
 * data rate. Its filters are not modelled: the world's rates are those after the filters. Chip-specific notes are in
 * icm42688.c, lsm6dso.c and bmi270.c.
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

/** Faults; all zero: none. */
typedef struct hil_gyro_faults_t {
    bool absent;       /**< no acknowledge */
    bool silent;       /**< it responds, but the gyro never starts */
    bool stuck;        /**< it repeats the last reading, flagged as new */
    bool refuses;      /**< it rejects its configuration file, if it needs one */
    uint8_t other_id;  /**< another chip's identity; 0: its own */
    double bit_errors; /**< probability that a byte from it has one bit wrong */
    uint64_t seed;     /**< of those */
} hil_gyro_faults_t;

/** Bus state since the last START. */
typedef enum hil_gyro_talk_t {
    HIL_GYRO_SILENT = 0, /**< not addressed */
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
    uint64_t reset_until_us;  /**< end of a reset, without acknowledge */
    uint64_t locked_until_us; /**< writes are not allowed until then */
    uint64_t starts_until_us; /**< end of the gyro's start-up */
    uint64_t loads_until_us;  /**< end of processing the configuration file */
    uint64_t next_sample_us;
    int16_t sample[HIL_GYRO_AXES]; /**< the newest; a chip may keep older ones in its registers */
    uint8_t held;                  /**< bit per axis: half of its reading has been read */
    uint8_t upload[HIL_GYRO_UPLOAD];
    uint8_t uploaded[HIL_GYRO_UPLOAD / 8]; /**< bit per byte: it has been written */
    uint32_t ignored_writes;               /**< writes to read-only registers or while locked */
    uint64_t bytes_given;                  /**< index of the random bit errors */
    hil_gyro_faults_t faults;
} hil_gyro_chip_t;

/** Power-up reset. Keeps time and faults. `*chip` must be initialised, to zero at first.
 *  @param kind hil_gyro_kind_t. */
void hil_gyro_chip_reset(hil_gyro_chip_t *chip, uint8_t kind, uint8_t address);

/** Advance the time. @param time_us monotonic. @param rad_s angular rates about x, y, z. */
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
