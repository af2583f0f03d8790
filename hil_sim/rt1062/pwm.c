/* SPDX-License-Identifier: MIT */
/* i.MX RT1060 RM, chapters eFlexPWM and Quad Timer; offsets as in imxrt.h of the core. */
#include "devices.h"
#include "machine.h"

/* FlexPWM: four submodules of 0x60 bytes, then what they share. */
enum {
    SUBMODULES_END = 0x180,
    SUBMODULE = 0x60,
    MCTRL = 0x188,
    FCTRL0 = 0x18C,
    FSTS0 = 0x18E,
    FFILT0 = 0x190,
    FLEXPWM_STEP = 0x4000
};

#define MCTRL_LDOK 0x000Fu  /* goes when the values are taken over: at once here */
#define MCTRL_CLDOK 0x00F0u /* reads as zero */

/* INIT, CTRL2, CTRL, VAL0..5, OCTRL, DTCNT0 */
static const uint8_t submodule_registers[] = {0x02, 0x04, 0x06, 0x0A, 0x0E, 0x12, 0x16, 0x1A, 0x1E, 0x22, 0x30};
/* COMP1, LOAD, CNTR, CTRL, SCTRL, CMPLD1, CSCTRL of each of four channels of 0x20 bytes */
static const uint8_t channel_registers[] = {0x00, 0x06, 0x0A, 0x0C, 0x0E, 0x10, 0x14};

static bool among(const uint8_t *offsets, uint32_t count, uint32_t offset) {
    for (uint32_t i = 0; i < count; i++) {
        if (offsets[i] == offset) {
            return true;
        }
    }
    return false;
}

static void look_at_gate(rt1062_t *m, rt_clock_gate_t gate, const char *what) {
    if (!rt_clock_on(m, gate)) {
        rt_finding(m, RT1062_FINDING_CLOCK, "%s is accessed while its clock gate in CCM_CCGR is off", what);
    }
}

static bool flexpwm_read(rt1062_t *m, uint32_t offset, uint32_t size, uint32_t *value) {
    const uint32_t number = offset / FLEXPWM_STEP;
    look_at_gate(m, (rt_clock_gate_t)(RT_CLOCK_PWM1 + number), "FlexPWM");
    *value = m->s.flexpwm[number].control;
    return size == 2 && offset % FLEXPWM_STEP == MCTRL;
}

static bool flexpwm_write(rt1062_t *m, uint32_t offset, uint32_t size, uint32_t value) {
    const uint32_t number = offset / FLEXPWM_STEP;
    const uint32_t at = offset % FLEXPWM_STEP;
    look_at_gate(m, (rt_clock_gate_t)(RT_CLOCK_PWM1 + number), "FlexPWM");
    if (size != 2) {
        return false;
    }
    if (at < SUBMODULES_END) {
        return among(submodule_registers, sizeof submodule_registers, at % SUBMODULE);
    }
    if (at == MCTRL) {
        m->s.flexpwm[number].control = value & ~(MCTRL_LDOK | MCTRL_CLDOK);
    }
    return at == MCTRL || at == FCTRL0 || at == FSTS0 || at == FFILT0;
}

static void flexpwm_reset(rt1062_t *m) {
    for (uint32_t i = 0; i < RT_FLEXPWMS; i++) {
        m->s.flexpwm[i].control = 0;
    }
}

static bool quad_timer_write(rt1062_t *m, uint32_t offset, uint32_t size, uint32_t value) {
    enum { STEP = 0x4000, CHANNELS_END = 0x80 };
    (void)value;
    look_at_gate(m, (rt_clock_gate_t)(RT_CLOCK_QTIMER1 + offset / STEP), "a quad timer");
    return size == 2 && offset % STEP < CHANNELS_END && among(channel_registers, sizeof channel_registers, offset % 0x20);
}

const rt_device_t rt_flexpwm = {"FlexPWM", 0x403DC000, RT_FLEXPWMS *FLEXPWM_STEP, flexpwm_read, flexpwm_write, flexpwm_reset};
const rt_device_t rt_quad_timers = {"quad timer", 0x401DC000, 0xC000, NULL, quad_timer_write, NULL};
