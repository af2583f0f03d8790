/* SPDX-License-Identifier: MIT */
#include "adc.h"

#include "clocks.h"
#include "devices.h"
#include "machine.h"
#include "pads.h"
#include "pins.h"

enum {
    HC0 = 0x00,
    HS = 0x20,
    R0 = 0x24,
    CFG = 0x44,
    GC = 0x48,
    GS = 0x4C,
    SPACING = 0x4000,
    CHANNELS = 16,
    CHANNEL_OFF = 0x1F,
    HS_COCO0 = 1,
    GS_ADACT = 1,
    GC_CAL = 1 << 7,
    GC_AVGE = 1 << 5,
    CFG_LOW_POWER = 1 << 7,
    CFG_HIGH_SPEED = 1 << 10,
    CFG_LONG_SAMPLE = 1 << 4,
    CFG_ADTRG = 1 << 13,
    CFG_REFSEL = 3 << 11,
    CFG_OVERWRITE = 1 << 16,
    CFG_MASK = 0x1FFFF,
    CFG_RESET = 0x200,
    ASYNCHRONOUS = 3,          /* ADICLK */
    CALIBRATION_CYCLES = 14000 /* no manual says; NXP's ADC16, its relative, takes at most so many */
};

static const double REFERENCE_V = 3.3;

/*
 * ADC1_IN0 .. 15 ([core] analog.c, pin_to_channel; RM, chapter ADC, external signals); ADC2 has other pads at 1 ..
 * 4.
 */
static uint32_t pad_of_channel(uint32_t unit, uint32_t channel) {
    static const uint8_t pads[CHANNELS] = {
        RT_PAD_AD_B1 + 11, RT_PAD_AD_B0 + 12, RT_PAD_AD_B0 + 13, RT_PAD_AD_B0 + 14, RT_PAD_AD_B0 + 15, RT_PAD_AD_B1 + 0,
        RT_PAD_AD_B1 + 1,  RT_PAD_AD_B1 + 2,  RT_PAD_AD_B1 + 3,  RT_PAD_AD_B1 + 4,  RT_PAD_AD_B1 + 5,  RT_PAD_AD_B1 + 6,
        RT_PAD_AD_B1 + 7,  RT_PAD_AD_B1 + 8,  RT_PAD_AD_B1 + 9,  RT_PAD_AD_B1 + 10,
    };
    return unit == 1 && channel >= 1 && channel <= 4 ? RT_PAD_AD_B1 + 11 + channel : pads[channel];
}

/* ------------------------------------------------------------------ conversions */

static uint32_t bits(const rt_adc_t *adc) {
    return 8 + 2 * (adc->config >> 2 & 3); /* MODE: 8, 10, 12 bits */
}

static uint32_t clock_Hz(const rt1062_t *m, const rt_adc_t *adc) {
    const uint32_t source = adc->config & 3;
    uint32_t frequency_Hz = rt_clock_hz(m, RT_ROOT_IPG);
    if (source == ASYNCHRONOUS) {
        frequency_Hz = (adc->config & CFG_HIGH_SPEED) != 0
                           ? 20000000
                           : 10000000; /* ADACK, typical, in the data sheet's ADC table */
    } else if (source == 1) {
        frequency_Hz /= 2; /* IPG / 2; 2, ALTCLK, is refused */
    }
    return frequency_Hz >> (adc->config >> 5 & 3);
}

/*
 * Sample and conversion cycles as the core's analog.c counts them: 17 cycles for 8 or 10 bits, 25 for 12, and the
 * sample period.
 */
static uint32_t conversion_cycles(const rt_adc_t *adc) {
    const uint32_t select = adc->config >> 8 & 3;
    const uint32_t sample = (adc->config & CFG_LONG_SAMPLE) != 0 ? 13 + 4 * select : 3 + 2 * select;
    const uint32_t averaged = (adc->general & GC_AVGE) != 0 ? 4u << (adc->config >> 14 & 3) : 1;
    return averaged * (sample + (bits(adc) == 12 ? 25 : 17));
}

static uint64_t cycles_ns(const rt1062_t *m, const rt_adc_t *adc, uint32_t cycles) {
    const uint32_t frequency_Hz = clock_Hz(m, adc);
    return frequency_Hz == 0 ? RT_NEVER / 2 : cycles * UINT64_C(1000000000) / frequency_Hz;
}

static uint32_t convert(rt1062_t *m, const rt_adc_t *adc, uint32_t pad) {
    if (rt_pad_pulls(m, pad)) {
        rt_finding(m, RT1062_FINDING_PINS, "a pin is measured while its pull or keeper bends the voltage");
    }
    const double steps = rt_pins_voltage(m, pad) / REFERENCE_V * (double)(1u << bits(adc));
    const uint32_t most = (1u << bits(adc)) - 1;
    return steps <= 0.0 ? 0 : steps >= (double)most ? most : (uint32_t)steps;
}

static void finish(const rt1062_t *m, rt_adc_t *adc) {
    if (adc->converting && rt_now(m) >= adc->ready_ns) {
        adc->converting = false;
        adc->complete = true;
        adc->result = adc->sampled;
    }
}

/* Writing HC0 begins, and ends what was under way. */
static bool start(rt1062_t *m, uint32_t unit, uint32_t value) {
    rt_adc_t *adc = &m->s.adc[unit];
    if (value != CHANNEL_OFF && value >= CHANNELS) {
        return false; /* interrupts, internal channels: not modelled */
    }
    adc->channel = value;
    adc->complete = false;
    adc->converting = value != CHANNEL_OFF;
    if (adc->converting) {
        if (rt_now(m) < adc->calibrated_ns) {
            rt_refuse(m, "ADC%u: a conversion is started during the calibration", (unsigned)unit + 1);
            return true;
        }
        adc->sampled = convert(m, adc, pad_of_channel(unit, value));
        adc->ready_ns = rt_now(m) + cycles_ns(m, adc, conversion_cycles(adc));
    }
    return true;
}

/* ------------------------------------------------------------------ registers */

static bool clocked(rt1062_t *m, uint32_t unit) {
    return unit == 0 ? rt_clock_needed(m, RT_CLOCK_ADC1, "ADC1") : rt_clock_needed(m, RT_CLOCK_ADC2, "ADC2");
}

/* The converter that an access is for, as it is now. NULL: the access is over; *good says whether there is such a
 * register. */
static rt_adc_t *reached(rt1062_t *m, uint32_t offset, uint32_t size, bool *good) {
    const uint32_t unit = offset / SPACING;
    *good = size == 4;
    if (!*good || !clocked(m, unit)) {
        return NULL;
    }
    finish(m, &m->s.adc[unit]);
    return &m->s.adc[unit];
}

static bool read(rt1062_t *m, uint32_t offset, uint32_t size, uint32_t *value) {
    bool good;
    rt_adc_t *adc = reached(m, offset, size, &good);
    *value = 0;
    if (adc == NULL) {
        return good;
    }
    switch (offset % SPACING) {
    case HC0:
        *value = adc->channel;
        return true;
    case HS:
        *value = adc->complete ? HS_COCO0 : 0;
        return true;
    case R0:
        *value = adc->result;
        adc->complete = false;
        return true;
    case CFG:
        *value = adc->config;
        return true;
    case GC:
        *value = adc->general | (rt_now(m) < adc->calibrated_ns ? GC_CAL : 0u);
        return true;
    case GS:
        *value = adc->converting ? GS_ADACT : 0; /* CALF never: the calibration succeeds */
        return true;
    default:
        return false;
    }
}

static bool write_config(rt_adc_t *adc, uint32_t value) {
    const bool other_reference = (value & (CFG_ADTRG | CFG_REFSEL)) != 0;
    const bool alternate_clock = (value & 3) == 2;
    const bool three = (value >> 2 & 3) == 3;
    if ((value & ~(uint32_t)CFG_MASK) != 0 || other_reference || alternate_clock || three) {
        return false;
    }
    adc->config = value;
    return true;
}

static bool write_general(rt1062_t *m, rt_adc_t *adc, uint32_t value) {
    if ((value & ~(uint32_t)(GC_CAL | GC_AVGE)) != 0) {
        return false;
    }
    adc->general = value & GC_AVGE;
    if ((value & GC_CAL) != 0) {
        adc->converting = false;
        adc->complete = false;
        adc->calibrated_ns = rt_now(m) + cycles_ns(m, adc, CALIBRATION_CYCLES);
    }
    return true;
}

static bool write(rt1062_t *m, uint32_t offset, uint32_t size, uint32_t value) {
    bool good;
    rt_adc_t *adc = reached(m, offset, size, &good);
    if (adc == NULL) {
        return good;
    }
    switch (offset % SPACING) {
    case HC0:
        return start(m, offset / SPACING, value);
    case CFG:
        return write_config(adc, value);
    case GC:
        return write_general(m, adc, value);
    default:
        return false;
    }
}

static void reset(rt1062_t *m) {
    for (uint32_t unit = 0; unit < RT_ADCS; unit++) {
        m->s.adc[unit] = (rt_adc_t){.channel = CHANNEL_OFF, .config = CFG_RESET};
    }
}

const rt_device_t rt_adc = {"ADC1, ADC2", 0x400C4000, RT_ADCS *SPACING, read, write, reset};
