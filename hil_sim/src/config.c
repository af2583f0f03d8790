/* SPDX-License-Identifier: MIT */
/* Refuses worlds that make no sense, naming the field. */
#include <math.h>
#include <stddef.h>
#include <stdio.h>
#include <string.h>

#include "drivers_gen.h"
#include "hil_sim/schema.h"
#include "parts.h"
#include "spd3.h"

static const double LARGEST_PATCH_m = 1e6;

typedef struct complaint_t {
    char *why;
    uint32_t size;
} complaint_t;

static hil_result_t refuse(const complaint_t *complaint, const char *name, int32_t index, double value,
                           const char *allowed) {
    if (complaint->size > 0) {
        char element[16] = "";
        if (index >= 0) {
            (void)snprintf(element, sizeof element, "[%d]", (int)index);
        }
        (void)snprintf(complaint->why, complaint->size, "%s%s is %g; allowed: %s", name, element, value, allowed);
    }
    return HIL_ERR_CONFIG;
}

static double element_of(const hil_world_config_t *config, const hil_number_t *number, uint32_t index) {
    const char *first = (const char *)config + number->offset;
    if (number->whole) {
        int32_t value;
        memcpy(&value, first + index * sizeof value, sizeof value);
        return value;
    }
    double value;
    memcpy(&value, first + index * sizeof value, sizeof value);
    return value;
}

static hil_result_t check_number(const hil_world_config_t *config, const hil_number_t *number,
                                 const complaint_t *complaint) {
    const uint32_t count = number->count == 0 ? config->wheels : number->count;
    for (uint32_t i = 0; i < count; i++) {
        const double value = element_of(config, number, i);
        /* Written so that NaN is refused. */
        if (!(value >= number->minimum && value <= number->maximum)) {
            return refuse(complaint, number->name, number->count == 1 ? -1 : (int32_t)i, value, number->allowed);
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
        hil_spd3_add(rolling, 1.0, -sin(angle_rad), cos(angle_rad),
                     config->wheel_distance_m[i] / config->wheel_distance_m[0]);
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

static hil_result_t check_direction(const char *name, const int32_t *direction, uint32_t wheels,
                                    const complaint_t *complaint) {
    for (uint32_t i = 0; i < wheels; i++) {
        if (direction[i] == 0) {
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
        const uint32_t channel = (uint32_t)(first ? config->in1_channel[wheel] : config->in2_channel[wheel]);
        if ((used & 1u << channel) != 0) {
            return refuse(complaint, first ? "in1_channel" : "in2_channel", (int32_t)wheel, channel,
                          "each channel once");
        }
        used |= 1u << channel;
    }
    return HIL_OK;
}

static hil_result_t check_wiring(const hil_world_config_t *config, const complaint_t *complaint) {
    if (config->i2c_stranger == config->pca9685_address) {
        return refuse(complaint, "i2c_stranger", -1, config->i2c_stranger, "an address that is not the PWM chip's");
    }
    if (config->driver >= HIL_DRIVER_COUNT) {
        return refuse(complaint, "driver", -1, config->driver, "a number of hil_driver_t");
    }
    hil_result_t result = check_direction("encoder_direction", config->encoder_direction, config->wheels, complaint);
    if (result == HIL_OK) {
        result = check_direction("motor_direction", config->motor_direction, config->wheels, complaint);
    }
    return result == HIL_OK && !HIL_DRIVERS[config->driver].on_pins ? check_channels(config, complaint) : result;
}

static hil_result_t check_fault(const hil_world_config_t *config, uint32_t index, const complaint_t *complaint) {
    const hil_fault_t *fault = &config->fault[index];
    if (fault->kind >= HIL_FAULT_KIND_COUNT) {
        return refuse(complaint, "fault.kind", (int32_t)index, fault->kind, "a number of hil_fault_kind_t");
    }
    const hil_fault_rule_t *rule = &hil_fault_rules[fault->kind];
    if (rule->wheel && fault->wheel >= config->wheels) {
        return refuse(complaint, "fault.wheel", (int32_t)index, fault->wheel, "a wheel of the robot, from 0");
    }
    if (!(fault->start_s >= 0.0)) {
        return refuse(complaint, "fault.start_s", (int32_t)index, fault->start_s, "0 or more");
    }
    if (!(fault->stop_s > fault->start_s)) {
        return refuse(complaint, "fault.stop_s", (int32_t)index, fault->stop_s, "above start_s");
    }
    if (!(fault->value >= rule->minimum && fault->value <= rule->maximum)) {
        return refuse(complaint, "fault.value", (int32_t)index, fault->value, rule->allowed);
    }
    return HIL_OK;
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

static hil_result_t check_patch(const hil_world_config_t *config, uint32_t index, const complaint_t *complaint) {
    const hil_patch_t *patch = &config->patch[index];
    const int32_t number = (int32_t)index;
    if (!(patch->friction >= 0.001 && patch->friction <= 10.0)) {
        return refuse(complaint, "patch.friction", number, patch->friction, "0.001..10, a factor");
    }
    if (!(patch->radius_m >= 0.0 && patch->radius_m <= LARGEST_PATCH_m)) {
        return refuse(complaint, "patch.radius_m", number, patch->radius_m, "0 for a rectangle, up to 1e6");
    }
    for (int n = 0; n < (patch->radius_m > 0.0 ? 1 : 2); n++) {
        if (!(fabs(patch->x_m[n]) <= LARGEST_PATCH_m) || !(fabs(patch->y_m[n]) <= LARGEST_PATCH_m)) {
            const double wrong = fabs(patch->x_m[n]) <= LARGEST_PATCH_m ? patch->y_m[n] : patch->x_m[n];
            return refuse(complaint, "patch.x_m or y_m", number, wrong, "-1e6..1e6");
        }
    }
    if (!(patch->radius_m > 0.0) && !(patch->x_m[0] < patch->x_m[1] && patch->y_m[0] < patch->y_m[1])) {
        const double wrong = patch->x_m[0] < patch->x_m[1] ? patch->y_m[1] : patch->x_m[1];
        return refuse(complaint, "patch.x_m or y_m", number, wrong, "from, then a larger to");
    }
    return HIL_OK;
}

static hil_result_t check_patches(const hil_world_config_t *config, const complaint_t *complaint) {
    if (config->patch_count > HIL_MAX_PATCHES) {
        return refuse(complaint, "patch_count", -1, config->patch_count, "0..8");
    }
    if (config->patch_count > 0 && config->plant != HIL_PLANT_FULL) {
        return refuse(complaint, "patch_count", -1, config->patch_count, "0 for every plant but full");
    }
    for (uint32_t i = 0; i < config->patch_count; i++) {
        const hil_result_t result = check_patch(config, i, complaint);
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
    for (uint32_t i = 0; i < hil_number_count; i++) {
        const hil_result_t result = check_number(config, &hil_numbers[i], &complaint);
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
    if (result == HIL_OK) {
        result = check_patches(config, &complaint);
    }
    return result == HIL_OK ? check_faults(config, &complaint) : result;
}
