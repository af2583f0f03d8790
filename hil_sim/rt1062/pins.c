/* SPDX-License-Identifier: MIT */
#include "pins.h"

#include <math.h>
#include <string.h>

#include "devices.h"
#include "handlers.h"
#include "hil_sim/random.h"
#include "i2c_chip.h"
#include "lpi2c.h"
#include "machine.h"
#include "pads.h"
#include "pwm.h"

enum { STEP_us = 1000, STEP_ns = 1000000, STREAM_NOISE = 0x4E4F4953 };

static const double HIGH_V = 3.3;

/* ------------------------------------------------------------------ encoders */

static bool is_loose(const rt1062_t *m, uint32_t pad) {
    return m->s.pins.noise.on && m->s.pins.noise.pad == pad;
}

/* A leads B: 00, 10, 11, 01. */
static void show_levels(rt1062_t *m, uint32_t wheel, uint64_t at_ns) {
    const uint32_t place = m->s.pins.wheel[wheel].position & 3;
    const int level[2] = {place == 1 || place == 2, place >= 2};
    for (uint32_t phase = 0; phase < 2; phase++) {
        const uint32_t pad = rt_pad_of_pin(m->config.encoder_pin[wheel][phase]);
        if (pad != RT_NO_PAD && !is_loose(m, pad)) {
            rt_pad_wire(m, pad, level[phase], at_ns);
        }
    }
}

static uint32_t edges_of(const rt_wheel_t *wheel) {
    return wheel->edges < 0 ? 0u - (uint32_t)wheel->edges : (uint32_t)wheel->edges;
}

/* Time of the wheel's next edge; RT_NEVER: none in this millisecond. */
static uint64_t next_edge_ns(const rt1062_t *m, const rt_wheel_t *wheel) {
    const uint64_t edges = edges_of(wheel);
    if (wheel->done >= edges) {
        return RT_NEVER;
    }
    return m->s.pins.begin_ns + (2 * (uint64_t)wheel->done + 1) * STEP_ns / (2 * edges);
}

static uint32_t next_wheel(const rt1062_t *m) {
    uint32_t first = 0;
    for (uint32_t i = 1; i < HIL_MAX_WHEELS; i++) {
        const bool earlier = next_edge_ns(m, &m->s.pins.wheel[i]) < next_edge_ns(m, &m->s.pins.wheel[first]);
        first = earlier ? i : first;
    }
    return first;
}

static void schedule_edge(rt1062_t *m) {
    rt_schedule(m, RT_EVENT_ENCODER, next_edge_ns(m, &m->s.pins.wheel[next_wheel(m)]));
}

void rt_encoder_event(rt1062_t *m) {
    uint32_t number = next_wheel(m);
    while (next_edge_ns(m, &m->s.pins.wheel[number]) <= rt_now(m)) {
        rt_wheel_t *wheel = &m->s.pins.wheel[number];
        const uint64_t at_ns = next_edge_ns(m, wheel);
        wheel->position += wheel->edges < 0 ? UINT32_MAX : 1u;
        wheel->done++;
        show_levels(m, number, at_ns);
        number = next_wheel(m);
    }
    schedule_edge(m);
}

void rt_noise_event(rt1062_t *m) {
    rt_noise_t *noise = &m->s.pins.noise;
    while (noise->on && noise->next_ns <= rt_now(m)) {
        rt_pad_wire(m, noise->pad, (int)(noise->edges & 1), noise->next_ns);
        const double share = 0.5 + hil_uniform(m->config.seed, STREAM_NOISE, noise->edges);
        noise->edges++;
        noise->next_ns += (uint64_t)(share * noise->mean_ns) + 1;
    }
    rt_schedule(m, RT_EVENT_NOISE, noise->on ? noise->next_ns : RT_NEVER);
}

bool rt1062_noise(rt1062_t *m, uint32_t teensy_pin, uint32_t edges_per_s) {
    const uint32_t pad = rt_pad_of_pin(teensy_pin);
    if (pad == RT_NO_PAD || !m->s.pins.connected || edges_per_s > 1000000000u) {
        return false;
    }
    const uint32_t mean_ns = edges_per_s > 0 ? 1000000000u / edges_per_s : 0;
    m->s.pins.noise = (rt_noise_t){.on = edges_per_s > 0, .pad = pad, .mean_ns = mean_ns, .next_ns = rt_now(m)};
    for (uint32_t i = 0; i < m->world->config.wheels; i++) {
        show_levels(m, i, 0);
    }
    rt_schedule(m, RT_EVENT_NOISE, edges_per_s > 0 ? rt_now(m) : RT_NEVER);
    return true;
}

static void plan_edges(rt1062_t *m) {
    int32_t counts[HIL_MAX_WHEELS] = {0};
    hil_world_counts(m->world, counts);
    for (uint32_t i = 0; i < m->world->config.wheels; i++) {
        rt_wheel_t *wheel = &m->s.pins.wheel[i];
        wheel->edges = (int32_t)((uint32_t)counts[i] - (uint32_t)wheel->counts);
        wheel->counts = counts[i];
        wheel->done = 0;
    }
    schedule_edge(m);
}

/* ------------------------------------------------------------------ motors without a PWM chip */

static uint16_t motor_steps(rt1062_t *m, uint32_t pad) {
    enum { STEPS = 4096 };
    rt_pulses_t pulses;
    if (!rt_pwm_pulses(m, pad, &pulses)) {
        return m->s.pads.level[pad] == 1 ? STEPS : 0;
    }
    const double wanted_Hz = m->world->config.motor_pwm_Hz;
    if (fabs(pulses.frequency_Hz - wanted_Hz) > 0.01 * wanted_Hz) {
        rt_finding(m, RT1062_FINDING_PINS, "a motor's pin has pulses at %.0f Hz; the robot file says %.0f",
                   pulses.frequency_Hz, wanted_Hz);
    }
    return (uint16_t)(pulses.share * STEPS + 0.5);
}

static void show_motor_pins(rt1062_t *m) {
    uint16_t steps[2 * HIL_MAX_WHEELS] = {0};
    for (uint32_t i = 0; i < 2 * m->world->config.wheels; i++) {
        const uint32_t pad = rt_pad_of_pin(m->config.motor_pin[i / 2][i % 2]);
        steps[i] = pad != RT_NO_PAD ? motor_steps(m, pad) : 0;
    }
    hil_world_motor_pins(m->world, steps);
}

/* ------------------------------------------------------------------ the world's millisecond */

static bool refuses_faults(rt1062_t *m) {
    static const struct {
        uint8_t kind;
        const char *name;
    } refused[] = {
        {HIL_FAULT_ENCODER_INVALID, "encoder_invalid"},
        {HIL_FAULT_ENCODER_BIT, "encoder_bit"},
        {HIL_FAULT_CLOCK_JUMP, "clock_jump"},
        {HIL_FAULT_CLOCK_STUCK, "clock_stuck"},
        {HIL_FAULT_TICK_LATE, "tick_late"},
    };
    for (uint32_t i = 0; i < sizeof refused / sizeof refused[0]; i++) {
        if ((m->world->active_faults >> refused[i].kind & 1) != 0) {
            rt_refuse(m, "the world's fault %s cannot be shown at the chip's pins", refused[i].name);
            return true;
        }
    }
    return false;
}

/* Normally closed to ground; open, the chip's own pull-up decides. */
static void show_button(rt1062_t *m) {
    const uint32_t pad = rt_pad_of_pin(m->config.stop_button_pin);
    if (pad != RT_NO_PAD) {
        const bool open = hil_world_fault_active(m->world, HIL_FAULT_STOP_BUTTON, HIL_MAX_WHEELS);
        rt_pad_wire(m, pad, open ? RT_FLOATING : 0, 0);
    }
}

static void show_faults(rt1062_t *m) {
    show_button(m);
    const bool stuck = hil_world_fault_active(m->world, HIL_FAULT_I2C_STUCK, HIL_MAX_WHEELS);
    const bool scl = stuck && hil_world_fault_value(m->world, HIL_FAULT_I2C_STUCK) == HIL_STUCK_SCL;
    const rt_i2c_chip_t *chip = &m->s.i2c_chip[0];
    if (scl != chip->stuck_scl || (stuck && !scl) != chip->stuck_sda) {
        rt_i2c_chip_stuck(m, 0, scl, stuck && !scl);
    }
}

static bool gyro_wired(const rt1062_t *m) {
    return m->config.gyro_address != 0;
}

/* A world without a gyro has an empty socket. A gyro that the world makes silent has no power. */
static void turn_gyro(rt1062_t *m) {
    hil_gyro_chip_t *gyro = &m->s.gyro;
    if (!gyro_wired(m)) {
        return;
    }
    const bool silent = hil_world_fault_active(m->world, HIL_FAULT_GYRO_SILENT, HIL_MAX_WHEELS);
    if (silent && !gyro->faults.absent) {
        hil_gyro_chip_reset(gyro, m->config.gyro_chip, m->config.gyro_address);
    }
    gyro->faults.absent = silent || m->world->config.gyro_rate_Hz <= 0.0;
    hil_gyro_chip_sense(gyro, rt_now(m) / 1000, m->world->gyro_rad_s);
}

static bool flow_wired(const rt1062_t *m) {
    return m->config.flow_address != 0;
}

/* As with the gyro. One that the world makes stuck counts no more. */
static void move_flow(rt1062_t *m) {
    hil_flow_chip_t *flow = &m->s.flow;
    if (!flow_wired(m)) {
        return;
    }
    const bool silent = hil_world_fault_active(m->world, HIL_FAULT_FLOW_SILENT, HIL_MAX_WHEELS);
    if (silent && !flow->faults.absent) {
        hil_flow_chip_reset(flow, m->config.flow_chip, m->config.flow_address);
    }
    flow->faults.absent = silent || m->world->config.flow_rate_Hz <= 0.0;
    double moved[HIL_FLOW_AXES];
    hil_world_flow_way(m->world, m->s.flow_pose, moved);
    if (hil_world_fault_active(m->world, HIL_FAULT_FLOW_STUCK, HIL_MAX_WHEELS)) {
        moved[0] = moved[1] = moved[2] = 0.0;
    }
    hil_flow_chip_move(flow, rt_now(m) / 1000, moved);
}

void rt_world_event(rt1062_t *m) {
    rt_i2c_sync(m);
    show_motor_pins(m);
    hil_world_step(m->world, STEP_us);
    turn_gyro(m);
    move_flow(m);
    m->s.pins.begin_ns += STEP_ns;
    if (refuses_faults(m)) {
        return;
    }
    show_faults(m);
    plan_edges(m);
    rt_schedule(m, RT_EVENT_WORLD, m->s.pins.begin_ns + STEP_ns);
    rt_i2c_sync(m);
}

/* ------------------------------------------------------------------ the other wires */

static uint32_t output_enable_pad(const rt1062_t *m) {
    return rt_pad_of_pin(m->config.output_enable_pin);
}

/* Active low, pulled up. */
static void show_output_enable(rt1062_t *m) {
    const uint32_t pad = output_enable_pad(m);
    if (pad != RT_NO_PAD) {
        hil_world_output_enable(m->world, m->s.pads.level[pad] == 0);
    }
}

void rt_pins_level_changed(rt1062_t *m, uint32_t pad) {
    if (m->s.pins.connected && pad == output_enable_pad(m)) {
        show_output_enable(m);
    }
}

double rt_pins_voltage(rt1062_t *m, uint32_t pad) {
    if (m->s.pins.connected && pad == rt_pad_of_pin(m->config.battery_pin) && m->config.battery_divider > 0.0) {
        return m->world->supply_V / m->config.battery_divider;
    }
    return rt_pad_level(m, pad) == 1 ? HIGH_V : 0.0;
}

/* ------------------------------------------------------------------ connecting */

static void pull(rt1062_t *m, uint32_t pad, int level) {
    if (pad != RT_NO_PAD) {
        m->s.pads.pulled[pad] = (int8_t)level;
        rt_pad_update(m, pad);
    }
}

static void release_buses(rt1062_t *m) {
    for (uint32_t number = 0; number < RT_I2C_UNITS; number++) {
        m->s.i2c_chip[number] = (rt_i2c_chip_t){.scl = true, .sda = true};
    }
}

static void connect(rt1062_t *m) {
    m->s.pins = (rt_pins_t){.connected = true, .begin_ns = rt_now(m)};
    release_buses(m);
    pull(m, RT_PAD_SCL, 1);
    pull(m, RT_PAD_SDA, 1);
    if (gyro_wired(m)) {
        hil_gyro_chip_reset(&m->s.gyro, m->config.gyro_chip, m->config.gyro_address);
        pull(m, RT_PAD_SCL3, 1);
        pull(m, RT_PAD_SDA3, 1);
    }
    if (flow_wired(m)) {
        m->s.flow.wheels = (hil_flow_wheels_t){m->config.flow_steps_per_mm,
                                               m->config.flow_x_wheel_mm,
                                               m->config.flow_y_wheel_mm,
                                               {m->config.flow_reversed[0], m->config.flow_reversed[1]}};
        hil_flow_chip_reset(&m->s.flow, m->config.flow_chip, m->config.flow_address);
        memcpy(m->s.flow_pose, m->world->pose, sizeof m->s.flow_pose);
        pull(m, RT_PAD_SCL4, 1);
        pull(m, RT_PAD_SDA4, 1);
    }
    pull(m, output_enable_pad(m), 1);
    for (uint32_t i = 0; i < 2 * HIL_MAX_WHEELS; i++) {
        pull(m, rt_pad_of_pin(m->config.motor_pin[i / 2][i % 2]), 0);
    }
    int32_t counts[HIL_MAX_WHEELS] = {0};
    hil_world_counts(m->world, counts);
    for (uint32_t i = 0; i < m->world->config.wheels; i++) {
        m->s.pins.wheel[i].counts = counts[i];
        show_levels(m, i, 0);
    }
    show_output_enable(m);
    show_motor_pins(m);
    refuses_faults(m);
    show_faults(m);
    rt_schedule(m, RT_EVENT_WORLD, m->s.pins.begin_ns + STEP_ns);
}

static void disconnect(rt1062_t *m) {
    m->s.pins = (rt_pins_t){0};
    release_buses(m);
    for (uint32_t pad = 0; pad < RT_PADS; pad++) {
        m->s.pads.pulled[pad] = m->s.pads.wired[pad] = RT_FLOATING;
        rt_pad_update(m, pad);
    }
    rt_schedule(m, RT_EVENT_WORLD, RT_NEVER);
    rt_schedule(m, RT_EVENT_ENCODER, RT_NEVER);
}

void rt1062_attach(rt1062_t *m, hil_world_t *world) {
    m->world = world;
    if (!m->s.powered) {
        return; /* power-on connects */
    }
    rt_i2c_sync(m);
    disconnect(m);
    if (world != NULL) {
        connect(m);
    }
    rt_i2c_sync(m);
}

/* The chip's resets leave the world alone: its clock goes on, its levels stay. After power-on it is connected anew. */
static void reset(rt1062_t *m) {
    for (uint32_t pad = 0; pad < RT_PADS; pad++) {
        rt_pad_update(m, pad);
    }
    if (m->world == NULL) {
        return;
    }
    if (m->s.pins.connected) {
        show_motor_pins(m);
        rt_schedule(m, RT_EVENT_WORLD, m->s.pins.begin_ns + STEP_ns);
        rt_schedule(m, RT_EVENT_NOISE, m->s.pins.noise.on ? rt_now(m) : RT_NEVER);
        schedule_edge(m);
    } else {
        connect(m);
    }
}

/* Behind all devices in the table: their registers have been reset when the wires are. */
const rt_device_t rt_wires = {"wires", 0, 0, NULL, NULL, reset};
