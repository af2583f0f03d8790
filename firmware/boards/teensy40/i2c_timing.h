// SPDX-License-Identifier: MIT
/// @file i2c_timing.h  Clock divisions of the LPI2C master, and how long a batch takes on the wire.
///
/// Formulas: i.MX RT1060 reference manual, LPI2C, "Timing Parameters"; limits: NXP UM10204, table 10. The master counts
/// a high period only from when it sees SCL high, so a slow edge stretches the clock. So f_SCL is met with the fastest
/// edge, the set-up times with the slowest one that the specification allows.
#pragma once

#include <cstdint>

namespace omni {

/// Register fields, in LPI2C clocks divided by 2^prescale; filters in LPI2C clocks.
struct I2cTiming {
    uint32_t prescale;
    uint32_t clk_low;    ///< CLKLO
    uint32_t clk_high;   ///< CLKHI
    uint32_t set_hold;   ///< SETHOLD
    uint32_t data_valid; ///< DATAVD
    uint32_t filter;     ///< FILTSCL, FILTSDA
    uint32_t bus_idle;   ///< BUSIDLE
};

/// What the I2C specification demands of a mode.
struct I2cMode {
    uint32_t speed_Hz;
    uint32_t low_ns;
    uint32_t high_ns;
    uint32_t start_setup_ns; ///< repeated START
    uint32_t start_hold_ns;
    uint32_t stop_setup_ns;
    uint32_t data_setup_ns;
    uint32_t rise_ns; ///< longest rise time, 30 % to 70 %
    uint32_t prescale;
    uint32_t filter;
    uint32_t low_percent; ///< low fraction of the SCL period: large, for slow SDA edges
};

constexpr uint32_t i2c_clock_Hz = 60'000'000; ///< PLL3 / 8
constexpr uint32_t i2c_fastest_rise_ns = 20;

constexpr I2cMode i2c_modes[] = {
    {100'000, 4700, 4000, 4700, 4000, 4000, 250, 1000, 3, 15, 52},
    {400'000, 1300, 600, 600, 600, 600, 100, 300, 1, 15, 60},
    {1'000'000, 500, 260, 260, 260, 260, 50, 120, 0, 4, 60},
};

/// @return the fastest mode that is not faster than `speed_Hz`; the slowest if there is none.
constexpr const I2cMode &i2c_mode(uint32_t speed_Hz) {
    const I2cMode *found = &i2c_modes[0];
    for (const I2cMode &mode : i2c_modes) {
        found = mode.speed_Hz <= speed_Hz ? &mode : found;
    }
    return *found;
}

/// Prescaled clocks until the master sees that a line it let go is high. An RC edge takes 0.91 of its 30 % to 70 % rise
/// time to the input's threshold.
constexpr uint32_t i2c_latency(uint32_t prescale, uint32_t filter, uint32_t rise_ns) {
    const uint32_t rise_clocks = rise_ns * 91 / 100 * (i2c_clock_Hz / 1'000'000) / 1000;
    return (2 + filter + rise_clocks) >> prescale;
}

constexpr uint32_t i2c_clocks_of(uint32_t ns, uint32_t prescale) {
    const uint64_t dividend = uint64_t{ns} * (i2c_clock_Hz >> prescale);
    return static_cast<uint32_t>((dividend + 999'999'999) / 1'000'000'000);
}

constexpr uint64_t i2c_ns_of(uint64_t clocks, uint32_t prescale) {
    return (clocks << prescale) * 1'000'000'000 / i2c_clock_Hz;
}

constexpr I2cTiming i2c_timing(const I2cMode &mode) {
    const uint32_t period = i2c_clocks_of(1'000'000'000 / mode.speed_Hz, mode.prescale);
    const uint32_t low = period * mode.low_percent / 100;
    const uint32_t longest = mode.start_setup_ns > mode.start_hold_ns ? mode.start_setup_ns : mode.start_hold_ns;
    I2cTiming timing{};
    timing.prescale = mode.prescale;
    timing.filter = mode.filter;
    timing.clk_low = low - 1;
    timing.clk_high = period - low - 1 - i2c_latency(mode.prescale, mode.filter, i2c_fastest_rise_ns);
    timing.set_hold = i2c_clocks_of(longest * 6 / 5, mode.prescale) - 1;
    timing.data_valid = low / 6;
    timing.bus_idle = 2 * (timing.clk_low + timing.set_hold + 2);
    return timing;
}

/// Time on the wire [ns]. @param bytes with their acknowledge bits. @param starts repeated ones too; one STOP ends it
/// all.
constexpr uint64_t i2c_batch_ns(const I2cTiming &timing, uint32_t rise_ns, uint32_t bytes, uint32_t starts) {
    const uint64_t latency = i2c_latency(timing.prescale, timing.filter, rise_ns);
    const uint64_t low = timing.clk_low + 1;
    const uint64_t bit = low + timing.clk_high + 1 + latency;
    const uint64_t hold = timing.set_hold + 1;
    // A START holds; a repeated START and a STOP first take SCL low and set up.
    const uint64_t clocks = bit * bytes * 9 + starts * (hold + low + hold + latency);
    return i2c_ns_of(clocks, timing.prescale);
}

} // namespace omni
