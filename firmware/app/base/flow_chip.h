// SPDX-License-Identifier: MIT
/// @file flow_chip.h  Driver interface of a floor odometry sensor (optical flow or dead wheels) and its fault causes.
///
/// Driving does not depend on it: without readings the core uses the wheels only and raises the warning `flow`.
#pragma once

#include <cstdint>

namespace omni {

/// Cause of missing or invalid readings.
enum class FlowCause : uint8_t {
    none,      ///< working, or still starting
    absent,    ///< no device acknowledges its address
    bus,       ///< a line is held low, or a transfer takes too long
    wrong_id,  ///< another chip responds: FlowTrouble::seen is its identity register
    blind,     ///< the chip reports that it does not see the floor: lifted, tilted, or an unsuitable surface
    unplugged, ///< the chip reports a disconnected dead wheel
    broken,    ///< the chip reports a hardware failure: FlowTrouble::seen is its status
    restarted, ///< the chip is initialising during a drive: supply brown-out
    jumped     ///< implausible displacement: restart of the chip, or bit errors
};

struct FlowTrouble {
    FlowCause cause = FlowCause::none;
    uint8_t seen = 0;   ///< with wrong_id and broken
    uint8_t wanted = 0; ///< expected value of the identity register
};

class FlowChip {
public:
    /// Enable or disable. Any context. @param wanted false: no bus access, no readings.
    virtual void use(bool wanted) = 0;
    /// Once per tick, from the tick; never waits. @param now_us robot clock.
    /// @param moved out: x, y [m] and turn [rad] since the previous reading, in the sensor's axes at mid-interval;
    /// unchanged without a new reading. @param rests the robot is at rest, so that the chip may calibrate its gyro.
    /// @return bits of omni_flow_tick_t::valid (omni/flow.h).
    virtual uint8_t read(uint64_t now_us, float *moved, bool rests) = 0;
    /// Current fault. Any context.
    virtual FlowTrouble trouble() const = 0;

protected:
    ~FlowChip() = default;
};

} // namespace omni
