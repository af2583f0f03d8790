// SPDX-License-Identifier: MIT
/// @file flow_chip.h  A sensor of motion over the floor on the board: what every driver does, and what it says when it
/// cannot.
///
/// Motors do not depend on it: without readings the core counts the wheels alone and shows the warning `flow`.
#pragma once

#include <cstdint>

namespace omni {

/// Why there are no readings, or none to be trusted.
enum class FlowCause : uint8_t {
    none,      ///< it reads, or is still starting
    absent,    ///< nobody acknowledges its address
    bus,       ///< a line is held low, or a transfer takes too long
    wrong_id,  ///< another chip answers: FlowTrouble::seen is what its identity register says
    blind,     ///< it says that it does not see the floor: lifted, tilted, or a bad surface
    unplugged, ///< it says that a wheel of it is not connected
    broken,    ///< it says that a part of it has failed: FlowTrouble::seen is its status
    restarted, ///< it is getting ready in the middle of a drive: a dip of its supply
    jumped     ///< it has moved further than any robot does: it has restarted, or bits were lost on the wires
};

struct FlowTrouble {
    FlowCause cause = FlowCause::none;
    uint8_t seen = 0;   ///< with wrong_id and broken
    uint8_t wanted = 0; ///< what its identity register should say
};

class FlowChip {
public:
    /// From any context. @param wanted false: leave the bus alone and give no readings.
    virtual void use(bool wanted) = 0;
    /// Once per tick, from the tick; never waits. @param now_us robot clock.
    /// @param moved x, y [m] and turn [rad] since the reading before, in the sensor's axes of mid-way; left as they are
    /// where nothing is new. @param rests the robot has stood still for a while: a chip may calibrate its gyro.
    /// @return bits of omni_flow_tick_t::valid (omni/flow.h).
    virtual uint8_t read(uint64_t now_us, float *moved, bool rests) = 0;
    /// From any context.
    virtual FlowTrouble trouble() const = 0;

protected:
    ~FlowChip() = default;
};

} // namespace omni
