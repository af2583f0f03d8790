/* SPDX-License-Identifier: MIT */
/** @file parts.h  Internal interfaces of the simulated world. */
#ifndef HIL_SIM_PARTS_H
#define HIL_SIM_PARTS_H

#include <stddef.h>

#include "hil_sim/world.h"
#include "real_math.h"

/* Random streams of a run; those per wheel take HIL_MAX_WHEELS numbers from their start. */
enum {
    HIL_STREAM_SLIP = 0,
    HIL_STREAM_SLIP_SPEED = 4,
    HIL_STREAM_FIX_X = 16,
    HIL_STREAM_FIX_Y,
    HIL_STREAM_FIX_THETA,
    HIL_STREAM_FIX_DROP,
    HIL_STREAM_ENCODER = 24, /* per wheel */
    HIL_STREAM_ROLLERS = 28, /* per wheel */
    HIL_STREAM_GYRO = 40,    /* per axis */
    HIL_STREAM_GYRO_BIAS = 43,
    HIL_STREAM_GYRO_DRIFT = 46,
    HIL_STREAM_FLOW = 60, /* x, y, turn */
    HIL_STREAM_FLOW_BIAS = 63,
    HIL_STREAM_FLOW_DROP
};

/** Bits of i2c_status. */
enum { HIL_I2C_NOT_ACKNOWLEDGED = 1, HIL_I2C_BUS_STUCK = 2 };

/** How the electrics act on the motion during a step: V_i = gain_i * supply + offset_i, or a current that the winding
 * can't change. */
typedef struct hil_electrics_t {
    hil_real_t gain[HIL_MAX_WHEELS];
    hil_real_t offset_V[HIL_MAX_WHEELS];
    hil_real_t closed[HIL_MAX_WHEELS]; /**< 1: the winding is connected, 0: open */
    hil_real_t battery_V;
    hil_real_t drive[HIL_MAX_WHEELS]; /**< fraction of the motor current drawn from the battery */
} hil_electrics_t;

/* config.c */
hil_result_t hil_config_check(const hil_world_config_t *config, char *why, uint32_t why_size);

/* plant.c */
void hil_plant_init(hil_plant_t *plant, const hil_world_config_t *config);
/** Can this plant be driven by this source? */
bool hil_plant_accepts_source(uint32_t plant, uint32_t source);
/** Select the source that drives the wheels. */
void hil_plant_set_source(hil_world_t *world, uint32_t source);
void hil_plant_step(hil_world_t *world, const hil_electrics_t *electrics, double step_s);

/* motors.c */
void hil_motors_apply_inputs(hil_world_t *world, uint32_t wheel, hil_real_t phase1, hil_real_t phase2, double period_s);
void hil_motors_begin(hil_world_t *world, hil_electrics_t *electrics, double step_s, hil_real_t *open_end_A);
void hil_motors_end(hil_world_t *world, const hil_electrics_t *electrics, const hil_real_t *open_end_A);

/* sensors.c */
/** Integrate counters after a step; time and faults are those at its start. */
void hil_sensors_integrate(hil_world_t *world);
/** Sample the sensors; time and faults are current. */
void hil_sensors_sample(hil_world_t *world);

/* sensor_encoders.c */
/** Set the encoder edges since the start, an integer, positive: counter-clockwise. */
void hil_encoders_set_edges(hil_world_t *world, uint32_t wheel, hil_real_t edges);

/* sensor_pose.c */
/** Queue a fix of an external pose sensor that arrives now. @param pose x, y, theta. */
void hil_pose_queue_fix(hil_world_t *world, uint64_t taken_us, const double *pose);

/** A motor's speed, as seen at the wheel: the wheel's, unless the gear has play. */
static inline hil_real_t hil_motor_rad_s(const hil_world_t *world, uint32_t wheel) {
    return world->plant.play ? world->motor_rad_s[wheel] : world->wheel_rad_s[wheel];
}

/* backlash.c */
/** Shift the gear's state after an external rotation of a wheel (fault wheel_turned). Plants with backlash. */
void hil_backlash_shift(hil_world_t *world, uint32_t wheel, hil_real_t moved_rad);

/* slip.c */
void hil_slip_init(hil_world_t *world);
/** Update the slip ratios at a time. */
void hil_slip_update(hil_world_t *world, double time_s);
/** Draw the slip speeds of the next step. */
void hil_slip_draw_speeds(hil_world_t *world);

/* faults.c */
/** Update the active faults; call after each change of the time. */
void hil_faults_update(hil_world_t *world);
const hil_fault_t *hil_fault_search(const hil_world_t *world, uint8_t kind, uint32_t wheel);
/** Robot's clock, with clock faults. */
uint64_t hil_robot_clock_us(const hil_world_t *world);
/** Bits of i2c_status that faults of the bus set. */
uint8_t hil_bus_fault(const hil_world_t *world);

/** The active fault of this kind that concerns the wheel (HIL_MAX_WHEELS or above: any), or NULL. */
static inline const hil_fault_t *hil_fault_find(const hil_world_t *world, uint8_t kind, uint32_t wheel) {
    return (world->active_faults >> kind & 1u) == 0 ? NULL : hil_fault_search(world, kind, wheel);
}

/** Value of an active fault of this kind, or `otherwise`. */
static inline hil_real_t hil_fault_value(const hil_world_t *world, uint8_t kind, hil_real_t otherwise) {
    const hil_fault_t *fault = hil_fault_find(world, kind, HIL_MAX_WHEELS);
    return fault != NULL ? (hil_real_t)fault->value : otherwise;
}

/** State of a bridge, coded as levels of IN1 (bit 0) and IN2 (bit 1). */
typedef enum hil_bridge_action_t {
    HIL_BRIDGE_COAST = 0,
    HIL_BRIDGE_FORWARD = 1,
    HIL_BRIDGE_BACKWARD = 2,
    HIL_BRIDGE_BRAKE = 3
} hil_bridge_action_t;

/** Truth table of a motor driver's bridges (hil_driver_t); from `motor_drivers` in shared/params.toml. */
typedef struct hil_driver_rule_t {
    bool on_pins;      /**< of the processor; otherwise behind the PWM chip, and the rest is of no effect */
    uint8_t low;       /**< hil_bridge_action_t while both pins are low: coast or brake */
    uint8_t single[2]; /**< while the first, or the second, is high alone */
    uint8_t both;      /**< while both are high */
} hil_driver_rule_t;

/* world_step.c */
/** Whether the chip takes OE for high. @param drive hil_output_enable_t */
bool hil_output_enable_high(const hil_world_config_t *config, uint8_t drive);
/** Are the motors driven by a PWM chip, not by the processor's pins? */
bool hil_has_chip(const hil_world_t *world);
/** Every pin low. */
void hil_bridges_init(hil_world_t *world);
/** Power loss of the PWM chip: outputs off, registers reset. */
void hil_chip_power_loss(hil_world_t *world);
/** Apply bridge inputs: those set directly, or the chip's outputs. */
void hil_bridges_apply_inputs(hil_world_t *world, bool direct);

#endif
