/* SPDX-License-Identifier: MIT */
/* LPUART6 [RM, chapter LPUART]. What HardwareSerial.cpp of the core does not use (parity, nine bits, inversion, DMA,
 * CTS) is refused. */
#include "lpuart.h"

#include <string.h>

#include "clocks.h"
#include "devices.h"
#include "handlers.h"
#include "links.h"
#include "machine.h"

enum {
    BASE = 0x40198000,
    SIZE = 0x4000,
    IRQ_LPUART6 = 25,
    ALT_LPUART6 = 2,
    DAISY_RX_PIN_0 = 1, /* GPIO_AD_B0_03, not GPIO_EMC_26 */
    PINCFG = 0x0C,
    BAUD = 0x10,
    STAT = 0x14,
    CTRL = 0x18,
    DATA = 0x1C,
    FIFO = 0x28,
    WATER = 0x2C,
    BITS_PER_FRAME = 10
};

#define BAUD_RESET 0x0F000004u
#define BAUD_OSR_SHIFT 24
#define BAUD_OSR_MASK 0x1Fu
#define BAUD_BOTHEDGE (1u << 17)
#define BAUD_SBR_MASK 0x1FFFu
#define BAUD_MODELLED (BAUD_OSR_MASK << BAUD_OSR_SHIFT | BAUD_BOTHEDGE | BAUD_SBR_MASK)

#define STAT_RXEDGIF (1u << 30)
#define STAT_RAF (1u << 24)
#define STAT_TDRE (1u << 23)
#define STAT_TC (1u << 22)
#define STAT_RDRF (1u << 21)
#define STAT_IDLE (1u << 20)
#define STAT_OR (1u << 19)
/* Cleared by writing ones; LBKDIF, NF, FE, PF, MA1F and MA2F are never set here. */
#define STAT_CLEARED_BY_ONE (0xC01FC000u)
/* MSBF, RXINV, RWUID, BRK13, LBKDE */
#define STAT_REFUSED 0x3E000000u

#define CTRL_ORIE (1u << 27)
#define CTRL_TIE (1u << 23)
#define CTRL_TCIE (1u << 22)
#define CTRL_RIE (1u << 21)
#define CTRL_ILIE (1u << 20)
#define CTRL_TE (1u << 19)
#define CTRL_RE (1u << 18)
#define CTRL_ILT (1u << 2)
#define CTRL_MODELLED                                                                                                  \
    (CTRL_ORIE | CTRL_TIE | CTRL_TCIE | CTRL_RIE | CTRL_ILIE | CTRL_TE | CTRL_RE | CTRL_ILT | 7u << 24)

#define DATA_RXEMPT (1u << 12)
#define DATA_IDLINE (1u << 11) /* the line was idle before */

#define FIFO_TXEMPT (1u << 23)
#define FIFO_RXEMPT (1u << 22)
#define FIFO_TXOF (1u << 17)
#define FIFO_RXUF (1u << 16)
#define FIFO_TXFLUSH (1u << 15)
#define FIFO_RXFLUSH (1u << 14)
#define FIFO_TXFE (1u << 7)
#define FIFO_RXFE (1u << 3)
#define FIFO_SIZES 0x11u     /* four words each */
#define FIFO_REFUSED 0x1F00u /* RXIDEN, TXOFE, RXUFE */

#define WATER_MASK 0x00030003u

static uint32_t depth(const rt_lpuart_t *u, uint32_t enable) {
    return (u->fifo & enable) != 0 ? RT_UART_FIFO : 1;
}

static uint32_t tx_water(const rt_lpuart_t *u) {
    return (u->fifo & FIFO_TXFE) != 0 ? u->water & 3 : 0;
}

static uint32_t rx_water(const rt_lpuart_t *u) {
    return (u->fifo & FIFO_RXFE) != 0 ? u->water >> 16 & 3 : 0;
}

static uint32_t status(const rt_lpuart_t *u) {
    uint32_t stat = u->flags;
    stat |= u->sending.count <= tx_water(u) ? STAT_TDRE : 0;
    stat |= !u->shifting && u->sending.count == 0 ? STAT_TC : 0;
    stat |= u->received.count > rx_water(u) ? STAT_RDRF : 0;
    stat |= u->listening && (u->arriving || u->idle_ns != RT_NEVER) ? STAT_RAF : 0;
    return stat;
}

/* The enable bits are where the flags are, OR apart. */
static void update_irq(rt1062_t *m) {
    const rt_lpuart_t *u = &m->s.lpuart;
    const uint32_t stat = status(u);
    const uint32_t same_place = STAT_TDRE | STAT_TC | STAT_RDRF | STAT_IDLE;
    rt_irq_set(m, IRQ_LPUART6,
               (stat & u->ctrl & same_place) != 0 || ((stat & STAT_OR) != 0 && (u->ctrl & CTRL_ORIE) != 0));
}

/* Time of some bits on the line [ns]: SBR times the oversampling ratio clocks each. 0: the baud rate generator is off.
 */
static uint64_t bits_ns(const rt1062_t *m, uint32_t bits) {
    const uint32_t baud = m->s.lpuart.baud;
    const uint32_t osr = baud >> BAUD_OSR_SHIFT & BAUD_OSR_MASK;
    const uint64_t clocks = (uint64_t)bits * (baud & BAUD_SBR_MASK) * (osr == 0 ? 16 : osr + 1);
    const uint32_t hz = rt_clock_on(m, RT_CLOCK_LPUART6) ? rt_clock_hz(m, RT_ROOT_UART) : 0;
    return hz == 0 ? 0 : (clocks * 1000000000u + hz / 2) / hz;
}

/* Whether the pads of pins 0 and 1 are connected to it [core, UART6_Hardware]. The daisy of TX is that of its input,
 * for a single wire. */
static bool hears_pad(const rt1062_t *m) {
    return rt_pad_is(m, RT_PAD_UART_RX, ALT_LPUART6) && m->s.pads.daisy[RT_DAISY_LPUART6_RX] == DAISY_RX_PIN_0;
}

static bool drives_pad(const rt1062_t *m) {
    return rt_pad_is(m, RT_PAD_UART_TX, ALT_LPUART6);
}

static uint16_t fifo_take(rt_uart_fifo_t *fifo) {
    const uint16_t word = fifo->words[0];
    fifo->count--;
    memmove(fifo->words, fifo->words + 1, fifo->count * sizeof word);
    return word;
}

/* ---- sending */

static void shift_next(rt1062_t *m, uint64_t from_ns) {
    rt_lpuart_t *u = &m->s.lpuart;
    const uint64_t frame_ns = bits_ns(m, BITS_PER_FRAME);
    u->shifting = (u->preamble || (u->sending.count > 0 && (u->ctrl & CTRL_TE) != 0)) && frame_ns != 0;
    if (!u->shifting) {
        return;
    }
    if (!u->preamble) {
        u->shifter = (uint8_t)fifo_take(&u->sending);
    }
    u->sent_ns = from_ns + frame_ns;
    rt_schedule(m, RT_EVENT_UART_SEND, u->sent_ns);
}

void rt_uart_send_event(rt1062_t *m) {
    rt_lpuart_t *u = &m->s.lpuart;
    const bool byte_left = !u->preamble;
    u->preamble = false;
    if (byte_left && drives_pad(m)) {
        rt_output(m, RT1062_UART, &u->shifter, 1);
    } else if (byte_left) {
        rt_finding(m, RT1062_FINDING_PINS, "LPUART6 sends, but the pad of pin 1 is not connected to it");
    }
    shift_next(m, u->sent_ns);
    update_irq(m);
}

static void write_data(rt1062_t *m, uint32_t value) {
    rt_lpuart_t *u = &m->s.lpuart;
    if (u->sending.count >= depth(u, FIFO_TXFE)) {
        u->fifo |= FIFO_TXOF;
        return;
    }
    u->sending.words[u->sending.count++] = (uint8_t)value;
    if (!u->shifting) {
        shift_next(m, rt_now(m));
    }
}

/* ---- receiving */

/* Bits from a frame's start until the line has been high for a character. Counted from after the start bit, or from
 * after the stop bit. */
static uint32_t bits_until_idle(const rt_lpuart_t *u) {
    uint32_t high_since = BITS_PER_FRAME;
    if ((u->ctrl & CTRL_ILT) == 0) {
        for (high_since = 9; high_since > 1 && (u->frame >> (high_since - 2) & 1) != 0; high_since--) {}
    }
    return high_since + BITS_PER_FRAME;
}

static bool hears(rt1062_t *m) {
    return (m->s.lpuart.ctrl & CTRL_RE) != 0 && hears_pad(m);
}

static void next_frame(rt1062_t *m, uint64_t from_ns) {
    rt_lpuart_t *u = &m->s.lpuart;
    const uint64_t frame_ns = bits_ns(m, BITS_PER_FRAME);
    if (u->line_count == 0 || frame_ns == 0) {
        rt_schedule(m, RT_EVENT_UART_RECEIVE, u->idle_ns);
        return;
    }
    u->frame = u->line[u->line_begin];
    u->line_begin = (u->line_begin + 1) % RT_UART_LINE;
    u->line_count--;
    u->arriving = true;
    u->was_idle = u->idle_ns == RT_NEVER;
    u->idle_ns = RT_NEVER;
    u->listening = hears(m);
    u->flags |= u->listening ? STAT_RXEDGIF : 0;
    u->arrived_ns = from_ns + frame_ns;
    rt_schedule(m, RT_EVENT_UART_RECEIVE, u->arrived_ns);
}

/* While OR is set nothing more is stored [RM, LPUART, STAT]. */
static void store_frame(rt_lpuart_t *u) {
    if ((u->flags & STAT_OR) != 0) {
        return;
    }
    if (u->received.count >= depth(u, FIFO_RXFE)) {
        u->flags |= STAT_OR;
        return;
    }
    u->received.words[u->received.count++] = (uint16_t)(u->frame | (u->was_idle ? DATA_IDLINE : 0));
}

static void frame_arrived(rt1062_t *m) {
    rt_lpuart_t *u = &m->s.lpuart;
    u->arriving = false;
    if (u->listening && hears(m)) {
        store_frame(u);
        u->idle_ns = u->arrived_ns - bits_ns(m, BITS_PER_FRAME) + bits_ns(m, bits_until_idle(u));
    }
    next_frame(m, u->arrived_ns);
}

void rt_uart_receive_event(rt1062_t *m) {
    rt_lpuart_t *u = &m->s.lpuart;
    if (u->arriving) {
        frame_arrived(m);
    } else if (u->idle_ns <= rt_now(m)) {
        u->flags |= hears(m) ? STAT_IDLE : 0;
        u->idle_ns = RT_NEVER;
    }
    update_irq(m);
}

uint32_t rt_uart_send(rt1062_t *m, const uint8_t *bytes, uint32_t count) {
    rt_lpuart_t *u = &m->s.lpuart;
    const uint32_t room = RT_UART_LINE - u->line_count;
    const uint32_t taken = count < room ? count : room;
    for (uint32_t i = 0; i < taken; i++) {
        u->line[(u->line_begin + u->line_count++) % RT_UART_LINE] = bytes[i];
    }
    if (!u->arriving && m->s.powered) {
        next_frame(m, rt_now(m));
    }
    return taken;
}

/* ---- registers */

static uint32_t read_data(rt_lpuart_t *u) {
    if (u->received.count == 0) {
        u->fifo |= (u->fifo & FIFO_RXFE) != 0 ? FIFO_RXUF : 0;
        return DATA_RXEMPT;
    }
    return fifo_take(&u->received);
}

static uint32_t fifo_value(const rt_lpuart_t *u) {
    return u->fifo | FIFO_SIZES | (u->sending.count == 0 ? FIFO_TXEMPT : 0) |
           (u->received.count == 0 ? FIFO_RXEMPT : 0);
}

static bool lpuart_read(rt1062_t *m, uint32_t offset, uint32_t size, uint32_t *value) {
    rt_lpuart_t *u = &m->s.lpuart;
    if (size != 4) {
        return false;
    }
    rt_clock_needed(m, RT_CLOCK_LPUART6, "LPUART6");
    switch (offset) {
    case PINCFG:
        *value = 0;
        return true;
    case BAUD:
        *value = u->baud;
        return true;
    case STAT:
        *value = status(u);
        return true;
    case CTRL:
        *value = u->ctrl;
        return true;
    case FIFO:
        *value = fifo_value(u);
        return true;
    case WATER:
        *value = u->water | (uint32_t)u->sending.count << 8 | (uint32_t)u->received.count << 24;
        return true;
    case DATA:
        *value = read_data(u);
        update_irq(m);
        return true;
    default:
        return false;
    }
}

/* Takes effect with the next frame. The manual wants TE and RE to be off; the core's begin() leaves them on when it is
 * called again. */
static void write_baud(rt1062_t *m, uint32_t value) {
    rt_lpuart_t *u = &m->s.lpuart;
    const uint32_t osr = value >> BAUD_OSR_SHIFT & BAUD_OSR_MASK;
    if ((value & ~BAUD_MODELLED) != 0 || osr == 1 || osr == 2) {
        rt_refuse(m, "LPUART6 BAUD = 0x%08X: these bits are not modelled", (unsigned)value);
    } else if (osr >= 3 && osr < 7 && (value & BAUD_BOTHEDGE) == 0) {
        rt_refuse(m, "LPUART6 BAUD = 0x%08X: oversampling below 8 needs BOTHEDGE", (unsigned)value);
    } else {
        u->baud = value;
        if (!u->arriving) {
            next_frame(m, rt_now(m));
        }
    }
}

static void write_ctrl(rt1062_t *m, uint32_t value) {
    rt_lpuart_t *u = &m->s.lpuart;
    if ((value & ~CTRL_MODELLED) != 0) {
        rt_refuse(m, "LPUART6 CTRL = 0x%08X: these bits are not modelled", (unsigned)value);
        return;
    }
    const uint32_t risen = value & ~u->ctrl;
    u->ctrl = value;
    if ((value & CTRL_RE) == 0) {
        u->listening = false;
        u->idle_ns = RT_NEVER;
    }
    if ((risen & CTRL_TE) != 0 && !u->shifting) {
        u->preamble = true; /* an idle character comes first [RM, LPUART, CTRL] */
        shift_next(m, rt_now(m));
    }
}

static void write_fifo(rt1062_t *m, uint32_t value) {
    rt_lpuart_t *u = &m->s.lpuart;
    if ((value & FIFO_REFUSED) != 0) {
        rt_refuse(m, "LPUART6 FIFO = 0x%08X: these bits are not modelled", (unsigned)value);
        return;
    }
    u->fifo &= ~(value & (FIFO_TXOF | FIFO_RXUF));
    u->fifo = (u->fifo & (FIFO_TXOF | FIFO_RXUF)) | (value & (FIFO_TXFE | FIFO_RXFE));
    u->sending.count = (value & FIFO_TXFLUSH) != 0 ? 0 : u->sending.count;
    u->received.count = (value & FIFO_RXFLUSH) != 0 ? 0 : u->received.count;
}

static bool lpuart_write(rt1062_t *m, uint32_t offset, uint32_t size, uint32_t value) {
    rt_lpuart_t *u = &m->s.lpuart;
    if (size != 4) {
        return false;
    }
    rt_clock_needed(m, RT_CLOCK_LPUART6, "LPUART6");
    switch (offset) {
    case PINCFG:
        if (value != 0) {
            return false;
        }
        break;
    case BAUD:
        write_baud(m, value);
        break;
    case STAT:
        if ((value & STAT_REFUSED) != 0) {
            return false;
        }
        u->flags &= ~(value & STAT_CLEARED_BY_ONE);
        break;
    case CTRL:
        write_ctrl(m, value);
        break;
    case DATA:
        write_data(m, value);
        break;
    case FIFO:
        write_fifo(m, value);
        break;
    case WATER:
        u->water = value & WATER_MASK;
        break;
    default:
        return false;
    }
    update_irq(m);
    return true;
}

/* What is on the line from outside stays on it. */
static void lpuart_reset(rt1062_t *m) {
    rt_lpuart_t *u = &m->s.lpuart;
    u->baud = BAUD_RESET;
    u->flags = u->ctrl = u->fifo = u->water = 0;
    u->sending.count = u->received.count = 0;
    u->shifting = u->preamble = u->listening = u->was_idle = false;
    u->idle_ns = RT_NEVER;
    rt_schedule(m, RT_EVENT_UART_SEND, RT_NEVER);
    if (u->arriving) {
        rt_schedule(m, RT_EVENT_UART_RECEIVE, u->arrived_ns);
    } else {
        next_frame(m, rt_now(m));
    }
    update_irq(m);
}

const rt_device_t rt_lpuart6 = {
    .name = "LPUART6", .base = BASE, .size = SIZE, .read = lpuart_read, .write = lpuart_write, .reset = lpuart_reset};
