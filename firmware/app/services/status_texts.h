// SPDX-License-Identifier: MIT
/// @file status_texts.h  STATUSTEXT on changes: safety state, faults, end of a trajectory, and limited setpoints.
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
    /// Report changes since the last call.
    void serve();
    void restart();
    /// Report active stops and sensor faults to a new peer on this link.
    void greet(size_t link);

private:
    /// A gyro's or floor odometry sensor's fault.
    struct SensorTrouble {
        const char *sensor;
        uint8_t cause; ///< GyroCause or FlowCause; 0: none
        const char *text;
        HexByte bytes[2]; ///< read and expected
    };
    void report_state(uint8_t state);
    void report_link_changes();
    void report_button();
    void report_read_back();
    void report_sensor(const SensorTrouble &trouble, uint8_t *reported);
    bool is_repetition_due(uint64_t &reported_us) const;
    void reset_sensor_reports(size_t link);
    void report_gyro();
    void report_flow();
    void report_failsafe();
    void report_stop_cause();
    void report_slowdown();
    void report_current_limit();

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
    uint64_t slowdown_reported_us_ = 0;      ///< 0: not yet
    uint64_t current_limit_reported_us_ = 0; ///< the same of currents
    bool read_back_reported_ = false;
    uint8_t gyro_reported_[Board::max_ports] = {}; ///< last cause reported on each link
    uint8_t flow_reported_[Board::max_ports] = {};
    bool button_reported_[Board::max_ports] = {};
};

} // namespace omni
