/* SPDX-License-Identifier: MIT */
#include "hil_sim/teensy_circuit.h"

#include <string.h>

enum { BUS_MOTORS, BUS_GYRO, BUS_FLOW };

static bool has_fault(const hil_teensy_circuit_t *circuit, uint8_t kind) {
    return hil_world_fault_active(circuit->world, kind, HIL_MAX_WHEELS);
}

static const char *refused_fault(const hil_teensy_circuit_t *circuit) {
    static const struct {
        uint8_t kind;
        const char *why;
    } refused[] = {
        {HIL_FAULT_ENCODER_INVALID, "the world's fault encoder_invalid cannot be shown at the chip's pins"},
        {HIL_FAULT_ENCODER_BIT, "the world's fault encoder_bit cannot be shown at the chip's pins"},
        {HIL_FAULT_CLOCK_JUMP, "the world's fault clock_jump cannot be shown at the chip's pins"},
        {HIL_FAULT_CLOCK_STUCK, "the world's fault clock_stuck cannot be shown at the chip's pins"},
        {HIL_FAULT_TICK_LATE, "the world's fault tick_late cannot be shown at the chip's pins"},
    };
    for (uint32_t i = 0; i < sizeof refused / sizeof refused[0]; i++) {
        if ((circuit->world->active_faults >> refused[i].kind & 1) != 0) {
            return refused[i].why;
        }
    }
    return NULL;
}

/* ------------------------------------------------------------------ time */

static const char *power_on(void *context) {
    hil_teensy_circuit_t *circuit = context;
    if (circuit->gyro_address != 0) {
        hil_gyro_chip_reset(&circuit->gyro, circuit->gyro_kind, circuit->gyro_address);
    }
    if (circuit->flow_address != 0) {
        hil_flow_chip_reset(&circuit->flow, circuit->flow_kind, circuit->flow_address);
        memcpy(circuit->flow_pose, circuit->world->pose, sizeof circuit->flow_pose);
    }
    return refused_fault(circuit);
}

/* A world without a gyro has an empty socket. A gyro that the world makes silent has no power. */
static void step_gyro(hil_teensy_circuit_t *circuit, uint64_t now_us) {
    hil_gyro_chip_t *gyro = &circuit->gyro;
    if (circuit->gyro_address == 0) {
        return;
    }
    const bool silent = has_fault(circuit, HIL_FAULT_GYRO_SILENT);
    if (silent && !gyro->faults.absent) {
        hil_gyro_chip_reset(gyro, circuit->gyro_kind, circuit->gyro_address);
    }
    gyro->faults.absent = silent || circuit->world->config.gyro_rate_Hz <= 0.0;
    hil_gyro_chip_sense(gyro, now_us, circuit->world->gyro_rad_s);
}

/* As with the gyro. One that the world makes stuck counts no more. */
static void step_flow(hil_teensy_circuit_t *circuit, uint64_t now_us) {
    hil_flow_chip_t *flow = &circuit->flow;
    if (circuit->flow_address == 0) {
        return;
    }
    const bool silent = has_fault(circuit, HIL_FAULT_FLOW_SILENT);
    if (silent && !flow->faults.absent) {
        hil_flow_chip_reset(flow, circuit->flow_kind, circuit->flow_address);
    }
    flow->faults.absent = silent || circuit->world->config.flow_rate_Hz <= 0.0;
    double moved[HIL_FLOW_AXES];
    hil_world_flow_way(circuit->world, circuit->flow_pose, moved);
    if (has_fault(circuit, HIL_FAULT_FLOW_STUCK)) {
        moved[0] = moved[1] = moved[2] = 0.0;
    }
    hil_flow_chip_move(flow, now_us, moved);
}

static const char *step(void *context, uint64_t now_us) {
    hil_teensy_circuit_t *circuit = context;
    hil_world_step(circuit->world, RT1062_STEP_us);
    step_gyro(circuit, now_us);
    step_flow(circuit, now_us);
    return refused_fault(circuit);
}

/* ------------------------------------------------------------------ pins */

static void encoder_counts(void *context, int32_t *counts) {
    hil_world_counts(((hil_teensy_circuit_t *)context)->world, counts);
}

static void duties(void *context, const uint16_t *steps) {
    hil_world_motor_pins(((hil_teensy_circuit_t *)context)->world, steps);
}

static void output_enable(void *context, bool enabled) {
    hil_world_output_enable(((hil_teensy_circuit_t *)context)->world, enabled);
}

static bool stop_button_open(void *context) {
    return has_fault(context, HIL_FAULT_STOP_BUTTON);
}

static double battery_V(void *context) {
    return ((hil_teensy_circuit_t *)context)->world->supply_V;
}

/* ------------------------------------------------------------------ I2C */

static void i2c_stuck(void *context, uint32_t bus, bool *scl, bool *sda) {
    const hil_teensy_circuit_t *circuit = context;
    const bool stuck = bus == BUS_MOTORS && has_fault(circuit, HIL_FAULT_I2C_STUCK);
    *scl = stuck && hil_world_fault_value(circuit->world, HIL_FAULT_I2C_STUCK) == HIL_STUCK_SCL;
    *sda = stuck && !*scl;
}

static bool i2c_start(void *context, uint32_t bus, uint64_t now_us, uint8_t address, bool read) {
    hil_teensy_circuit_t *circuit = context;
    switch (bus) {
    case BUS_MOTORS:
        return hil_world_i2c_start(circuit->world, address, read);
    case BUS_GYRO:
        circuit->gyro.time_us = now_us;
        return hil_gyro_chip_start(&circuit->gyro, address, read);
    default:
        circuit->flow.time_us = now_us;
        return hil_flow_chip_start(&circuit->flow, address, read);
    }
}

static bool i2c_put(void *context, uint32_t bus, uint8_t byte) {
    hil_teensy_circuit_t *circuit = context;
    switch (bus) {
    case BUS_MOTORS:
        return hil_world_i2c_put(circuit->world, byte);
    case BUS_GYRO:
        return hil_gyro_chip_put(&circuit->gyro, byte);
    default:
        return hil_flow_chip_put(&circuit->flow, byte);
    }
}

static uint8_t i2c_get(void *context, uint32_t bus) {
    hil_teensy_circuit_t *circuit = context;
    switch (bus) {
    case BUS_MOTORS:
        return hil_world_i2c_get(circuit->world);
    case BUS_GYRO:
        return hil_gyro_chip_get(&circuit->gyro);
    default:
        return hil_flow_chip_get(&circuit->flow);
    }
}

static void i2c_stop(void *context, uint32_t bus) {
    hil_teensy_circuit_t *circuit = context;
    switch (bus) {
    case BUS_MOTORS:
        hil_world_i2c_stop(circuit->world);
        break;
    case BUS_GYRO:
        hil_gyro_chip_stop(&circuit->gyro);
        break;
    default:
        hil_flow_chip_stop(&circuit->flow);
    }
}

/* ------------------------------------------------------------------ snapshots */

typedef struct saved_t {
    hil_teensy_circuit_t circuit;
    hil_world_t world;
} saved_t;

static void save(const void *context, void *state) {
    const hil_teensy_circuit_t *circuit = context;
    saved_t *saved = state;
    saved->circuit = *circuit;
    saved->world = *circuit->world;
}

static void restore(void *context, const void *state) {
    hil_teensy_circuit_t *circuit = context;
    const saved_t *saved = state;
    hil_world_t *world = circuit->world;
    *circuit = saved->circuit;
    *world = saved->world;
    circuit->world = world;
}

void hil_teensy_attach(rt1062_t *machine, hil_teensy_circuit_t *circuit) {
    const rt1062_circuit_t callbacks = {
        .context = circuit,
        .encoders = circuit->world->config.wheels,
        .i2c_buses = 1u << BUS_MOTORS | (circuit->gyro_address != 0 ? 1u << BUS_GYRO : 0u) |
                     (circuit->flow_address != 0 ? 1u << BUS_FLOW : 0u),
        .pwm_frequency_Hz = circuit->world->config.motor_pwm_Hz,
        .state_size = sizeof(saved_t),
        .power_on = power_on,
        .step = step,
        .encoder_counts = encoder_counts,
        .duties = duties,
        .output_enable = output_enable,
        .stop_button_open = stop_button_open,
        .battery_V = battery_V,
        .i2c_stuck = i2c_stuck,
        .i2c_start = i2c_start,
        .i2c_put = i2c_put,
        .i2c_get = i2c_get,
        .i2c_stop = i2c_stop,
        .save = save,
        .restore = restore,
    };
    rt1062_attach(machine, &callbacks);
}
