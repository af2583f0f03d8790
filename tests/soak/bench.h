// SPDX-License-Identifier: MIT
/// @file bench.h  The firmware, the simulated world at its pins and a ground station, a millisecond at a time in this
/// process.
#pragma once

#include <cstdint>

#include "robot.h"
#include "station.h"

extern "C" {
#include "hil_sim/world.h"
}

namespace soak {

/// What goes on from hour to hour, and from one process to the next: plain data.
struct State {
    uint64_t hour = 0;
    uint64_t signing_time = 0; ///< the station's calendar [10 us since 2015]
    uint8_t storage[fuzz::FakeStorage::capacity] = {};
    hil_world_t world = {};
};

class Bench {
public:
    /// @param robot name of a built-in robot. @param state its memory is the robot's, its world goes on.
    Bench(const char *robot, const State &state);

    /// One millisecond: world, robot, station, pose fixes over both links, heartbeats.
    void tick();
    void run(double seconds);
    /// Send a command and wait until it was accepted.
    void command(size_t link, uint16_t number, float first = 0.0f, float second = 0.0f, float third = 0.0f);
    /// Pose, trajectory, arm: over the link that is in command from then on. Waits until the robot says that it is
    /// armed.
    void start(size_t link);
    void disarm(size_t link);
    /// Clock and stopwatch on by so much, as if the robot had rested for so long.
    void jump(uint64_t us);
    State state(uint64_t hour) const;

    bool armed() const { return station.state == MAV_STATE_ACTIVE; }
    uint64_t ticks() const { return ticks_; }
    double distance_m() const { return distance_m_; }

    fuzz::Robot robot;
    Station station;
    bool beats = true;        ///< heartbeats are sent
    double error_m_max = 0.0; ///< of the estimate, from a second after start() on

private:
    void actuate();
    void pass_fix(const hil_sensors_t &sensors);
    void compare();

    hil_world_t world_;
    uint64_t ticks_ = 0;
    uint64_t compare_from_ = UINT64_MAX;
    uint64_t fixes_ = 0;
    uint64_t trackings_ = 0;
    double distance_m_ = 0.0;
};

} // namespace soak
