// SPDX-License-Identifier: MIT
/// @file burst_log.h  Starts bursts, and serves a recorded one by MAVLink's log protocol (LOG_REQUEST_*).
///
/// The newest burst is log number 0. The client requests lost pieces again. Data have the lowest priority, after
/// telemetry and acknowledgements.
#pragma once

#include "app/services/parameters.h"
#include "app/services/robot_state.h"

namespace omni {

class BurstLog {
public:
    BurstLog(const Board &board, Links &links, Texts &texts, const RobotState &robot, ControlLoop &control,
             const Parameters &parameters)
        : links_(links), texts_(texts), robot_(robot), control_(control), parameters_(parameters) {
        control.burst.attach(board.burst_memory, board.burst_bytes);
    }

    /// MAV_CMD_OMNI_BURST. @param wait start with the next excitation. @return MAV_RESULT
    uint8_t start(float duration_s, float every, float signals, float wheels, float wait);
    // Messages of the log protocol.
    void on_request_list(const Sender &sender);
    void on_request_data(const Frame &frame, const Sender &sender);
    void on_request_end(const Sender &sender) { forget(sender.link); }
    void on_erase(const Sender &sender);
    /// Send requested data as far as the links accept it.
    void serve();
    /// Cancel the transfer on a link with a new peer.
    void forget(size_t link) { streams_[link] = {}; }

private:
    /// Remaining transfer on a link.
    struct Stream {
        uint32_t next = 0;
        uint32_t end = 0;
        bool active = false;
    };
    uint8_t refuse(const Text &why);
    bool plan(float duration_s, float every, float signals, float wheels, BurstPlan &plan) const;
    bool send_piece(size_t link, Stream &stream);

    Links &links_;
    Texts &texts_;
    const RobotState &robot_;
    ControlLoop &control_;
    const Parameters &parameters_;
    Stream streams_[Board::max_ports];
};

} // namespace omni
