/* SPDX-License-Identifier: MIT */
#include "pins.h"

#include <math.h>

#include "devices.h"
#include "handlers.h"
#include "i2c_chip.h"
#include "lpi2c.h"
#include "machine.h"
#include "pads.h"
#include "pwm.h"
#include "random.h"

enum { STEP_ns = 1000 * RT1062_STEP_us, STREAM_NOISE = 0x4E4F4953 };

static const double HIGH_V = 3.3;

/* ------------------------------------------------------------------ encoders */

static bool is_loose(const rt1062_t *m, uint32_t pad) {
    return m->s.pins.noise.on && m->s.pins.noise.pad == pad;
}

/* A leads B: 00, 10, 11, 01. */
static void show_levels(rt1062_t *m, uint32_t number, uint64_t at_ns) {
    const uint32_t place = m->s.pins.disc[number].position & 3;
    const int level[2] = {place == 1 || place == 2, place >= 2};
    for (uint32_t phase = 0; phase < 2; phase++) {
        const uint32_t pad = rt_pad_of_pin(m->config.encoder_pin[number][phase]);
        if (pad != RT_NO_PAD && !is_loose(m, pad)) {
            rt_pad_wire(m, pad, level[phase], at_ns);
        }
    }
}

static uint32_t edges_of(const rt_disc_t *disc) {
    return disc->edges < 0 ? 0u - (uint32_t)disc->edges : (uint32_t)disc->edges;
}

/* Time of the encoder's next edge; RT_NEVER: none in this step. */
static uint64_t next_edge_ns(const rt1062_t *m, const rt_disc_t *disc) {
    const uint64_t edges = edges_of(disc);
    if (disc->done >= edges) {
        return RT_NEVER;
    }
    return m->s.pins.begin_ns + (2 * (uint64_t)disc->done + 1) * STEP_ns / (2 * edges);
}

static uint32_t next_encoder(const rt1062_t *m) {
    uint32_t first = 0;
    for (uint32_t i = 1; i < RT1062_ENCODERS; i++) {
        const bool earlier = next_edge_ns(m, &m->s.pins.disc[i]) < next_edge_ns(m, &m->s.pins.disc[first]);
        first = earlier ? i : first;
    }
    return first;
}

static void schedule_edge(rt1062_t *m) {
    rt_schedule(m, RT_EVENT_ENCODER, next_edge_ns(m, &m->s.pins.disc[next_encoder(m)]));
}

void rt_encoder_event(rt1062_t *m) {
    uint32_t number = next_encoder(m);
    while (next_edge_ns(m, &m->s.pins.disc[number]) <= rt_now(m)) {
        rt_disc_t *disc = &m->s.pins.disc[number];
        const uint64_t at_ns = next_edge_ns(m, disc);
        disc->position += disc->edges < 0 ? UINT32_MAX : 1u;
        disc->done++;
        show_levels(m, number, at_ns);
        number = next_encoder(m);
    }
    schedule_edge(m);
}

void rt_noise_event(rt1062_t *m) {
    rt_noise_t *noise = &m->s.pins.noise;
    while (noise->on && noise->next_ns <= rt_now(m)) {
        rt_pad_wire(m, noise->pad, (int)(noise->edges & 1), noise->next_ns);
        const double share = 0.5 + rt_uniform(m->config.seed, STREAM_NOISE, noise->edges);
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
    for (uint32_t i = 0; i < m->circuit.encoders; i++) {
        show_levels(m, i, 0);
    }
    rt_schedule(m, RT_EVENT_NOISE, edges_per_s > 0 ? rt_now(m) : RT_NEVER);
    return true;
}

static void plan_edges(rt1062_t *m) {
    int32_t counts[RT1062_ENCODERS] = {0};
    m->circuit.encoder_counts(m->circuit.context, counts);
    for (uint32_t i = 0; i < m->circuit.encoders; i++) {
        rt_disc_t *disc = &m->s.pins.disc[i];
        disc->edges = (int32_t)((uint32_t)counts[i] - (uint32_t)disc->counts);
        disc->counts = counts[i];
        disc->done = 0;
    }
    schedule_edge(m);
}

/* ------------------------------------------------------------------ PWM pins */

static uint16_t duty_steps(rt1062_t *m, uint32_t pad) {
    rt_pulses_t pulses;
    if (!rt_pwm_pulses(m, pad, &pulses)) {
        return m->s.pads.level[pad] == 1 ? RT1062_DUTY_STEPS : 0;
    }
    const double wanted_Hz = m->circuit.pwm_frequency_Hz;
    if (fabs(pulses.frequency_Hz - wanted_Hz) > 0.01 * wanted_Hz) {
        rt_finding(m, RT1062_FINDING_PINS, "a PWM pin has pulses at %.0f Hz; the circuit expects %.0f",
                   pulses.frequency_Hz, wanted_Hz);
    }
    return (uint16_t)(pulses.share * RT1062_DUTY_STEPS + 0.5);
}

static void show_duties(rt1062_t *m) {
    uint16_t steps[RT1062_PWM_PINS] = {0};
    for (uint32_t i = 0; i < RT1062_PWM_PINS; i++) {
        const uint32_t pad = rt_pad_of_pin(m->config.pwm_pin[i]);
        steps[i] = pad != RT_NO_PAD ? duty_steps(m, pad) : 0;
    }
    m->circuit.duties(m->circuit.context, steps);
}

/* ------------------------------------------------------------------ the circuit's step */

static bool refuses(rt1062_t *m, const char *why) {
    if (why != NULL) {
        rt_refuse(m, "%s", why);
    }
    return why != NULL;
}

/* Open, the chip's own pull-up decides. */
static void show_button(rt1062_t *m) {
    const uint32_t pad = rt_pad_of_pin(m->config.stop_button_pin);
    if (pad != RT_NO_PAD) {
        rt_pad_wire(m, pad, m->circuit.stop_button_open(m->circuit.context) ? RT_FLOATING : 0, 0);
    }
}

static void show_stuck_lines(rt1062_t *m) {
    for (uint32_t bus = 0; bus < RT_I2C_UNITS; bus++) {
        const rt_i2c_chip_t *chip = &m->s.i2c_chip[bus];
        bool scl = false, sda = false;
        m->circuit.i2c_stuck(m->circuit.context, bus, &scl, &sda);
        if (scl != chip->stuck_scl || sda != chip->stuck_sda) {
            rt_i2c_chip_stuck(m, bus, scl, sda);
        }
    }
}

void rt_circuit_event(rt1062_t *m) {
    rt_i2c_sync(m);
    show_duties(m);
    const char *why = m->circuit.step(m->circuit.context, rt_now(m) / 1000);
    m->s.pins.begin_ns += STEP_ns;
    if (refuses(m, why)) {
        return;
    }
    show_button(m);
    show_stuck_lines(m);
    plan_edges(m);
    rt_schedule(m, RT_EVENT_CIRCUIT, m->s.pins.begin_ns + STEP_ns);
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
        m->circuit.output_enable(m->circuit.context, m->s.pads.level[pad] == 0);
    }
}

void rt_pins_level_changed(rt1062_t *m, uint32_t pad) {
    if (m->s.pins.connected && pad == output_enable_pad(m)) {
        show_output_enable(m);
    }
}

double rt_pins_voltage(rt1062_t *m, uint32_t pad) {
    if (m->s.pins.connected && pad == rt_pad_of_pin(m->config.battery_pin) && m->config.battery_divider > 0.0) {
        return m->circuit.battery_V(m->circuit.context) / m->config.battery_divider;
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
    static const struct {
        uint32_t scl, sda;
    } lines[RT_I2C_UNITS] = {{RT_PAD_SCL, RT_PAD_SDA}, {RT_PAD_SCL3, RT_PAD_SDA3}, {RT_PAD_SCL4, RT_PAD_SDA4}};
    m->s.pins = (rt_pins_t){.connected = true, .begin_ns = rt_now(m)};
    release_buses(m);
    const char *why = m->circuit.power_on(m->circuit.context);
    for (uint32_t bus = 0; bus < RT_I2C_UNITS; bus++) {
        if ((m->circuit.i2c_buses >> bus & 1) != 0) {
            pull(m, lines[bus].scl, 1);
            pull(m, lines[bus].sda, 1);
        }
    }
    pull(m, output_enable_pad(m), 1);
    for (uint32_t i = 0; i < RT1062_PWM_PINS; i++) {
        pull(m, rt_pad_of_pin(m->config.pwm_pin[i]), 0);
    }
    int32_t counts[RT1062_ENCODERS] = {0};
    m->circuit.encoder_counts(m->circuit.context, counts);
    for (uint32_t i = 0; i < m->circuit.encoders; i++) {
        m->s.pins.disc[i].counts = counts[i];
        show_levels(m, i, 0);
    }
    show_output_enable(m);
    show_duties(m);
    refuses(m, why);
    show_button(m);
    show_stuck_lines(m);
    rt_schedule(m, RT_EVENT_CIRCUIT, m->s.pins.begin_ns + STEP_ns);
}

static void disconnect(rt1062_t *m) {
    m->s.pins = (rt_pins_t){0};
    release_buses(m);
    for (uint32_t pad = 0; pad < RT_PADS; pad++) {
        m->s.pads.pulled[pad] = m->s.pads.wired[pad] = RT_FLOATING;
        rt_pad_update(m, pad);
    }
    rt_schedule(m, RT_EVENT_CIRCUIT, RT_NEVER);
    rt_schedule(m, RT_EVENT_ENCODER, RT_NEVER);
}

void rt1062_attach(rt1062_t *m, const rt1062_circuit_t *circuit) {
    m->wired = circuit != NULL;
    m->circuit = m->wired ? *circuit : (rt1062_circuit_t){0};
    if (!m->s.powered) {
        return; /* power-on connects */
    }
    rt_i2c_sync(m);
    disconnect(m);
    if (m->wired) {
        connect(m);
    }
    rt_i2c_sync(m);
}

/* The chip's resets leave the circuit alone: its clock goes on, its levels stay. Power-on connects it anew. */
static void reset(rt1062_t *m) {
    for (uint32_t pad = 0; pad < RT_PADS; pad++) {
        rt_pad_update(m, pad);
    }
    if (!m->wired) {
        return;
    }
    if (m->s.pins.connected) {
        show_duties(m);
        rt_schedule(m, RT_EVENT_CIRCUIT, m->s.pins.begin_ns + STEP_ns);
        rt_schedule(m, RT_EVENT_NOISE, m->s.pins.noise.on ? rt_now(m) : RT_NEVER);
        schedule_edge(m);
    } else {
        connect(m);
    }
}

/* Behind all devices in the table: their registers have been reset when the wires are. */
const rt_device_t rt_wires = {"wires", 0, 0, NULL, NULL, reset};
