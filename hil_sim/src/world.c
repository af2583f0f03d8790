/* SPDX-License-Identifier: MIT */
/* The world but its step: start, transactions of the bus, ideal sources. */
#include "hil_sim/world.h"

#include <math.h>
#include <string.h>

#include "parts.h"

enum { I2C_HEADER = 2 };

hil_result_t hil_world_init(hil_world_t *world, const hil_world_config_t *config, char *why, uint32_t why_size) {
    const hil_result_t result = hil_config_check(config, why, why_size);
    if (result != HIL_OK) {
        return result;
    }
    memset(world, 0, sizeof *world);
    world->config = *config;
    memcpy(world->pose, config->start_pose, sizeof world->pose);
    hil_plant_init(&world->plant, config);
    hil_pca9685_reset(&world->chip, (uint8_t)config->pca9685_address);
    world->chip.output_enable_high = hil_output_enable_high(config, HIL_OE_RELEASED);
    hil_bridges_init(world);
    hil_faults_update(world);
    world->supply_V = hil_fault_value(world, HIL_FAULT_BATTERY_SAG, config->battery_V);
    world->source_V = config->battery_V;
    hil_slip_init(world);
    hil_sensors_sample(world);
    return HIL_OK;
}

/* One coded transaction at `bytes`. @return its length, 0 if it doesn't fit into `left`. */
static uint32_t transaction_length(const uint8_t *bytes, uint32_t left) {
    const uint32_t length = left < I2C_HEADER ? 0 : I2C_HEADER + (uint32_t)bytes[1] + 1;
    const bool fits = length != 0 && length <= left && bytes[length - 1] <= HIL_MAX_I2C_READ;
    return fits ? length : 0;
}

static bool i2c_parses(const uint8_t *bytes, uint32_t length) {
    uint32_t at = 0;
    while (at < length) {
        const uint32_t used = transaction_length(bytes + at, length - at);
        if (used == 0) {
            return false;
        }
        at += used;
    }
    return length <= HIL_MAX_I2C;
}

bool hil_world_i2c_start(hil_world_t *world, uint8_t address, bool read) {
    if (hil_bus_fault(world) != 0) {
        return false;
    }
    const bool acknowledged = hil_has_chip(world) && hil_pca9685_start(&world->chip, address, read);
    world->stranger_addressed = !read && world->config.i2c_stranger != 0 && address == world->config.i2c_stranger;
    return acknowledged || world->stranger_addressed;
}

bool hil_world_i2c_put(hil_world_t *world, uint8_t byte) {
    if (hil_bus_fault(world) != 0) {
        return false;
    }
    const bool acknowledged = hil_has_chip(world) && hil_pca9685_put(&world->chip, byte);
    return acknowledged || world->stranger_addressed;
}

uint8_t hil_world_i2c_get(hil_world_t *world) {
    return hil_pca9685_get(&world->chip);
}

void hil_world_i2c_stop(hil_world_t *world) {
    hil_pca9685_stop(&world->chip);
    world->stranger_addressed = false;
    hil_bridges_apply_inputs(world, false);
}

/* START, address and bytes. */
static bool write_all(hil_world_t *world, uint8_t address, const uint8_t *data, uint32_t length) {
    bool acknowledged = hil_world_i2c_start(world, address, false);
    for (uint32_t i = 0; i < length && acknowledged; i++) {
        acknowledged = hil_world_i2c_put(world, data[i]);
    }
    return acknowledged;
}

static bool read_all(hil_world_t *world, uint8_t address, uint32_t length) {
    const bool acknowledged = hil_world_i2c_start(world, address, true);
    for (uint32_t i = 0; i < length && acknowledged; i++) {
        world->i2c_read[i] = hil_world_i2c_get(world);
    }
    world->i2c_read_length = acknowledged ? (uint8_t)length : 0;
    return acknowledged;
}

static void run_transaction(hil_world_t *world, const uint8_t *bytes) {
    const uint8_t address = bytes[0];
    const uint8_t written = bytes[1];
    const uint8_t wanted = bytes[I2C_HEADER + written];
    bool acknowledged = true;
    if (written > 0 || wanted == 0) {
        acknowledged = write_all(world, address, bytes + I2C_HEADER, written);
    }
    if (acknowledged && wanted > 0) {
        acknowledged = read_all(world, address, wanted);
    }
    if (!acknowledged) {
        world->i2c_status |= HIL_I2C_NOT_ACKNOWLEDGED;
    }
}

hil_result_t hil_world_i2c(hil_world_t *world, const uint8_t *bytes, uint32_t length) {
    world->i2c_status = 0;
    world->i2c_read_length = 0;
    if (!i2c_parses(bytes, length)) {
        return HIL_ERR_PROTOCOL;
    }
    if (length == 0) {
        return HIL_OK;
    }
    world->i2c_status = hil_bus_fault(world);
    if (world->i2c_status != 0) {
        return HIL_OK;
    }
    for (uint32_t at = 0; at < length; at += transaction_length(bytes + at, length - at)) {
        run_transaction(world, bytes + at);
    }
    hil_world_i2c_stop(world);
    return HIL_OK;
}

static hil_result_t drive(hil_world_t *world, uint32_t source, const double *values) {
    if (!hil_plant_accepts_source(world->config.plant, source)) {
        return HIL_ERR_CONFIG;
    }
    for (uint32_t i = 0; i < world->config.wheels; i++) {
        if (!isfinite(values[i])) {
            return HIL_ERR_CONFIG;
        }
    }
    hil_plant_set_source(world, source);
    memcpy(world->driven, values, world->config.wheels * sizeof values[0]);
    return HIL_OK;
}

hil_result_t hil_world_drive_speed(hil_world_t *world, const double *wheel_rad_s) {
    return drive(world, HIL_SOURCE_SPEED, wheel_rad_s);
}

hil_result_t hil_world_drive_voltage(hil_world_t *world, const double *volts) {
    return drive(world, HIL_SOURCE_VOLTAGE, volts);
}

hil_result_t hil_world_drive_torque(hil_world_t *world, const double *torque_N_m) {
    return drive(world, HIL_SOURCE_TORQUE, torque_N_m);
}

double hil_world_kinetic_energy(const hil_world_t *world) {
    const hil_world_config_t *config = &world->config;
    const double speed2 = world->twist[0] * world->twist[0] + world->twist[1] * world->twist[1];
    double energy_J = 0.5 * config->mass_kg * speed2 + 0.5 * config->inertia_kg_m2 * world->twist[2] * world->twist[2];
    for (uint32_t i = 0; i < config->wheels; i++) {
        const double share = world->plant.play ? config->wheel_inertia_share : 1.0, motor = world->motor_rad_s[i];
        const double wheel2 = world->wheel_rad_s[i] * world->wheel_rad_s[i];
        energy_J += 0.5 * config->motor_inertia_kg_m2 * (share * wheel2 + (1.0 - share) * motor * motor);
    }
    return energy_J;
}
