// SPDX-License-Identifier: MIT
// Every operation of lanes.hpp against the scalar operation, lane by lane and bit by bit. A NaN is a NaN: which one is
// the compiler's choice of operand order.
#include <cstdio>

#include "lanes.hpp"

namespace {

using namespace lanes;

const float floats[] = {0.0f,
                        -0.0f,
                        1.0f,
                        -1.0f,
                        0.5f,
                        -2.5f,
                        3.14159f,
                        -1e-3f,
                        1e-41f,
                        -1e-45f,
                        3e38f,
                        -3.4e38f,
                        1e30f,
                        -7.75f,
                        8388607.5f,
                        1.1754944e-38f,
                        0.0f / 1,
                        2147483.0f,
                        -3e-9f,
                        __builtin_inff(),
                        -__builtin_inff(),
                        __builtin_nanf(""),
                        1e9f,
                        -1e9f};
constexpr int kinds = sizeof floats / sizeof floats[0];

template <typename T>
bool same_bits(T a, T b) {
    if (a != a || b != b) {
        return a != a && b != b;
    }
    return std::memcmp(&a, &b, sizeof a) == 0;
}

struct tally {
    int wrong = 0;
    template <typename T>
    void check(const char *name, T lane, T scalar) {
        if (!same_bits(lane, scalar)) {
            ++wrong;
            std::fprintf(stderr, "%s: %.9g instead of %.9g\n", name, static_cast<double>(lane),
                         static_cast<double>(scalar));
        }
    }
    void check(const char *name, bool lane, bool scalar) {
        if (lane != scalar) {
            ++wrong;
            std::fprintf(stderr, "%s: %d instead of %d\n", name, lane, scalar);
        }
    }
};

template <typename T>
void check_arithmetic(tally &t, const T *x, const T *y) {
    using many = number<T>;
    const many a = many::load(x);
    const many b = many::load(y);
    const many larger = select(a > b, a, b);
    const many kept = select(!(a < b) || a == b, a, T(1));
    for (int i = 0; i < count; ++i) {
        const volatile T p = x[i];
        const volatile T q = y[i];
        const T u = p;
        const T v = q;
        const T magnitude = static_cast<T>(__builtin_fabs(static_cast<double>(u)));
        t.check("+", (a + b).get(i), static_cast<T>(u + v));
        t.check("-", (a - b).get(i), static_cast<T>(u - v));
        t.check("*", (a * b).get(i), static_cast<T>(u * v));
        t.check("/", (a / b).get(i), static_cast<T>(u / v));
        t.check("negate", (-a).get(i), static_cast<T>(-u));
        t.check("abs", abs(a).get(i), magnitude);
        t.check("sqrt", sqrt(abs(a)).get(i), static_cast<T>(__builtin_sqrt(static_cast<double>(magnitude))));
        t.check("select", larger.get(i), u > v ? u : v);
        t.check("select with a scalar", kept.get(i), !(u < v) || u == v ? u : T(1));
        const unsigned bit = 1u << i;
        t.check("<", ((a < b).bits() & bit) != 0, u < v);
        t.check("<=", ((a <= b).bits() & bit) != 0, u <= v);
        t.check(">", ((a > b).bits() & bit) != 0, u > v);
        t.check(">=", ((a >= b).bits() & bit) != 0, u >= v);
        t.check("==", ((a == b).bits() & bit) != 0, u == v);
        t.check("!=", ((a != b).bits() & bit) != 0, u != v);
    }
}

void check_conversions(tally &t, const float *x) {
    const real_t a = real_t::load(x);
    const wide_t exact = a;
    const real_t back(exact);
    for (int i = 0; i < count; ++i) {
        t.check("float to double", exact.get(i), static_cast<double>(x[i]));
        t.check("double to float", back.get(i), x[i]);
        if (x[i] > -2e9f && x[i] < 2e9f) {
            t.check("truncation", int_t(a).get(i) == static_cast<std::int32_t>(x[i]), true);
            t.check("truncation of doubles", int_t(exact).get(i) == static_cast<std::int32_t>(x[i]), true);
            t.check("from int", real_t(int_t(a)).get(i), static_cast<float>(static_cast<std::int32_t>(x[i])));
            t.check("from int, wide", wide_t(int_t(a)).get(i), static_cast<double>(static_cast<std::int32_t>(x[i])));
        }
    }
}

} // namespace

extern "C" {

int lanes_wrong_numbers(void) {
    tally t;
    for (int i = 0; i < kinds; ++i) {
        for (int j = 0; j < kinds; ++j) {
            float x[count];
            float y[count];
            double wide_x[count];
            double wide_y[count];
            for (int lane = 0; lane < count; ++lane) {
                x[lane] = floats[(i + lane) % kinds];
                y[lane] = floats[(j + 5 * lane) % kinds];
                wide_x[lane] = static_cast<double>(x[lane]) * 1.1;
                wide_y[lane] = static_cast<double>(y[lane]) * 0.9;
            }
            check_arithmetic(t, x, y);
            check_arithmetic(t, wide_x, wide_y);
            check_conversions(t, x);
        }
    }
    return t.wrong;
}

int lanes_wrong_whole_numbers(void) {
    tally t;
    const std::int32_t x[count] = {0, 1, -1, 2147483647, -2147483647, 12345, -54321, 7};
    const std::int32_t y[count] = {0, 3, 5, 2, 9, -12345, 54321, 7};
    const int_t a = int_t::load(x);
    const int_t b = int_t::load(y);
    for (int i = 0; i < count; ++i) {
        const auto u = static_cast<std::uint32_t>(x[i]);
        const auto v = static_cast<std::uint32_t>(y[i]);
        t.check("uint +", (uint_t(a) + uint_t(b)).get(i) == u + v, true);
        t.check("uint -", (uint_t(a) - uint_t(b)).get(i) == u - v, true);
        t.check("uint &", (uint_t(a) & 3u).get(i) == (u & 3u), true);
        t.check("uint |", (uint_t(a) | uint_t(b)).get(i) == (u | v), true);
        t.check("int <", ((a < b).bits() >> i & 1u) != 0, x[i] < y[i]);
        t.check("uint <", ((uint_t(a) < uint_t(b)).bits() >> i & 1u) != 0, u < v);
        t.check("shift", (a >> 3).get(i) == x[i] >> 3, true);
    }
    return t.wrong;
}

int lanes_count(void) {
    return count;
}

/** A mask with these eight bits as a condition; sixteen lanes get them twice. Bit 0: answer; 1: the lanes parted. */
int lanes_condition(unsigned bits) {
    float x[count];
    for (int i = 0; i < count; ++i) {
        x[i] = (bits >> i % 8 & 1u) != 0 ? 1.0f : -1.0f;
    }
    (void)hil_lanes_take_diverged();
    const bool answer = real_t::load(x) > 0.0f;
    const bool parted = hil_lanes_take_diverged();
    const bool wide = wide_t(real_t::load(x)) > 0.0;
    const bool parted_wide = hil_lanes_take_diverged();
    return answer != wide || parted != parted_wide ? -1 : static_cast<int>(answer) | static_cast<int>(parted) << 1;
}

/** A cast to a scalar, with another value in one lane (or in none: -1). @return the value, + 100 if the lanes parted.
 */
int lanes_cast(int other_lane) {
    real_t x = 3.75f;
    if (other_lane >= 0) {
        x.set(other_lane, 4.75f);
    }
    (void)hil_lanes_take_diverged();
    const int value = static_cast<int>(x);
    return value + (hil_lanes_take_diverged() ? 100 : 0);
}
}
