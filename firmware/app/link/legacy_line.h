// SPDX-License-Identifier: MIT
/// @file legacy_line.h  The set-point line of the original three-wheel robot: `x,y,theta[,vx,vy,wz]*` in ASCII, world
/// frame, m, rad, m/s, rad/s. Line ends and blanks around numbers don't matter.
///
/// It has no checksum, so the reader is strict. Anything a line cannot hold spoils everything up to the next `*`. A
/// MAVLink frame or silence in the middle of a line spoils it, too. Half a line looks like a shorter one, so a line
/// counts only if the one before held as many numbers.
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

/// Understand the text of one line, without its `*`. @return how many numbers it holds: 3 or 6, all finite; 0: no such
/// line.
size_t parse_legacy_line(const char *text, size_t length, LegacySetpoint *setpoint);

class LegacyLine final : public TextSink {
public:
    static constexpr size_t capacity = 80;

    /// Only while on are lines looked for; off forgets what was begun.
    void set_on(bool on);
    bool on_byte(uint8_t byte) override;
    void on_frame() override;
    /// Half a line, then silence: the rest will not come.
    void on_silence() { on_frame(); }
    /// The latest whole line since the last call: older ones are overtaken. @return false if there was none.
    bool take(LegacySetpoint *setpoint);
    /// Lines thrown away since boot.
    uint32_t refused() const { return refused_; }

private:
    void end_line();
    void spoil();

    char text_[capacity] = {};
    size_t length_ = 0;
    bool on_ = false;
    bool spoilt_ = false; ///< up to the next `*`
    size_t numbers_ = 0;  ///< in the line before
    bool waiting_ = false;
    LegacySetpoint latest_;
    uint32_t refused_ = 0;
};

} // namespace omni
