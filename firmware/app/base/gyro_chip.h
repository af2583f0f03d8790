// SPDX-License-Identifier: MIT
/// @file gyro_chip.h  A gyro on the board: what every chip's driver does, and what it says when it cannot.
///
/// Motors do not depend on it: without readings the core counts the wheels alone and shows the warning `gyro`.
#pragma once

#include <cstdint>

namespace omni {

/// Why there are no readings, or none to be trusted.
enum class GyroCause : uint8_t {
    none,         ///< it reads, or is still starting
    absent,       ///< nobody acknowledges its address
    bus,          ///< a line is held low, or a transfer takes too long
    wrong_id,     ///< another chip answers: GyroTrouble::seen is what its identity register says
    lost,         ///< it has lost its settings: a reset of its own, or a dip of its supply
    silent,       ///< it answers but does not measure
    stuck,        ///< the same reading again and again
    saturated,    ///< the robot turns faster than its range
    noisy,        ///< readings jump as nothing can turn: bits are lost on the wires
    configuration ///< it does not take its configuration file: GyroTrouble::seen is its status
};

struct GyroTrouble {
    GyroCause cause = GyroCause::none;
    uint8_t seen = 0;   ///< with wrong_id and configuration
    uint8_t wanted = 0; ///< what the chip's identity register should say
};

class GyroChip {
public:
    /// From any context. @param axis GYRO_AXIS; 0: leave the bus alone and give no readings.
    virtual void use_axis(int8_t axis) = 0;
    /// Once per tick, from the tick; never waits. @param now_us robot clock.
    /// @param rad_s rates about the chip's x, y, z [rad/s]; left as they are where nothing is new.
    /// @return bit per axis: new.
    virtual uint8_t read(uint64_t now_us, float *rad_s) = 0;
    /// From any context.
    virtual GyroTrouble trouble() const = 0;

protected:
    ~GyroChip() = default;
};

} // namespace omni
