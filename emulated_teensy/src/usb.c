/* SPDX-License-Identifier: MIT */
/* USB1: the controller's registers, timers and interrupt [RM, chapter USB], and its transceiver [RM, chapter USB-PHY].
 */
#include "usb.h"

#include "clocks.h"
#include "devices.h"
#include "handlers.h"
#include "machine.h"

enum {
    BASE = 0x402E0000,
    SIZE = 0x200, /* USB2 begins there */
    IRQ_USB1 = 113,
    GPTIMER0LD = 0x80,
    GPTIMER0CTRL = 0x84,
    GPTIMER1LD = 0x88,
    GPTIMER1CTRL = 0x8C,
    USBCMD = 0x140,
    USBSTS = 0x144,
    USBINTR = 0x148,
    DEVICEADDR = 0x154,
    ENDPOINTLISTADDR = 0x158,
    BURSTSIZE = 0x160,
    PORTSC1 = 0x184,
    USBMODE = 0x1A8,
    ENDPTSETUPSTAT = 0x1AC,
    ENDPTPRIME = 0x1B0,
    ENDPTFLUSH = 0x1B4,
    ENDPTSTAT = 0x1B8,
    ENDPTCOMPLETE = 0x1BC,
    ENDPTCTRL0 = 0x1C0,
    ENDPTCTRL7 = 0x1DC,
    PRIME_NS = 200, /* a queue head and a descriptor read from memory */
    US = 1000
};

#define USBCMD_RESET 0x00080000u
#define USBCMD_RS (1u << 0)
#define USBCMD_RST (1u << 1)
#define USBCMD_ITC (0xFFu << 16)
#define USBCMD_MODELLED (USBCMD_RS | USBCMD_RST | RT_USB_TRIPWIRE_SETUP | RT_USB_TRIPWIRE_DESCRIPTOR | USBCMD_ITC)

#define USBSTS_TI0 (1u << 24)
#define USBSTS_TI1 (1u << 25)
#define USBSTS_CLEARED_BY_ONE                                                                                          \
    (RT_USB_UI | RT_USB_PCI | RT_USB_SEI | RT_USB_URI | RT_USB_SRI | RT_USB_SLI | USBSTS_TI0 | USBSTS_TI1)
#define USBINTR_UEE (1u << 1)
#define USBINTR_MODELLED (USBSTS_CLEARED_BY_ONE | USBINTR_UEE)

#define USBMODE_RESET 0x00005000u
#define USBMODE_CM 3u
#define USBMODE_DEVICE 2u
#define USBMODE_SLOM (1u << 3)
#define USBMODE_SDIS (1u << 4)

#define PORTSC1_PTW (1u << 28)
#define PORTSC1_PSPD_SHIFT 26
#define PORTSC1_HSP (1u << 9)
#define PORTSC1_PR (1u << 8)
#define PORTSC1_SUSP (1u << 7)
#define PORTSC1_PE (1u << 2)
#define PORTSC1_CCS (1u << 0)

#define ENDPTCTRL_TXE (1u << 23)
#define ENDPTCTRL_TXR (1u << 22)
#define ENDPTCTRL_RXE (1u << 7)
#define ENDPTCTRL_RXR (1u << 6)
#define ENDPTCTRL_MODELLED 0x00CF00CFu /* TXI and RXI, for tests of the chip, are left out */

#define GPTIMER_RUN (1u << 31)
#define GPTIMER_RST (1u << 30)
#define GPTIMER_MODE (1u << 24)
#define GPTIMER_MASK 0x00FFFFFFu

#define BOTH_DIRECTIONS 0x00FF00FFu

static const uint64_t SUSPEND_NS = 3000000;
static const uint64_t MICROFRAME_NS = 125000;
static const uint64_t FRAME_NS = 1000000;

/* ---- deadlines and interrupt */

static void reschedule(rt1062_t *m) {
    uint64_t first = RT_NEVER;
    for (uint32_t i = 0; i < RT_USB_DUE_COUNT; i++) {
        first = m->s.usb.due_ns[i] < first ? m->s.usb.due_ns[i] : first;
    }
    rt_schedule(m, RT_EVENT_USB, first);
}

void rt_usb_at(rt1062_t *m, rt_usb_due_t due, uint64_t at_ns) {
    m->s.usb.due_ns[due] = at_ns;
    reschedule(m);
}

static void update_irq(rt1062_t *m) {
    rt_irq_set(m, IRQ_USB1, (m->s.usb.usbsts & m->s.usb.usbintr) != 0);
}

void rt_usb_raise(rt1062_t *m, uint32_t status) {
    m->s.usb.usbsts |= status;
    update_irq(m);
}

/* ---- frames: SRI is only looked at where somebody asks */

static uint64_t frame_length_ns(const rt_usb_t *u) {
    return u->high_speed ? MICROFRAME_NS : FRAME_NS;
}

static void note_frames(rt1062_t *m) {
    rt_usb_t *u = &m->s.usb;
    const uint64_t length = frame_length_ns(u);
    if (u->frames && (rt_now(m) - u->frames_ns) / length != (u->frame_seen_ns - u->frames_ns) / length) {
        u->usbsts |= RT_USB_SRI;
        u->frame_seen_ns = rt_now(m);
    }
}

static void plan_frame(rt1062_t *m) {
    rt_usb_t *u = &m->s.usb;
    uint64_t next = RT_NEVER;
    if (u->frames && (u->usbintr & RT_USB_SRI) != 0) {
        const uint64_t length = frame_length_ns(u);
        next = rt_now(m) + length - (rt_now(m) - u->frames_ns) % length;
    }
    rt_usb_at(m, RT_USB_DUE_FRAME, next);
}

/* ---- the bus */

bool rt_usb_attached(const rt1062_t *m) {
    const rt_usb_t *u = &m->s.usb;
    return (u->usbcmd & USBCMD_RS) != 0 && (u->usbmode & USBMODE_CM) == USBMODE_DEVICE && rt_usb_phy_awake(m);
}

void rt_usb_bus_silent(rt1062_t *m) {
    m->s.usb.frames = false;
    plan_frame(m);
    rt_usb_at(m, RT_USB_DUE_SUSPEND, rt_usb_attached(m) ? rt_now(m) + SUSPEND_NS : RT_NEVER);
}

static void suspend(rt1062_t *m) {
    rt_usb_t *u = &m->s.usb;
    if (rt_usb_attached(m) && !u->frames && !u->in_reset) {
        u->suspended = true;
        rt_usb_raise(m, RT_USB_SLI);
    }
}

void rt_usb_bus_reset(rt1062_t *m, bool on) {
    rt_usb_t *u = &m->s.usb;
    u->in_reset = on;
    u->suspended = false;
    rt_usb_at(m, RT_USB_DUE_SUSPEND, RT_NEVER);
    u->enabled = !on;
    u->frames = !on;
    if (on) {
        u->address = u->address_in_force = 0;
        u->toggle = 0;
        rt_usb_raise(m, RT_USB_URI);
    } else {
        u->high_speed = !u->host.full_speed;
        u->frames_ns = u->frame_seen_ns = rt_now(m);
        rt_usb_raise(m, RT_USB_PCI);
    }
    plan_frame(m);
}

/* The pull-up may have come or gone. */
void rt_usb_attachment_changed(rt1062_t *m, bool before) {
    rt_usb_t *u = &m->s.usb;
    if (before && !rt_usb_attached(m)) {
        u->enabled = u->in_reset = u->suspended = u->high_speed = false;
        rt_usb_bus_silent(m);
        rt_usb_host_lost(m);
    } else if (!before && rt_usb_attached(m)) {
        rt_usb_bus_silent(m);
        rt_usb_host_look(m);
    }
}

/* ---- timers, in microseconds */

static void timer_event(rt1062_t *m, uint32_t number) {
    rt_usb_timer_t *t = &m->s.usb.timer[number];
    t->running = t->repeats;
    t->left_ns = 0;
    if (t->repeats) {
        t->end_ns += ((uint64_t)t->load + 1) * US;
        rt_usb_at(m, RT_USB_DUE_TIMER0 + number, t->end_ns);
    }
    rt_usb_raise(m, USBSTS_TI0 << number);
}

static uint64_t timer_left_ns(const rt1062_t *m, const rt_usb_timer_t *t) {
    if (!t->running) {
        return t->left_ns;
    }
    return t->end_ns > rt_now(m) ? t->end_ns - rt_now(m) : 0;
}

static uint32_t timer_value(const rt1062_t *m, const rt_usb_timer_t *t) {
    return (t->running ? GPTIMER_RUN : 0) | (t->repeats ? GPTIMER_MODE : 0) | (uint32_t)(timer_left_ns(m, t) / US);
}

static void timer_control(rt1062_t *m, uint32_t number, uint32_t value) {
    rt_usb_timer_t *t = &m->s.usb.timer[number];
    t->left_ns = (value & GPTIMER_RST) != 0 ? ((uint64_t)t->load + 1) * US : timer_left_ns(m, t);
    t->repeats = (value & GPTIMER_MODE) != 0;
    t->running = (value & GPTIMER_RUN) != 0 && (t->left_ns > 0 || t->repeats);
    t->end_ns = rt_now(m) + t->left_ns;
    rt_usb_at(m, RT_USB_DUE_TIMER0 + number, t->running ? t->end_ns : RT_NEVER);
}

void rt_usb_event(rt1062_t *m) {
    rt_usb_t *u = &m->s.usb;
    for (uint32_t i = 0; i < RT_USB_DUE_COUNT; i++) {
        const uint64_t at_ns = u->due_ns[i];
        if (at_ns > rt_now(m)) {
            continue;
        }
        u->due_ns[i] = RT_NEVER;
        switch ((rt_usb_due_t)i) {
        case RT_USB_DUE_PRIME:
            rt_usb_fetch_primed(m);
            break;
        case RT_USB_DUE_HOST:
            rt_usb_host_step(m, at_ns);
            break;
        case RT_USB_DUE_FRAME:
            note_frames(m);
            update_irq(m);
            plan_frame(m);
            break;
        case RT_USB_DUE_SUSPEND:
            suspend(m);
            break;
        case RT_USB_DUE_TIMER0:
            timer_event(m, 0);
            break;
        case RT_USB_DUE_TIMER1:
            timer_event(m, 1);
            break;
        case RT_USB_DUE_COUNT:
            break;
        }
    }
    reschedule(m);
}

/* ---- registers */

static uint32_t port_value(const rt1062_t *m) {
    const rt_usb_t *u = &m->s.usb;
    const uint32_t speed = u->high_speed ? 2u << PORTSC1_PSPD_SHIFT | PORTSC1_HSP : 0;
    return PORTSC1_PTW | PORTSC1_PE | speed | (u->in_reset ? PORTSC1_PR : 0) | (u->suspended ? PORTSC1_SUSP : 0) |
           (rt_usb_attached(m) ? PORTSC1_CCS : 0);
}

static bool usb_read(rt1062_t *m, uint32_t offset, uint32_t size, uint32_t *value) {
    const rt_usb_t *u = &m->s.usb;
    if (size != 4) {
        return false;
    }
    rt_clock_needed(m, RT_CLOCK_USBOH3, "USB1");
    if (offset >= ENDPTCTRL0 && offset <= ENDPTCTRL7) {
        *value = u->endpoint[(offset - ENDPTCTRL0) / 4];
        return true;
    }
    switch (offset) {
    case GPTIMER0LD:
        *value = u->timer[0].load;
        return true;
    case GPTIMER0CTRL:
        *value = timer_value(m, &u->timer[0]);
        return true;
    case GPTIMER1LD:
        *value = u->timer[1].load;
        return true;
    case GPTIMER1CTRL:
        *value = timer_value(m, &u->timer[1]);
        return true;
    case USBCMD:
        *value = u->usbcmd;
        return true;
    case USBSTS:
        note_frames(m);
        *value = u->usbsts;
        return true;
    case USBINTR:
        *value = u->usbintr;
        return true;
    case DEVICEADDR:
        *value = u->address;
        return true;
    case ENDPOINTLISTADDR:
        *value = u->list;
        return true;
    case BURSTSIZE:
        *value = u->burst;
        return true;
    case PORTSC1:
        *value = port_value(m);
        return true;
    case USBMODE:
        *value = u->usbmode;
        return true;
    case ENDPTSETUPSTAT:
        *value = u->setup_stat;
        return true;
    case ENDPTPRIME:
        *value = u->prime;
        return true;
    case ENDPTFLUSH:
        *value = 0;
        return true;
    case ENDPTSTAT:
        *value = u->ready;
        return true;
    case ENDPTCOMPLETE:
        *value = u->complete;
        return true;
    default:
        return false;
    }
}

static void controller_reset(rt1062_t *m) {
    rt_usb_t *u = &m->s.usb;
    u->usbcmd = USBCMD_RESET;
    u->usbmode = USBMODE_RESET;
    u->burst = 0x0808;
    u->usbsts = u->usbintr = u->address = u->address_in_force = u->list = 0;
    u->setup_stat = u->prime = u->ready = u->complete = u->toggle = 0;
    for (uint32_t i = 0; i < RT_USB_ENDPOINTS; i++) {
        u->endpoint[i] = i == 0 ? ENDPTCTRL_TXE | ENDPTCTRL_RXE : 0;
    }
    for (uint32_t i = 0; i < RT_USB_TIMERS; i++) {
        u->timer[i] = (rt_usb_timer_t){0};
        u->due_ns[RT_USB_DUE_TIMER0 + i] = RT_NEVER;
    }
    u->due_ns[RT_USB_DUE_PRIME] = u->due_ns[RT_USB_DUE_FRAME] = RT_NEVER;
    reschedule(m);
}

static void write_command(rt1062_t *m, uint32_t value) {
    rt_usb_t *u = &m->s.usb;
    const bool before = rt_usb_attached(m);
    if ((value & ~USBCMD_MODELLED) != 0 || ((value & USBCMD_RS) != 0 && (value & USBCMD_ITC) != 0)) {
        rt_refuse(m, "USBCMD = 0x%08X: only RS, RST, SUTW, ATDTW and an interrupt threshold of 0 are modelled",
                  (unsigned)value);
    } else if ((value & USBCMD_RST) != 0) {
        controller_reset(m);
    } else {
        u->usbcmd = value;
    }
    rt_usb_attachment_changed(m, before);
}

/* The mode can be set once after a reset of the controller. */
static void write_mode(rt1062_t *m, uint32_t value) {
    rt_usb_t *u = &m->s.usb;
    const bool before = rt_usb_attached(m);
    const uint32_t mode = (u->usbmode & USBMODE_CM) != 0 ? u->usbmode & USBMODE_CM : value & USBMODE_CM;
    if ((value & ~(USBMODE_CM | USBMODE_SLOM | USBMODE_SDIS)) != 0 || (value & USBMODE_CM) == USBMODE_CM) {
        rt_refuse(m, "USBMODE = 0x%08X: only the mode, SLOM and SDIS are modelled, and no host", (unsigned)value);
        return;
    }
    u->usbmode = USBMODE_RESET | mode | (value & (USBMODE_SLOM | USBMODE_SDIS));
    rt_usb_attachment_changed(m, before);
}

static void write_endpoint(rt1062_t *m, uint32_t number, uint32_t value) {
    rt_usb_t *u = &m->s.usb;
    if ((value & ~ENDPTCTRL_MODELLED) != 0) {
        rt_refuse(m, "ENDPTCTRL%u = 0x%08X: these bits are not modelled", (unsigned)number, (unsigned)value);
        return;
    }
    u->toggle &= ~((value & ENDPTCTRL_RXR) != 0 ? 1u << number : 0);
    u->toggle &= ~((value & ENDPTCTRL_TXR) != 0 ? 1u << (number + 16) : 0);
    u->endpoint[number] =
        (value & ~(ENDPTCTRL_RXR | ENDPTCTRL_TXR)) | (number == 0 ? ENDPTCTRL_TXE | ENDPTCTRL_RXE : 0);
    rt_usb_host_look(m);
}

static void write_device_address(rt_usb_t *u, uint32_t value) {
    u->address = value & 0xFF000000u;
    if ((value & RT_USB_ADDRESS_STAGED) == 0) {
        u->address_in_force = value >> 25;
    }
}

static bool write_endpoint_bits(rt1062_t *m, uint32_t offset, uint32_t value) {
    rt_usb_t *u = &m->s.usb;
    switch (offset) {
    case ENDPTSETUPSTAT:
        u->setup_stat &= ~value;
        rt_usb_host_look(m);
        return true;
    case ENDPTPRIME:
        u->prime |= value & BOTH_DIRECTIONS;
        rt_usb_at(m, RT_USB_DUE_PRIME, rt_now(m) + PRIME_NS);
        return true;
    case ENDPTFLUSH:
        u->prime &= ~value;
        u->ready &= ~value;
        return true;
    case ENDPTCOMPLETE:
        u->complete &= ~value;
        return true;
    default:
        return false;
    }
}

static bool usb_write(rt1062_t *m, uint32_t offset, uint32_t size, uint32_t value) {
    rt_usb_t *u = &m->s.usb;
    if (size != 4) {
        return false;
    }
    rt_clock_needed(m, RT_CLOCK_USBOH3, "USB1");
    if (offset >= ENDPTCTRL0 && offset <= ENDPTCTRL7) {
        write_endpoint(m, (offset - ENDPTCTRL0) / 4, value);
        return true;
    }
    switch (offset) {
    case GPTIMER0LD:
        u->timer[0].load = value & GPTIMER_MASK;
        return true;
    case GPTIMER0CTRL:
        timer_control(m, 0, value);
        return true;
    case GPTIMER1LD:
        u->timer[1].load = value & GPTIMER_MASK;
        return true;
    case GPTIMER1CTRL:
        timer_control(m, 1, value);
        return true;
    case USBCMD:
        write_command(m, value);
        return true;
    case USBSTS:
        note_frames(m);
        u->usbsts &= ~(value & USBSTS_CLEARED_BY_ONE);
        update_irq(m);
        return true;
    case USBINTR:
        if ((value & ~USBINTR_MODELLED) != 0) {
            return false;
        }
        u->usbintr = value;
        update_irq(m);
        plan_frame(m);
        return true;
    case DEVICEADDR:
        write_device_address(u, value);
        return true;
    case ENDPOINTLISTADDR:
        u->list = value & ~0x7FFu;
        return true;
    case BURSTSIZE:
        u->burst = value & 0x0001FFFFu;
        return true;
    case USBMODE:
        write_mode(m, value);
        return true;
    default:
        return write_endpoint_bits(m, offset, value);
    }
}

/* The host, and whether the cable is in, are outside of the chip. */
static void usb_reset(rt1062_t *m) {
    const bool before = rt_usb_attached(m);
    if ((m->s.reset_flags & RT_RESET_POWER) != 0) {
        for (uint32_t i = 0; i < RT_USB_DUE_COUNT; i++) {
            m->s.usb.due_ns[i] = RT_NEVER;
        }
    }
    controller_reset(m);
    update_irq(m);
    rt_usb_attachment_changed(m, before);
}

const rt_device_t rt_usb = {
    .name = "USB1", .base = BASE, .size = SIZE, .read = usb_read, .write = usb_write, .reset = usb_reset};
