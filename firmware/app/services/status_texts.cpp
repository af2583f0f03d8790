// SPDX-License-Identifier: MIT
#include "app/services/status_texts.h"

#include <cmath>

#include "app/base/core.h"
#include "app/base/flash_code.h"

namespace omni {
namespace {

constexpr uint64_t slowed_interval_us = 5'000'000;

/// Two decimals: a text holds 50 characters.
float rounded_figure(float value) {
    return std::fabs(value) < 1e5f ? static_cast<float>(std::lround(value * 100.0f)) * 0.01f : value;
}

/// One byte in hexadecimal.
Text &add_byte(Text &text, uint8_t byte) {
    const char *digits = "0123456789ABCDEF";
    const char written[] = {'0', 'x', digits[byte >> 4], digits[byte & 0xF], '\0'};
    return text.add(written);
}

/// Cause and remedy of missing readings.
Text gyro_text(const GyroTrouble &trouble) {
    Text text;
    text.add("gyro: ");
    switch (trouble.cause) {
    case GyroCause::none:
        return text.add("readings again");
    case GyroCause::absent:
        return text.add("no chip answers; check power and wires");
    case GyroCause::bus:
        return text.add("a line of its bus is held low");
    case GyroCause::wrong_id:
        add_byte(text.add("WHO_AM_I is "), trouble.seen).add(", not ");
        return add_byte(text, trouble.wanted).add(": another chip");
    case GyroCause::lost:
        return text.add("lost its settings; check its power");
    case GyroCause::silent:
        return text.add("it answers but does not measure");
    case GyroCause::stuck:
        return text.add("the same reading 100 times");
    case GyroCause::saturated:
        return text.add("turning faster than its range");
    case GyroCause::noisy:
        return text.add("readings jump; check its wires");
    case GyroCause::configuration:
        return add_byte(text.add("configuration file refused, status "), trouble.seen);
    }
    return text;
}

Text flow_text(const FlowTrouble &trouble) {
    Text text;
    text.add("floor motion: ");
    switch (trouble.cause) {
    case FlowCause::none:
        return text.add("readings again");
    case FlowCause::absent:
        return text.add("no sensor answers; check its wires");
    case FlowCause::bus:
        return text.add("a line of its bus is held low");
    case FlowCause::wrong_id:
        add_byte(text.add("its identity is "), trouble.seen).add(", not ");
        return add_byte(text, trouble.wanted);
    case FlowCause::blind:
        return text.add("it does not see the floor");
    case FlowCause::unplugged:
        return text.add("a wheel of it is not connected");
    case FlowCause::broken:
        return add_byte(text.add("it reports a failure, status "), trouble.seen);
    case FlowCause::restarted:
        return text.add("it restarted; check its power");
    case FlowCause::jumped:
        return text.add("it jumped; check its power and wires");
    }
    return text;
}

bool is_velocity(uint8_t kind) {
    return kind == OMNI_SETPOINT_VELOCITY_BODY || kind == OMNI_SETPOINT_VELOCITY_WORLD;
}

} // namespace

void StatusTexts::restart() {
    state_ = OMNI_STATE_INIT;
    phase_ = OMNI_PHASE_NONE;
    history_ = 0;
    slowed_said_us_ = 0;
    limited_said_us_ = 0;
    read_back_said_ = false;
    for (size_t link = 0; link < links_.count(); ++link) {
        reset_sensor_reports(link);
    }
}

void StatusTexts::greet(size_t link) {
    button_said_[link] = false;
    reset_sensor_reports(link);
}

void StatusTexts::reset_sensor_reports(size_t link) {
    gyro_said_[link] = GyroCause::none;
    flow_said_[link] = FlowCause::none;
}

void StatusTexts::report_state(uint8_t state) {
    const bool alarm = state == OMNI_STATE_FAILSAFE || state == OMNI_STATE_ESTOP;
    const char *name = omni_safety_state_name(static_cast<omni_safety_state_t>(state));
    texts_.say(alarm ? MAV_SEVERITY_CRITICAL : MAV_SEVERITY_INFO, Text().add(name));
}

/// Report heartbeat losses. Of the station in command they stop the robot (link loss).
void StatusTexts::report_link_changes() {
    if (!robot_.armed()) {
        return;
    }
    for (size_t link = 0; link < links_.count(); ++link) {
        const bool commands = heartbeats_.stations.commander() == link;
        Text text;
        text.add("link ").add(static_cast<uint32_t>(link + 1));
        switch (heartbeats_.stations.watch(link, clock_.now_us)) {
        case Stations::Change::lost:
            texts_.say(MAV_SEVERITY_WARNING,
                       text.add(commands ? " lost: it had the command" : " lost: its ground station is silent"));
            break;
        case Stations::Change::back:
            texts_.say(MAV_SEVERITY_INFO, text.add(" is back"));
            break;
        default:
            break;
        }
    }
}

/// Report once per link and press, until the release of the e-stop.
void StatusTexts::report_button() {
    const bool pressed = button_.pressed();
    for (size_t link = 0; link < links_.count(); ++link) {
        if (pressed && !button_said_[link] && links_[link].connected()) {
            texts_.send_to(link, MAV_SEVERITY_CRITICAL, Text().add("stop button open: pressed, or its wire is cut"));
        }
        button_said_[link] = pressed && links_[link].connected();
    }
}

/// Report once at the start: the motors stay off from then on.
void StatusTexts::report_read_back() {
    const bool missing = robot_.latest().read_back_missing;
    if (missing && !read_back_said_) {
        texts_.say(MAV_SEVERITY_CRITICAL, Text().add("PWM chip: MODE1 does not read back as 0x20"));
    }
    read_back_said_ = missing;
}

/// Fault of the board's gyro, not of a simulated one. Once per link, also for peers that connect later.
OMNI_COLD void StatusTexts::report_gyro() {
    const GyroTrouble trouble = gyro_chip_->trouble();
    for (size_t link = 0; link < links_.count(); ++link) {
        if (is_new_cause(link, gyro_said_[link], trouble.cause)) {
            const bool over = trouble.cause == GyroCause::none;
            texts_.send_to(link, over ? MAV_SEVERITY_INFO : MAV_SEVERITY_WARNING, gyro_text(trouble));
        }
    }
}

/// Fault of the board's floor odometry sensor, reported in the same way.
OMNI_COLD void StatusTexts::report_flow() {
    const FlowTrouble trouble = flow_chip_->trouble();
    for (size_t link = 0; link < links_.count(); ++link) {
        if (is_new_cause(link, flow_said_[link], trouble.cause)) {
            const bool over = trouble.cause == FlowCause::none;
            texts_.send_to(link, over ? MAV_SEVERITY_INFO : MAV_SEVERITY_WARNING, flow_text(trouble));
        }
    }
}

/// Measured value and limit at a stop, for faults with a threshold.
OMNI_COLD void StatusTexts::report_stop_cause() {
    const omni_stop_t &stop = robot_.latest().outputs.stop;
    const uint32_t faults = robot_.latest().outputs.fault_history;
    const omni_limits_t &limits = parameters_.config().limits;
    if (stop.wheel != 0) {
        texts_.say(MAV_SEVERITY_CRITICAL, Text()
                                              .add("wheel ")
                                              .add(uint32_t{stop.wheel})
                                              .add(": given ")
                                              .add(rounded_figure(stop.voltage_V))
                                              .add(" V, turned at ")
                                              .add(rounded_figure(stop.wheel_rad_s))
                                              .add(" rad/s"));
    }
    if ((faults & OMNI_FAULT_MOTOR_HEAT) != 0) {
        texts_.say(MAV_SEVERITY_CRITICAL, Text()
                                              .add("motor ")
                                              .add(uint32_t{stop.wheel})
                                              .add(" too hot: ")
                                              .add(rounded_figure(stop.current_A))
                                              .add(" A, SAFE_I ")
                                              .add(parameters_.values()[OMNI_PARAM_SAFE_I])
                                              .add(" A"));
    }
    if ((faults & OMNI_FAULT_BATTERY) != 0) {
        texts_.say(MAV_SEVERITY_CRITICAL, Text()
                                              .add("supply ")
                                              .add(rounded_figure(stop.supply_V))
                                              .add(" V: BAT_V_MIN ")
                                              .add(limits.battery_min_V)
                                              .add(" V"));
    }
    if ((faults & OMNI_FAULT_TRACKING) != 0) {
        texts_.say(MAV_SEVERITY_CRITICAL, Text()
                                              .add("off by ")
                                              .add(rounded_figure(std::hypot(stop.error[0], stop.error[1])))
                                              .add(" m, ")
                                              .add(rounded_figure(std::fabs(stop.error[2])))
                                              .add(" rad: SAFE_ERR_XY ")
                                              .add(limits.error_m)
                                              .add(", TH ")
                                              .add(limits.error_rad));
    }
    if ((faults & OMNI_FAULT_POSITION) != 0) {
        texts_.say(MAV_SEVERITY_CRITICAL, Text().add("pose beyond LIM_POS ").add(limits.position_m).add(" m"));
    }
    if ((faults & OMNI_FAULT_COMMAND_LOSS) != 0) {
        texts_.say(MAV_SEVERITY_CRITICAL,
                   Text().add("no setpoint for SAFE_CMD_TO ").add(limits.command_timeout_s).add(" s"));
    }
    if ((faults & OMNI_FAULT_LINK_LOSS) != 0) {
        texts_.say(MAV_SEVERITY_CRITICAL,
                   Text().add("no heartbeat for SAFE_LINK_TO ").add(limits.link_timeout_s).add(" s"));
    }
}

void StatusTexts::report_failsafe() {
    texts_.say(MAV_SEVERITY_CRITICAL, fault_text("failsafe: ", robot_.latest().outputs.fault_history));
    if (state_ != OMNI_STATE_FAILSAFE) {
        report_stop_cause();
    }
}

/// Report a limited velocity setpoint, repeatedly while it lasts.
OMNI_COLD void StatusTexts::report_slowdown() {
    const omni_outputs_t &out = robot_.latest().outputs;
    const bool quiet = slowed_said_us_ != 0 && clock_.now_us - slowed_said_us_ < slowed_interval_us;
    if (!is_velocity(out.setpoint_kind) || out.velocity_limits == 0 || quiet) {
        return;
    }
    slowed_said_us_ = clock_.now_us > 0 ? clock_.now_us : 1;
    const omni_limits_t &limits = parameters_.config().limits;
    Text text;
    text.add("velocity scaled to ").add(static_cast<uint32_t>(out.velocity_scale * 100.0f)).add(" %: ");
    if ((out.velocity_limits & OMNI_LIMIT_TURN) != 0) {
        text.add("LIM_W ").add(rounded_figure(limits.turn_rad_s)).add(" rad/s");
    } else if ((out.velocity_limits & OMNI_LIMIT_SPEED) != 0) {
        text.add("LIM_V ").add(rounded_figure(limits.speed_m_s)).add(" m/s");
    } else {
        text.add("LIM_WHEEL ").add(rounded_figure(limits.wheel_rad_s)).add(" rad/s");
    }
    texts_.say(MAV_SEVERITY_NOTICE, text);
}

/// Report active current limiting, repeatedly while it lasts.
void StatusTexts::report_current_limit() {
    const omni_outputs_t &out = robot_.latest().outputs;
    const bool quiet = limited_said_us_ != 0 && clock_.now_us - limited_said_us_ < slowed_interval_us;
    if (!(out.current_reduction > 0.0f) || quiet) {
        return;
    }
    limited_said_us_ = clock_.now_us > 0 ? clock_.now_us : 1;
    texts_.say(MAV_SEVERITY_NOTICE, Text()
                                        .add("motors pushed at ")
                                        .add(static_cast<uint32_t>((1.0f - out.current_reduction) * 100.0f))
                                        .add(" %: LIM_I ")
                                        .add(rounded_figure(parameters_.values()[OMNI_PARAM_LIM_I]))
                                        .add(" A"));
}

void StatusTexts::serve() {
    report_link_changes();
    report_button();
    report_read_back();
    if (gyro_chip_ != nullptr && !robot_.hil()) {
        report_gyro();
    }
    if (flow_chip_ != nullptr && !robot_.hil()) {
        report_flow();
    }
    const omni_outputs_t &out = robot_.latest().outputs;
    if (out.state == OMNI_STATE_FAILSAFE && (out.state != state_ || (out.fault_history & ~history_) != 0)) {
        report_failsafe();
    } else if (out.state != state_) {
        report_state(out.state);
    }
    if (out.reference.phase == OMNI_PHASE_DONE && phase_ != OMNI_PHASE_DONE) {
        texts_.say(MAV_SEVERITY_INFO, Text().add("trajectory done"));
    }
    report_slowdown();
    report_current_limit();
    state_ = out.state;
    phase_ = static_cast<uint8_t>(out.reference.phase);
    history_ = out.fault_history;
}

} // namespace omni
