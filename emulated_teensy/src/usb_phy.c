/* SPDX-License-Identifier: MIT */
/* USBPHY1, the transceiver of USB1 [RM, chapter USB-PHY]. Each register has one to set, one to clear and one to toggle
 * bits beside it. */
#include "devices.h"
#include "machine.h"
#include "usb.h"

enum { BASE = 0x400D9000, SIZE = 0x1000, PWD = 0x00, TX = 0x10, RX = 0x20, CTRL = 0x30, REGISTERS_END = 0x40 };

#define PWD_RESET 0x001E1C00u
#define TX_RESET 0x10060607u
#define CTRL_SFTRST (1u << 31)
#define CTRL_CLKGATE (1u << 30)

bool rt_usb_phy_awake(const rt1062_t *m) {
    return m->s.usb.phy_pwd == 0 && (m->s.usb.phy_ctrl & (CTRL_SFTRST | CTRL_CLKGATE)) == 0;
}

static void phy_defaults(rt_usb_t *u) {
    u->phy_pwd = PWD_RESET;
    u->phy_tx = TX_RESET;
    u->phy_rx = 0;
    u->phy_ctrl = CTRL_SFTRST | CTRL_CLKGATE;
}

static uint32_t *phy_register(rt_usb_t *u, uint32_t offset) {
    uint32_t *const registers[] = {&u->phy_pwd, &u->phy_tx, &u->phy_rx, &u->phy_ctrl};
    return registers[offset / 0x10];
}

static bool phy_read(rt1062_t *m, uint32_t offset, uint32_t size, uint32_t *value) {
    if (size != 4 || offset >= REGISTERS_END) {
        return false;
    }
    *value = *phy_register(&m->s.usb, offset);
    return true;
}

static bool phy_write(rt1062_t *m, uint32_t offset, uint32_t size, uint32_t value) {
    if (size != 4 || offset >= REGISTERS_END) {
        return false;
    }
    const bool before = rt_usb_attached(m);
    uint32_t *reg = phy_register(&m->s.usb, offset);
    switch (offset / 4 % 4) {
    case 1:
        *reg |= value;
        break;
    case 2:
        *reg &= ~value;
        break;
    case 3:
        *reg ^= value;
        break;
    default:
        *reg = value;
        break;
    }
    if ((m->s.usb.phy_ctrl & CTRL_SFTRST) != 0) {
        phy_defaults(&m->s.usb);
    }
    rt_usb_attachment_changed(m, before);
    return true;
}

static void phy_reset(rt1062_t *m) {
    const bool before = rt_usb_attached(m);
    phy_defaults(&m->s.usb);
    rt_usb_attachment_changed(m, before);
}

const rt_device_t rt_usb_phy = {
    .name = "USBPHY1", .base = BASE, .size = SIZE, .read = phy_read, .write = phy_write, .reset = phy_reset};
