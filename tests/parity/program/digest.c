/* SPDX-License-Identifier: MIT */
#include "digest.h"

#include <inttypes.h>
#include <stdio.h>
#include <string.h>

#include "omni/math.h"

typedef struct field_t {
    const char *name;
    uint16_t offset;
    uint8_t size;  /* bytes of an element */
    uint8_t count; /* elements */
    bool real;
} field_t;

#define REALS(name)                                                                                                    \
    { #name, offsetof(omni_outputs_t, name), 4, sizeof(((omni_outputs_t *)0)->name) / 4, true }
#define WHOLE(name)                                                                                                    \
    { #name, offsetof(omni_outputs_t, name), sizeof(((omni_outputs_t *)0)->name), 1, false }

static const field_t fields[] = {
    WHOLE(time_us),
    WHOLE(state),
    WHOLE(drive),
    WHOLE(controller),
    WHOLE(setpoint_kind),
    WHOLE(faults),
    WHOLE(fault_history),
    WHOLE(config_sequence),
    REALS(duty),
    REALS(voltage_V),
    REALS(wheel_rad_s),
    REALS(wheel_reference),
    REALS(current_A),
    REALS(pose),
    REALS(rate),
    REALS(pose_sd),
    REALS(pose_xy_m2),
    REALS(reference.pose),
    REALS(reference.rate),
    REALS(reference.acceleration),
    REALS(reference.path_time_s),
    WHOLE(reference.phase),
    REALS(terms),
    REALS(ismc_margin),
    REALS(slip_m_s),
    REALS(slip_residual_m_s),
    REALS(wheel_scale),
    REALS(duty_scale),
    REALS(velocity_scale),
    WHOLE(velocity_limits),
    WHOLE(stop.wheel),
    REALS(stop.voltage_V),
    REALS(stop.wheel_rad_s),
    REALS(stop.supply_V),
    REALS(stop.error),
    REALS(supply_V),
    REALS(nis),
    WHOLE(fixes_accepted),
    WHOLE(fixes_refused),
    REALS(gyro_rad_s),
    REALS(gyro_bias),
    REALS(gyro_bias_sd),
    WHOLE(gyro_used),
    REALS(flow_sum),
    REALS(flow_nis),
    WHOLE(flow_used),
    WHOLE(flow_refused),
    WHOLE(flow_received),
    WHOLE(flow_dropped),
    REALS(flow_misalignment_rad),
    WHOLE(flow_usable),
    WHOLE(flow_overriding),
    REALS(motor_heat),
    REALS(current_reduction),
    REALS(stop.current_A),
};

enum {
    FIELDS = sizeof fields / sizeof fields[0],
    /* After config_sequence 2, after stop.wheel 3, after gyro_used 3, at the end 6. */
    PADDING = 5 + 3 + 6
};

bool digest_is_complete(void) {
    size_t bytes = PADDING;
    for (size_t i = 0; i < FIELDS; ++i) {
        bytes += (size_t)fields[i].size * fields[i].count;
    }
    return bytes == sizeof(omni_outputs_t);
}

/* Element of a field, zero-extended. */
static uint64_t element(const omni_outputs_t *outputs, const field_t *field, size_t index) {
    const uint8_t *at = (const uint8_t *)outputs + field->offset + index * field->size;
    uint64_t value = 0; /* every target is little-endian */
    memcpy(&value, at, field->size);
    return value;
}

uint64_t digest_word(uint64_t hash, uint32_t word) {
    const uint64_t mixed = (hash ^ word) * 0x9E3779B97F4A7C15u;
    return mixed ^ (mixed >> 29);
}

uint64_t digest_reals(uint64_t hash, const omni_real_t *values, size_t count) {
    for (size_t i = 0; i < count; ++i) {
        uint32_t bits;
        memcpy(&bits, &values[i], sizeof bits);
        hash = digest_word(hash, bits);
    }
    return hash;
}

uint64_t digest_outputs(uint64_t hash, const omni_outputs_t *outputs) {
    for (size_t i = 0; i < FIELDS; ++i) {
        for (size_t j = 0; j < fields[i].count; ++j) {
            const uint64_t value = element(outputs, &fields[i], j);
            hash = digest_word(hash, (uint32_t)value);
            if (fields[i].size > 4) {
                hash = digest_word(hash, (uint32_t)(value >> 32));
            }
        }
    }
    return hash;
}

const char *digest_not_finite(const omni_outputs_t *outputs) {
    for (size_t i = 0; i < FIELDS; ++i) {
        for (size_t j = 0; fields[i].real && j < fields[i].count; ++j) {
            const uint32_t exponent = 0x7F800000u;
            if (((uint32_t)element(outputs, &fields[i], j) & exponent) == exponent) {
                return fields[i].name;
            }
        }
    }
    return NULL;
}

void digest_print(uint32_t tick, const omni_outputs_t *outputs) {
    for (size_t i = 0; i < FIELDS; ++i) {
        printf("%" PRIu32 " %s", tick, fields[i].name);
        for (size_t j = 0; j < fields[i].count; ++j) {
            const uint64_t value = element(outputs, &fields[i], j);
            /* In halves: not every C library prints 64 bits. */
            printf(" %08" PRIx32 "%08" PRIx32, (uint32_t)(value >> 32), (uint32_t)value);
        }
        printf("\n");
    }
}
