/* SPDX-License-Identifier: MIT */
/* What the processor or the model objects to. */
#include <stdarg.h>
#include <stdio.h>
#include <string.h>

#include "machine.h"

static rt1062_finding_t *same_finding(rt1062_t *m, uint32_t kind, uint32_t pc) {
    for (uint32_t i = 0; i < m->s.finding_count; i++) {
        if (m->s.finding[i].kind == kind && m->s.finding[i].pc == pc) {
            return &m->s.finding[i];
        }
    }
    return NULL;
}

static void note(rt1062_t *m, uint32_t kind, uint32_t pc, uint32_t address, const char *text) {
    rt1062_finding_t *found = same_finding(m, kind, pc);
    if (found != NULL) {
        found->count++;
        return;
    }
    if (m->s.finding_count == RT1062_FINDINGS) {
        return; /* the first ones tell the story */
    }
    found = &m->s.finding[m->s.finding_count++];
    *found = (rt1062_finding_t){.kind = kind, .pc = pc, .address = address, .count = 1, .time_ns = rt_now(m)};
    snprintf(found->text, sizeof found->text, "%s", text);
}

void rt_refuse(rt1062_t *m, const char *format, ...) {
    if (m->stop == RT1062_STOP_REFUSED) {
        return; /* the first reason counts */
    }
    va_list arguments;
    va_start(arguments, format);
    /* NOLINTNEXTLINE(clang-analyzer-valist.Uninitialized): it is, in the line before */
    vsnprintf(m->why, sizeof m->why, format, arguments);
    va_end(arguments);
    rt_stop(m, RT1062_STOP_REFUSED);
}

void rt_fault(rt1062_t *m, uint32_t exception, uint32_t address, const char *format, ...) {
    if (m->s.fault_exception != 0) {
        return; /* the chip would not have come here: the rest of the block is executed before a fault is taken */
    }
    char text[sizeof m->s.finding[0].text];
    va_list arguments;
    va_start(arguments, format);
    /* NOLINTNEXTLINE(clang-analyzer-valist.Uninitialized): it is, in the line before */
    vsnprintf(text, sizeof text, format, arguments);
    va_end(arguments);
    const bool width = exception == RT_USAGE_FAULT && address != 0;
    note(m, width ? RT1062_FINDING_DEVICE_WIDTH : RT1062_FINDING_FAULT, m->access_pc, address, text);
    m->s.fault_exception = exception;
    m->s.fault_pc = m->access_pc;
    rt_fault_status(m, exception, address);
    rt_look_up(m);
}

void rt_finding(rt1062_t *m, rt1062_finding_kind_t kind, const char *format, ...) {
    char text[sizeof m->s.finding[0].text];
    va_list arguments;
    va_start(arguments, format);
    /* NOLINTNEXTLINE(clang-analyzer-valist.Uninitialized): it is, in the line before */
    vsnprintf(text, sizeof text, format, arguments);
    va_end(arguments);
    note(m, (uint32_t)kind, m->access_pc, 0, text);
}
