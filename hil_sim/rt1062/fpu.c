/* SPDX-License-Identifier: MIT */
/*
 * Double-precision instructions, which the chip has and Unicorn's Cortex-M7 has not [V7M A7.5, "Floating-point data-processing
 * instructions"]. Only those with the rounding mode and the flags of a C program: to nearest, no flush to zero.
 */
#include <math.h>
#include <string.h>

#include "machine.h"

enum { FPSCR_MODES = 0x07C00000 /* AHP, DN, FZ, RMode */, FPSCR_FLAGS_SHIFT = 28 };

typedef struct fields_t {
    uint32_t d; /* register number as a double's */
    uint32_t n;
    uint32_t m;
    uint32_t single_d; /* and as a float's */
    uint32_t single_m;
    uint32_t operation; /* bits 23, 21, 20 */
    uint32_t second;    /* bits 19..16 */
    bool bit6;
    bool bit7;
} fields_t;

static fields_t decode(uint32_t word) {
    const uint32_t vd = word >> 12 & 15;
    const uint32_t vm = word & 15;
    return (fields_t){.d = (word >> 22 & 1) << 4 | vd,
                      .n = (word >> 7 & 1) << 4 | (word >> 16 & 15),
                      .m = (word >> 5 & 1) << 4 | vm,
                      .single_d = vd << 1 | (word >> 22 & 1),
                      .single_m = vm << 1 | (word >> 5 & 1),
                      .operation = (word >> 23 & 1) << 2 | (word >> 20 & 3),
                      .second = word >> 16 & 15,
                      .bit6 = (word >> 6 & 1) != 0,
                      .bit7 = (word >> 7 & 1) != 0};
}

static uint64_t bits_of(rt1062_t *m, uint32_t number) {
    return (uint64_t)rt_reg(m, RT_REG_S0 + 2 * (int)number + 1) << 32 | rt_reg(m, RT_REG_S0 + 2 * (int)number);
}

static double get(rt1062_t *m, uint32_t number) {
    const uint64_t bits = bits_of(m, number);
    double value;
    memcpy(&value, &bits, sizeof value);
    return value;
}

static void put(rt1062_t *m, uint32_t number, double value) {
    uint64_t bits;
    memcpy(&bits, &value, sizeof bits);
    rt_set_reg(m, RT_REG_S0 + 2 * (int)number, (uint32_t)bits);
    rt_set_reg(m, RT_REG_S0 + 2 * (int)number + 1, (uint32_t)(bits >> 32));
}

static float get_single(rt1062_t *m, uint32_t number) {
    const uint32_t bits = rt_reg(m, RT_REG_S0 + (int)number);
    float value;
    memcpy(&value, &bits, sizeof value);
    return value;
}

static void put_single(rt1062_t *m, uint32_t number, float value) {
    uint32_t bits;
    memcpy(&bits, &value, sizeof bits);
    rt_set_reg(m, RT_REG_S0 + (int)number, bits);
}

static void compare(rt1062_t *m, double a, double b) {
    const uint32_t flags = isnan(a) || isnan(b) ? 3u : a == b ? 6u : a < b ? 8u : 2u;
    rt_set_reg(m, RT_REG_FPSCR, (rt_reg(m, RT_REG_FPSCR) & 0x0FFFFFFFu) | flags << FPSCR_FLAGS_SHIFT);
}

/* Saturates, as the chip does; towards zero or to nearest even. */
static uint32_t to_integer(double value, bool with_sign, bool towards_zero) {
    const double whole = towards_zero ? trunc(value) : nearbyint(value);
    if (isnan(value)) {
        return 0;
    }
    if (with_sign) {
        return whole <= -2147483648.0 ? 0x80000000u : whole >= 2147483647.0 ? 0x7FFFFFFFu : (uint32_t)(int32_t)whole;
    }
    return whole <= 0.0 ? 0u : whole >= 4294967295.0 ? 0xFFFFFFFFu : (uint32_t)whole;
}

/* VMOV immediate: sign, exponent and four bits of fraction in a byte [V7M A6.4.1]. */
static double immediate(const fields_t *f, uint32_t word) {
    const uint64_t byte = f->second << 4 | (word & 15);
    const uint64_t b6 = byte >> 6 & 1;
    const uint64_t exponent = (b6 ^ 1) << 10 | (b6 != 0 ? 0xFFull << 2 : 0) | (byte >> 4 & 3);
    const uint64_t bits = (byte >> 7) << 63 | exponent << 52 | (byte & 15) << 48;
    double value;
    memcpy(&value, &bits, sizeof value);
    return value;
}

/* Moves, comparisons and conversions: operation 7. */
static bool other(rt1062_t *m, const fields_t *f, uint32_t word) {
    if (!f->bit6) {
        put(m, f->d, immediate(f, word));
        return true;
    }
    switch (f->second << 1 | (f->bit7 ? 1u : 0u)) {
    case 0 << 1:
        put(m, f->d, get(m, f->m));
        return true;
    case 0 << 1 | 1:
        put(m, f->d, fabs(get(m, f->m)));
        return true;
    case 1 << 1:
        put(m, f->d, -get(m, f->m));
        return true;
    case 1 << 1 | 1:
        put(m, f->d, sqrt(get(m, f->m)));
        return true;
    case 4 << 1:
    case 4 << 1 | 1:
        compare(m, get(m, f->d), get(m, f->m));
        return true;
    case 5 << 1:
    case 5 << 1 | 1:
        compare(m, get(m, f->d), 0.0);
        return true;
    case 7 << 1 | 1:
        put_single(m, f->single_d, (float)get(m, f->m));
        return true;
    case 8 << 1:
        put(m, f->d, (double)rt_reg(m, RT_REG_S0 + (int)f->single_m));
        return true;
    case 8 << 1 | 1:
        put(m, f->d, (double)(int32_t)rt_reg(m, RT_REG_S0 + (int)f->single_m));
        return true;
    case 12 << 1:
    case 12 << 1 | 1:
    case 13 << 1:
    case 13 << 1 | 1:
        rt_set_reg(m, RT_REG_S0 + (int)f->single_d, to_integer(get(m, f->m), f->second == 13, f->bit7));
        return true;
    default:
        return false;
    }
}

static bool arithmetic(rt1062_t *m, const fields_t *f, uint32_t word) {
    const double n = get(m, f->n);
    const double by = get(m, f->m);
    const double d = get(m, f->d);
    switch (f->operation << 1 | (f->bit6 ? 1u : 0u)) {
    case 0 << 1: /* VMLA rounds twice */
    case 0 << 1 | 1: {
        const double product = n * by;
        put(m, f->d, f->bit6 ? d - product : d + product);
        return true;
    }
    case 2 << 1:
        put(m, f->d, n * by);
        return true;
    case 2 << 1 | 1:
        put(m, f->d, -(n * by));
        return true;
    case 3 << 1:
        put(m, f->d, n + by);
        return true;
    case 3 << 1 | 1:
        put(m, f->d, n - by);
        return true;
    case 4 << 1:
        put(m, f->d, n / by);
        return true;
    case 6 << 1: /* VFMA rounds once */
        put(m, f->d, fma(n, by, d));
        return true;
    case 6 << 1 | 1:
        put(m, f->d, fma(-n, by, d));
        return true;
    default:
        return f->operation == 7 && other(m, f, word);
    }
}

bool rt_fpu_double(rt1062_t *m, uint32_t instruction) {
    if ((rt_reg(m, RT_REG_FPSCR) & (uint32_t)FPSCR_MODES) != 0) {
        return false;
    }
    const fields_t f = decode(instruction);
    const uint32_t kind = instruction & 0xFF000F10u;
    if (kind == 0xEE000B00u) {
        return f.d < 16 && f.m < 16 && f.n < 16 ? arithmetic(m, &f, instruction) : other(m, &f, instruction);
    }
    /* VCVT.F64.F32 is coded among the single-precision instructions. */
    if (kind == 0xEE000A00u && f.operation == 7 && f.second == 7 && f.bit6 && f.bit7) {
        put(m, f.d, (double)get_single(m, f.single_m));
        return true;
    }
    return false;
}
