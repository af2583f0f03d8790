/* SPDX-License-Identifier: MIT */
/*
 * Double-precision instructions, which the chip has and Unicorn's Cortex-M7 has not [V7M A7.5, "Floating-point
 * data-processing instructions"]. Only those with the rounding mode and the flags of a C program: to nearest, no flush
 * to zero. The cumulative exception flags of FPSCR are not set.
 */
#include <math.h>
#include <string.h>

#include "machine.h"

enum { FPSCR_MODES = 0x07C00000 /* AHP, DN, FZ, RMode */, FPSCR_FLAGS_SHIFT = 28, CONTROL_FPCA = 4 };

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

static bool signalling(double value) {
    uint64_t bits;
    memcpy(&bits, &value, sizeof bits);
    return isnan(value) && (bits >> 51 & 1) == 0;
}

static double quiet(double value) {
    uint64_t bits;
    memcpy(&bits, &value, sizeof bits);
    bits |= 1ull << 51;
    memcpy(&value, &bits, sizeof value);
    return value;
}

/* Which NaN an operation gives, for a PC's processor gives another one [V7M A2.5.6, FPProcessNaNs()]. */
static double nan_of(double a, double b, double c) {
    static const uint64_t default_nan = 0x7FF8000000000000u;
    const double operands[3] = {a, b, c};
    for (uint32_t i = 0; i < 3; i++) {
        if (signalling(operands[i])) {
            return quiet(operands[i]);
        }
    }
    for (uint32_t i = 0; i < 3; i++) {
        if (isnan(operands[i])) {
            return operands[i];
        }
    }
    double value;
    memcpy(&value, &default_nan, sizeof value);
    return value;
}

static double settled(double result, double a, double b) {
    return isnan(result) ? nan_of(a, b, 0.0) : result;
}

static double add(double a, double b) {
    return settled(a + b, a, b);
}

static double multiply(double a, double b) {
    return settled(a * b, a, b);
}

static double fused(double addend, double a, double b) {
    const bool endless = (isinf(a) && b == 0.0) || (a == 0.0 && isinf(b));
    const double result = fma(a, b, addend);
    return !isnan(result) ? result : endless && !signalling(addend) ? nan_of(0.0, 0.0, 0.0) : nan_of(addend, a, b);
}

static void compare(rt1062_t *m, double a, double b) {
    const uint32_t flags = isnan(a) || isnan(b) ? 3u : a == b ? 6u : a < b ? 8u : 2u;
    rt_set_reg(m, RT_REG_FPSCR, (rt_reg(m, RT_REG_FPSCR) & 0x0FFFFFFFu) | flags << FPSCR_FLAGS_SHIFT);
}

/* Saturates, as the chip does. @param whole already rounded. */
static uint32_t to_integer(double whole, bool with_sign) {
    if (isnan(whole)) {
        return 0;
    }
    if (with_sign) {
        return whole <= -2147483648.0 ? 0x80000000u : whole >= 2147483647.0 ? 0x7FFFFFFFu : (uint32_t)(int32_t)whole;
    }
    return whole <= 0.0 ? 0u : whole >= 4294967295.0 ? 0xFFFFFFFFu : (uint32_t)whole;
}

/* RM of VRINT and VCVT: to nearest with ties away from zero, ties to even, up, down. */
static double rounded(double value, uint32_t mode) {
    const double whole = mode == 0   ? round(value)
                         : mode == 1 ? nearbyint(value)
                         : mode == 2 ? ceil(value)
                                     : floor(value);
    return settled(whole, value, value);
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

/* VCVT between a double and a fixed-point number of 32 bits, in place. @return false: of 16 bits. */
static bool fixed_point(rt1062_t *m, const fields_t *f, uint32_t word) {
    if (!f->bit7) {
        return false;
    }
    const int fraction = 32 - (int)((word & 15) << 1 | (word >> 5 & 1));
    const bool with_sign = (f->second & 1) == 0;
    const uint32_t low = (uint32_t)bits_of(m, f->d);
    if (f->second < 12) {
        put(m, f->d, ldexp(with_sign ? (double)(int32_t)low : (double)low, -fraction));
    } else {
        const uint32_t value = to_integer(trunc(ldexp(get(m, f->d), fraction)), with_sign);
        rt_set_reg(m, RT_REG_S0 + 2 * (int)f->d, value);
        rt_set_reg(m, RT_REG_S0 + 2 * (int)f->d + 1, with_sign && value >> 31 != 0 ? 0xFFFFFFFFu : 0);
    }
    return true;
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
        put(m, f->d, settled(sqrt(get(m, f->m)), get(m, f->m), 0.0));
        return true;
    case 4 << 1:
    case 4 << 1 | 1:
        compare(m, get(m, f->d), get(m, f->m));
        return true;
    case 5 << 1:
    case 5 << 1 | 1:
        compare(m, get(m, f->d), 0.0);
        return true;
    case 6 << 1:
    case 7 << 1: /* VRINTR, VRINTX: the mode is to nearest */
        put(m, f->d, rounded(get(m, f->m), 1));
        return true;
    case 6 << 1 | 1:
        put(m, f->d, settled(trunc(get(m, f->m)), get(m, f->m), 0.0));
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
    case 13 << 1:
        rt_set_reg(m, RT_REG_S0 + (int)f->single_d, to_integer(nearbyint(get(m, f->m)), f->second == 13));
        return true;
    case 12 << 1 | 1:
    case 13 << 1 | 1:
        rt_set_reg(m, RT_REG_S0 + (int)f->single_d, to_integer(trunc(get(m, f->m)), f->second == 13));
        return true;
    default:
        return (f->second >> 1 == 5 || f->second >> 1 == 7) && fixed_point(m, f, word);
    }
}

static bool arithmetic(rt1062_t *m, const fields_t *f) {
    const double n = get(m, f->n);
    const double by = get(m, f->m);
    const double d = get(m, f->d);
    switch (f->operation << 1 | (f->bit6 ? 1u : 0u)) {
    case 0 << 1: /* VMLA, VMLS, VNMLS, VNMLA round twice */
        put(m, f->d, add(d, multiply(n, by)));
        return true;
    case 0 << 1 | 1:
        put(m, f->d, add(d, -multiply(n, by)));
        return true;
    case 1 << 1:
        put(m, f->d, add(-d, multiply(n, by)));
        return true;
    case 1 << 1 | 1:
        put(m, f->d, add(-d, -multiply(n, by)));
        return true;
    case 2 << 1:
        put(m, f->d, multiply(n, by));
        return true;
    case 2 << 1 | 1:
        put(m, f->d, -multiply(n, by));
        return true;
    case 3 << 1:
        put(m, f->d, add(n, by));
        return true;
    case 3 << 1 | 1:
        put(m, f->d, settled(n - by, n, by));
        return true;
    case 4 << 1:
        put(m, f->d, settled(n / by, n, by));
        return true;
    case 5 << 1: /* VFNMS, VFNMA, VFMA, VFMS round once */
        put(m, f->d, fused(-d, n, by));
        return true;
    case 5 << 1 | 1:
        put(m, f->d, fused(-d, -n, by));
        return true;
    case 6 << 1:
        put(m, f->d, fused(d, n, by));
        return true;
    case 6 << 1 | 1:
        put(m, f->d, fused(d, -n, by));
        return true;
    default:
        return false;
    }
}

/* VMAXNM, VMINNM: a number beats a NaN that is quiet; +0 is more than -0. */
static double extreme(double a, double b, bool lowest) {
    if (signalling(a) || signalling(b) || (isnan(a) && isnan(b))) {
        return nan_of(a, b, 0.0);
    }
    if (isnan(a) || isnan(b)) {
        return isnan(a) ? b : a;
    }
    const bool a_less = a < b || (a == b && signbit(a));
    return a_less == lowest ? a : b;
}

/* VSEL: EQ, VS, GE, GT. */
static bool condition(rt1062_t *m, uint32_t which) {
    const uint32_t flags = rt_reg(m, RT_REG_XPSR) >> 28;
    const bool n = (flags & 8) != 0;
    const bool z = (flags & 4) != 0;
    const bool v = (flags & 1) != 0;
    return which == 0 ? z : which == 1 ? v : which == 2 ? n == v : n == v && !z;
}

/* What FPv5 added: never conditional. */
static bool version_5(rt1062_t *m, const fields_t *f, uint32_t word) {
    if ((word & 0xFF800F50u) == 0xFE000B00u) {
        put(m, f->d, condition(m, word >> 20 & 3) ? get(m, f->n) : get(m, f->m));
    } else if ((word & 0xFFB00F10u) == 0xFE800B00u) {
        put(m, f->d, extreme(get(m, f->n), get(m, f->m), f->bit6));
    } else if ((word & 0xFFBC0FD0u) == 0xFEB80B40u) {
        put(m, f->d, rounded(get(m, f->m), f->second & 3));
    } else if ((word & 0xFFBC0F50u) == 0xFEBC0B40u) {
        const uint32_t value = to_integer(rounded(get(m, f->m), f->second & 3), f->bit7);
        rt_set_reg(m, RT_REG_S0 + (int)f->single_d, value);
    } else {
        return false;
    }
    return true;
}

static bool execute(rt1062_t *m, uint32_t word) {
    const fields_t f = decode(word);
    /* VCVT.F64.F32 is coded among the single-precision instructions. */
    if ((word & 0x100) == 0) {
        put(m, f.d, (double)get_single(m, f.single_m));
        return true;
    }
    const bool conversion = f.operation == 7 || (word & 0xFFB00000u) == 0xFEB00000u;
    if (!conversion && (f.d > 15 || f.n > 15 || f.m > 15)) {
        return false;
    }
    if (word >> 24 == 0xFE) {
        return version_5(m, &f, word);
    }
    return f.operation == 7 ? other(m, &f, word) : arithmetic(m, &f);
}

bool rt_fpu_is_double(uint32_t instruction) {
    return (instruction & 0xEF000F10u) == 0xEE000B00u || (instruction & 0xFFBF0FD0u) == 0xEEB70AC0u;
}

/* The instruction is over: the next one of its IT block [V7M A7.3.2, ITAdvance()], and a context that interrupts must
 * keep. */
static void step(rt1062_t *m) {
    const uint32_t xpsr = rt_reg(m, RT_REG_XPSR);
    const uint32_t it = (xpsr >> 10 & 0x3F) << 2 | (xpsr >> 25 & 3);
    if (it != 0) {
        const uint32_t next = (it & 7) == 0 ? 0 : (it & 0xE0) | (it << 1 & 0x1F);
        rt_set_reg(m, RT_REG_XPSR, (xpsr & ~XPSR_IT) | (next >> 2) << 10 | (next & 3) << 25);
    }
    const uint32_t control = rt_reg(m, RT_REG_CONTROL);
    if ((control & CONTROL_FPCA) == 0) {
        rt_set_reg(m, RT_REG_CONTROL, control | CONTROL_FPCA);
    }
    rt_set_reg(m, RT_REG_PC, (rt_reg(m, RT_REG_PC) + 4) | 1u);
}

bool rt_fpu_double(rt1062_t *m, uint32_t instruction) {
    if ((rt_reg(m, RT_REG_FPSCR) & (uint32_t)FPSCR_MODES) != 0 || !execute(m, instruction)) {
        return false;
    }
    step(m);
    return true;
}
