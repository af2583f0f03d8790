/* SPDX-License-Identifier: MIT */
#include "i2c_chip.h"

#include "i2c_master.h"
#include "machine.h"
#include "pads.h"

enum { BITS = 8, CLOCKS = 9 };

static void drive(rt1062_t *m, uint32_t number) {
    const rt_i2c_chip_t *chip = &m->s.i2c_chip[number];
    rt_pad_wire(m, rt_i2c_units[number].pad[RT_SDA], chip->pulls || chip->stuck_sda ? 0 : RT_FLOATING, 0);
}

static void pull(rt1062_t *m, uint32_t number, bool low) {
    m->s.i2c_chip[number].pulls = low;
    drive(m, number);
}

void rt_i2c_chip_stuck(rt1062_t *m, uint32_t number, bool scl, bool sda) {
    m->s.i2c_chip[number].stuck_scl = scl;
    m->s.i2c_chip[number].stuck_sda = sda;
    rt_pad_wire(m, rt_i2c_units[number].pad[RT_SCL], scl ? 0 : RT_FLOATING, 0);
    drive(m, number);
}

static void on_start(rt1062_t *m, uint32_t number) {
    rt_i2c_chip_t *chip = &m->s.i2c_chip[number];
    chip->listens = true;
    chip->reads = false;
    chip->address = true;
    chip->bit = 0;
    chip->byte = 0;
    pull(m, number, false);
}

static void on_stop(rt1062_t *m, uint32_t number) {
    m->s.i2c_chip[number].listens = false;
    m->circuit.i2c_stop(m->circuit.context, number);
}

static void on_rise(rt1062_t *m, uint32_t number, bool sda) {
    rt_i2c_chip_t *chip = &m->s.i2c_chip[number];
    chip->bit++;
    if (chip->bit <= BITS && !chip->reads) {
        chip->byte = (uint8_t)(chip->byte << 1 | sda);
    } else if (chip->bit == CLOCKS && chip->reads) {
        chip->acknowledges = !sda; /* the master wants another byte */
    }
}

/* A whole byte has come: does the chip acknowledge it? */
static bool take(rt1062_t *m, uint32_t number) {
    rt_i2c_chip_t *chip = &m->s.i2c_chip[number];
    if (!chip->address) {
        return m->circuit.i2c_put(m->circuit.context, number, chip->byte);
    }
    return m->circuit.i2c_start(m->circuit.context, number, rt_now(m) / 1000, chip->byte >> 1, (chip->byte & 1) != 0);
}

static void send_bit(rt1062_t *m, uint32_t number) {
    const rt_i2c_chip_t *chip = &m->s.i2c_chip[number];
    pull(m, number, (chip->byte >> (BITS - 1 - chip->bit) & 1) == 0);
}

static void begin_byte(rt1062_t *m, uint32_t number) {
    rt_i2c_chip_t *chip = &m->s.i2c_chip[number];
    chip->reads = chip->address ? (chip->byte & 1) != 0 : chip->reads;
    chip->address = false;
    chip->bit = 0;
    chip->listens = chip->acknowledges;
    if (chip->listens && chip->reads) {
        chip->byte = m->circuit.i2c_get(m->circuit.context, number);
        send_bit(m, number);
    } else {
        pull(m, number, false);
    }
}

/* SCL has fallen: SDA may change. */
static void on_fall(rt1062_t *m, uint32_t number) {
    rt_i2c_chip_t *chip = &m->s.i2c_chip[number];
    if (chip->bit == CLOCKS) {
        begin_byte(m, number);
    } else if (chip->bit == BITS && chip->reads) {
        pull(m, number, false); /* the master's acknowledge */
    } else if (chip->bit == BITS) {
        chip->acknowledges = take(m, number);
        pull(m, number, chip->acknowledges);
    } else if (chip->reads) {
        send_bit(m, number);
    }
}

void rt_i2c_chip_lines(rt1062_t *m, uint32_t number, bool scl, bool sda) {
    rt_i2c_chip_t *chip = &m->s.i2c_chip[number];
    const bool scl_before = chip->scl;
    const bool sda_before = chip->sda;
    chip->scl = scl;
    chip->sda = sda;
    if (!m->wired) {
        return;
    }
    if (scl && scl_before && sda != sda_before) {
        if (sda) {
            on_stop(m, number);
        } else {
            on_start(m, number);
        }
    } else if (chip->listens && scl && !scl_before) {
        on_rise(m, number, sda);
    } else if (chip->listens && !scl && scl_before) {
        on_fall(m, number);
    }
}
