/* SPDX-License-Identifier: MIT */
/**
 * @file flow_chip.h
 * Register models of floor odometry chips at their I2C pins: SparkFun OTOS and goBILDA Pinpoint.
 *
 * Written from the vendors' public drivers, as their registers have no data sheets. The world provides displacements
 * (hil_flow_chip_move), the bus START, bytes and STOP. The model integrates the pose; it adds no errors but the
 * resolution of its counters.
 *
 * Assumptions (not documented): an OTOS saturates at 10 m; during a gyro calibration it does not integrate; a read
 * returns the pose at the start of the read.
 */
#ifndef HIL_SIM_FLOW_CHIP_H
#define HIL_SIM_FLOW_CHIP_H

#include <stdbool.h>
#include <stdint.h>

enum { HIL_FLOW_AXES = 3, HIL_FLOW_REGISTERS = 128, HIL_FLOW_READ = 40 };

/** The sensors, in the order of flow_chips in shared/params.toml. */
typedef enum hil_flow_kind_t { HIL_FLOW_OTOS = 0, HIL_FLOW_PINPOINT, HIL_FLOW_KINDS } hil_flow_kind_t;

/** Faults; all zero: none. */
typedef struct hil_flow_faults_t {
    bool absent;      /**< no acknowledge */
    bool blind;       /**< OTOS lifted: status set, no motion */
    bool unplugged;   /**< Pinpoint without x wheel: status set, no motion in x */
    bool tilted;      /**< OTOS tilted: status set, works on */
    bool broken;      /**< the OTOS's IMU fails its test, or the Pinpoint's has run away */
    uint8_t other_id; /**< another chip's identity; 0: its own */
} hil_flow_faults_t;

/** True geometry of a Pinpoint's dead wheels. */
typedef struct hil_flow_wheels_t {
    double steps_per_mm;
    double x_wheel_mm; /**< left of the robot's centre */
    double y_wheel_mm; /**< in front of it */
    bool reversed[2];  /**< x, y: encoder counts backwards */
} hil_flow_wheels_t;

typedef struct hil_flow_chip_t {
    uint8_t kind;    /**< hil_flow_kind_t */
    uint8_t address; /**< 7 bit */
    hil_flow_wheels_t wheels;
    hil_flow_faults_t faults;
    uint64_t time_us;
    uint64_t busy_until_us; /**< end of the gyro calibration */
    uint64_t written_us;    /**< time of a pose write that is not effective yet; 0: none */
    double written[HIL_FLOW_AXES];
    double pose[HIL_FLOW_AXES]; /**< integrated pose: x, y [m], heading [rad] */
    uint8_t registers[HIL_FLOW_REGISTERS];
    float settings[HIL_FLOW_REGISTERS]; /**< a Pinpoint's, by register */
    bool counts_backwards[2];           /**< Pinpoint's direction setting */
    uint8_t pointer;
    uint8_t talk;                 /**< bus state: 0 not addressed, 1 register expected, 2 being written, 3 being read */
    uint8_t taken[4];             /**< bytes of a value being written */
    uint8_t count;                /**< number of bytes in `taken`, or read from `given` */
    uint8_t given[HIL_FLOW_READ]; /**< data of a read, latched at its start */
    uint32_t ignored_writes;      /**< writes to read-only registers */
    uint32_t calibrations;
    uint32_t calibration_us; /**< duration of a Pinpoint's; 0: as documented */
} hil_flow_chip_t;

/** Power-up reset. Keeps time, faults and wheels. `*chip` must be initialised, to zero at first.
 *  @param kind hil_flow_kind_t. */
void hil_flow_chip_reset(hil_flow_chip_t *chip, uint8_t kind, uint8_t address);

/** Advance the time and the pose. @param time_us monotonic. @param moved x, y [m] in the sensor's axes at mid-interval,
 * turn [rad].
 *  For a Pinpoint that is the robot's centre. */
void hil_flow_chip_move(hil_flow_chip_t *chip, uint64_t time_us, const double *moved);

/** START or repeated START and an address byte. @param address 7 bit. @return true if acknowledged. */
bool hil_flow_chip_start(hil_flow_chip_t *chip, uint8_t address, bool read);
/** A byte from the master. @return true if acknowledged. */
bool hil_flow_chip_put(hil_flow_chip_t *chip, uint8_t byte);
/** A byte for the master; 0xFF unless addressed for reading. */
uint8_t hil_flow_chip_get(hil_flow_chip_t *chip);
/** STOP. */
void hil_flow_chip_stop(hil_flow_chip_t *chip);

#endif
