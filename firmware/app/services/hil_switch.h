// SPDX-License-Identifier: MIT
/// @file hil_switch.h  Interface to enter and leave hardware-in-the-loop; implemented by the application.
#pragma once

#include <cstddef>
#include <cstdint>

namespace omni {

class HilSwitch {
public:
    /// @return MAV_RESULT
    virtual uint8_t switch_hil(bool enable, size_t link) = 0;
    /// Hardware-in-the-loop, but no sensor message received yet.
    virtual bool hil_silent() const = 0;

protected:
    ~HilSwitch() = default;
};

} // namespace omni
