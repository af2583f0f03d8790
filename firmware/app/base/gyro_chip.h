// SPDX-License-Identifier: MIT
/// @file gyro_chip.h  Driver interface of a gyro and its fault causes.
///
/// Driving does not depend on it: without readings the core uses the wheels only and raises the warning `gyro`.
#pragma once

#include <cstdint>

namespace omni {

/// Cause of missing or invalid readings.
enum class GyroCause : uint8_t {
    none,         ///< working, or still starting
    absent,       ///< no device acknowledges its address
    bus,          ///< a line is held low, or a transfer takes too long
    wrong_id,     ///< another chip responds: GyroTrouble::seen is its identity register
    lost,         ///< it has lost its settings: reset or supply brown-out
    silent,       ///< it responds but gives no new data
    stuck,        ///< the same reading repeatedly
    saturated,    ///< rate beyond its range
    noisy,        ///< implausible jumps between readings: bit errors on the bus
    configuration ///< it rejects its configuration file: GyroTrouble::seen is its status
};

struct GyroTrouble {
    GyroCause cause = GyroCause::none;
    uint8_t seen = 0;   ///< with wrong_id and configuration
    uint8_t wanted = 0; ///< expected value of the identity register
};

class GyroChip {
public:
    /// Select the axis. Any context. @param axis GYRO_AXIS; 0: no bus access, no readings.
    virtual void use_axis(int8_t axis) = 0;
    /// Once per tick, from the tick; never waits. @param now_us robot clock.
    /// @param rad_s out: rates about the chip's x, y, z [rad/s]; unchanged without a new reading.
    /// @return bit per axis: new reading.
    virtual uint8_t read(uint64_t now_us, float *rad_s) = 0;
    /// Current fault. Any context.
    virtual GyroTrouble trouble() const = 0;

protected:
    ~GyroChip() = default;
};

} // namespace omni
