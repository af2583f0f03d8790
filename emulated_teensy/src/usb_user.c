/* SPDX-License-Identifier: MIT */
/* What the user of the machine does at the USB host: cable, port, bytes. */
#include "links.h"
#include "machine.h"
#include "usb.h"

void rt1062_usb_cable(rt1062_t *m, bool connected) {
    rt_usb_host_t *h = &m->s.usb.host;
    if (connected == h->cable) {
        return;
    }
    h->cable = connected;
    rt_usb_host_lost(m);
    if (connected) {
        rt_usb_host_look(m);
    } else {
        m->s.usb.in_reset = false;
        rt_usb_bus_silent(m);
    }
}

void rt1062_usb_full_speed(rt1062_t *m, bool full_speed) {
    m->s.usb.host.full_speed = full_speed;
}

void rt1062_usb_deaf(rt1062_t *m, bool deaf) {
    m->s.usb.host.deaf = deaf;
    rt_usb_host_look(m);
}

void rt1062_usb_open(rt1062_t *m, bool open, uint32_t baud) {
    rt_usb_host_t *h = &m->s.usb.host;
    h->open_wanted = open;
    h->baud = baud;
    rt_usb_host_look(m);
}

bool rt1062_usb_ready(const rt1062_t *m) {
    return m->s.usb.host.step == RT_USB_HOST_READY;
}

uint32_t rt_usb_send(rt1062_t *m, const uint8_t *bytes, uint32_t count) {
    rt_usb_host_t *h = &m->s.usb.host;
    if (h->step != RT_USB_HOST_READY || !h->open_wanted) {
        return 0;
    }
    const uint32_t room = RT_USB_TO_ROBOT - h->to_robot_count;
    const uint32_t taken = count < room ? count : room;
    for (uint32_t i = 0; i < taken; i++) {
        h->to_robot[(h->to_robot_begin + h->to_robot_count++) % RT_USB_TO_ROBOT] = bytes[i];
    }
    rt_usb_host_look(m);
    return taken;
}
