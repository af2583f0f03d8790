/* SPDX-License-Identifier: MIT */
/* OCOTP's shadow registers (i.MX RT1060 RM, chapters Fusemap and OCOTP). */
#include "machine.h"

#include "fuses.h"

typedef struct fuse_t {
    uint16_t offset;
    uint32_t value;
} fuse_t;

/* Words that the core reads; a Teensy 4.0 as PJRC ships it is not locked (CFG5 bit 1). */
static const fuse_t fuses[] = {
    {0x440, 0},            /* CFG3: speed grading and temperature range; clockspeed.c */
    {0x460, 0},            /* CFG5: usb.c asks for bit 1, secure boot */
    {0x4E0, RT_FUSE_ANA1}, /* ANA1: tempmon.c */
    {0x620, 0x04E5A0B1},   /* MAC0: usb_desc.c makes the serial number of its lower 24 bits */
    {0x630, 0x000004E9},   /* MAC1: E9 E5 is PJRC's prefix */
};

static bool ocotp_read(rt1062_t *m, uint32_t offset, uint32_t size, uint32_t *value) {
    if (!rt_clock_on(m, RT_CLOCK_OCOTP)) {
        rt_finding(m, RT1062_FINDING_CLOCK, "OCOTP is read while CCM_CCGR2_OCOTP_CTRL is off");
    }
    for (uint32_t i = 0; size == 4 && i < sizeof fuses / sizeof fuses[0]; i++) {
        if (fuses[i].offset == offset) {
            *value = fuses[i].value;
            return true;
        }
    }
    return false;
}

const rt_device_t rt_ocotp = {"OCOTP", 0x401F4000, 0x4000, ocotp_read, NULL, NULL};
