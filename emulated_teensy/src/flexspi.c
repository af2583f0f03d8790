/* SPDX-License-Identifier: MIT */
/* FlexSPI1 (i.MX RT1060 RM, chapter FlexSPI). Reset values: the register tables of the vendor's SVD file. */
#include "flexspi.h"

#include <string.h>

#include "machine.h"
#include "nor.h"
#include "registers.h"

enum { MCR0, MCR1, MCR2, AHBCR, INTEN, FLSHA1CR0, FLSHA1CR1, FLSHA1CR2, IPCR0, IPCR1, IPRXFCR, IPTXFCR };

static const rt_register_t table[RT_FLEXSPI_STORED] = {
    [MCR0] = {0x000, 0xFFFF80C2, 0xFFFF78F2, 0x8000, "FLEXSPI_MCR0"}, /* bit 0, SWRESET, is not kept */
    [MCR1] = {0x004, 0xFFFFFFFF, 0xFFFFFFFF, 0, "FLEXSPI_MCR1"},
    [MCR2] = {0x008, 0x200081F7, 0xFF088800, 0x4000, "FLEXSPI_MCR2"},
    [AHBCR] = {0x00C, 0x00000018, 0x00000078, 0, "FLEXSPI_AHBCR"},
    [INTEN] = {0x010, 0x00000000, 0x00000F7F, 0, "FLEXSPI_INTEN"},
    [FLSHA1CR0] = {0x060, 0x00010000, 0x007FFFFF, 0, "FLEXSPI_FLSHA1CR0"},
    [FLSHA1CR1] = {0x070, 0x00000063, 0xFFFFFFFF, 0, "FLEXSPI_FLSHA1CR1"},
    [FLSHA1CR2] = {0x080, 0x00000000, 0x7FFFEFEF, 0x80000000, "FLEXSPI_FLSHA1CR2"},
    [IPCR0] = {0x0A0, 0x00000000, 0xFFFFFFFF, 0, "FLEXSPI_IPCR0"},
    [IPCR1] = {0x0A4, 0x00000000, 0x070FFFFF, 0, "FLEXSPI_IPCR1"},
    [IPRXFCR] = {0x0B8, 0x00000000, 0x0000003C, 1, "FLEXSPI_IPRXFCR"},
    [IPTXFCR] = {0x0BC, 0x00000000, 0x0000003C, 1, "FLEXSPI_IPTXFCR"},
};

enum {
    INTR = 0x014,
    LUTKEY = 0x018,
    LUTCR = 0x01C,
    IPCMD = 0x0B0,
    STS0 = 0x0E0,
    RFDR = 0x100,
    TFDR = 0x180,
    LUT = 0x200,
    IRQ_FLEXSPI = 108,
    LUT_KEY = 0x5AF05AF0,
    LUT_LOCK = 1,
    LUT_UNLOCK = 2,
    SWRESET = 1,
    MDIS = 2,
    CLEAR_FIFO = 1,
    IDLE = 3,       /* STS0: SEQIDLE, ARBIDLE */
    CLOCK_ns = 10,  /* 100 MHz: serialClkFreq 6 in the configuration block of bootdata.c */
    SELECT_ns = 100 /* chip select, arbitration; a guess */
};

#define IPCMDDONE (1u << 0)
#define IPCMDERR (1u << 3)
#define IPRXWA (1u << 5)
#define IPTXWE (1u << 6)
#define CLEARED_BY_ONE 0xF1Fu

/* Instructions of a sequence, and what we make of one. */
enum { OP_STOP = 0x00, OP_COMMAND = 0x01, OP_ADDRESS = 0x02, OP_WRITE = 0x08, OP_READ = 0x09 };

typedef struct sequence_t {
    uint8_t code;
    uint8_t lanes[3];
    bool writes;
    bool reads;
    uint32_t data_count; /* of the data instruction's operand, for IDATSZ 0 */
} sequence_t;

static bool clocked(rt1062_t *m) {
    return rt_clock_needed(m, RT_CLOCK_FLEXSPI, "FlexSPI");
}

/* Bytes at which IPTXWE and IPRXWA are set: (WMRK + 1) times 64 bits. */
static uint32_t watermark(const rt1062_t *m, uint32_t which) {
    return 8 * ((m->s.flexspi.stored[which] >> 2 & 0xF) + 1);
}

static uint32_t interrupts(const rt1062_t *m) {
    const rt_flexspi_t *f = &m->s.flexspi;
    uint32_t flags = f->interrupts;
    flags |= RT_FLEXSPI_FIFO - f->tx_count >= watermark(m, IPTXFCR) ? IPTXWE : 0;
    flags |= f->rx_count >= watermark(m, IPRXFCR) ? IPRXWA : 0;
    return flags;
}

static void update_irq(rt1062_t *m) {
    rt_irq_set(m, IRQ_FLEXSPI, (interrupts(m) & m->s.flexspi.stored[INTEN]) != 0);
}

/* Notice that the command under way has ended. */
static void look_at_wire(rt1062_t *m) {
    rt_flexspi_t *f = &m->s.flexspi;
    if (f->busy && rt_now(m) >= f->done_ns) {
        f->busy = false;
        f->interrupts |= IPCMDDONE;
    }
}

/* ---- the look-up table */

static bool parse_instruction(rt1062_t *m, uint32_t word, sequence_t *sequence) {
    static const uint8_t lanes[4] = {1, 2, 4, 8};
    const uint32_t op = word >> 10 & 0x3F;
    const uint8_t pads = lanes[word >> 8 & 3];
    switch (op) {
    case OP_COMMAND:
        sequence->code = (uint8_t)word;
        sequence->lanes[0] = pads;
        return true;
    case OP_ADDRESS:
        if ((word & 0xFF) != 24) {
            rt_refuse(m, "FlexSPI sends %u bits of address; the flash chip takes 24", (unsigned)(word & 0xFF));
        }
        sequence->lanes[1] = pads;
        return true;
    case OP_WRITE:
    case OP_READ:
        sequence->lanes[2] = pads;
        sequence->writes = op == OP_WRITE;
        sequence->reads = op == OP_READ;
        sequence->data_count = word & 0xFF;
        return true;
    default:
        rt_refuse(m, "FlexSPI instruction 0x%02X of the look-up table is not modelled", (unsigned)op);
        return false;
    }
}

static bool parse_sequence(rt1062_t *m, uint32_t number, sequence_t *sequence) {
    memset(sequence, 0, sizeof *sequence);
    for (uint32_t i = 0; i < 8; i++) {
        const uint32_t word = m->s.flexspi.lut[4 * number + i / 2] >> (16 * (i % 2)) & 0xFFFF;
        if (word >> 10 == OP_STOP) {
            break;
        }
        if (!parse_instruction(m, word, sequence)) {
            return false;
        }
    }
    if (sequence->lanes[0] == 0) {
        rt_refuse(m, "FlexSPI runs sequence %u, which holds no command", (unsigned)number);
        return false;
    }
    return true;
}

static uint64_t wire_ns(const sequence_t *sequence, uint32_t data_count) {
    uint32_t clocks = 8u / sequence->lanes[0];
    clocks += sequence->lanes[1] != 0 ? 24u / sequence->lanes[1] : 0;
    clocks += sequence->lanes[2] != 0 ? 8u * data_count / sequence->lanes[2] : 0;
    return SELECT_ns + (uint64_t)clocks * CLOCK_ns;
}

/* ---- commands */

static uint32_t data_size(const rt1062_t *m, const sequence_t *sequence) {
    const uint32_t size = m->s.flexspi.stored[IPCR1] & 0xFFFF;
    return size != 0 ? size : sequence->data_count;
}

static void send(rt1062_t *m, const sequence_t *sequence, uint32_t size) {
    rt_flexspi_t *f = &m->s.flexspi;
    const rt_nor_command_t command = {
        .code = sequence->code,
        .lanes = {sequence->lanes[0], sequence->lanes[1], sequence->lanes[2]},
        .address = f->stored[IPCR0],
        .out = f->tx,
        .out_count = sequence->writes ? size : 0,
        .in = f->rx,
        .in_count = sequence->reads ? size : 0,
    };
    f->done_ns = rt_now(m) + wire_ns(sequence, size);
    rt_nor_command(m, &command);
    if (sequence->reads) {
        f->rx_count = size;
    }
    if (sequence->writes) {
        f->tx_count -= size;
        memmove(f->tx, f->tx + size, f->tx_count);
    }
}

/* The clock stands still until the FIFO holds what is to be sent (chapter FlexSPI, "Flash access by IP command"). */
static void try_to_send(rt1062_t *m) {
    rt_flexspi_t *f = &m->s.flexspi;
    sequence_t sequence;
    if (!f->busy || f->done_ns != RT_NEVER || !parse_sequence(m, f->stored[IPCR1] >> 16 & 0xF, &sequence)) {
        return;
    }
    const uint32_t size = data_size(m, &sequence);
    if (size > (sequence.reads ? RT_FLEXSPI_WINDOW : RT_FLEXSPI_FIFO)) {
        rt_refuse(m, "FlexSPI command of %u bytes of data: more than a FIFO holds is not modelled", (unsigned)size);
    } else if (!sequence.writes || f->tx_count >= size) {
        send(m, &sequence, size);
    }
}

static void trigger(rt1062_t *m) {
    rt_flexspi_t *f = &m->s.flexspi;
    if (f->busy) {
        rt_refuse(m, "FlexSPI is given a command while the one before is under way");
        return;
    }
    if ((f->stored[MCR0] & MDIS) != 0 || (f->stored[IPCR1] >> 24 & 7) != 0) {
        rt_refuse(
            m, "FlexSPI is given a command while it is disabled, or one of several sequences, which is not modelled");
        return;
    }
    if (f->stored[IPCR0] / 1024 >= f->stored[FLSHA1CR0]) { /* beyond the chip: no such flash [IPCMDERR] */
        rt_finding(m, RT1062_FINDING_FLASH, "FlexSPI command for address 0x%08X, beyond the flash chip",
                   (unsigned)f->stored[IPCR0]);
        f->interrupts |= IPCMDERR | IPCMDDONE;
        return;
    }
    f->busy = true;
    f->done_ns = RT_NEVER;
    try_to_send(m);
}

/* Writing one to IPTXWE hands the window's first bytes, up to the watermark, to the FIFO (chapter FlexSPI, "Writing
 * data to IP TX FIFO"). */
static void push(rt1062_t *m) {
    rt_flexspi_t *f = &m->s.flexspi;
    const uint32_t count = watermark(m, IPTXFCR);
    if (RT_FLEXSPI_FIFO - f->tx_count < count) {
        rt_finding(m, RT1062_FINDING_FLASH, "FlexSPI's FIFO is given more than it holds");
        return;
    }
    memcpy(f->tx + f->tx_count, f->tx_window, count);
    f->tx_count += count;
    try_to_send(m);
}

/* ---- registers */

static void lut_written(rt1062_t *m, uint32_t number, uint32_t value) {
    rt_flexspi_t *f = &m->s.flexspi;
    if (f->lut_control != LUT_UNLOCK) {
        rt_finding(m, RT1062_FINDING_FLASH, "FLEXSPI_LUT%u is written while the table is locked: nothing happens",
                   (unsigned)number);
    } else if (number / 4 == (f->stored[FLSHA1CR2] & 0xF)) {
        rt_refuse(m, "FLEXSPI_LUT%u belongs to the sequence that reads the memory; changing it is not modelled",
                  (unsigned)number);
    } else {
        f->lut[number] = value;
    }
}

static void lut_control_written(rt1062_t *m, uint32_t value, bool key_given) {
    rt_flexspi_t *f = &m->s.flexspi;
    if (!key_given) {
        rt_finding(m, RT1062_FINDING_FLASH,
                   "FLEXSPI_LUTCR is written without the key in FLEXSPI_LUTKEY before: nothing happens");
    } else if (value == LUT_LOCK || value == LUT_UNLOCK) {
        f->lut_control = value;
    } else {
        rt_refuse(m, "FLEXSPI_LUTCR: 0x%X neither locks nor unlocks", (unsigned)value);
    }
}

static void interrupts_written(rt1062_t *m, uint32_t value) {
    m->s.flexspi.interrupts &= ~(value & CLEARED_BY_ONE);
    if ((value & IPTXWE) != 0) {
        push(m);
    }
}

static void stored_written(rt1062_t *m, int32_t place, uint32_t value) {
    rt_flexspi_t *f = &m->s.flexspi;
    const uint32_t once = place == MCR0 ? SWRESET : 0;
    rt_register_write(m, &table[place], &f->stored[place], value & ~once);
    if (place == IPTXFCR && (value & CLEAR_FIFO) != 0) {
        f->tx_count = 0;
    } else if (place == IPRXFCR && (value & CLEAR_FIFO) != 0) {
        f->rx_count = 0;
    } else if (place == MCR0 && (value & SWRESET) != 0) {
        f->busy = false;
        f->tx_count = 0;
        f->rx_count = 0;
    }
}

static bool word_write(rt1062_t *m, uint32_t offset, uint32_t value) {
    rt_flexspi_t *f = &m->s.flexspi;
    const bool key_given = f->key_given;
    f->key_given = offset == LUTKEY && value == LUT_KEY;
    const int32_t place = rt_register_find(table, RT_FLEXSPI_STORED, offset);
    if (place >= 0) {
        stored_written(m, place, value);
    } else if (offset >= LUT && offset < LUT + 4 * RT_FLEXSPI_LUT) {
        lut_written(m, (offset - LUT) / 4, value);
    } else if (offset == INTR) {
        interrupts_written(m, value);
    } else if (offset == LUTCR) {
        lut_control_written(m, value, key_given);
    } else if (offset == IPCMD && value == 1) {
        trigger(m);
    } else {
        return offset == LUTKEY;
    }
    return true;
}

/*
 * TFDR takes any width. What it does with part of a word is not written down, but the core relies on it. Its eeprom.c
 * writes its two bytes with one halfword.
 */
static bool flexspi_write(rt1062_t *m, uint32_t offset, uint32_t size, uint32_t value) {
    if (!clocked(m)) {
        return true;
    }
    look_at_wire(m);
    bool known = true;
    if (offset - TFDR < RT_FLEXSPI_WINDOW) {
        memcpy(m->s.flexspi.tx_window + (offset - TFDR), &value, size);
    } else {
        known = size == 4 && word_write(m, offset, value);
    }
    update_irq(m);
    return known;
}

static bool word_read(rt1062_t *m, uint32_t offset, uint32_t *value) {
    const rt_flexspi_t *f = &m->s.flexspi;
    const int32_t place = rt_register_find(table, RT_FLEXSPI_STORED, offset);
    if (place >= 0) {
        *value = f->stored[place];
    } else if (offset >= LUT && offset < LUT + 4 * RT_FLEXSPI_LUT) {
        *value = f->lut[(offset - LUT) / 4];
    } else if (offset == INTR) {
        *value = interrupts(m);
    } else if (offset == LUTCR) {
        *value = f->lut_control;
    } else if (offset == STS0) {
        *value = f->busy ? 0 : IDLE;
    } else {
        return false;
    }
    return true;
}

static bool flexspi_read(rt1062_t *m, uint32_t offset, uint32_t size, uint32_t *value) {
    *value = 0;
    if (!clocked(m)) {
        return true;
    }
    look_at_wire(m);
    if (offset - RFDR >= RT_FLEXSPI_WINDOW) {
        return size == 4 && word_read(m, offset, value);
    }
    if (offset - RFDR + 1 > m->s.flexspi.rx_count) {
        rt_finding(m, RT1062_FINDING_FLASH, "FlexSPI's FIFO is read at byte %u while it holds %u",
                   (unsigned)(offset - RFDR), (unsigned)m->s.flexspi.rx_count);
    }
    memcpy(value, m->s.flexspi.rx + (offset - RFDR), size);
    return true;
}

static void flexspi_reset(rt1062_t *m) {
    rt_flexspi_t *f = &m->s.flexspi;
    memset(f, 0, sizeof *f);
    rt_registers_reset(table, RT_FLEXSPI_STORED, f->stored);
    f->lut_control = LUT_UNLOCK;
    f->done_ns = RT_NEVER;
}

/* Offsets of the configuration block as bootdata.c of the core gives them: sflashA1Size 0x50, lookupTable 0x80. */
void rt_flexspi_after_rom(rt1062_t *m, const uint8_t *block) {
    rt_flexspi_t *f = &m->s.flexspi;
    uint32_t size = 0;
    memcpy(&size, block + 0x50, sizeof size);
    memcpy(f->lut, block + 0x80, sizeof f->lut);
    f->stored[FLSHA1CR0] = size / 1024;
    f->stored[MCR0] &= ~(uint32_t)MDIS;
    f->lut_control = LUT_LOCK;
}

const rt_device_t rt_flexspi = {"FlexSPI", 0x402A8000, 0x4000, flexspi_read, flexspi_write, flexspi_reset};
