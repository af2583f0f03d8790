// SPDX-License-Identifier: MIT
#include "app/services/status_texts.h"

#include <algorithm>
#include <cmath>
#include <iterator>

#include "app/base/core.h"
#include "app/base/flash_code.h"

namespace omni {
namespace {

constexpr uint64_t repetition_us = 5'000'000;

/// Two decimals: a text holds 50 characters.
float rounded_figure(float value) {
    return std::fabs(value) < 1e5f ? static_cast<float>(std::lround(value * 100.0f)) * 0.01f : value;
}

/// Texts by cause. A `#` stands for the byte that was read, the second one for the expected byte.
constexpr const char *gyro_texts[] = {
    "readings again",                         // none
    "no chip answers; check power and wires", // absent
    "a line of its bus is held low",          // bus
    "WHO_AM_I is #, not #: another chip",     // wrong_id
    "lost its settings; check its power",     // lost
    "it answers but does not measure",        // silent
    "the same reading 100 times",             // stuck
    "turning faster than its range",          // saturated
    "readings jump; check its wires",         // noisy
    "configuration file refused, status #",   // configuration
};
constexpr const char *flow_texts[] = {
    "readings again",                       // none
    "no sensor answers; check its wires",   // absent
    "a line of its bus is held low",        // bus
    "its identity is #, not #",             // wrong_id
    "it does not see the floor",            // blind
    "a wheel of it is not connected",       // unplugged
    "it reports a failure, status #",       // broken
    "it restarted; check its power",        // restarted
    "it jumped; check its power and wires", // jumped
};
static_assert(std::size(gyro_texts) == static_cast<size_t>(GyroCause::configuration) + 1, "one text per cause");
static_assert(std::size(flow_texts) == static_cast<size_t>(FlowCause::jumped) + 1, "one text per cause");

bool is_velocity(uint8_t kind) {
    return kind == OMNI_SETPOINT_VELOCITY_BODY || kind == OMNI_SETPOINT_VELOCITY_WORLD;
}

} // namespace

void StatusTexts::restart() {
    state_ = OMNI_STATE_INIT;
    phase_ = OMNI_PHASE_NONE;
    history_ = 0;
    slowdown_reported_us_ = 0;
    current_limit_reported_us_ = 0;
    read_back_reported_ = false;
    for (size_t link = 0; link < links_.count(); ++link) {
        reset_sensor_reports(link);
    }
}

void StatusTexts::greet(size_t link) {
    button_reported_[link] = false;
    reset_sensor_reports(link);
}

void StatusTexts::reset_sensor_reports(size_t link) {
    gyro_reported_[link] = 0;
    flow_reported_[link] = 0;
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
        const float number[] = {static_cast<float>(link + 1)};
        const Stations::Change change = heartbeats_.stations.watch(link, clock_.now_us);
        if (change == Stations::Change::lost) {
            texts_.say(MAV_SEVERITY_WARNING, Text().fill(commands ? "link # lost: it had the command"
                                                                  : "link # lost: its ground station is silent",
                                                         number));
        } else if (change == Stations::Change::back) {
            texts_.say(MAV_SEVERITY_INFO, Text().fill("link # is back", number));
        }
    }
}

/// Report once per link and press, until the release of the e-stop.
OMNI_COLD void StatusTexts::report_button() {
    const bool pressed = button_.pressed();
    for (size_t link = 0; link < links_.count(); ++link) {
        if (pressed && !button_reported_[link] && links_[link].connected()) {
            texts_.send_to(link, MAV_SEVERITY_CRITICAL, Text().add("stop button open: pressed, or its wire is cut"));
        }
        button_reported_[link] = pressed && links_[link].connected();
    }
}

/// Report once at the start: the motors stay off from then on.
void StatusTexts::report_read_back() {
    const bool missing = robot_.latest().read_back_missing;
    if (missing && !read_back_reported_) {
        texts_.say(MAV_SEVERITY_CRITICAL, Text().add("PWM chip: MODE1 does not read back as 0x20"));
    }
    read_back_reported_ = missing;
}

/// Report a sensor's fault or its end, once per link, also to peers that connect later.
OMNI_COLD void StatusTexts::report_sensor(const SensorTrouble &trouble, uint8_t *reported) {
    for (size_t link = 0; link < links_.count(); ++link) {
        if (trouble.cause != reported[link] && links_[link].connected()) {
            reported[link] = trouble.cause;
            texts_.send_to(link, trouble.cause == 0 ? MAV_SEVERITY_INFO : MAV_SEVERITY_WARNING,
                           Text().add(trouble.sensor).fill(trouble.text, trouble.bytes));
        }
    }
}

/// Faults of the board's own sensors, not of simulated ones.
OMNI_COLD void StatusTexts::report_gyro() {
    if (gyro_chip_ != nullptr && !robot_.hil()) {
        const GyroTrouble trouble = gyro_chip_->trouble();
        const auto cause = static_cast<uint8_t>(trouble.cause);
        report_sensor({"gyro: ", cause, gyro_texts[cause], {{trouble.seen}, {trouble.wanted}}}, gyro_reported_);
    }
}

OMNI_COLD void StatusTexts::report_flow() {
    if (flow_chip_ != nullptr && !robot_.hil()) {
        const FlowTrouble trouble = flow_chip_->trouble();
        const auto cause = static_cast<uint8_t>(trouble.cause);
        report_sensor({"floor motion: ", cause, flow_texts[cause], {{trouble.seen}, {trouble.wanted}}}, flow_reported_);
    }
}

/// Measured value and limit at a stop, for faults with a threshold.
OMNI_COLD void StatusTexts::report_stop_cause() {
    const omni_stop_t &stop = robot_.latest().outputs.stop;
    const uint32_t faults = robot_.latest().outputs.fault_history;
    const omni_limits_t &limits = parameters_.config().limits;
    const float wheel = stop.wheel;
    const float error_m = rounded_figure(std::hypot(stop.error[0], stop.error[1]));
    const float error_rad = rounded_figure(std::fabs(stop.error[2]));
    const struct {
        bool applies;
        const char *text;
        float figures[4];
    } causes[] = {
        {wheel != 0.0f,
         "wheel #: given # V, turned at # rad/s",
         {wheel, rounded_figure(stop.voltage_V), rounded_figure(stop.wheel_rad_s)}},
        {(faults & OMNI_FAULT_MOTOR_HEAT) != 0,
         "motor # too hot: # A, SAFE_I # A",
         {wheel, rounded_figure(stop.current_A), parameters_.values()[OMNI_PARAM_SAFE_I]}},
        {(faults & OMNI_FAULT_BATTERY) != 0,
         "supply # V: BAT_V_MIN # V",
         {rounded_figure(stop.supply_V), limits.battery_min_V}},
        {(faults & OMNI_FAULT_TRACKING) != 0,
         "off by # m, # rad: SAFE_ERR_XY #, TH #",
         {error_m, error_rad, limits.error_m, limits.error_rad}},
        {(faults & OMNI_FAULT_POSITION) != 0, "pose beyond LIM_POS # m", {limits.position_m}},
        {(faults & OMNI_FAULT_COMMAND_LOSS) != 0, "no setpoint for SAFE_CMD_TO # s", {limits.command_timeout_s}},
        {(faults & OMNI_FAULT_LINK_LOSS) != 0, "no heartbeat for SAFE_LINK_TO # s", {limits.link_timeout_s}},
    };
    for (const auto &cause : causes) {
        if (cause.applies) {
            texts_.say(MAV_SEVERITY_CRITICAL, Text().fill(cause.text, cause.figures));
        }
    }
}

void StatusTexts::report_failsafe() {
    texts_.say(MAV_SEVERITY_CRITICAL, fault_text("failsafe: ", robot_.latest().outputs.fault_history));
    if (state_ != OMNI_STATE_FAILSAFE) {
        report_stop_cause();
    }
}

/// Is the text about a lasting state due again? @param reported_us time of the last one, updated; 0: none.
bool StatusTexts::is_repetition_due(uint64_t &reported_us) const {
    if (reported_us != 0 && clock_.now_us - reported_us < repetition_us) {
        return false;
    }
    reported_us = std::max(clock_.now_us, uint64_t{1});
    return true;
}

/// Report a limited velocity setpoint, repeatedly while it lasts.
OMNI_COLD void StatusTexts::report_slowdown() {
    const omni_outputs_t &out = robot_.latest().outputs;
    if (!is_velocity(out.setpoint_kind) || out.velocity_limits == 0 || !is_repetition_due(slowdown_reported_us_)) {
        return;
    }
    const omni_limits_t &limits = parameters_.config().limits;
    const struct {
        uint32_t limit;
        const char *text;
        float value;
    } causes[] = {
        {OMNI_LIMIT_TURN, "velocity scaled to # %: LIM_W # rad/s", limits.turn_rad_s},
        {OMNI_LIMIT_SPEED, "velocity scaled to # %: LIM_V # m/s", limits.speed_m_s},
        {UINT32_MAX, "velocity scaled to # %: LIM_WHEEL # rad/s", limits.wheel_rad_s},
    };
    const auto *cause = std::begin(causes);
    while ((out.velocity_limits & cause->limit) == 0) {
        ++cause;
    }
    const float figures[] = {std::trunc(out.velocity_scale * 100.0f), rounded_figure(cause->value)};
    texts_.say(MAV_SEVERITY_NOTICE, Text().fill(cause->text, figures));
}

/// Report active current limiting, repeatedly while it lasts.
void StatusTexts::report_current_limit() {
    const omni_outputs_t &out = robot_.latest().outputs;
    if (out.current_reduction > 0.0f && is_repetition_due(current_limit_reported_us_)) {
        const float figures[] = {std::trunc((1.0f - out.current_reduction) * 100.0f),
                                 rounded_figure(parameters_.values()[OMNI_PARAM_LIM_I])};
        texts_.say(MAV_SEVERITY_NOTICE, Text().fill("motors pushed at # %: LIM_I # A", figures));
    }
}

void StatusTexts::serve() {
    report_link_changes();
    report_button();
    report_read_back();
    report_gyro();
    report_flow();
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
