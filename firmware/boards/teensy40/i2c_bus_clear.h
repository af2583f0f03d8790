// SPDX-License-Identifier: MIT
/// @file i2c_bus_clear.h  Frees an I2C bus whose SDA is held low (NXP UM10204, 3.1.16), one step per half clock.
///
/// Clocks only as long as SDA is low, at most nine. A chip that was being written to must not get bits it would take
/// for data. Then a STOP ends its transaction.
#pragma once

#include <cstdint>

namespace omni {

class I2cBusClear {
public:
    enum class Result : uint8_t {
        working,
        freed,
        scl_stuck, ///< SCL stays low: a master cannot free it
        sda_stuck, ///< SDA is low after nine clocks or did not follow the STOP
    };

    void begin();
    /// @param scl,sda levels of the lines, half a clock after what pulls_scl() and pulls_sda() said was done.
    Result step(bool scl, bool sda);
    bool pulls_scl() const { return pulls_scl_; }
    bool pulls_sda() const { return pulls_sda_; }

private:
    enum class Phase : uint8_t { let_go, clock_low, clock_high, stop_low, stop_sda, stop_high, stop_end };
    static constexpr uint8_t clock_limit = 9;
    static constexpr uint8_t scl_timeout = 200; ///< half clocks that SCL may be held low

    void go(Phase phase, bool pull_scl, bool pull_sda);
    Result check_sda(bool sda);

    Phase phase_ = Phase::let_go;
    bool pulls_scl_ = false;
    bool pulls_sda_ = false;
    uint8_t clocks_ = 0;
    uint8_t waited_ = 0;
};

} // namespace omni
