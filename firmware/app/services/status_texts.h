// SPDX-License-Identifier: MIT
/// @file status_texts.h  Says what changes: safety state, faults, end of a trajectory. Also what a limit makes slower
/// than asked.
#pragma once

#include "app/services/button_watch.h"
#include "app/services/heartbeats.h"
#include "app/services/parameters.h"
#include "app/services/robot_state.h"

namespace omni {

class StatusTexts {
public:
    StatusTexts(const Links &links, Texts &texts, const RobotClock &clock, const RobotState &robot,
                Heartbeats &heartbeats, const ButtonWatch &button, const Parameters &parameters,
                const GyroChip *gyro_chip, const FlowChip *flow_chip)
        : links_(links), texts_(texts), clock_(clock), robot_(robot), heartbeats_(heartbeats), button_(button),
          parameters_(parameters), gyro_chip_(gyro_chip), flow_chip_(flow_chip) {}
    /// Compare the latest tick with what was said last.
    void serve();
    void restart();
    /// Somebody has come to this link: what stops the robot, or is wrong with a sensor, is news there.
    void greet(size_t link);

private:
    void say_state(uint8_t state);
    void say_links();
    void say_button();
    void say_read_back();
    /// Whether `cause` is another one than was said on this link, where somebody listens; it counts as said then.
    template <typename Cause>
    bool is_news(size_t link, Cause &said, Cause cause) const {
        const bool news = cause != said && links_[link].connected();
        said = news ? cause : said;
        return news;
    }
    void forget_sensors(size_t link);
    void say_gyro();
    void say_flow();
    void say_failsafe();
    void say_cause();
    void say_slowed();
    void say_limited();

    const Links &links_;
    Texts &texts_;
    const RobotClock &clock_;
    const RobotState &robot_;
    Heartbeats &heartbeats_;
    const ButtonWatch &button_;
    const Parameters &parameters_;
    const GyroChip *gyro_chip_; ///< nullptr: none
    const FlowChip *flow_chip_; ///< nullptr: none
    uint8_t state_ = OMNI_STATE_INIT;
    uint8_t phase_ = OMNI_PHASE_NONE;
    uint32_t history_ = 0;
    uint64_t slowed_said_us_ = 0;  ///< 0: not yet
    uint64_t limited_said_us_ = 0; ///< the same of currents
    bool read_back_said_ = false;
    GyroCause gyro_said_[Board::max_ports] = {};
    FlowCause flow_said_[Board::max_ports] = {};
    bool button_said_[Board::max_ports] = {};
};

} // namespace omni
