/* SPDX-License-Identifier: MIT */
/**
 * @file flow_chip.h
 * Models of sensors that count their own pose over the floor, at their I2C pins: SparkFun's OTOS and goBILDA's
 * Pinpoint.
 *
 * They are written from the makers' public drivers, because there are no data sheets of their registers. Whoever plays
 * the world tells a sensor how far it has moved (hil_flow_chip_move). Whoever plays the bus hands on START, bytes and
 * STOP. A sensor adds up what it measures by itself. Its errors are the world's: it has none of its own but the steps
 * of its counters.
 *
 * Assumed, because the makers do not say it: an OTOS whose counter of 10 m is full stays there. While one calibrates
 * its gyro it does not count. The pose that is read is that of the moment at which the read begins.
 */
#ifndef HIL_SIM_FLOW_CHIP_H
#define HIL_SIM_FLOW_CHIP_H

#include <stdbool.h>
#include <stdint.h>

enum { HIL_FLOW_AXES = 3, HIL_FLOW_REGISTERS = 128, HIL_FLOW_READ = 40 };

/** The sensors, in the order of flow_chips in shared/params.toml. */
typedef enum hil_flow_kind_t { HIL_FLOW_OTOS = 0, HIL_FLOW_PINPOINT, HIL_FLOW_KINDS } hil_flow_kind_t;

/** What is wrong with it; all zero: nothing. */
typedef struct hil_flow_faults_t {
    bool absent;      /**< not there: it acknowledges nothing */
    bool blind;       /**< an OTOS that has been lifted: it says so, and counts nothing */
    bool unplugged;   /**< a Pinpoint without its x wheel: it says so, and counts nothing of it */
    bool tilted;      /**< an OTOS on a ramp: it says so, and goes on */
    bool broken;      /**< the OTOS's IMU fails its test, or the Pinpoint's has run away */
    uint8_t other_id; /**< another chip's identity; 0: its own */
} hil_flow_faults_t;

/** How a Pinpoint's wheels really are, as the robot file should say it. */
typedef struct hil_flow_wheels_t {
    double steps_per_mm;
    double x_wheel_mm; /**< left of the robot's centre */
    double y_wheel_mm; /**< in front of it */
    bool reversed[2];  /**< x, y: its encoder counts the other way */
} hil_flow_wheels_t;

typedef struct hil_flow_chip_t {
    uint8_t kind;    /**< hil_flow_kind_t */
    uint8_t address; /**< 7 bit */
    hil_flow_wheels_t wheels;
    hil_flow_faults_t faults;
    uint64_t time_us;
    uint64_t busy_until_us; /**< it calibrates its gyro */
    uint64_t written_us;    /**< when a pose was written that it has not taken over yet; 0: none */
    double written[HIL_FLOW_AXES];
    double pose[HIL_FLOW_AXES]; /**< what it has counted: x, y [m], heading [rad] */
    uint8_t registers[HIL_FLOW_REGISTERS];
    float settings[HIL_FLOW_REGISTERS]; /**< a Pinpoint's, by register */
    bool counts_backwards[2];           /**< as the Pinpoint has been told */
    uint8_t pointer;
    uint8_t talk;                 /**< 0: not addressed; 1: the register comes; 2: bytes come; 3: bytes go */
    uint8_t taken[4];             /**< bytes of a value that is being written */
    uint8_t count;                /**< of them, or of those given */
    uint8_t given[HIL_FLOW_READ]; /**< what a read gives, from its beginning */
    uint32_t ignored_writes;      /**< to registers that cannot be written */
    uint32_t calibrations;
    uint32_t calibration_us; /**< that a Pinpoint's takes; 0: as its maker says */
} hil_flow_chip_t;

/** Power-up. Time, faults and wheels stay. `*chip` must be initialised, to zero at first.
 *  @param kind hil_flow_kind_t. */
void hil_flow_chip_reset(hil_flow_chip_t *chip, uint8_t kind, uint8_t address);

/** Time goes on. @param time_us must not go back. @param moved x, y [m] in the sensor's axes of mid-way, turn [rad].
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
