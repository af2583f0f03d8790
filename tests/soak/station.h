// SPDX-License-Identifier: MIT
/// @file station.h  A ground station on two links of a robot in this process: USB, and a radio where everything is
/// signed.
#pragma once

#include <cstddef>
#include <cstdint>

#include "robot.h"

namespace soak {

using fuzz::Bytes;
using fuzz::Found;

constexpr size_t usb = 0;
constexpr size_t radio = 1;
constexpr size_t links = 2;

/// Talks and listens. Anything that a healthy robot does not say breaks a promise (check.h) and ends the process.
class Station final : public fuzz::Listener {
public:
    /// @param signing_time the calendar [10 us since 2015].
    Station(fuzz::Robot &robot, uint64_t signing_time);

    void heard(size_t port, const Found &frame) override;
    void host_ticked() override {}

    template <class Message>
    void send(size_t link, uint32_t id, const Message &message) {
        put(link, fuzz::frame_of(id, message, form_on(link)));
    }
    /// COMMAND_LONG; the robot must accept it within a second, see tick().
    void command(size_t link, uint16_t number, float first = 0.0f, float second = 0.0f, float third = 0.0f);
    void heartbeat(size_t link);
    /// @param name 16 characters at most.
    void set_parameter(size_t link, const char *name, float value);
    void set_key();
    void list_parameters(size_t link);
    /// Once per millisecond: the calendar goes on, commands that were not answered are noticed.
    void tick();
    /// The robot is expected to stop, and to say so.
    void expect_stop(bool expected) { stop_expected_ = expected; }

    bool waits() const { return waiting_ms_ != 0; }
    uint64_t signing_time() const { return signing_time_; }

    uint64_t frames[links] = {};
    uint64_t heartbeats[links] = {};
    uint64_t texts = 0;
    uint64_t acknowledged = 0;
    uint8_t state = 0; ///< MAV_STATE of the last heartbeat
    uint64_t parameters = 0;
    mavlink_omni_status_t status{};
    mavlink_omni_health_t health{};
    mavlink_omni_tracking_t tracking{};
    double signing_ahead_ms = 0.0; ///< the robot's signing clock beside the calendar
    uint64_t trackings = 0;

private:
    fuzz::Form form_on(size_t link) const;
    void put(size_t link, Bytes frame);
    void take_text(const Found &frame);
    void take_ack(const Found &frame);

    fuzz::Robot &robot_;
    uint64_t signing_time_;
    uint32_t sequence_ = 0;
    uint16_t waiting_for_ = 0;
    unsigned waiting_ms_ = 0;
    bool stop_expected_ = false;
};

} // namespace soak
