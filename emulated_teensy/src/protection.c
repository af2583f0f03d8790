/* SPDX-License-Identifier: MIT */
/*
 * What memory there is and who may do what with it. That is the partition of the tightly coupled memory and the memory
 * protection unit [V7M B3.5], as rights of Unicorn's pages of 4 KB. Smaller regions are watched access by access.
 */
#include "machine.h"

enum { PAGE = 4096, SMALLEST_PAGED = 11 /* RASR.SIZE of 4 KB */ };

typedef struct memory_t {
    uint32_t base;
    uint32_t size;
} memory_t;

static const memory_t memories[] = {{RT_ITCM_BASE, RT_ITCM_SIZE},
                                    {RT_DTCM_BASE, RT_DTCM_SIZE},
                                    {RT_OCRAM_BASE, RT_OCRAM_SIZE},
                                    {RT_FLASH_BASE, RT_FLASH_SIZE}};

static uint32_t region_size_log2(const rt_mpu_region_t *region) {
    return (region->attributes >> 1 & 0x1F) + 1;
}

/* @return whether the region is on and covers the address, its disabled eighths apart. */
static bool covers(const rt_mpu_region_t *region, uint32_t address) {
    if ((region->attributes & 1) == 0) {
        return false;
    }
    const uint32_t bits = region_size_log2(region);
    const uint32_t offset = address - region->base;
    if (bits < 32 && offset >> bits != 0) {
        return false;
    }
    const uint32_t eighth = bits >= 8 ? offset >> (bits - 3) & 7 : 0;
    return (region->attributes >> (8 + eighth) & 1) == 0;
}

/* Rights of privileged code. */
static uint32_t rights_of(const rt_mpu_region_t *region) {
    static const uint8_t access[8] = {0, 3, 3, 3, 0, 1, 1, 1}; /* AP: bit 0 read, bit 1 write */
    const uint32_t granted = access[region->attributes >> 24 & 7];
    uint32_t rights = (granted & 1) != 0 ? RT_UC_PROT_READ : 0;
    rights |= (granted & 2) != 0 ? RT_UC_PROT_WRITE : 0;
    const bool executable = (region->attributes >> 28 & 1) == 0 && (granted & 1) != 0;
    return rights | (executable ? RT_UC_PROT_EXEC : 0);
}

/* @param smallest log2 of the smallest region that is looked at. */
static uint32_t mpu_rights(const rt1062_t *m, uint32_t address, uint32_t smallest) {
    if ((m->s.scs.mpu_ctrl & 1) == 0) {
        return RT_UC_PROT_ALL;
    }
    for (uint32_t i = RT_MPU_REGIONS; i-- > 0;) {
        const rt_mpu_region_t *region = &m->s.scs.mpu[i];
        if (region_size_log2(region) >= smallest && covers(region, address)) {
            return rights_of(region);
        }
    }
    return (m->s.scs.mpu_ctrl & 4) != 0 ? RT_UC_PROT_ALL : RT_UC_PROT_NONE;
}

static bool exists(const rt1062_t *m, uint32_t address) {
    if (address - RT_ITCM_BASE < RT_ITCM_SIZE) {
        return address - RT_ITCM_BASE < m->s.itcm_size;
    }
    return address - RT_DTCM_BASE >= RT_DTCM_SIZE || address - RT_DTCM_BASE < m->s.dtcm_size;
}

static uint32_t page_rights(const rt1062_t *m, uint32_t address) {
    if (!exists(m, address)) {
        return RT_UC_PROT_NONE;
    }
    if (address - RT_FLASH_BASE < RT_FLASH_SIZE && rt_nor_busy(m)) {
        return RT_UC_PROT_NONE;
    }
    const uint32_t rights = mpu_rights(m, address, SMALLEST_PAGED + 1);
    /* The flash controller takes no plain writes. */
    return address - RT_FLASH_BASE < RT_FLASH_SIZE ? rights & ~(uint32_t)RT_UC_PROT_WRITE : rights;
}

bool rt_may_write(const rt1062_t *m, uint32_t address) {
    return (page_rights(m, address) & RT_UC_PROT_WRITE) != 0 && (mpu_rights(m, address, 0) & RT_UC_PROT_WRITE) != 0;
}

static void protect_memory(rt1062_t *m, const memory_t *memory) {
    uint32_t begin = memory->base;
    const uint32_t end = memory->base + memory->size;
    while (begin < end) {
        const uint32_t rights = page_rights(m, begin);
        uint32_t next = begin + PAGE;
        while (next < end && page_rights(m, next) == rights) {
            next += PAGE;
        }
        m->api.protect(m->engine, begin, next - begin, rights);
        begin = next;
    }
}

/* An access to a region smaller than a page. */
static void on_guarded(rt_uc_engine_t *engine, int type, uint64_t address, int size, int64_t value, void *user) {
    (void)engine;
    (void)value;
    rt1062_t *m = user;
    rt_leave_it_block(m);
    const bool write = type == RT_UC_MEM_WRITE;
    if ((mpu_rights(m, (uint32_t)address, 0) & (write ? RT_UC_PROT_WRITE : RT_UC_PROT_READ)) != 0) {
        return;
    }
    m->access_pc = rt_reg(m, RT_REG_PC);
    rt_fault(m, RT_MEM_FAULT, (uint32_t)address, "%s of %d bytes at 0x%08X, which the memory protection unit forbids",
             write ? "write" : "read", size, (unsigned)address);
}

static void guard_small_regions(rt1062_t *m) {
    while (m->guard_count > 0) {
        m->api.hook_delete(m->engine, m->guards[--m->guard_count]);
    }
    const bool wanted = m->config.strict && (m->s.scs.mpu_ctrl & 1) != 0;
    for (uint32_t i = 0; wanted && i < RT_MPU_REGIONS; i++) {
        const rt_mpu_region_t *region = &m->s.scs.mpu[i];
        const uint32_t bits = region_size_log2(region);
        if ((region->attributes & 1) == 0 || bits > SMALLEST_PAGED) {
            continue;
        }
        m->api.hook_add(m->engine, &m->guards[m->guard_count++], RT_UC_HOOK_MEM_READ | RT_UC_HOOK_MEM_WRITE,
                        (rt_callback_t)on_guarded, m, (uint64_t)region->base,
                        (uint64_t)region->base + (1u << bits) - 1);
    }
}

void rt_protection_changed(rt1062_t *m) {
    m->protection_dirty = true;
    rt_look_up(m);
}

void rt_flash_protection_changed(rt1062_t *m) {
    m->flash_dirty = true;
    rt_look_up(m);
}

void rt_protection_apply(rt1062_t *m) {
    if (m->flash_dirty) {
        m->flash_dirty = false;
        protect_memory(m, &memories[sizeof memories / sizeof memories[0] - 1]);
    }
    if (!m->protection_dirty) {
        return;
    }
    m->protection_dirty = false;
    for (uint32_t i = 0; i < sizeof memories / sizeof memories[0]; i++) {
        protect_memory(m, &memories[i]);
    }
    guard_small_regions(m);
}

void rt_flexram_configured(rt1062_t *m, uint32_t banks) {
    enum { BANK = 32 * 1024, DTCM = 2, ITCM = 3 };
    m->s.itcm_size = 0;
    m->s.dtcm_size = 0;
    for (uint32_t i = 0; i < 16; i++) {
        const uint32_t use = banks >> (2 * i) & 3;
        m->s.itcm_size += use == ITCM ? BANK : 0;
        m->s.dtcm_size += use == DTCM ? BANK : 0;
    }
    rt_protection_changed(m);
}

uint8_t *rt_memory(rt1062_t *m, uint32_t address, uint32_t size) {
    uint8_t *const bytes[] = {m->itcm, m->dtcm, m->ocram, m->flash};
    for (uint32_t i = 0; i < sizeof memories / sizeof memories[0]; i++) {
        const uint32_t offset = address - memories[i].base;
        if (offset < memories[i].size && size <= memories[i].size - offset) {
            return bytes[i] + offset;
        }
    }
    return NULL;
}
