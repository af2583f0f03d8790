/* SPDX-License-Identifier: MIT */
/* Deadlines of the peripherals, and what time it is. */
#include "machine.h"

#include "handlers.h"

const rt_event_handler_t rt_event_handlers[RT_EVENT_COUNT] = {
    [RT_EVENT_SYSTICK] = rt_systick_event,
    [RT_EVENT_FLASH] = rt_nor_event,
    [RT_EVENT_WATCHDOG] = rt_watchdog_event,
    [RT_EVENT_PIT0] = rt_pit0_event,
    [RT_EVENT_PIT1] = rt_pit1_event,
    [RT_EVENT_PIT2] = rt_pit2_event,
    [RT_EVENT_PIT3] = rt_pit3_event,
    [RT_EVENT_I2C] = rt_i2c_event,
    [RT_EVENT_CIRCUIT] = rt_circuit_event,
    [RT_EVENT_ENCODER] = rt_encoder_event,
    [RT_EVENT_NOISE] = rt_noise_event,
    [RT_EVENT_UART_SEND] = rt_uart_send_event,
    [RT_EVENT_UART_RECEIVE] = rt_uart_receive_event,
    [RT_EVENT_USB] = rt_usb_event,
};

uint64_t rt_now(const rt1062_t *m) {
    return m->s.now_ns + (uint64_t)(m->slice_ns - m->budget_ns);
}

void rt_schedule(rt1062_t *m, rt_event_t event, uint64_t at_ns) {
    m->s.deadline_ns[event] = at_ns;
    if (at_ns < m->look_up_ns) {
        rt_look_up(m);
    }
}

uint64_t rt_next_event(const rt1062_t *m) {
    uint64_t next = RT_NEVER;
    for (uint32_t i = 0; i < RT_EVENT_COUNT; i++) {
        next = m->s.deadline_ns[i] < next ? m->s.deadline_ns[i] : next;
    }
    return next;
}

/* In the order of their deadlines, so that what one does can't depend on how the table is sorted. */
void rt_events_run(rt1062_t *m) {
    for (;;) {
        uint32_t first = 0;
        for (uint32_t i = 1; i < RT_EVENT_COUNT; i++) {
            first = m->s.deadline_ns[i] < m->s.deadline_ns[first] ? i : first;
        }
        if (m->s.deadline_ns[first] > rt_now(m)) {
            return;
        }
        m->s.deadline_ns[first] = RT_NEVER;
        rt_event_handlers[first](m);
    }
}
