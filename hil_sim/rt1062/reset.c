/* SPDX-License-Identifier: MIT */
/* Resets, and what the boot ROM does after one. */
#include <string.h>

#include "machine.h"

enum { IVT_OFFSET = 0x1000, IVT_TAG = 0xD1 };

void rt_reset_request(rt1062_t *m, uint32_t flags) {
    m->s.reset_wanted |= flags;
    rt_look_up(m);
}

static uint32_t flash_word(const rt1062_t *m, uint32_t offset) {
    uint32_t value;
    memcpy(&value, m->flash + offset, sizeof value);
    return value;
}

static void boot(rt1062_t *m) {
    if ((flash_word(m, IVT_OFFSET) & 0xFF) != IVT_TAG) {
        rt_refuse(m, "the boot ROM finds no image vector table at 0x60001000: this is no Teensy 4.0 image");
        return;
    }
    rt_cpu_reset(m, 0x2001FFF0u, flash_word(m, IVT_OFFSET + 4));
}

void rt_reset_now(rt1062_t *m, uint32_t flags) {
    m->s.reset_flags = flags;
    m->s.reset_wanted = 0;
    for (uint32_t i = 0; i < RT_EVENT_COUNT; i++) {
        m->s.deadline_ns[i] = RT_NEVER;
    }
    m->s.itcm_size = 128 * 1024;
    m->s.dtcm_size = 128 * 1024;
    for (uint32_t i = 0; rt_devices[i] != NULL; i++) {
        if (rt_devices[i]->reset != NULL) {
            rt_devices[i]->reset(m);
        }
    }
    boot(m);
}
