/* SPDX-License-Identifier: MIT */
#include "hil_sim/world.h"

#include <math.h>
#include <string.h>

#include "parts.h"

enum { PWM_STEPS = 4096, NOT_ACKNOWLEDGED = 1, BUS_STUCK = 2, I2C_HEADER = 2 };

/* PRESCALE 3, the chip's fastest. */
static const double DIRECT_PERIOD_s = 4096.0 * 4.0 / 25e6;

hil_result_t hil_world_init(hil_world_t *world, const hil_world_config_t *config, char *why, uint32_t why_size) {
    const hil_result_t result = hil_config_check(config, why, why_size);
    if (result != HIL_OK) {
        return result;
    }
    memset(world, 0, sizeof *world);
    world->config = *config;
    memcpy(world->pose, config->start_pose, sizeof world->pose);
    hil_plant_init(&world->plant, config);
    hil_pca9685_reset(&world->chip, config->pca9685_address);
    world->chip.output_enable_high = config->output_enable_wired;
    for (uint32_t i = 0; i < config->wheels; i++) {
        hil_motors_apply_inputs(world, i, 0.0, 0.0, DIRECT_PERIOD_s);
    }
    world->supply_V = hil_fault_value(world, HIL_FAULT_BATTERY_SAG, config->battery_V);
    hil_slip_init(world);
    hil_pose_sensor_update(world);
    return HIL_OK;
}

static bool fault_covers(const hil_fault_t *fault, uint8_t kind, uint32_t wheel, double time_us) {
    const bool concerns = wheel >= HIL_MAX_WHEELS || fault->wheel == wheel;
    /* Half a microsecond, because times given in seconds are rounded. */
    const bool now = time_us >= fault->start_s * 1e6 - 0.5 && time_us < fault->stop_s * 1e6 - 0.5;
    return fault->kind == kind && concerns && now;
}

const hil_fault_t *hil_fault_find(const hil_world_t *world, uint8_t kind, uint32_t wheel) {
    for (uint32_t i = 0; i < world->config.fault_count; i++) {
        const hil_fault_t *fault = &world->config.fault[i];
        if (fault_covers(fault, kind, wheel, (double)world->time_us)) {
            return fault;
        }
    }
    return NULL;
}

bool hil_world_fault_active(const hil_world_t *world, uint8_t kind, uint32_t wheel) {
    return hil_fault_find(world, kind, wheel) != NULL;
}

double hil_fault_value(const hil_world_t *world, uint8_t kind, double otherwise) {
    const hil_fault_t *fault = hil_fault_find(world, kind, HIL_MAX_WHEELS);
    return fault != NULL ? fault->value : otherwise;
}

uint32_t hil_world_tick_us(const hil_world_t *world, uint32_t usual_us) {
    return (uint32_t)(1e6 * hil_fault_value(world, HIL_FAULT_TICK_LATE, 1e-6 * usual_us) + 0.5);
}

/* What the robot takes for the time; never before the clock's zero. */
static uint64_t robot_clock_us(const hil_world_t *world) {
    const hil_fault_t *stuck = hil_fault_find(world, HIL_FAULT_CLOCK_STUCK, HIL_MAX_WHEELS);
    if (stuck != NULL) {
        return (uint64_t)(stuck->start_s * 1e6);
    }
    const double time_us = (double)world->time_us + 1e6 * hil_fault_value(world, HIL_FAULT_CLOCK_JUMP, 0.0);
    return time_us > 0.0 ? (uint64_t)(time_us + 0.5) : 0;
}

static uint8_t valid_counts(const hil_world_t *world) {
    uint32_t valid = 0;
    for (uint32_t i = 0; i < world->config.wheels; i++) {
        valid |= (uint32_t)!hil_world_fault_active(world, HIL_FAULT_ENCODER_INVALID, i) << i;
    }
    return (uint8_t)valid;
}

static void take_due_fix(hil_world_t *world, hil_sensors_t *sensors) {
    sensors->has_fix = world->fix_count > 0 && world->fix[world->fix_head].arrives_us <= world->time_us;
    if (sensors->has_fix) {
        sensors->fix = world->fix[world->fix_head];
        world->fix_head = (world->fix_head + 1) % HIL_MAX_FIXES;
        world->fix_count--;
    }
}

void hil_world_sense(hil_world_t *world, hil_sensors_t *sensors) {
    memset(sensors, 0, sizeof *sensors);
    sensors->time_us = robot_clock_us(world);
    hil_encoders_read(world, sensors->counts);
    sensors->counts_valid = valid_counts(world);
    sensors->battery_V = world->supply_V;
    sensors->i2c_status = world->i2c_status;
    sensors->i2c_read_length = world->i2c_read_length;
    memcpy(sensors->i2c_read, world->i2c_read, sizeof sensors->i2c_read);
    sensors->link_silent = hil_world_fault_active(world, HIL_FAULT_LINK_SILENCE, HIL_MAX_WHEELS);
    take_due_fix(world, sensors);
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

static bool i2c_write(hil_world_t *world, uint8_t address, const uint8_t *data, uint32_t length) {
    const bool stranger = world->config.i2c_stranger != 0 && address == world->config.i2c_stranger;
    return stranger || hil_pca9685_write(&world->chip, address, data, length);
}

static void run_transaction(hil_world_t *world, const uint8_t *bytes) {
    const uint8_t address = bytes[0];
    const uint8_t written = bytes[1];
    const uint8_t wanted = bytes[I2C_HEADER + written];
    bool acknowledged = true;
    if (written > 0 || wanted == 0) {
        acknowledged = i2c_write(world, address, bytes + I2C_HEADER, written);
    }
    if (acknowledged && wanted > 0) {
        acknowledged = hil_pca9685_read(&world->chip, address, world->i2c_read, wanted);
        world->i2c_read_length = acknowledged ? wanted : 0;
    }
    if (!acknowledged) {
        world->i2c_status |= NOT_ACKNOWLEDGED;
    }
}

static void direct_to_bridges(hil_world_t *world) {
    for (uint32_t i = 0; i < world->config.wheels; i++) {
        world->in1[i] = world->chip.output_enable_high ? 0.0 : world->direct_in1[i];
        world->in2[i] = world->chip.output_enable_high ? 0.0 : world->direct_in2[i];
        hil_motors_apply_inputs(world, i, 0.0, 0.0, DIRECT_PERIOD_s);
    }
}

static void chip_to_bridges(hil_world_t *world) {
    const double period_s = 1.0 / hil_pca9685_frequency_Hz(&world->chip);
    for (uint32_t i = 0; i < world->config.wheels; i++) {
        const uint32_t channel1 = world->config.in1_channel[i];
        const uint32_t channel2 = world->config.in2_channel[i];
        world->in1[i] = hil_pca9685_duty(&world->chip, channel1);
        world->in2[i] = hil_pca9685_duty(&world->chip, channel2);
        hil_motors_apply_inputs(world, i, hil_pca9685_phase(&world->chip, channel1), hil_pca9685_phase(&world->chip, channel2),
                                period_s);
    }
}

static void outputs_to_bridges(hil_world_t *world, bool direct) {
    world->direct = direct;
    hil_plant_source(world, HIL_SOURCE_BRIDGES);
    if (direct) {
        direct_to_bridges(world);
    } else {
        chip_to_bridges(world);
    }
}

void hil_world_output_enable(hil_world_t *world, bool on) {
    const bool high = world->config.output_enable_wired && !on;
    if (high == world->chip.output_enable_high) {
        return;
    }
    world->chip.output_enable_high = high;
    if (world->source == HIL_SOURCE_BRIDGES) {
        outputs_to_bridges(world, world->direct);
    }
}

static uint8_t bus_fault(const hil_world_t *world) {
    if (hil_world_fault_active(world, HIL_FAULT_I2C_STUCK, HIL_MAX_WHEELS)) {
        return BUS_STUCK;
    }
    const bool silent = hil_world_fault_active(world, HIL_FAULT_I2C_NACK, HIL_MAX_WHEELS) ||
                        hil_world_fault_active(world, HIL_FAULT_CHIP_POWER, HIL_MAX_WHEELS);
    return silent ? NOT_ACKNOWLEDGED : 0;
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
    world->i2c_status = bus_fault(world);
    if (world->i2c_status != 0) {
        return HIL_OK;
    }
    for (uint32_t at = 0; at < length; at += transaction_length(bytes + at, length - at)) {
        run_transaction(world, bytes + at);
    }
    outputs_to_bridges(world, false);
    return HIL_OK;
}

static double share_of_period(uint16_t steps) {
    return (steps < PWM_STEPS ? steps : PWM_STEPS) / (double)PWM_STEPS;
}

void hil_world_bridge(hil_world_t *world, const uint16_t *in1_steps, const uint16_t *in2_steps) {
    world->i2c_status = bus_fault(world);
    if (world->i2c_status != 0) {
        return;
    }
    for (uint32_t i = 0; i < world->config.wheels; i++) {
        world->direct_in1[i] = share_of_period(in1_steps[i]);
        world->direct_in2[i] = share_of_period(in2_steps[i]);
    }
    outputs_to_bridges(world, true);
}

static hil_result_t drive(hil_world_t *world, uint32_t source, const double *values) {
    if (!hil_plant_takes(world->config.plant, source)) {
        return HIL_ERR_CONFIG;
    }
    for (uint32_t i = 0; i < world->config.wheels; i++) {
        if (!isfinite(values[i])) {
            return HIL_ERR_CONFIG;
        }
    }
    hil_plant_source(world, source);
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

/* A chip without power drives nothing and wakes up with its power-up registers. */
static void starve_chip(hil_world_t *world) {
    if (!hil_world_fault_active(world, HIL_FAULT_CHIP_POWER, HIL_MAX_WHEELS)) {
        return;
    }
    hil_pca9685_reset(&world->chip, world->config.pca9685_address);
    memset(world->direct_in1, 0, sizeof world->direct_in1);
    memset(world->direct_in2, 0, sizeof world->direct_in2);
    outputs_to_bridges(world, world->direct);
}

/* Whatever the plant made of the wheel: a hand, and a blocked gear, are stronger. */
static void turn_by_hand(hil_world_t *world, const double *angle_before_rad, double step_s) {
    for (uint32_t i = 0; i < world->config.wheels; i++) {
        const hil_fault_t *blocked = hil_fault_find(world, HIL_FAULT_MOTOR_STALLED, i);
        const hil_fault_t *turned = hil_fault_find(world, HIL_FAULT_WHEEL_TURNED, i);
        if (blocked != NULL || turned != NULL) {
            world->wheel_rad_s[i] = blocked != NULL ? 0.0 : turned->value;
            world->wheel_angle_rad[i] = angle_before_rad[i] + world->wheel_rad_s[i] * step_s;
        }
    }
}

void hil_world_step(hil_world_t *world, uint32_t step_us) {
    if (step_us == 0) {
        return;
    }
    starve_chip(world);
    const double step_s = 1e-6 * step_us;
    double open_end_A[HIL_MAX_WHEELS] = {0.0};
    double angle_before_rad[HIL_MAX_WHEELS];
    hil_electrics_t electrics;
    memcpy(angle_before_rad, world->wheel_angle_rad, sizeof angle_before_rad);
    hil_slip_update(world, 1e-6 * (double)world->time_us + 0.5 * step_s);
    hil_motors_begin(world, &electrics, step_s, open_end_A);
    hil_plant_step(world, &electrics, step_s);
    hil_motors_end(world, &electrics, open_end_A);
    turn_by_hand(world, angle_before_rad, step_s);
    hil_encoders_update(world);
    world->time_us += step_us;
    world->steps++;
    hil_slip_hold(world);
    hil_pose_sensor_update(world);
}

double hil_world_kinetic_energy(const hil_world_t *world) {
    const hil_world_config_t *config = &world->config;
    const double speed2 = world->twist[0] * world->twist[0] + world->twist[1] * world->twist[1];
    double energy_J = 0.5 * config->mass_kg * speed2 + 0.5 * config->inertia_kg_m2 * world->twist[2] * world->twist[2];
    for (uint32_t i = 0; i < config->wheels; i++) {
        energy_J += 0.5 * config->motor_inertia_kg_m2 * world->wheel_rad_s[i] * world->wheel_rad_s[i];
    }
    return energy_J;
}
