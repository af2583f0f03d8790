/* SPDX-License-Identifier: MIT */
/* Stands in for parts that are being written: each goes when its own file comes. */
#include "machine.h"

#define PENDING __attribute__((weak))

PENDING uint32_t rt1062_send(rt1062_t *m, rt1062_channel_t channel, const uint8_t *bytes, uint32_t count) {
    (void)m, (void)channel, (void)bytes;
    return count;
}
PENDING void rt1062_usb_cable(rt1062_t *m, bool connected) { (void)m, (void)connected; }
PENDING void rt1062_usb_open(rt1062_t *m, bool open, uint32_t baud) { (void)m, (void)open, (void)baud; }
PENDING bool rt1062_usb_ready(const rt1062_t *m) { return m == NULL; }
PENDING void rt1062_cut_power_at(rt1062_t *m, uint32_t commands, double share) { (void)m, (void)commands, (void)share; }
