/* SPDX-License-Identifier: MIT */
/*
 * Sensor gyro: turn rates about the three axes of its chip, sampled at its own rate.
 *
 *   reading = (1 + scale error) (rate + bias + noise),    limited to the range and rounded to its 32768th part
 *
 * Noise is white: its standard deviation per sample is the density times the root of the rate. The bias starts
 * anywhere, walks, and changes as the chip warms up: warmth = end (1 - e^(-t/T)). The chip's axes are those of the
 * body, turned so that one of them points up, and tilted. So the body's roll and pitch on its rollers shake the
 * readings. The chip's filter is one of first order, y' = (rate - y)/T. Between two looks the rate changes evenly.
 */
#include <string.h>

#include "hil_sim/random.h"
#include "sensor.h"

enum { GYRO_AXES = 3, BIAS_STEP_US = 100000 };

static const double gyro_steps = 32768.0;
static const double root_bias_step = 0.31622776601683794; /* sqrt(0.1 s) */

/* Rates about the chip's axes; the last one is the one that points up. */
static void turn_about_chip(const hil_world_t *world, hil_real_t *rates) {
    hil_real_t tilt[2];
    hil_cos_sin(world->config.gyro_tilt_rad, tilt);
    rates[0] = tilt[0] * world->rise_rate[1] - tilt[1] * world->twist[2];
    rates[1] = world->rise_rate[2];
    rates[2] = tilt[1] * world->rise_rate[1] + tilt[0] * world->twist[2];
}

static void warm_gyro_up(hil_world_t *world) {
    const hil_world_config_t *config = &world->config;
    const hil_real_t left = hil_exp(-1e-6 * (double)world->time_us / config->gyro_warm_up_s);
    const hil_real_t warmer_K = config->gyro_warm_up_K * (1.0 - left) - world->gyro_warmth_K;
    for (uint32_t axis = 0; axis < GYRO_AXES; axis++) {
        const hil_real_t drawn = hil_normal(config->seed, HIL_STREAM_GYRO_DRIFT + axis, 0);
        world->gyro_bias[axis] += config->gyro_drift_per_K * drawn * warmer_K;
    }
    world->gyro_warmth_K += warmer_K;
}

static void walk_gyro_bias(hil_world_t *world) {
    const hil_world_config_t *config = &world->config;
    const uint64_t step = world->time_us / BIAS_STEP_US;
    if (world->gyro_samples > 0 && step == world->gyro_bias_step) {
        return;
    }
    for (uint32_t axis = 0; axis < GYRO_AXES; axis++) {
        const hil_real_t drawn = hil_normal(config->seed, HIL_STREAM_GYRO_BIAS + axis, step);
        if (world->gyro_samples == 0) {
            world->gyro_bias[axis] = config->gyro_bias_rad_s * drawn;
        } else {
            world->gyro_bias[axis] += config->gyro_bias_walk * root_bias_step * drawn;
        }
    }
    world->gyro_bias_step = step;
    warm_gyro_up(world);
}

/* The chip's filter goes on to now. */
static void filter_gyro(hil_world_t *world) {
    const double lag_s = world->config.gyro_lag_s;
    const double passed_s = 1e-6 * (double)(world->time_us - world->gyro_late_us);
    hil_real_t rates[GYRO_AXES];
    turn_about_chip(world, rates);
    if (lag_s <= 0.0 || passed_s <= 0.0) {
        memcpy(world->gyro_late, rates, sizeof rates);
    } else {
        const double kept = exp(-passed_s / lag_s);
        for (uint32_t axis = 0; axis < GYRO_AXES; axis++) {
            const hil_real_t before = world->gyro_rate[axis];
            const hil_real_t behind = (rates[axis] - before) * (lag_s / passed_s); /* once it has settled */
            world->gyro_late[axis] = rates[axis] - behind + (world->gyro_late[axis] - before + behind) * kept;
        }
    }
    memcpy(world->gyro_rate, rates, sizeof rates);
    world->gyro_late_us = world->time_us;
}

static void take_gyro_sample(hil_world_t *world) {
    const hil_world_config_t *config = &world->config;
    const hil_real_t range = config->gyro_range_rad_s;
    const hil_real_t sd = config->gyro_noise_density * hil_sqrt((hil_real_t)config->gyro_rate_Hz);
    const hil_real_t offset = hil_fault_value(world, HIL_FAULT_GYRO_OFFSET, 0.0);
    const int32_t up = config->gyro_axis == 0 ? GYRO_AXES : config->gyro_axis;
    const uint32_t last = (uint32_t)(up < 0 ? -up : up) % GYRO_AXES;
    const hil_real_t *rates = world->gyro_late;
    walk_gyro_bias(world);
    for (uint32_t i = 0; i < GYRO_AXES; i++) {
        const uint32_t axis = (last + i) % GYRO_AXES;
        const hil_real_t rate = up < 0 && i != 0 ? -rates[i] : rates[i];
        const hil_real_t noise = sd * hil_normal(config->seed, HIL_STREAM_GYRO + axis, world->gyro_samples);
        const hil_real_t read = (1.0 + config->gyro_scale_error) * (rate + world->gyro_bias[axis] + noise) + offset;
        const hil_real_t rounded = hil_nearest(read * (gyro_steps / range)) * (range / gyro_steps);
        world->gyro_rad_s[axis] = hil_max(hil_min(rounded, range), -range);
    }
}

/* Samples are due at k / rate and are taken in the first tick that is not before. */
static void sample_gyro(hil_world_t *world) {
    const hil_world_config_t *config = &world->config;
    world->gyro_new = false;
    if (config->gyro_rate_Hz <= 0.0) {
        return;
    }
    filter_gyro(world);
    const uint64_t due_us = (uint64_t)((double)world->gyro_samples * 1e6 / config->gyro_rate_Hz + 0.5);
    if (due_us <= world->time_us) {
        if (hil_fault_find(world, HIL_FAULT_GYRO_STUCK, HIL_MAX_WHEELS) == NULL) {
            take_gyro_sample(world);
        }
        world->gyro_samples++;
        world->gyro_new = hil_fault_find(world, HIL_FAULT_GYRO_SILENT, HIL_MAX_WHEELS) == NULL;
    }
}

static void show_gyro(hil_world_t *world, hil_sensors_t *sensors) {
    if (world->gyro_new) {
        for (uint32_t axis = 0; axis < GYRO_AXES; axis++) {
            sensors->gyro_rad_s[axis] = world->gyro_rad_s[axis];
        }
        sensors->gyro_valid = (1u << GYRO_AXES) - 1u;
    }
}

const hil_sensor_t hil_sensor_gyro = {.sample = sample_gyro, .show = show_gyro};
