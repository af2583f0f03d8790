// SPDX-License-Identifier: MIT
/// @file legacy_line.h  Setpoint line of the original three-wheel robot: `x,y,theta[,vx,vy,wz]*` in ASCII, world
/// frame, m, rad, m/s, rad/s. Line ends and blanks around numbers are ignored.
///
/// The format has no checksum, so the parser is strict: an invalid byte, a MAVLink frame or a silence discards
/// everything up to the next `*`. A truncated line looks like a shorter one, so a line is accepted only if the previous
/// one had as many numbers.
#pragma once

#include <cstddef>
#include <cstdint>

#include "app/link/codec.h"
#include "omni/types.h"

namespace omni {

struct LegacySetpoint {
    omni_pose_t pose{};
    omni_twist_t rate{}; ///< 0 if the line has three numbers
};

/// Parse one line, without its `*`. @return number of finite numbers: 3 or 6; 0: invalid.
size_t parse_legacy_line(const char *text, size_t length, LegacySetpoint *setpoint);

class LegacyLine final : public TextSink {
public:
    static constexpr size_t capacity = 80;

    /// Enable or disable the parser; disabling discards an incomplete line.
    void set_on(bool on);
    bool on_byte(uint8_t byte) override;
    void on_frame() override;
    /// Discard an incomplete line after a silence.
    void on_silence() { on_frame(); }
    /// Get the latest complete line since the last call. @return false: none.
    bool take(LegacySetpoint *setpoint);
    /// Rejected lines since boot.
    uint32_t refused() const { return refused_; }

private:
    void end_line();
    void spoil();

    char text_[capacity] = {};
    size_t length_ = 0;
    bool on_ = false;
    bool calibration_disturbed_ = false; ///< discard up to the next `*`
    size_t numbers_ = 0;                 ///< count in the previous line
    bool waiting_ = false;
    LegacySetpoint latest_;
    uint32_t refused_ = 0;
};

} // namespace omni
