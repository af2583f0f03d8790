/* SPDX-License-Identifier: MIT */
/* Refuses worlds that make no sense, naming the field. */
#include <float.h>
#include <math.h>
#include <stddef.h>
#include <stdio.h>
#include <string.h>

#include "parts.h"
#include "spd3.h"

/* Allowed range of a field: one number, `count` numbers, or one per wheel (count 0). */
typedef struct range_t {
    const char *name;
    size_t offset;
    uint32_t count;
    double minimum;
    double maximum;
    const char *allowed;
} range_t;

#define FIELD(name) #name, offsetof(hil_world_config_t, name)

static const range_t RANGES[] = {
    {FIELD(wheel_radius_m), 0, DBL_MIN, 10.0, "above 0, at most 10"},
    {FIELD(wheel_distance_m), 0, DBL_MIN, 100.0, "above 0, at most 100"},
    {FIELD(wheel_angle_rad), 0, -1e3, 1e3, "-1000..1000"},
    {FIELD(motor_inertia_kg_m2), 1, DBL_MIN, 1e6, "above 0"},
    {FIELD(motor_viscous_N_m_s), 1, 0.0, 1e6, "0 or more"},
    {FIELD(motor_coulomb_N_m), 1, 0.0, 1e6, "0 or more"},
    {FIELD(motor_constant_N_m_A), 1, DBL_MIN, 1e6, "above 0"},
    {FIELD(motor_resistance_ohm), 1, DBL_MIN, 1e6, "above 0"},
    {FIELD(motor_inductance_H), 1, DBL_MIN, 1e3, "above 0"},
    {FIELD(battery_V), 1, DBL_MIN, 1e3, "above 0, at most 1000"},
    {FIELD(battery_resistance_ohm), 1, 0.0, 1e3, "0 or more"},
    {FIELD(mass_kg), 1, DBL_MIN, 1e6, "above 0"},
    {FIELD(inertia_kg_m2), 1, DBL_MIN, 1e6, "above 0"},
    {FIELD(friction_coefficient), 1, DBL_MIN, 1e6, "above 0, at most 1e6"},
    {FIELD(slip_stiffness_N_s_m), 1, DBL_MIN, 1e9, "above 0"},
    {FIELD(roller_friction_N_s_m), 1, 0.0, 1e6, "0 or more"},
    {FIELD(slip_max), 1, 0.0, 0.99, "0..0.99"},
    {FIELD(slip_time_s), 1, 1e-6, 1e6, "at least 0.000001"},
    {FIELD(slip_speed_max_m_s), 1, 0.0, 1e3, "0 or more"},
    {FIELD(linear_viscous), 3, -1.0, 1e6, "0 or more, or -1: from the motors"},
    {FIELD(linear_coulomb), 3, -1.0, 1e6, "0 or more, or -1: from the motors"},
    {FIELD(fix_rate_Hz), 1, 0.0, 1e4, "0 (no pose sensor) .. 10000"},
    {FIELD(fix_sd_xy_m), 1, 0.0, 1e3, "0 or more"},
    {FIELD(fix_sd_theta_rad), 1, 0.0, 1e3, "0 or more"},
    {FIELD(fix_delay_s), 1, 0.0, 1e3, "0 or more"},
    {FIELD(output_enable_rest_V), 1, 0.0, 5.5, "0 to 5.5"},
    {FIELD(fix_drop_probability), 1, 0.0, 1.0, "0..1"},
    {FIELD(start_pose), 3, -1e6, 1e6, "-1e6..1e6"},
};

typedef struct complaint_t {
    char *why;
    uint32_t size;
} complaint_t;

static hil_result_t refuse(const complaint_t *complaint, const char *name, int32_t index, double value, const char *allowed) {
    if (complaint->size > 0) {
        char element[16] = "";
        if (index >= 0) {
            (void)snprintf(element, sizeof element, "[%d]", (int)index);
        }
        (void)snprintf(complaint->why, complaint->size, "%s%s is %g; allowed: %s", name, element, value, allowed);
    }
    return HIL_ERR_CONFIG;
}

static hil_result_t check_range(const hil_world_config_t *config, const range_t *range, const complaint_t *complaint) {
    const uint32_t count = range->count == 0 ? config->wheels : range->count;
    for (uint32_t i = 0; i < count; i++) {
        double value;
        memcpy(&value, (const char *)config + range->offset + i * sizeof value, sizeof value);
        /* Written so that NaN is refused. */
        if (!(value >= range->minimum && value <= range->maximum)) {
            return refuse(complaint, range->name, range->count == 1 ? -1 : (int32_t)i, value, range->allowed);
        }
    }
    return HIL_OK;
}

/* The report's models get the body's velocity from rolling: the wheels' contacts must determine it. */
static hil_result_t check_plant(const hil_world_config_t *config, const complaint_t *complaint) {
    if (config->plant >= HIL_PLANT_KIND_COUNT) {
        return refuse(complaint, "plant", -1, config->plant, "a number of hil_plant_kind_t");
    }
    double rolling[6] = {0.0};
    for (uint32_t i = 0; i < config->wheels; i++) {
        const double angle_rad = config->wheel_angle_rad[i];
        hil_spd3_add(rolling, 1.0, -sin(angle_rad), cos(angle_rad), config->wheel_distance_m[i] / config->wheel_distance_m[0]);
    }
    hil_spd3_t factors;
    hil_spd3_factor(&factors, rolling);
    for (int n = 0; n < 3 && config->plant != HIL_PLANT_FULL; n++) {
        if (!(factors.inv_d[n] > 0.0 && factors.inv_d[n] < 1e6)) {
            return refuse(complaint, "wheel_angle_rad", 0, config->wheel_angle_rad[0],
                          "wheels that together move the body in every direction");
        }
    }
    return HIL_OK;
}

static hil_result_t check_direction(const char *name, const int32_t *direction, uint32_t wheels, const complaint_t *complaint) {
    for (uint32_t i = 0; i < wheels; i++) {
        if (direction[i] != 1 && direction[i] != -1) {
            return refuse(complaint, name, (int32_t)i, direction[i], "1 or -1");
        }
    }
    return HIL_OK;
}

static hil_result_t check_channels(const hil_world_config_t *config, const complaint_t *complaint) {
    uint32_t used = 0;
    for (uint32_t n = 0; n < 2 * config->wheels; n++) {
        const uint32_t wheel = n / 2;
        const bool first = n % 2 == 0;
        const uint32_t channel = first ? config->in1_channel[wheel] : config->in2_channel[wheel];
        if (channel >= HIL_PCA9685_CHANNELS || (used & 1u << channel) != 0) {
            return refuse(complaint, first ? "in1_channel" : "in2_channel", (int32_t)wheel, channel,
                          "0..15, each channel once");
        }
        used |= 1u << channel;
    }
    return HIL_OK;
}

static hil_result_t check_wiring(const hil_world_config_t *config, const complaint_t *complaint) {
    if (config->counts_per_revolution < 1) {
        return refuse(complaint, "counts_per_revolution", -1, config->counts_per_revolution, "1 or more");
    }
    if (config->pca9685_address == 0 || config->pca9685_address > 0x7F) {
        return refuse(complaint, "pca9685_address", -1, config->pca9685_address, "1..127");
    }
    if (config->i2c_stranger > 0x7F || config->i2c_stranger == config->pca9685_address) {
        return refuse(complaint, "i2c_stranger", -1, config->i2c_stranger, "0..127, not the PWM chip's");
    }
    hil_result_t result = check_direction("encoder_direction", config->encoder_direction, config->wheels, complaint);
    if (result == HIL_OK) {
        result = check_direction("motor_direction", config->motor_direction, config->wheels, complaint);
    }
    return result == HIL_OK ? check_channels(config, complaint) : result;
}

static bool needs_wheel(uint8_t kind) {
    return kind == HIL_FAULT_ENCODER_STUCK || kind == HIL_FAULT_ENCODER_REVERSED || kind == HIL_FAULT_ENCODER_INVALID ||
           kind == HIL_FAULT_ENCODER_NOISY || kind == HIL_FAULT_ENCODER_BIT || kind == HIL_FAULT_MOTOR_DEAD ||
           kind == HIL_FAULT_MOTOR_STALLED || kind == HIL_FAULT_WHEEL_TURNED;
}

typedef struct fault_range_t {
    uint8_t kind;
    double minimum;
    double maximum;
    const char *allowed;
} fault_range_t;

static const fault_range_t FAULT_RANGES[] = {
    {HIL_FAULT_BATTERY_SAG, 0.0, 1e6, "a voltage not below 0"}, {HIL_FAULT_ENCODER_NOISY, 0.0, 1e6, "counts, 0..1e6"},
    {HIL_FAULT_ENCODER_BIT, 0.0, 31.0, "a bit number, 0..31"},  {HIL_FAULT_POSE_DELAY, 0.0, 1.0, "0..1 s"},
    {HIL_FAULT_CLOCK_JUMP, -1e3, 1e3, "-1000..1000 s"},         {HIL_FAULT_TICK_LATE, 1e-4, 0.1, "0.0001..0.1 s"},
};

static hil_result_t check_fault_value(const hil_fault_t *fault, uint32_t index, const complaint_t *complaint) {
    fault_range_t range = {fault->kind, -1e6, 1e6, "a finite number"};
    for (size_t i = 0; i < sizeof FAULT_RANGES / sizeof FAULT_RANGES[0]; i++) {
        range = FAULT_RANGES[i].kind == fault->kind ? FAULT_RANGES[i] : range;
    }
    if (!(fault->value >= range.minimum && fault->value <= range.maximum)) {
        return refuse(complaint, "fault.value", (int32_t)index, fault->value, range.allowed);
    }
    return HIL_OK;
}

static hil_result_t check_fault(const hil_world_config_t *config, uint32_t index, const complaint_t *complaint) {
    const hil_fault_t *fault = &config->fault[index];
    if (fault->kind >= HIL_FAULT_KIND_COUNT) {
        return refuse(complaint, "fault.kind", (int32_t)index, fault->kind, "a number of hil_fault_kind_t");
    }
    if (needs_wheel(fault->kind) && fault->wheel >= config->wheels) {
        return refuse(complaint, "fault.wheel", (int32_t)index, fault->wheel, "a wheel of the robot, from 0");
    }
    if (!(fault->start_s >= 0.0)) {
        return refuse(complaint, "fault.start_s", (int32_t)index, fault->start_s, "0 or more");
    }
    if (!(fault->stop_s > fault->start_s)) {
        return refuse(complaint, "fault.stop_s", (int32_t)index, fault->stop_s, "above start_s");
    }
    return check_fault_value(fault, index, complaint);
}

static hil_result_t check_faults(const hil_world_config_t *config, const complaint_t *complaint) {
    if (config->fault_count > HIL_MAX_FAULTS) {
        return refuse(complaint, "fault_count", -1, config->fault_count, "0..16");
    }
    for (uint32_t i = 0; i < config->fault_count; i++) {
        const hil_result_t result = check_fault(config, i, complaint);
        if (result != HIL_OK) {
            return result;
        }
    }
    return HIL_OK;
}

hil_result_t hil_config_check(const hil_world_config_t *config, char *why, uint32_t why_size) {
    complaint_t complaint;
    complaint.why = why;
    complaint.size = why_size;
    if (config->wheels != 3 && config->wheels != 4) {
        return refuse(&complaint, "wheels", -1, config->wheels, "3 or 4");
    }
    for (size_t i = 0; i < sizeof RANGES / sizeof RANGES[0]; i++) {
        const hil_result_t result = check_range(config, &RANGES[i], &complaint);
        if (result != HIL_OK) {
            return result;
        }
    }
    if (config->fix_delay_s * config->fix_rate_Hz > HIL_MAX_FIXES - 1) {
        return refuse(&complaint, "fix_delay_s", -1, config->fix_delay_s, "at most 63 fixes on their way at once");
    }
    hil_result_t result = check_plant(config, &complaint);
    if (result == HIL_OK) {
        result = check_wiring(config, &complaint);
    }
    return result == HIL_OK ? check_faults(config, &complaint) : result;
}
