/* SPDX-License-Identifier: MIT */
#include "i2c_chip.h"

#include "machine.h"
#include "pads.h"

enum { BITS = 8, CLOCKS = 9 };

static void drive(rt1062_t *m) {
    const rt_i2c_chip_t *chip = &m->s.i2c_chip;
    rt_pad_wire(m, RT_PAD_SDA, chip->pulls || chip->stuck_sda ? 0 : RT_FLOATING, 0);
}

static void pull(rt1062_t *m, bool low) {
    m->s.i2c_chip.pulls = low;
    drive(m);
}

void rt_i2c_chip_stuck(rt1062_t *m, bool scl, bool sda) {
    m->s.i2c_chip.stuck_scl = scl;
    m->s.i2c_chip.stuck_sda = sda;
    rt_pad_wire(m, RT_PAD_SCL, scl ? 0 : RT_FLOATING, 0);
    drive(m);
}

static void on_start(rt1062_t *m) {
    rt_i2c_chip_t *chip = &m->s.i2c_chip;
    chip->listens = true;
    chip->reads = false;
    chip->address = true;
    chip->bit = 0;
    chip->byte = 0;
    pull(m, false);
}

static void on_stop(rt1062_t *m) {
    m->s.i2c_chip.listens = false;
    hil_world_i2c_stop(m->world);
}

static void on_rise(rt1062_t *m, bool sda) {
    rt_i2c_chip_t *chip = &m->s.i2c_chip;
    chip->bit++;
    if (chip->bit <= BITS && !chip->reads) {
        chip->byte = (uint8_t)(chip->byte << 1 | sda);
    } else if (chip->bit == CLOCKS && chip->reads) {
        chip->acknowledges = !sda; /* the master wants another byte */
    }
}

/* A whole byte has come: does the chip acknowledge it? */
static bool take(rt1062_t *m) {
    rt_i2c_chip_t *chip = &m->s.i2c_chip;
    if (!chip->address) {
        return hil_world_i2c_put(m->world, chip->byte);
    }
    return hil_world_i2c_start(m->world, chip->byte >> 1, (chip->byte & 1) != 0);
}

static void send_bit(rt1062_t *m) {
    const rt_i2c_chip_t *chip = &m->s.i2c_chip;
    pull(m, (chip->byte >> (BITS - 1 - chip->bit) & 1) == 0);
}

static void begin_byte(rt1062_t *m) {
    rt_i2c_chip_t *chip = &m->s.i2c_chip;
    chip->reads = chip->address ? (chip->byte & 1) != 0 : chip->reads;
    chip->address = false;
    chip->bit = 0;
    chip->listens = chip->acknowledges;
    if (chip->listens && chip->reads) {
        chip->byte = hil_world_i2c_get(m->world);
        send_bit(m);
    } else {
        pull(m, false);
    }
}

/* SCL has fallen: SDA may change. */
static void on_fall(rt1062_t *m) {
    rt_i2c_chip_t *chip = &m->s.i2c_chip;
    if (chip->bit == CLOCKS) {
        begin_byte(m);
    } else if (chip->bit == BITS && chip->reads) {
        pull(m, false); /* the master's acknowledge */
    } else if (chip->bit == BITS) {
        chip->acknowledges = take(m);
        pull(m, chip->acknowledges);
    } else if (chip->reads) {
        send_bit(m);
    }
}

void rt_i2c_chip_lines(rt1062_t *m, bool scl, bool sda) {
    rt_i2c_chip_t *chip = &m->s.i2c_chip;
    const bool scl_before = chip->scl;
    const bool sda_before = chip->sda;
    chip->scl = scl;
    chip->sda = sda;
    if (m->world == NULL) {
        return;
    }
    if (scl && scl_before && sda != sda_before) {
        if (sda) {
            on_stop(m);
        } else {
            on_start(m);
        }
    } else if (chip->listens && scl && !scl_before) {
        on_rise(m, sda);
    } else if (chip->listens && !scl && scl_before) {
        on_fall(m);
    }
}
