/* SPDX-License-Identifier: MIT */
/* From an address to the register of a device; what the processor may not do on the way. */
#include <stdio.h>

#include "devices.h"
#include "machine.h"

const rt_device_t *const rt_devices[] = {
    &rt_scs,         /* processor */
    &rt_dwt,         /* cycle counter */
    &rt_ccm,         /* clocks */
    &rt_analog,      /* PLLs, supply, temperature */
    &rt_dcdc,        /* core voltage */
    &rt_ocotp,       /* fuses */
    &rt_snvs,        /* real-time clock */
    &rt_src,         /* resets */
    &rt_wdog3,       /* watchdog */
    &rt_flexspi,     /* flash memory */
    &rt_iomuxc,      /* pads */
    &rt_iomuxc_gpr,  /* owners of pins, partition of memory */
    &rt_gpio_slow,   /* GPIO1..4 */
    &rt_gpio_fast,   /* GPIO6..9 */
    &rt_xbar1,       /* crossbar */
    &rt_enc,         /* quadrature decoders */
    &rt_pit,         /* interval timers */
    &rt_adc,         /* converters */
    &rt_flexpwm,     /* pulses */
    &rt_quad_timers, /* the same */
    &rt_lpi2c1,      /* I2C */
    &rt_lpi2c3,
    &rt_lpi2c4,
    &rt_lpuart6, /* Serial1 */
    &rt_usb,     /* USB1 */
    &rt_usb_phy, /* and its transceiver */
    &rt_wires,   /* what the pins are wired to: last */
    NULL,
};

const rt_device_t *rt_device_at(uint32_t address) {
    for (uint32_t i = 0; rt_devices[i] != NULL; i++) {
        if (address - rt_devices[i]->base < rt_devices[i]->size) {
            return rt_devices[i];
        }
    }
    return NULL;
}

static void refuse_access(rt1062_t *m, const char *what, uint32_t address, uint32_t size) {
    const rt_device_t *device = rt_device_at(address);
    if (device == NULL) {
        rt_refuse(m, "%s of 0x%08X (%u bytes): no device is modelled there", what, (unsigned)address, (unsigned)size);
    } else {
        rt_refuse(m, "%s of 0x%08X (%u bytes): %s has no such register in the model", what, (unsigned)address,
                  (unsigned)size, device->name);
    }
}

uint32_t rt_bus_read(rt1062_t *m, uint32_t address, uint32_t size) {
    const rt_device_t *device = rt_device_at(address);
    uint32_t value = 0;
    if (device == NULL || device->read == NULL || !device->read(m, address - device->base, size, &value)) {
        refuse_access(m, "read", address, size);
    }
    return value;
}

void rt_bus_write(rt1062_t *m, uint32_t address, uint32_t size, uint32_t value) {
    const rt_device_t *device = rt_device_at(address);
    if (device == NULL || device->write == NULL || !device->write(m, address - device->base, size, value)) {
        refuse_access(m, "write", address, size);
    }
}

/*
 * Unicorn cuts an unaligned access into bytes. With config.strict on_access() has seen it before and taken the
 * processor to its fault. Without, a device refuses the bytes, and the address told is that of the basic block.
 */
static void note_place(rt1062_t *m) {
    if (!m->config.strict) {
        m->access_pc = m->block_at;
    }
}

static uint64_t on_read(rt_uc_engine_t *engine, uint64_t offset, unsigned size, void *user) {
    (void)engine;
    rt_window_t *window = user;
    note_place(window->m);
    return window->m->s.fault_exception != 0 ? 0 : rt_bus_read(window->m, window->base + (uint32_t)offset, size);
}

static void on_write(rt_uc_engine_t *engine, uint64_t offset, unsigned size, uint64_t value, void *user) {
    (void)engine;
    rt_window_t *window = user;
    note_place(window->m);
    if (window->m->s.fault_exception == 0) {
        rt_bus_write(window->m, window->base + (uint32_t)offset, size, (uint32_t)value);
    }
}

/* Every access to Device memory, before it happens [V7M A3.2.1: an unaligned one is a UsageFault]. */
static void on_access(rt_uc_engine_t *engine, int type, uint64_t address, int size, int64_t value, void *user) {
    (void)engine;
    (void)value;
    rt1062_t *m = user;
    rt_leave_it_block(m);
    m->access_pc = rt_reg(m, RT_REG_PC);
    if ((address & (uint64_t)(size - 1)) != 0) {
        rt_fault(m, RT_USAGE_FAULT, (uint32_t)address, "unaligned %s of %d bytes at 0x%08X in Device memory",
                 type == RT_UC_MEM_WRITE ? "write" : "read", size, (unsigned)address);
    }
}

/* Does the instruction want words at multiples of four even in Normal memory [V7M A3.2.1]? */
static bool wants_words(rt1062_t *m, uint32_t pc) {
    const uint8_t *code = rt_memory(m, pc, 2);
    const uint32_t first = code == NULL ? 0 : (uint32_t)code[0] | (uint32_t)code[1] << 8;
    return (first & 0xF000) == 0xC000 || /* LDM, STM */
           (first & 0xFE00) == 0xE800 || /* LDM, STM, LDRD, STRD, LDREX, STREX */
           (first & 0xFE00) == 0xEC00;   /* VLDR, VSTR, VLDM, VSTM */
}

/* Accesses to Normal memory: most instructions may make them unaligned. */
static void on_memory(rt_uc_engine_t *engine, int type, uint64_t address, int size, int64_t value, void *user) {
    (void)engine;
    (void)value;
    rt1062_t *m = user;
    rt_leave_it_block(m);
    if ((address & 3) == 0 || size < 4) {
        return;
    }
    m->access_pc = rt_reg(m, RT_REG_PC);
    if (wants_words(m, m->access_pc)) {
        rt_fault(m, RT_USAGE_FAULT, (uint32_t)address,
                 "unaligned %s at 0x%08X by an instruction that takes whole words only",
                 type == RT_UC_MEM_WRITE ? "write" : "read", (unsigned)address);
    }
}

static bool attach(rt1062_t *m, rt_window_t *window, uint32_t base, uint32_t size) {
    *window = (rt_window_t){m, base};
    return m->api.map_io(m->engine, base, size, (rt_callback_t)on_read, window, (rt_callback_t)on_write, window) ==
           RT_UC_ERR_OK;
}

static bool watch(rt1062_t *m, rt_uc_hook_t *hook, rt_callback_t callback, uint32_t base, uint32_t size) {
    const uint64_t end = (uint64_t)base + size - 1;
    return m->api.hook_add(m->engine, hook, RT_UC_HOOK_MEM_READ | RT_UC_HOOK_MEM_WRITE, callback, m, (uint64_t)base,
                           end) == RT_UC_ERR_OK;
}

/* Tightly coupled and on-chip memory lie in the lower half GB, flash memory above the devices. */
static bool watch_memory(rt1062_t *m) {
    return watch(m, &m->hooks[RT_WINDOWS + 4], (rt_callback_t)on_memory, RT_ITCM_BASE, RT_OCRAM_BASE + RT_OCRAM_SIZE) &&
           watch(m, &m->hooks[RT_WINDOWS + 5], (rt_callback_t)on_memory, RT_FLASH_BASE, RT_FLASH_SIZE);
}

bool rt_bus_attach(rt1062_t *m) {
    static const uint32_t windows[RT_WINDOWS][2] = {{0x40000000, 0x10000000}, {0xE0000000, 0x00100000}};
    bool attached = true;
    for (uint32_t i = 0; i < RT_WINDOWS; i++) {
        attached = attached && attach(m, &m->windows[i], windows[i][0], windows[i][1]);
        attached = attached && (!m->config.strict ||
                                watch(m, &m->hooks[i], (rt_callback_t)on_access, windows[i][0], windows[i][1]));
    }
    return attached && (!m->config.words || watch_memory(m));
}
