/* SPDX-License-Identifier: MIT */
/**
 * @file lpi2c.h
 * I2C masters LPI2C1, the motors', LPI2C3, the gyro's, and LPI2C4, the floor-motion sensor's (i.MX RT1060 RM, chapter
 * LPI2C). Each has the two lines of its bus with what hangs on them.
 *
 * The master makes every edge of SCL and SDA at its time, by the register's divisions and the clock that CCM gives it.
 * See "Timing Parameters"; the rise is the fastest that UM10204 allows. The master learns acknowledges, arbitration and
 * clock stretching from the lines' levels. Edges need no deadlines: the bus is played up to now whenever somebody looks
 * at it (rt_i2c_sync). A deadline stands at the end of what the program could see.
 *
 * Not modelled, and refused when asked for: slave mode, high-speed mode, DMA, data match, AUTOSTOP, IGNACK, pin
 * configurations but 2-pin open drain. What the manual leaves open: a STOP command without a START does nothing; a
 * STOP that SDA does not follow waits.
 */
#ifndef EMULATED_TEENSY_LPI2C_H
#define EMULATED_TEENSY_LPI2C_H

#include <stdbool.h>
#include <stdint.h>

#include "emulated_teensy/rt1062.h"

enum { RT_I2C_FIFO = 4, RT_I2C_UNITS = 3 };

/* What the master is doing. */
typedef enum rt_i2c_phase_t {
    RT_I2C_IDLE = 0,   /* waits for a command and a free bus */
    RT_I2C_START_HOLD, /* SDA low, SCL high */
    RT_I2C_WAIT,       /* SCL low: waits for a command, or for room */
    RT_I2C_LOW,        /* SCL low: SDA not yet changed */
    RT_I2C_SETTLE,     /* SCL low: SDA changed */
    RT_I2C_RISE,       /* SCL let go: waits until it is high */
    RT_I2C_SEEN,       /* high, but not through the input filter yet */
    RT_I2C_HIGH,       /* a bit: SCL high */
    RT_I2C_SETUP,      /* repeated START, STOP: SCL high, SDA still the other way */
    RT_I2C_STOP_RISE,  /* SDA let go: waits until it is high */
    RT_I2C_STOP_SEEN   /* high, but not through the input filter yet */
} rt_i2c_phase_t;

/* What the phases from LOW to HIGH are for. */
typedef enum rt_i2c_aim_t { RT_I2C_BIT = 0, RT_I2C_RESTART, RT_I2C_STOP } rt_i2c_aim_t;

typedef struct rt_i2c_t {
    uint32_t control;   /* MCR: MEN, DOZEN, DBGEN */
    bool in_reset;      /* MCR.RST */
    uint32_t enables;   /* MIER */
    uint32_t flags;     /* MSR: those that stay until cleared */
    uint32_t config[4]; /* MCFGR0 .. 3 */
    uint32_t clock;     /* MCCR0 */
    uint32_t water;     /* MFCR */
    uint16_t commands[RT_I2C_FIFO];
    uint32_t command_count;
    uint8_t received[RT_I2C_FIFO];
    uint32_t received_count;

    uint64_t at_ps;  /* the bus has been played up to here */
    uint64_t end_ps; /* of the phase, RT_NEVER: it waits for a level or a command */
    uint32_t phase;  /* rt_i2c_phase_t */
    uint32_t aim;    /* rt_i2c_aim_t */
    bool busy;       /* MBF: from START to STOP */
    bool reading;    /* the byte comes from the other side */
    uint8_t byte;
    uint8_t bit;         /* 0..7, 8: acknowledge */
    uint32_t bytes_left; /* of a RECEIVE, the present one included */
    bool last_read;      /* and the next command is no RECEIVE: not acknowledged */
    bool sampled;        /* SDA of this bit */
    bool pulls[2];       /* the master holds SCL, SDA low */
    uint64_t free_ps;    /* earliest next START after a STOP: t_BUF */

    bool line[2];           /* levels of SCL, SDA as the master's inputs have them */
    uint64_t changed_ps[2]; /* when they last changed */
    bool bus_busy;          /* BBF */
    bool playing;
} rt_i2c_t;

/* An edge at the motors' bus, for whoever looks on. */
typedef struct rt_i2c_trace_t {
    uint32_t count;
    rt1062_edge_t edge[RT1062_EDGES];
} rt_i2c_trace_t;

/* Play the buses up to now. */
void rt_i2c_sync(rt1062_t *m);
/* What the master does to this pad: 0 or RT_FLOATING. */
int rt_i2c_drives(const rt1062_t *m, uint32_t pad);
/* The level of a pad changed; of interest if it is one of the bus. */
void rt_i2c_line_changed(rt1062_t *m, uint32_t pad);

#endif
