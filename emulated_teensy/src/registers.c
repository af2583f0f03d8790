/* SPDX-License-Identifier: MIT */
#include "registers.h"

int32_t rt_register_find(const rt_register_t *table, uint32_t count, uint32_t offset) {
    for (uint32_t i = 0; i < count; i++) {
        if (table[i].offset == offset) {
            return (int32_t)i;
        }
    }
    return -1;
}

void rt_registers_reset(const rt_register_t *table, uint32_t count, uint32_t *values) {
    for (uint32_t i = 0; i < count; i++) {
        values[i] = table[i].reset;
    }
}

void rt_register_write(rt1062_t *m, const rt_register_t *entry, uint32_t *kept, uint32_t value) {
    const uint32_t reserved = ~(entry->writable | entry->fixed);
    const uint32_t set = value & ~*kept & reserved;
    if (set != 0) {
        rt_refuse(m, "%s: 0x%08X sets bits 0x%08X, which the model does not know", entry->name, (unsigned)value,
                  (unsigned)set);
        return;
    }
    *kept = (*kept & ~entry->writable) | (value & entry->writable);
}
