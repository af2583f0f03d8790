/* SPDX-License-Identifier: MIT */
/**
 * @file teensy_circuit.h
 * A simulated robot as the circuit around an emulated Teensy: encoders, PWM chip with its output-enable pin or motors
 * at PWM pins, stop button and battery of a world, gyro and floor odometry sensor on I2C buses of their own.
 *
 * Faults of the world act at the wires. Those that no wire can show end the run with a reason: `encoder_invalid`,
 * `encoder_bit`, `clock_jump`, `clock_stuck`, `tick_late`. Faults of the pose sensor and the link belong to the program
 * at the other end of the link.
 */
#ifndef HIL_SIM_TEENSY_CIRCUIT_H
#define HIL_SIM_TEENSY_CIRCUIT_H

#include <stdint.h>

#include "emulated_teensy/rt1062.h"
#include "hil_sim/flow_chip.h"
#include "hil_sim/gyro_chip.h"
#include "hil_sim/world.h"

typedef struct hil_teensy_circuit_t {
    hil_world_t *world;
    uint8_t gyro_address; /**< of a chip on the second I2C bus, 7 bit; 0: none */
    uint8_t gyro_kind;    /**< hil_gyro_kind_t */
    uint8_t flow_address; /**< of a sensor on the third I2C bus, 7 bit; 0: none */
    uint8_t flow_kind;    /**< hil_flow_kind_t */
    hil_gyro_chip_t gyro;
    hil_flow_chip_t flow;
    double flow_pose[3]; /**< pose of the world at the sensor's last step */
} hil_teensy_circuit_t;

/** Connect a machine to the circuit. Set world, addresses, kinds and flow.wheels first, the rest to zero; it must live
 *  as long as the machine. */
void hil_teensy_attach(rt1062_t *machine, hil_teensy_circuit_t *circuit);

#endif
