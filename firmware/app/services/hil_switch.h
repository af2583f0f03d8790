// SPDX-License-Identifier: MIT
/// @file hil_switch.h  Enters and leaves host-in-the-loop; the application is one.
#pragma once

#include <cstddef>
#include <cstdint>

namespace omni {

class HilSwitch {
public:
    /// @return MAV_RESULT
    virtual uint8_t switch_hil(bool enable, size_t link) = 0;
    /// Host-in-the-loop without a sensor message yet.
    virtual bool hil_silent() const = 0;

protected:
    ~HilSwitch() = default;
};

} // namespace omni
