/* SPDX-License-Identifier: MIT */
/* i.MX RT1060 RM, chapter System Boot: "FlexSPI NOR configuration block", "Image vector table", "Boot data"; the core's
 * bootdata.c. */
#include "rom.h"

#include <string.h>

#include "machine.h"

enum {
    BLOCK_TAG = 0x42464346, /* FCFB */
    BLOCK_VERSION = 0x56,   /* 'V' in its top byte */
    BLOCK_A1_SIZE = 0x50,
    BLOCK_LUT = 0x80,
    IVT = 0x1000,
    IVT_TAG = 0xD1,
    IVT_ENTRY = IVT + 4,
    IVT_DCD = IVT + 12,
    IVT_BOOT_DATA = IVT + 16,
    IVT_SELF = IVT + 20,
    /* Header version from which the entry is an address to jump to. Up to 0x42 it is a vector table (bootdata.c of old
     * and new cores). */
    VERSION_JUMP = 0x43,
    /* Up to the jump. No manual gives it; a guess. After a power-on PJRC's own chip (MKL02) lets the processor go
       first. */
    ROM_ns = 5000000,
    POWER_UP_ns = 50000000,
    /* OCRAM that the ROM uses for itself; usb.c of the core hands it memory above that. */
    ROM_MEMORY = 0x8000,
    ROM_STACK = 0x20201000
};

static uint32_t word(const rt1062_t *m, uint32_t offset) {
    uint32_t value;
    memcpy(&value, m->flash + offset, sizeof value);
    return value;
}

static bool configuration_ok(rt1062_t *m) {
    if (word(m, 0) != BLOCK_TAG) {
        rt_refuse(m,
                  "the boot ROM finds no flash configuration block at 0x60000000 (0x%08X instead of FCFB): no program "
                  "is there",
                  (unsigned)word(m, 0));
        return false;
    }
    if (word(m, 4) >> 24 != BLOCK_VERSION || word(m, BLOCK_A1_SIZE) == 0 || (word(m, BLOCK_LUT) >> 10 & 0x3F) != 1) {
        rt_refuse(m,
                  "the boot ROM can't use the flash configuration block: version 0x%08X, size 0x%X, first read "
                  "instruction 0x%X",
                  (unsigned)word(m, 4), (unsigned)word(m, BLOCK_A1_SIZE), (unsigned)(word(m, BLOCK_LUT) & 0xFFFF));
        return false;
    }
    return true;
}

static bool vector_table_ok(rt1062_t *m) {
    const uint32_t header = word(m, IVT);
    const uint32_t version = header >> 24;
    const bool header_ok =
        (header & 0xFF) == IVT_TAG && (header >> 8 & 0xFFFF) == 0x2000 && version >= 0x40 && version <= 0x43;
    if (!header_ok || word(m, IVT_SELF) != RT_FLASH_BASE + IVT) {
        rt_refuse(m, "the boot ROM finds no image vector table at 0x60001000: header 0x%08X, own address 0x%08X",
                  (unsigned)header, (unsigned)word(m, IVT_SELF));
        return false;
    }
    if (word(m, IVT_DCD) != 0) {
        rt_refuse(m, "the image has device configuration data (DCD), which the model's boot ROM does not carry out");
        return false;
    }
    return true;
}

/* @return the image's length, 0 if the boot data is none. */
static uint32_t image_length(rt1062_t *m) {
    const uint32_t at = word(m, IVT_BOOT_DATA) - RT_FLASH_BASE;
    const bool there = at < RT_FLASH_SIZE - 12;
    const uint32_t start = there ? word(m, at) : 0;
    const uint32_t length = there ? word(m, at + 4) : 0;
    if (start == RT_FLASH_BASE && length > IVT && length <= RT_FLASH_SIZE) {
        return length;
    }
    rt_refuse(m, "the image's boot data at 0x%08X is none: start 0x%08X, length %u", (unsigned)word(m, IVT_BOOT_DATA),
              (unsigned)start, (unsigned)length);
    return 0;
}

static bool inside(uint32_t address, uint32_t length) {
    return address - RT_FLASH_BASE < length;
}

static void jump(rt1062_t *m, uint32_t length) {
    uint32_t entry = word(m, IVT_ENTRY);
    uint32_t stack = ROM_STACK;
    if (word(m, IVT) >> 24 < VERSION_JUMP && inside(entry, length - 8)) {
        stack = word(m, entry - RT_FLASH_BASE);
        entry = word(m, entry - RT_FLASH_BASE + 4);
    }
    if (!inside(entry, length) || (entry & 1) == 0) {
        rt_refuse(m, "the image's entry 0x%08X is no Thumb code within its %u bytes", (unsigned)entry,
                  (unsigned)length);
        return;
    }
    rt_cpu_reset(m, stack, entry);
}

/* What it worked with; nobody may find sense in it. */
static void leave_memory(rt1062_t *m) {
    for (uint32_t i = 0; i < ROM_MEMORY; i++) {
        m->ocram[i] ^= (uint8_t)(0xA5 ^ i);
    }
}

void rt_rom_boot(rt1062_t *m) {
    m->s.now_ns += (m->s.reset_flags & RT_RESET_POWER) != 0 ? (uint64_t)POWER_UP_ns + ROM_ns : (uint64_t)ROM_ns;
    if (rt_nor_busy(m)) {
        rt_finding(m, RT1062_FINDING_FLASH, "reset while the flash chip is at work: the boot ROM can't read it");
        rt_refuse(m, "the chip was reset while its flash memory was at work: the boot ROM can't read a program");
        return;
    }
    if (!configuration_ok(m) || !vector_table_ok(m)) {
        return;
    }
    const uint32_t length = image_length(m);
    if (length == 0) {
        return;
    }
    m->s.image_length = length;
    leave_memory(m);
    rt_clocks_after_rom(m);
    rt_analog_after_rom(m);
    rt_watchdog_after_rom(m);
    rt_flexspi_after_rom(m, m->flash);
    jump(m, length);
}
