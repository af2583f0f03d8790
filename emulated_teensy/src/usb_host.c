/* SPDX-License-Identifier: MIT */
/* The host at the other end of the USB cable, as far as a CDC serial port needs one. See [USB 2.0, chapters 7.1.7, 9;
 * CDC PSTN 1.2]. */
#include <string.h>

#include "links.h"
#include "machine.h"
#include "usb.h"

enum { ADDRESS = 1, TRIES = 3, DEFAULT_BAUD = 9600, CONTROL_FIRST = 64, IN_TOGGLES = 8 };

/* Descriptors and requests. */
enum {
    DESCRIPTOR_DEVICE = 1,
    DESCRIPTOR_CONFIGURATION = 2,
    DESCRIPTOR_INTERFACE = 4,
    DESCRIPTOR_ENDPOINT = 5,
    DEVICE_DESCRIPTOR_SIZE = 18,
    CONFIGURATION_HEAD = 9,
    CLASS_CDC = 2,
    CLASS_CDC_DATA = 10,
    TRANSFER_BULK = 2,
    FROM_DEVICE = 0x80,
    TO_INTERFACE = 0x21, /* class request */
    SET_ADDRESS = 5,
    GET_DESCRIPTOR = 6,
    SET_CONFIGURATION = 9,
    SET_LINE_CODING = 0x20,
    SET_CONTROL_LINE_STATE = 0x22,
    LINE_CODING_SIZE = 7,
    DTR_AND_RTS = 3
};

static const uint64_t MS = 1000000;
static const uint64_t DEBOUNCE_NS = 100000000; /* [USB 2.0, 7.1.7.3] */
static const uint64_t RESET_NS = 50000000;     /* root hubs: at least 50 ms [USB 2.0, 7.1.7.5] */
static const uint64_t RECOVERY_NS = 10000000;
static const uint64_t GAP_NS = 125000;          /* the host's program asks for its next transfer */
static const uint64_t RETRY_NS = 5000;          /* until a token that got NAK is sent again */
static const uint64_t PATIENCE_NS = 5000000000; /* [USB 2.0, 9.2.6.4] */
/* What a packet's bytes and what is around them (token, synchronisation, handshake, gaps) take [USB 2.0, 5.11.3]: 55
 * bytes' time. */
static const uint64_t AROUND_BYTES = 55;
static const uint64_t BITS_PER_us[] = {12, 480};

static uint64_t packet_ns(const rt1062_t *m, uint32_t bytes) {
    const uint64_t rate = BITS_PER_us[m->s.usb.high_speed ? 1 : 0];
    return (AROUND_BYTES + bytes) * 8 * 1000 / rate;
}

static void wait_ns(rt1062_t *m, uint64_t from_ns, uint64_t time_ns) {
    m->s.usb.host.work = RT_USB_GAP;
    rt_usb_at(m, RT_USB_DUE_HOST, from_ns + time_ns);
}

/* ---- control transfers */

static void ask(rt1062_t *m, uint8_t type, uint8_t request, uint16_t value, uint16_t index, uint16_t length) {
    rt_usb_control_t *c = &m->s.usb.host.control;
    const uint8_t setup[8] = {type,
                              request,
                              (uint8_t)value,
                              (uint8_t)(value >> 8),
                              (uint8_t)index,
                              (uint8_t)(index >> 8),
                              (uint8_t)length,
                              (uint8_t)(length >> 8)};
    memcpy(c->setup, setup, sizeof setup);
    c->stage = RT_USB_SETUP;
    c->length = (type & FROM_DEVICE) != 0 ? 0 : length;
    c->at = 0;
    c->give_up_ns = rt_now(m) + PATIENCE_NS;
}

static void get_descriptor(rt1062_t *m, uint8_t kind, uint16_t length) {
    ask(m, FROM_DEVICE, GET_DESCRIPTOR, (uint16_t)(kind << 8), 0, length);
}

static uint32_t wanted_length(const rt_usb_control_t *c) {
    return c->setup[6] | (uint32_t)c->setup[7] << 8;
}

static bool data_from_device(const rt_usb_control_t *c) {
    return (c->setup[0] & FROM_DEVICE) != 0;
}

/* The status stage goes the other way than the data; without data it comes from the device. */
static bool stage_is_in(const rt_usb_control_t *c) {
    return (c->stage == RT_USB_DATA) == data_from_device(c);
}

static void next_stage(rt_usb_control_t *c) {
    if (c->stage == RT_USB_SETUP) {
        c->stage = wanted_length(c) > 0 ? RT_USB_DATA : RT_USB_STATUS;
    } else {
        c->stage = c->stage == RT_USB_DATA ? RT_USB_STATUS : RT_USB_NO_TRANSFER;
    }
}

static rt_usb_answer_t data_in(rt1062_t *m) {
    rt_usb_host_t *h = &m->s.usb.host;
    rt_usb_control_t *c = &h->control;
    uint8_t packet[RT_USB_PACKET];
    uint32_t count = 0;
    bool toggle = false;
    const rt_usb_answer_t answer = rt_usb_in(m, h->address, 0, &toggle, packet, &count);
    if (answer != RT_USB_ACK) {
        return answer;
    }
    if (c->stage == RT_USB_STATUS) {
        next_stage(c);
        return answer;
    }
    const uint32_t room = wanted_length(c) - c->length;
    memcpy(c->data + c->length, packet, count < room ? count : room);
    c->length += count < room ? count : room;
    if (count < h->control_packet || c->length >= wanted_length(c)) {
        next_stage(c);
    }
    return answer;
}

static rt_usb_answer_t data_out(rt1062_t *m) {
    rt_usb_host_t *h = &m->s.usb.host;
    rt_usb_control_t *c = &h->control;
    const uint32_t left = c->stage == RT_USB_DATA ? c->length - c->at : 0;
    const uint32_t count = left < h->control_packet ? left : h->control_packet;
    const rt_usb_answer_t answer = rt_usb_out(m, h->address, 0, false, c->data + c->at, count);
    if (answer == RT_USB_ACK) {
        c->at += count;
        if (c->stage == RT_USB_STATUS || c->at >= c->length) {
            next_stage(c);
        }
    }
    return answer;
}

static rt_usb_answer_t control_packet(rt1062_t *m) {
    rt_usb_host_t *h = &m->s.usb.host;
    rt_usb_control_t *c = &h->control;
    if (c->stage != RT_USB_SETUP) {
        return stage_is_in(c) ? data_in(m) : data_out(m);
    }
    const rt_usb_answer_t answer = rt_usb_setup(m, h->address, c->setup);
    if (answer == RT_USB_ACK) {
        next_stage(c);
    }
    return answer;
}

/* ---- enumeration */

/* What to ask in the step that begins. */
static void ask_for_step(rt1062_t *m) {
    rt_usb_host_t *h = &m->s.usb.host;
    switch (h->step) {
    case RT_USB_HOST_DEVICE_8:
        get_descriptor(m, DESCRIPTOR_DEVICE, CONTROL_FIRST);
        break;
    case RT_USB_HOST_ADDRESS:
        ask(m, 0, SET_ADDRESS, ADDRESS, 0, 0);
        break;
    case RT_USB_HOST_DEVICE:
        get_descriptor(m, DESCRIPTOR_DEVICE, DEVICE_DESCRIPTOR_SIZE);
        break;
    case RT_USB_HOST_CONFIGURATION_9:
        get_descriptor(m, DESCRIPTOR_CONFIGURATION, CONFIGURATION_HEAD);
        break;
    case RT_USB_HOST_CONFIGURATION:
        get_descriptor(m, DESCRIPTOR_CONFIGURATION, (uint16_t)wanted_length(&h->control));
        break;
    case RT_USB_HOST_CONFIGURE:
        ask(m, 0, SET_CONFIGURATION, h->control.data[5], 0, 0);
        break;
    default:
        break;
    }
}

static void begin_reset(rt1062_t *m, uint64_t at_ns) {
    rt_usb_host_t *h = &m->s.usb.host;
    h->control.stage = RT_USB_NO_TRANSFER;
    h->address = 0;
    h->control_packet = CONTROL_FIRST; /* the device tells its own; one packet of the first answer is enough */
    h->step = RT_USB_HOST_RESET;
    rt_usb_bus_reset(m, true);
    wait_ns(m, at_ns, RESET_NS);
}

/* A transfer failed, or brought nonsense. */
static void enumeration_failed(rt1062_t *m, uint64_t at_ns) {
    rt_usb_host_t *h = &m->s.usb.host;
    if (++h->tries < TRIES) {
        begin_reset(m, at_ns);
    } else {
        h->step = RT_USB_HOST_GAVE_UP;
        h->work = RT_USB_IDLE;
    }
}

static void take_endpoint(rt_usb_host_t *h, const uint8_t *d) {
    const uint16_t packet = (uint16_t)((d[4] | d[5] << 8) & 0x7FF);
    if ((d[2] & FROM_DEVICE) != 0) {
        h->bulk_in = d[2] & 0x0F;
        h->bulk_in_packet = packet;
    } else {
        h->bulk_out = d[2] & 0x0F;
        h->bulk_out_packet = packet;
    }
}

/* Find the serial port in the configuration's descriptors. @return false: there is none. */
static bool read_configuration(rt_usb_host_t *h) {
    const rt_usb_control_t *c = &h->control;
    uint8_t class = 0;
    h->bulk_in = h->bulk_out = 0;
    for (uint32_t at = 0; at + 2 <= c->length && c->data[at] >= 2 && at + c->data[at] <= c->length; at += c->data[at]) {
        const uint8_t *d = c->data + at;
        if (d[1] == DESCRIPTOR_INTERFACE && d[0] >= 9) {
            class = d[5];
            h->interface = class == CLASS_CDC ? d[2] : h->interface;
        } else if (d[1] == DESCRIPTOR_ENDPOINT && d[0] >= 7 && class == CLASS_CDC_DATA && (d[3] & 3) == TRANSFER_BULK) {
            take_endpoint(h, d);
        }
    }
    return h->bulk_in != 0 && h->bulk_out != 0 && h->bulk_in_packet <= RT_USB_PACKET &&
           h->bulk_out_packet <= RT_USB_PACKET && h->bulk_in_packet > 0 && h->bulk_out_packet > 0 &&
           h->bulk_in < RT_USB_ENDPOINTS && h->bulk_out < RT_USB_ENDPOINTS;
}

/* @return false: what came makes no sense. */
static bool step_done(rt_usb_host_t *h) {
    rt_usb_control_t *c = &h->control;
    switch (h->step) {
    case RT_USB_HOST_DEVICE_8:
        h->control_packet = c->length >= 8 ? c->data[7] : 0;
        return h->control_packet >= 8 && c->data[1] == DESCRIPTOR_DEVICE;
    case RT_USB_HOST_ADDRESS:
        h->address = ADDRESS;
        return true;
    case RT_USB_HOST_DEVICE:
        return c->length == DEVICE_DESCRIPTOR_SIZE;
    case RT_USB_HOST_CONFIGURATION_9:
        c->setup[6] = c->data[2];
        c->setup[7] = c->data[3];
        return c->length == CONFIGURATION_HEAD && wanted_length(c) <= RT_USB_CONTROL;
    case RT_USB_HOST_CONFIGURATION:
        return c->length == wanted_length(c) && read_configuration(h);
    case RT_USB_HOST_CONFIGURE:
        h->toggle = 0;
        return true;
    default:
        return true;
    }
}

static void transfer_over(rt1062_t *m, uint64_t at_ns, bool good) {
    rt_usb_host_t *h = &m->s.usb.host;
    h->control.stage = RT_USB_NO_TRANSFER;
    if (h->step == RT_USB_HOST_READY) {
        wait_ns(m, at_ns, GAP_NS);
    } else if (good && step_done(h)) {
        h->step++;
        ask_for_step(m);
        wait_ns(m, at_ns,
                h->step == RT_USB_HOST_DEVICE ? 2 * MS : GAP_NS); /* 2 ms to settle at the address [USB 2.0, 9.2.6.3] */
    } else {
        enumeration_failed(m, at_ns);
    }
}

/* ---- the serial port */

static void tell_line_coding(rt1062_t *m) {
    rt_usb_host_t *h = &m->s.usb.host;
    ask(m, TO_INTERFACE, SET_LINE_CODING, 0, h->interface, LINE_CODING_SIZE);
    h->baud_told = h->baud;
    for (uint32_t i = 0; i < 4; i++) {
        h->control.data[i] = (uint8_t)(h->baud >> 8 * i);
    }
    h->control.data[4] = h->control.data[5] = 0; /* one stop bit, no parity */
    h->control.data[6] = 8;
}

/* What the program at the port wants and the device has not been told. */
static void next_request(rt1062_t *m) {
    rt_usb_host_t *h = &m->s.usb.host;
    if (h->step != RT_USB_HOST_READY || h->control.stage != RT_USB_NO_TRANSFER) {
        return;
    }
    if (h->baud_told != h->baud) {
        tell_line_coding(m);
    } else if (h->open_told != h->open_wanted) {
        h->open_told = h->open_wanted;
        ask(m, TO_INTERFACE, SET_CONTROL_LINE_STATE, h->open_wanted ? DTR_AND_RTS : 0, h->interface, 0);
        h->to_robot_count = h->open_wanted ? h->to_robot_count : 0;
    }
}

static bool room_for_packet(const rt1062_t *m) {
    return !m->s.usb.host.deaf && RT1062_OUTPUT_SIZE - m->output[RT1062_USB].count >= RT_USB_PACKET;
}

static uint32_t out_packet(const rt_usb_host_t *h) {
    return h->to_robot_count < h->bulk_out_packet ? h->to_robot_count : h->bulk_out_packet;
}

static rt_usb_answer_t bulk_out(rt1062_t *m) {
    rt_usb_host_t *h = &m->s.usb.host;
    uint8_t packet[RT_USB_PACKET];
    const uint32_t count = out_packet(h);
    for (uint32_t i = 0; i < count; i++) {
        packet[i] = h->to_robot[(h->to_robot_begin + i) % RT_USB_TO_ROBOT];
    }
    const uint32_t toggle = 1u << h->bulk_out;
    /* cppcheck-suppress uninitvar ; count bytes are read */
    const rt_usb_answer_t answer = rt_usb_out(m, h->address, h->bulk_out, (h->toggle & toggle) != 0, packet, count);
    if (answer == RT_USB_ACK) {
        h->toggle ^= (uint16_t)toggle;
        h->to_robot_begin = (h->to_robot_begin + count) % RT_USB_TO_ROBOT;
        h->to_robot_count -= count;
    }
    return answer;
}

static rt_usb_answer_t bulk_in(rt1062_t *m) {
    rt_usb_host_t *h = &m->s.usb.host;
    uint8_t packet[RT_USB_PACKET];
    uint32_t count = 0;
    bool toggle = false;
    const rt_usb_answer_t answer = rt_usb_in(m, h->address, h->bulk_in, &toggle, packet, &count);
    const uint32_t expected = 1u << (h->bulk_in + IN_TOGGLES);
    if (answer == RT_USB_ACK && toggle == ((h->toggle & expected) != 0)) {
        h->toggle ^= (uint16_t)expected;
        if (count > 0) {
            rt_output(m, RT1062_USB, packet, count);
        }
    }
    return answer;
}

/* ---- what comes next on the bus */

static bool answers(rt1062_t *m, uint32_t endpoint, bool in, uint32_t *bytes) {
    return rt_usb_would(m, m->s.usb.host.address, endpoint, in, bytes) == RT_USB_ACK;
}

/* A control transfer first; then the two directions of the port in turns. NAK is not an answer, everything else is. */
static rt_usb_work_t choose(rt1062_t *m, uint32_t *bytes) {
    rt_usb_host_t *h = &m->s.usb.host;
    const rt_usb_control_t *c = &h->control;
    *bytes = 8;
    if (c->stage == RT_USB_SETUP) {
        return RT_USB_CONTROL_PACKET;
    }
    if (c->stage != RT_USB_NO_TRANSFER && rt_usb_would(m, h->address, 0, stage_is_in(c), bytes) != RT_USB_NAK) {
        return RT_USB_CONTROL_PACKET;
    }
    if (h->step != RT_USB_HOST_READY || !h->open_told) {
        return RT_USB_IDLE;
    }
    uint32_t in_bytes = 0;
    const bool out = h->to_robot_count > 0 && answers(m, h->bulk_out, false, bytes);
    const bool in = room_for_packet(m) && answers(m, h->bulk_in, true, &in_bytes);
    if (out && !(in && h->out_last)) {
        *bytes = out_packet(h);
        return RT_USB_BULK_OUT;
    }
    *bytes = in_bytes;
    return in ? RT_USB_BULK_IN : RT_USB_IDLE;
}

static void plan(rt1062_t *m, uint64_t at_ns) {
    rt_usb_host_t *h = &m->s.usb.host;
    next_request(m);
    uint32_t bytes = 0;
    h->work = choose(m, &bytes);
    if (h->work != RT_USB_IDLE) {
        rt_usb_at(m, RT_USB_DUE_HOST, at_ns + packet_ns(m, bytes));
    } else {
        rt_usb_at(m, RT_USB_DUE_HOST, h->control.stage != RT_USB_NO_TRANSFER ? h->control.give_up_ns : RT_NEVER);
    }
}

/* The packet that was on the bus has arrived; or it turns out that it was not answered. */
static void finish_packet(rt1062_t *m, uint64_t at_ns) {
    rt_usb_host_t *h = &m->s.usb.host;
    const rt_usb_work_t work = h->work;
    h->work = RT_USB_IDLE;
    h->out_last = work == RT_USB_BULK_OUT;
    if (work == RT_USB_BULK_OUT) {
        bulk_out(m);
    } else if (work == RT_USB_BULK_IN) {
        bulk_in(m);
    } else if (work == RT_USB_CONTROL_PACKET) {
        const rt_usb_answer_t answer = control_packet(m);
        if (answer == RT_USB_SILENT || answer == RT_USB_STALL || h->control.stage == RT_USB_NO_TRANSFER) {
            transfer_over(m, at_ns, answer == RT_USB_ACK);
        }
    }
}

void rt_usb_host_step(rt1062_t *m, uint64_t at_ns) {
    rt_usb_host_t *h = &m->s.usb.host;
    switch (h->step) {
    case RT_USB_HOST_ALONE:
    case RT_USB_HOST_GAVE_UP:
        return;
    case RT_USB_HOST_DEBOUNCE:
        begin_reset(m, at_ns);
        return;
    case RT_USB_HOST_RESET:
        rt_usb_bus_reset(m, false);
        h->step = RT_USB_HOST_RECOVERY;
        wait_ns(m, at_ns, RECOVERY_NS);
        return;
    case RT_USB_HOST_RECOVERY:
        h->step = RT_USB_HOST_DEVICE_8;
        ask_for_step(m);
        plan(m, at_ns);
        return;
    default:
        break;
    }
    finish_packet(m, at_ns);
    if (h->work != RT_USB_IDLE || h->step < RT_USB_HOST_DEVICE_8) {
        return; /* a pause */
    }
    if (h->control.stage != RT_USB_NO_TRANSFER && at_ns >= h->control.give_up_ns) {
        transfer_over(m, at_ns, false);
        return;
    }
    plan(m, at_ns);
}

void rt_usb_host_look(rt1062_t *m) {
    rt_usb_host_t *h = &m->s.usb.host;
    if (h->step == RT_USB_HOST_ALONE && h->cable && rt_usb_attached(m)) {
        h->step = RT_USB_HOST_DEBOUNCE;
        h->tries = 0;
        wait_ns(m, rt_now(m), DEBOUNCE_NS);
    } else if (h->step >= RT_USB_HOST_DEVICE_8 && h->work == RT_USB_IDLE) {
        const uint64_t retry_ns = rt_now(m) + RETRY_NS;
        if (retry_ns < m->s.usb.due_ns[RT_USB_DUE_HOST]) {
            rt_usb_at(m, RT_USB_DUE_HOST, retry_ns);
        }
    }
}

/* The serial port is gone, and with it whatever a program had opened. */
void rt_usb_host_lost(rt1062_t *m) {
    rt_usb_host_t *h = &m->s.usb.host;
    h->step = RT_USB_HOST_ALONE;
    h->work = RT_USB_IDLE;
    h->control.stage = RT_USB_NO_TRANSFER;
    h->open_wanted = h->open_told = false;
    h->baud = DEFAULT_BAUD;
    h->baud_told = 0;
    h->to_robot_count = 0;
    rt_usb_at(m, RT_USB_DUE_HOST, RT_NEVER);
}
