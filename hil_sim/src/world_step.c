/* SPDX-License-Identifier: MIT */
/* One tick of the world: bridges, step. */
#include <string.h>

#include "drivers_gen.h"
#include "parts.h"

enum { PWM_STEPS = 4096 };

/* PRESCALE 3, the chip's fastest. */
static const double CHIP_PERIOD_s = 4096.0 * 4.0 / 25e6;

bool hil_has_chip(const hil_world_t *world) {
    return !HIL_DRIVERS[world->config.driver].on_pins;
}

static double direct_period_s(const hil_world_t *world) {
    return hil_has_chip(world) ? CHIP_PERIOD_s : 1.0 / world->config.motor_pwm_Hz;
}

static void direct_to_bridges(hil_world_t *world) {
    const double period_s = direct_period_s(world);
    for (uint32_t i = 0; i < world->config.wheels; i++) {
        world->in1[i] = world->chip.output_enable_high ? 0.0 : world->direct_in1[i];
        world->in2[i] = world->chip.output_enable_high ? 0.0 : world->direct_in2[i];
        hil_motors_apply_inputs(world, i, world->direct_phase1[i], world->direct_phase2[i], period_s);
    }
}

/* Of both inputs of a bridge whose pins are low. */
static double resting_level(const hil_world_t *world) {
    return HIL_DRIVERS[world->config.driver].low == HIL_BRIDGE_BRAKE ? 1.0 : 0.0;
}

void hil_bridges_init(hil_world_t *world) {
    const double level = resting_level(world);
    world->direct = !hil_has_chip(world);
    for (uint32_t i = 0; i < world->config.wheels; i++) {
        world->direct_in1[i] = level;
        world->direct_in2[i] = level;
    }
    direct_to_bridges(world);
}

static void chip_to_bridges(hil_world_t *world) {
    const double period_s = 1.0 / hil_pca9685_frequency_Hz(&world->chip);
    for (uint32_t i = 0; i < world->config.wheels; i++) {
        const uint32_t channel1 = (uint32_t)world->config.in1_channel[i];
        const uint32_t channel2 = (uint32_t)world->config.in2_channel[i];
        world->in1[i] = hil_pca9685_duty(&world->chip, channel1);
        world->in2[i] = hil_pca9685_duty(&world->chip, channel2);
        hil_motors_apply_inputs(world, i, hil_pca9685_phase(&world->chip, channel1),
                                hil_pca9685_phase(&world->chip, channel2), period_s);
    }
}

void hil_bridges_apply_inputs(hil_world_t *world, bool direct) {
    world->direct = direct || !hil_has_chip(world);
    hil_plant_set_source(world, HIL_SOURCE_BRIDGES);
    if (world->direct) {
        direct_to_bridges(world);
    } else {
        chip_to_bridges(world);
    }
}

bool hil_output_enable_high(const hil_world_config_t *config, uint8_t drive) {
    const bool off = drive == HIL_OE_OFF || (drive == HIL_OE_RELEASED && config->output_enable_rest_V >= HIL_OE_HIGH_V);
    return config->output_enable_wired && off;
}

void hil_world_output_enable(hil_world_t *world, uint8_t drive) {
    const bool high = hil_output_enable_high(&world->config, drive);
    if (high == world->chip.output_enable_high) {
        return;
    }
    world->chip.output_enable_high = high;
    if (world->source == HIL_SOURCE_BRIDGES) {
        hil_bridges_apply_inputs(world, world->direct);
    }
}

static hil_real_t share_of_period(hil_steps_t steps) {
    return hil_min((hil_real_t)steps, (double)PWM_STEPS) * (1.0 / (double)PWM_STEPS);
}

void hil_world_bridge(hil_world_t *world, const hil_steps_t *in1_steps, const hil_steps_t *in2_steps) {
    world->i2c_status = hil_has_chip(world) ? hil_bus_fault(world) : 0;
    if (world->i2c_status != 0) {
        return;
    }
    for (uint32_t i = 0; i < world->config.wheels; i++) {
        const hil_real_t in1 = share_of_period(in1_steps[i]);
        const hil_real_t in2 = share_of_period(in2_steps[i]);
        const hil_real_t rest = resting_level(world);
        world->direct_phase1[i] = 0.0;
        world->direct_phase2[i] = 0.0;
        world->direct_in1[i] = hil_select(in1 + in2 <= 0.0, rest, in1);
        world->direct_in2[i] = hil_select(in1 + in2 <= 0.0, rest, in2);
    }
    hil_bridges_apply_inputs(world, true);
}

typedef struct pulse_t {
    double rises; /* 0..1 */
    double share;
} pulse_t;

/* A wheel's two pins rise together. So a period has three parts: both are high, the longer one alone is, none is.
   Whatever a bridge does in each, its input is high in one piece, around the end of the period too.
   @param input 0: IN1, 1: IN2. */
static pulse_t pulse_of(const hil_driver_rule_t *rule, double first, double second, uint32_t input) {
    const double shorter = first < second ? first : second;
    const double longer = first < second ? second : first;
    const bool both = (rule->both >> input & 1) != 0;
    const bool one = (rule->single[first < second] >> input & 1) != 0;
    const bool none = (rule->low >> input & 1) != 0;
    const double share = (both ? shorter : 0.0) + (one ? longer - shorter : 0.0) + (none ? 1.0 - longer : 0.0);
    if (none && !one) {
        return (pulse_t){longer < 1.0 ? longer : 0.0, share};
    }
    return (pulse_t){both ? 0.0 : shorter, share};
}

void hil_world_motor_pins(hil_world_t *world, const uint16_t *steps) {
    if (hil_has_chip(world)) {
        return;
    }
    for (uint32_t i = 0; i < world->config.wheels; i++) {
        const uint16_t *pins = &steps[2 * (size_t)i];
        const double first = pins[0] < PWM_STEPS ? (double)pins[0] / PWM_STEPS : 1.0;
        const double second = pins[1] < PWM_STEPS ? (double)pins[1] / PWM_STEPS : 1.0;
        const hil_driver_rule_t *rule = &HIL_DRIVERS[world->config.driver];
        const pulse_t in1 = pulse_of(rule, first, second, 0);
        const pulse_t in2 = pulse_of(rule, first, second, 1);
        world->direct_in1[i] = in1.share;
        world->direct_in2[i] = in2.share;
        world->direct_phase1[i] = in1.rises;
        world->direct_phase2[i] = in2.rises;
    }
    hil_bridges_apply_inputs(world, true);
}

void hil_chip_power_loss(hil_world_t *world) {
    if (hil_fault_find(world, HIL_FAULT_CHIP_POWER, HIL_MAX_WHEELS) == NULL) {
        return;
    }
    hil_pca9685_reset(&world->chip, (uint8_t)world->config.pca9685_address);
    memset(world->direct_in1, 0, sizeof world->direct_in1);
    memset(world->direct_in2, 0, sizeof world->direct_in2);
    memset(world->direct_phase1, 0, sizeof world->direct_phase1);
    memset(world->direct_phase2, 0, sizeof world->direct_phase2);
    hil_bridges_apply_inputs(world, world->direct);
}

/* Whatever the plant made of the wheel: a hand, and a blocked gear, are stronger. */
static void turn_by_hand(hil_world_t *world, const hil_real_t *angle_before_rad, double step_s) {
    for (uint32_t i = 0; i < world->config.wheels; i++) {
        const hil_fault_t *blocked = hil_fault_find(world, HIL_FAULT_MOTOR_STALLED, i);
        const hil_fault_t *turned = hil_fault_find(world, HIL_FAULT_WHEEL_TURNED, i);
        if (blocked != NULL || turned != NULL) {
            world->wheel_rad_s[i] = blocked != NULL ? 0.0 : turned->value;
            const hil_real_t turned_rad = world->wheel_angle_rad[i];
            world->wheel_angle_rad[i] = angle_before_rad[i] + world->wheel_rad_s[i] * step_s;
            if (world->plant.play) {
                hil_backlash_shift(world, i, world->wheel_angle_rad[i] - turned_rad);
            }
        }
    }
}

void hil_world_step(hil_world_t *world, uint32_t step_us) {
    if (step_us == 0) {
        return;
    }
    hil_chip_power_loss(world);
    const double step_s = 1e-6 * step_us;
    hil_real_t open_end_A[HIL_MAX_WHEELS] = {0.0};
    hil_real_t angle_before_rad[HIL_MAX_WHEELS];
    hil_electrics_t electrics;
    memcpy(angle_before_rad, world->wheel_angle_rad, sizeof angle_before_rad);
    hil_slip_update(world, 1e-6 * (double)world->time_us + 0.5 * step_s);
    hil_motors_begin(world, &electrics, step_s, open_end_A);
    hil_plant_step(world, &electrics, step_s);
    hil_motors_end(world, &electrics, open_end_A);
    turn_by_hand(world, angle_before_rad, step_s);
    hil_sensors_integrate(world);
    world->time_us += step_us;
    world->steps++;
    hil_faults_update(world);
    hil_slip_draw_speeds(world);
    hil_sensors_sample(world);
}
