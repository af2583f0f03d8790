/* SPDX-License-Identifier: MIT */
#include "nor.h"

#include <string.h>

#include "handlers.h"
#include "machine.h"
#include "random.h"

/* Streams of random numbers. */
enum { STREAM_TIME = 0x4E4F5254, STREAM_BITS = 0x4E4F5242 };

typedef struct nor_time_t {
    uint64_t typical_ns;
    uint64_t maximal_ns;
} nor_time_t;

/* tBP1 and tBP2, first and further bytes; tPP, a page at most; tSE, tBE1, tBE2, tCE [data sheet, AC electrical
 * characteristics]. */
static const nor_time_t first_byte = {30000, 50000};
static const nor_time_t next_byte = {2500, 12000};
static const nor_time_t whole_page = {400000, 3000000};

typedef struct nor_erase_t {
    uint8_t code;
    uint32_t size;
    nor_time_t time;
} nor_erase_t;

static const nor_erase_t erases[] = {
    {0x20, RT_NOR_SECTOR, {45000000, 400000000}},
    {0x52, 32 * 1024, {120000000, 1600000000}},
    {0xD8, 64 * 1024, {150000000, 2000000000}},
    {0xC7, RT_FLASH_SIZE, {5000000000, 25000000000}},
};

/* Instructions with the lanes that they want (quad enable is set in the factory: W25Q16JV-IQ). */
typedef struct nor_instruction_t {
    uint8_t code;
    uint8_t lanes[3];
    const char *name;
} nor_instruction_t;

static const nor_instruction_t instructions[] = {
    {0x06, {1, 0, 0}, "write enable"},      {0x04, {1, 0, 0}, "write disable"}, {0x05, {1, 0, 1}, "read status 1"},
    {0x35, {1, 0, 1}, "read status 2"},     {0x9F, {1, 0, 1}, "read JEDEC ID"}, {0x02, {1, 1, 1}, "page program"},
    {0x32, {1, 1, 4}, "quad page program"}, {0x20, {1, 1, 0}, "sector erase"},  {0x52, {1, 1, 0}, "32 KB block erase"},
    {0xD8, {1, 1, 0}, "64 KB block erase"}, {0xC7, {1, 0, 0}, "chip erase"},
};

#define STATUS_BUSY 0x01
#define STATUS_WRITE_ENABLED 0x02
#define STATUS_2_QUAD_ENABLED 0x02

static uint64_t draw(const rt1062_t *m, nor_time_t time) {
    const double share = rt_uniform(m->config.seed, STREAM_TIME, m->s.nor.commands);
    return time.typical_ns + (uint64_t)(share * (double)(time.maximal_ns - time.typical_ns));
}

/* Bytes as slow as their share of the spread, but no slower than a whole page. */
static uint64_t program_ns(const rt1062_t *m, uint32_t count) {
    const uint64_t further = count == 0 ? 0 : count - 1;
    const uint64_t bytes = draw(m, first_byte) + further * draw(m, next_byte);
    const uint64_t page = draw(m, whole_page);
    return bytes < page ? bytes : page;
}

bool rt_nor_busy(const rt1062_t *m) {
    return m->s.nor.work != RT_NOR_IDLE;
}

/* ---- what becomes of the bits */

static void program(rt1062_t *m, const uint8_t *page) {
    uint8_t *bytes = m->flash + (m->s.nor.address & ~(uint32_t)(RT_NOR_PAGE - 1));
    for (uint32_t i = 0; i < RT_NOR_PAGE; i++) {
        bytes[i] &= page[i];
    }
}

/* The program's own instructions may be among what was changed. */
static void forget_code(rt1062_t *m) {
    const rt_nor_t *nor = &m->s.nor;
    const uint32_t at = nor->work == RT_NOR_PROGRAM ? nor->address & ~(uint32_t)(RT_NOR_PAGE - 1) : nor->address;
    rt_code_changed(m, RT_FLASH_BASE + at, nor->work == RT_NOR_PROGRAM ? RT_NOR_PAGE : nor->size);
}

static void finish(rt1062_t *m) {
    if (m->s.nor.work == RT_NOR_PROGRAM) {
        program(m, m->s.nor.page);
    } else {
        memset(m->flash + m->s.nor.address, 0xFF, m->s.nor.size);
    }
}

/* Each bit of a byte set with probability `share`; numbered by the byte's place. */
static uint8_t random_bits(const rt1062_t *m, uint32_t place, double share) {
    uint8_t bits = 0;
    for (uint32_t bit = 0; bit < 8; bit++) {
        const uint64_t index = (m->s.nor.commands << 24 | place) << 3 | bit;
        bits |= (uint8_t)(rt_uniform(m->config.seed, STREAM_BITS, index) < share ? 1u << bit : 0u);
    }
    return bits;
}

/* Stop with this share done: each bit that was to change has changed with that probability. */
static void finish_partly(rt1062_t *m, double share) {
    rt_nor_t *nor = &m->s.nor;
    const uint32_t count = nor->work == RT_NOR_PROGRAM ? RT_NOR_PAGE : nor->size;
    for (uint32_t i = 0; i < count; i++) {
        const uint8_t done = random_bits(m, i, share);
        if (nor->work == RT_NOR_PROGRAM) {
            nor->page[i] |= (uint8_t)~done;
        } else {
            m->flash[nor->address + i] |= done;
        }
    }
    if (nor->work == RT_NOR_PROGRAM) {
        program(m, nor->page);
    }
}

void rt_nor_power_lost(rt1062_t *m) {
    rt_nor_t *nor = &m->s.nor;
    if (nor->work != RT_NOR_IDLE) {
        const uint64_t now = rt_now(m);
        const uint64_t gone = now < nor->begin_ns ? 0 : now - nor->begin_ns;
        const uint64_t all = nor->end_ns - nor->begin_ns;
        finish_partly(m, gone >= all ? 1.0 : (double)gone / (double)all);
    }
    nor->work = RT_NOR_IDLE;
    nor->write_enabled = false;
    rt_schedule(m, RT_EVENT_FLASH, RT_NEVER);
    rt_flash_protection_changed(m);
}

void rt_nor_event(rt1062_t *m) {
    rt_nor_t *nor = &m->s.nor;
    if (nor->work == RT_NOR_IDLE) {
        return;
    }
    const bool cut = nor->cut_after == 1;
    if (cut) {
        finish_partly(m, nor->cut_share);
    } else {
        finish(m);
    }
    forget_code(m);
    nor->cut_after -= nor->cut_after != 0;
    nor->work = RT_NOR_IDLE;
    nor->write_enabled = false;
    rt_flash_protection_changed(m);
    if (cut) {
        m->s.powered = false;
        rt_stop(m, RT1062_STOP_POWER);
    }
}

void rt1062_cut_power_at(rt1062_t *m, uint32_t flash_commands, double share) {
    m->s.nor.cut_after = flash_commands;
    m->s.nor.cut_share = share < 0 ? 0 : share > 1 ? 1 : share;
}

/* ---- commands */

static bool refused_write(rt1062_t *m, const char *name) {
    if (!m->s.nor.write_enabled) {
        rt_finding(m, RT1062_FINDING_FLASH, "%s without write enable: the flash chip ignores it", name);
    }
    return !m->s.nor.write_enabled;
}

static void begin_work(rt1062_t *m, rt_nor_work_t work, uint64_t duration_ns) {
    rt_nor_t *nor = &m->s.nor;
    if (nor->address < m->s.image_length) {
        rt_finding(m, RT1062_FINDING_FLASH, "%s at 0x%06X, in the program itself",
                   work == RT_NOR_ERASE ? "erase" : "page program", (unsigned)nor->address);
    }
    nor->work = work;
    nor->begin_ns = rt_now(m);
    nor->end_ns = nor->begin_ns + duration_ns;
    nor->commands++;
    const double share = nor->cut_after == 1 ? nor->cut_share : 1.0;
    rt_schedule(m, RT_EVENT_FLASH, nor->begin_ns + (uint64_t)(share * (double)duration_ns));
    rt_flash_protection_changed(m);
}

/* Bytes of ones leave what is there, and fill up a copy to a round length: they ask for nothing. */
static bool sets_bits(const rt1062_t *m, const rt_nor_command_t *command) {
    const uint8_t *page = m->flash + (command->address & ~(uint32_t)(RT_NOR_PAGE - 1));
    for (uint32_t i = 0; i < command->out_count; i++) {
        if (command->out[i] != 0xFF && (command->out[i] & ~page[(command->address + i) % RT_NOR_PAGE]) != 0) {
            return true;
        }
    }
    return false;
}

/* Bytes beyond the page's end begin anew at its start; of more than 256 the last ones count [chapter "Page Program"].
 */
static void page_program(rt1062_t *m, const rt_nor_command_t *command, const char *name) {
    rt_nor_t *nor = &m->s.nor;
    if (command->address % RT_NOR_PAGE + command->out_count > RT_NOR_PAGE) {
        rt_finding(m, RT1062_FINDING_FLASH, "%s of %u bytes at 0x%06X: wraps around within its page of 256 bytes", name,
                   (unsigned)command->out_count, (unsigned)command->address);
    }
    if (sets_bits(m, command)) {
        rt_finding(m, RT1062_FINDING_FLASH, "%s of %u bytes at 0x%06X: would set bits, which only an erase can", name,
                   (unsigned)command->out_count, (unsigned)command->address);
    }
    memset(nor->page, 0xFF, sizeof nor->page);
    for (uint32_t i = 0; i < command->out_count; i++) {
        nor->page[(command->address + i) % RT_NOR_PAGE] = command->out[i];
    }
    nor->address = command->address;
    begin_work(m, RT_NOR_PROGRAM, program_ns(m, command->out_count < RT_NOR_PAGE ? command->out_count : RT_NOR_PAGE));
}

static void erase(rt1062_t *m, const rt_nor_command_t *command) {
    for (uint32_t i = 0; i < sizeof erases / sizeof erases[0]; i++) {
        if (erases[i].code == command->code) {
            m->s.nor.address = erases[i].size == RT_FLASH_SIZE ? 0 : command->address & ~(erases[i].size - 1);
            m->s.nor.size = erases[i].size;
            begin_work(m, RT_NOR_ERASE, draw(m, erases[i].time));
        }
    }
}

/* Status and ID, again and again for as long as the controller listens. */
static void answer(rt1062_t *m, const rt_nor_command_t *command) {
    static const uint8_t jedec_id[3] = {0xEF, 0x40, 0x15};
    const rt_nor_t *nor = &m->s.nor;
    const uint8_t status =
        (uint8_t)((nor->work != RT_NOR_IDLE ? STATUS_BUSY : 0) | (nor->write_enabled ? STATUS_WRITE_ENABLED : 0));
    for (uint32_t i = 0; i < command->in_count; i++) {
        command->in[i] = command->code == 0x05   ? status
                         : command->code == 0x35 ? STATUS_2_QUAD_ENABLED
                                                 : jedec_id[i % 3];
    }
}

static const nor_instruction_t *understood(rt1062_t *m, const rt_nor_command_t *command) {
    for (uint32_t i = 0; i < sizeof instructions / sizeof instructions[0]; i++) {
        if (instructions[i].code != command->code) {
            continue;
        }
        if (memcmp(instructions[i].lanes, command->lanes, sizeof command->lanes) == 0) {
            return &instructions[i];
        }
        rt_refuse(
            m, "flash instruction 0x%02X (%s) wants %u, %u and %u lanes for code, address and data, got %u, %u and %u",
            command->code, instructions[i].name, instructions[i].lanes[0], instructions[i].lanes[1],
            instructions[i].lanes[2], command->lanes[0], command->lanes[1], command->lanes[2]);
        return NULL;
    }
    rt_refuse(m, "flash instruction 0x%02X is not modelled", command->code);
    return NULL;
}

static void carry_out(rt1062_t *m, const rt_nor_command_t *command, const char *name) {
    switch (command->code) {
    case 0x06:
        m->s.nor.write_enabled = true;
        return;
    case 0x04:
        m->s.nor.write_enabled = false;
        return;
    case 0x05:
    case 0x35:
    case 0x9F:
        answer(m, command);
        return;
    default:
        break;
    }
    if (refused_write(m, name)) {
        return;
    }
    if (command->code == 0x02 || command->code == 0x32) {
        page_program(m, command, name);
    } else {
        erase(m, command);
    }
}

void rt_nor_command(rt1062_t *m, const rt_nor_command_t *command) {
    const nor_instruction_t *instruction = understood(m, command);
    if (instruction == NULL) {
        return;
    }
    const bool status = command->code == 0x05 || command->code == 0x35;
    if (m->s.nor.work != RT_NOR_IDLE && !status) {
        rt_finding(m, RT1062_FINDING_FLASH, "%s while the flash chip is busy: it ignores it", instruction->name);
        memset(command->in, 0xFF, command->in_count);
        return;
    }
    carry_out(m, command, instruction->name);
}

void rt_nor_read_while_busy(rt1062_t *m, uint32_t address, bool fetch) {
    const char *work = m->s.nor.work == RT_NOR_ERASE ? "erases" : "programs";
    rt_finding(m, RT1062_FINDING_FLASH, "%s 0x%08X while the flash chip %s", fetch ? "runs code at" : "reads",
               (unsigned)address, work);
    rt_refuse(m, "the program %s 0x%08X while the flash chip %s: what it gets there is not what is stored",
              fetch ? "runs code at" : "reads", (unsigned)address, work);
}
