/* SPDX-License-Identifier: MIT */
#include "pit.h"

#include "clocks.h"
#include "devices.h"
#include "handlers.h"
#include "machine.h"

enum {
    MCR = 0x000,
    FIRST_CHANNEL = 0x100,
    CHANNEL_SIZE = 0x10,
    LDVAL = 0x0,
    CVAL = 0x4,
    TCTRL = 0x8,
    TFLG = 0xC,
    MCR_FRZ = 1 << 0, /* stops in debug mode, which there is none of */
    MCR_MDIS = 1 << 1,
    TCTRL_TEN = 1 << 0,
    TCTRL_TIE = 1 << 1,
    IRQ_PIT = 122 /* [core] imxrt.h */
};

static void update_line(rt1062_t *m) {
    bool any = false;
    for (uint32_t i = 0; i < RT_PIT_CHANNELS; i++) {
        const rt_pit_channel_t *channel = &m->s.pit.channel[i];
        any = any || (channel->flag && (channel->control & TCTRL_TIE) != 0);
    }
    rt_irq_set(m, IRQ_PIT, any);
}

/* End of the period under way. */
static uint64_t expires_ns(const rt1062_t *m, const rt_pit_channel_t *channel) {
    const uint32_t clock_Hz = rt_clock_hz(m, RT_ROOT_PERCLK);
    if (clock_Hz == 0) {
        return RT_NEVER;
    }
    const uint64_t counts = channel->counts * channel->periods;
    return channel->begin_ns + counts / clock_Hz * 1000000000u + counts % clock_Hz * 1000000000u / clock_Hz;
}

static void schedule(rt1062_t *m, uint32_t number) {
    const rt_pit_channel_t *channel = &m->s.pit.channel[number];
    const bool runs = (channel->control & TCTRL_TEN) != 0 && (m->s.pit.control & MCR_MDIS) == 0;
    rt_schedule(m, (rt_event_t)(RT_EVENT_PIT0 + number), runs ? expires_ns(m, channel) : RT_NEVER);
}

static void begin(rt_pit_channel_t *channel, uint64_t at_ns) {
    channel->counts = (uint64_t)channel->load + 1;
    channel->begin_ns = at_ns;
    channel->periods = 1;
}

static void expired(rt1062_t *m, uint32_t number) {
    rt_pit_channel_t *channel = &m->s.pit.channel[number];
    channel->flag = true;
    if (channel->counts == (uint64_t)channel->load + 1) {
        channel->periods++;
    } else {
        begin(channel, expires_ns(m, channel));
    }
    schedule(m, number);
    update_line(m);
}

void rt_pit0_event(rt1062_t *m) {
    expired(m, 0);
}

void rt_pit1_event(rt1062_t *m) {
    expired(m, 1);
}

void rt_pit2_event(rt1062_t *m) {
    expired(m, 2);
}

void rt_pit3_event(rt1062_t *m) {
    expired(m, 3);
}

/* ------------------------------------------------------------------ registers */

static bool clocked(rt1062_t *m) {
    return rt_clock_needed(m, RT_CLOCK_PIT, "PIT");
}

static uint32_t counts_left(const rt1062_t *m, const rt_pit_channel_t *channel) {
    if ((m->s.pit.control & MCR_MDIS) != 0) {
        return (uint32_t)channel->counts; /* its clock stands */
    }
    const uint64_t left_ns = expires_ns(m, channel) - rt_now(m);
    return (uint32_t)(left_ns * rt_clock_hz(m, RT_ROOT_PERCLK) / 1000000000u);
}

static bool read_channel(const rt1062_t *m, const rt_pit_channel_t *channel, uint32_t offset, uint32_t *value) {
    switch (offset) {
    case LDVAL:
        *value = channel->load;
        return true;
    case CVAL:
        if ((channel->control & TCTRL_TEN) == 0) {
            return false; /* RM: not reliable while the timer is off */
        }
        *value = counts_left(m, channel);
        return true;
    case TCTRL:
        *value = channel->control;
        return true;
    default:
        *value = channel->flag;
        return true;
    }
}

static bool read(rt1062_t *m, uint32_t offset, uint32_t size, uint32_t *value) {
    *value = 0;
    const uint32_t at = offset - FIRST_CHANNEL;
    if (size != 4 || at >= RT_PIT_CHANNELS * CHANNEL_SIZE) {
        return false;
    }
    return !clocked(m) || read_channel(m, &m->s.pit.channel[at / CHANNEL_SIZE], at % CHANNEL_SIZE, value);
}

static bool write_module_control(rt1062_t *m, uint32_t value) {
    if ((value & ~(uint32_t)(MCR_FRZ | MCR_MDIS)) != 0) {
        return false;
    }
    const bool stops = (value & ~m->s.pit.control & MCR_MDIS) != 0;
    const bool goes_on = (m->s.pit.control & ~value & MCR_MDIS) != 0;
    for (uint32_t i = 0; i < RT_PIT_CHANNELS; i++) {
        rt_pit_channel_t *channel = &m->s.pit.channel[i];
        if ((channel->control & TCTRL_TEN) != 0 && (stops || goes_on)) {
            channel->counts = stops ? counts_left(m, channel) : channel->counts;
            channel->begin_ns = rt_now(m);
            channel->periods = 1;
        }
    }
    m->s.pit.control = value;
    for (uint32_t i = 0; i < RT_PIT_CHANNELS && (stops || goes_on); i++) {
        schedule(m, i);
    }
    return true;
}

static bool write_channel(rt1062_t *m, uint32_t number, uint32_t offset, uint32_t value) {
    rt_pit_channel_t *channel = &m->s.pit.channel[number];
    const uint32_t before = channel->control;
    switch (offset) {
    case LDVAL:
        channel->load = value;
        return true;
    case TCTRL:
        if ((value & ~(uint32_t)(TCTRL_TEN | TCTRL_TIE)) != 0) {
            return false; /* chained: not modelled */
        }
        channel->control = value;
        if ((value & ~before & TCTRL_TEN) != 0) {
            begin(channel, rt_now(m));
        }
        schedule(m, number);
        break;
    case TFLG:
        channel->flag = channel->flag && (value & 1) == 0;
        break;
    default:
        return false; /* CVAL is read-only */
    }
    update_line(m);
    return true;
}

static bool write(rt1062_t *m, uint32_t offset, uint32_t size, uint32_t value) {
    const uint32_t at = offset - FIRST_CHANNEL;
    if (size != 4 || (offset != MCR && at >= RT_PIT_CHANNELS * CHANNEL_SIZE)) {
        return false;
    }
    if (!clocked(m)) {
        return true;
    }
    return offset == MCR ? write_module_control(m, value)
                         : write_channel(m, at / CHANNEL_SIZE, at % CHANNEL_SIZE, value);
}

static void reset(rt1062_t *m) {
    m->s.pit = (rt_pit_t){.control = MCR_MDIS};
    update_line(m);
}

const rt_device_t rt_pit = {"PIT", 0x40084000, 0x4000, read, write, reset};
