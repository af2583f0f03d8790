// SPDX-License-Identifier: MIT
#include "app/commands.h"

#include <algorithm>
#include <cstring>

#include "app/core.h"
#include "app/crc32.h"
#include "app/reports.h"
#include "app/stops.h"

namespace omni {
namespace {

/// Command numbers that pymavlink's common.xml knows, under short names.
enum : uint16_t {
    cmd_do_set_mode = MAV_CMD_DO_SET_MODE,
    cmd_terminate = MAV_CMD_DO_FLIGHTTERMINATION,
    cmd_storage = MAV_CMD_PREFLIGHT_STORAGE,
    cmd_reboot = MAV_CMD_PREFLIGHT_REBOOT_SHUTDOWN,
    cmd_arm = MAV_CMD_COMPONENT_ARM_DISARM,
    cmd_interval = MAV_CMD_SET_MESSAGE_INTERVAL,
    cmd_request_message = MAV_CMD_REQUEST_MESSAGE,
    cmd_capabilities = MAV_CMD_REQUEST_AUTOPILOT_CAPABILITIES,
};

/// Before the first tick, or while the motor driver's first setup is under way without any error.
bool starting_up(const TickReport &latest) {
    const uint32_t others = latest.arming_faults & ~static_cast<uint32_t>(OMNI_FAULT_LINK_LOSS);
    const bool driver_not_yet = others == OMNI_FAULT_DRIVER && latest.i2c_errors == 0;
    return latest.outputs.state == OMNI_STATE_INIT || driver_not_yet;
}

/// A report may be waiting, and a tick may be under way that has taken its requests before: the third one has seen the command.
constexpr uint8_t reports_until_known = 3;

/// Of a COMMAND_LONG or COMMAND_INT: seven numbers of four bytes come first in both.
template <class Message>
int32_t receipt_of(const Message &message, bool numbered) {
    if (!numbered) {
        return 0;
    }
    uint8_t bytes[7 * sizeof(float)];
    std::memcpy(bytes, &message, sizeof bytes);
    const uint32_t crc = crc32(bytes, sizeof bytes);
    int32_t receipt = 0;
    std::memcpy(&receipt, &crc, sizeof receipt);
    return receipt;
}

uint8_t queued(bool done) {
    return done ? MAV_RESULT_ACCEPTED : MAV_RESULT_TEMPORARILY_REJECTED;
}

} // namespace

void Commands::on_command_long(const Frame &frame, const Sender &sender) {
    const auto message = frame.as<mavlink_command_long_t>();
    handle({message.command,
            {message.param1, message.param2, message.param3, message.param4},
            sender,
            receipt_of(message, message.param5 != 0.0f),
            is_stop(frame)});
}

void Commands::on_command_int(const Frame &frame, const Sender &sender) {
    const auto message = frame.as<mavlink_command_int_t>();
    handle({message.command,
            {message.param1, message.param2, message.param3, message.param4},
            sender,
            receipt_of(message, message.x != 0),
            is_stop(frame)});
}

void Commands::on_set_mode(const Frame &frame, const Sender &sender) {
    const auto mode = static_cast<float>(frame.as<mavlink_set_mode_t>().custom_mode);
    if (set_mode(mode) == MAV_RESULT_ACCEPTED) {
        shared_.commanded(sender.link);
    }
}

void Commands::handle(const Command &command) {
    mavlink_command_ack_t ack{};
    ack.command = command.id;
    ack.result = run(command);
    ack.result_param2 = command.receipt;
    ack.target_system = command.sender.system;
    ack.target_component = command.sender.component;
    shared_.links[command.sender.link].send(MAVLINK_MSG_ID_COMMAND_ACK, ack, command.stops ? Priority::stop : Priority::reply);
}

/// Commands that say where to go.
uint8_t Commands::run_motion(const Command &command) {
    const float *p = command.param;
    uint8_t result = MAV_RESULT_UNSUPPORTED;
    if (command.id == cmd_do_set_mode) {
        result = set_mode(p[1]);
    } else if (command.id == MAV_CMD_OMNI_TRAJECTORY_START) {
        result = trajectories_.start(p[0], p[1]);
    } else if (command.id == MAV_CMD_OMNI_TRAJECTORY_STOP) {
        result = trajectories_.stop();
    }
    if (result == MAV_RESULT_ACCEPTED) {
        shared_.commanded(command.sender.link);
    }
    return result;
}

uint8_t Commands::run(const Command &command) {
    const float *p = command.param;
    switch (command.id) {
    case cmd_arm:
        return arm_disarm(p[0], command.sender.link);
    case cmd_do_set_mode:
    case MAV_CMD_OMNI_TRAJECTORY_START:
    case MAV_CMD_OMNI_TRAJECTORY_STOP:
        return run_motion(command);
    case cmd_terminate:
        return p[0] > 0.5f ? estop() : static_cast<uint8_t>(MAV_RESULT_DENIED);
    case cmd_storage:
        return parameters_.storage_command(p[0]);
    case cmd_reboot:
        return reboot(p[0]);
    case cmd_interval:
        return telemetry_.set_interval(command.sender.link, p[0], p[1], parameters_.values());
    case cmd_request_message:
        return request_message(command.sender.link, p[0]);
    case cmd_capabilities:
        return request_message(command.sender.link, MAVLINK_MSG_ID_AUTOPILOT_VERSION);
    default:
        return run_own(command);
    }
}

uint8_t Commands::run_own(const Command &command) {
    const float *p = command.param;
    switch (command.id) {
    case MAV_CMD_OMNI_HIL:
        return hil_command(p[0], command.sender.link);
    case MAV_CMD_OMNI_SET_POSE:
        return set_pose({p[0], p[1], p[2]});
    case MAV_CMD_OMNI_WAYPOINT:
        return trajectories_.set_waypoint(p[0], {p[1], p[2], p[3]});
    case MAV_CMD_OMNI_ESTOP:
        return estop_command(p[0]);
    case MAV_CMD_OMNI_I2C_SCAN:
        return scan_i2c(command.sender);
    case MAV_CMD_OMNI_OE_TEST:
        return test_pin(p[0], p[1]);
    default:
        return MAV_RESULT_UNSUPPORTED;
    }
}

uint8_t Commands::arm_disarm(float wanted, size_t link) {
    if (wanted == 1.0f) {
        return arm(link);
    }
    return wanted == 0.0f ? disarm() : static_cast<uint8_t>(MAV_RESULT_DENIED);
}

/// Who arms a robot without the pin should know what that means. Once is enough.
void Commands::warn_of_missing_pin() {
    if (!pin_said_ && !shared_.hil && !shared_.board.output_enable->wired()) {
        pin_said_ = true;
        shared_.say(MAV_SEVERITY_NOTICE, Text().add("no output-enable pin: a dead bus cannot be stopped"));
    }
}

uint8_t Commands::arm(size_t link) {
    const uint8_t state = shared_.latest.outputs.state;
    if (shared_.reboot) {
        shared_.refuse(MAV_SEVERITY_WARNING, Text().add("cannot arm: rebooting"));
        return MAV_RESULT_DENIED;
    }
    if (shared_.stopping > 0 && (state == OMNI_STATE_ARMED || state == OMNI_STATE_FAILSAFE || state == OMNI_STATE_DISARMED)) {
        return MAV_RESULT_TEMPORARILY_REJECTED; // the stop asked for has not been reported yet: in one tick it would win
    }
    if (state == OMNI_STATE_ARMED) {
        shared_.commanded(link);
        return MAV_RESULT_ACCEPTED;
    }
    if (hil_.hil_silent()) {
        shared_.refuse(MAV_SEVERITY_WARNING, Text().add("cannot arm: no OMNI_HIL_SENSORS yet"));
        return MAV_RESULT_TEMPORARILY_REJECTED;
    }
    if (shared_.i2c_scanning) {
        shared_.refuse(MAV_SEVERITY_NOTICE, Text().add("cannot arm yet: I2C scan"));
        return MAV_RESULT_TEMPORARILY_REJECTED;
    }
    if (starting_up(shared_.latest)) {
        shared_.refuse(MAV_SEVERITY_NOTICE, Text().add("cannot arm yet: starting up"));
        return MAV_RESULT_TEMPORARILY_REJECTED;
    }
    if (state != OMNI_STATE_DISARMED) {
        const char *name = omni_safety_state_name(static_cast<omni_safety_state_t>(state));
        const char *way_out = state == OMNI_STATE_ESTOP ? " (release it first)" : " (disarm first)";
        shared_.refuse(MAV_SEVERITY_WARNING, Text().add("cannot arm: ").add(name).add(way_out));
        return MAV_RESULT_DENIED;
    }
    const uint32_t faults = shared_.latest.arming_faults & ~static_cast<uint32_t>(OMNI_FAULT_LINK_LOSS);
    if (faults != 0) {
        shared_.refuse(MAV_SEVERITY_WARNING, fault_text("cannot arm: ", faults));
        return MAV_RESULT_DENIED;
    }
    // Whoever arms is there: the command counts as a heartbeat.
    shared_.stations.take_command(link);
    if (!shared_.signing.store_for_drive()) {
        shared_.say(MAV_SEVERITY_ERROR, Text().add("the memory failed: signing time not stored"));
    }
    shared_.heartbeat(link);
    if (!shared_.control.request_event(OMNI_EVENT_ARM)) {
        return MAV_RESULT_TEMPORARILY_REJECTED;
    }
    shared_.arming = reports_until_known;
    warn_of_missing_pin();
    trajectories_.on_arm();
    return MAV_RESULT_ACCEPTED;
}

uint8_t Commands::stop(uint32_t event) {
    shared_.arming = 0;
    trajectories_.on_disarm();
    shared_.control.plans.withdraw();
    shared_.control.stop(event);
    shared_.stopping = reports_until_known;
    return MAV_RESULT_ACCEPTED;
}

/// Always possible, in every state; it needs no force (param2 = 21196) and does not mind it.
uint8_t Commands::disarm() {
    return stop(OMNI_EVENT_DISARM);
}

uint8_t Commands::estop() {
    return stop(OMNI_EVENT_ESTOP);
}

/// Only a clear "release" releases; whatever else was meant, stopping is the safe reading.
uint8_t Commands::estop_command(float stop) {
    return stop == 0.0f ? clear_estop() : estop();
}

uint8_t Commands::hil_command(float enable, size_t link) {
    if (enable != 0.0f && enable != 1.0f) {
        return MAV_RESULT_DENIED;
    }
    return hil_.switch_hil(enable == 1.0f, link);
}

uint8_t Commands::clear_estop() {
    if (shared_.disarming()) {
        return MAV_RESULT_TEMPORARILY_REJECTED; // in one tick with the stop it would lose
    }
    if (shared_.armed()) {
        shared_.refuse(MAV_SEVERITY_WARNING, Text().add("there is no emergency stop to release"));
        return MAV_RESULT_DENIED;
    }
    if (shared_.button_open()) {
        shared_.refuse(MAV_SEVERITY_WARNING, Text().add("not released: the stop button is still open"));
        return MAV_RESULT_DENIED;
    }
    if (shared_.control.stopping(OMNI_EVENT_ESTOP)) {
        return MAV_RESULT_TEMPORARILY_REJECTED; // in one tick with the stop it would lose
    }
    shared_.button_pressed.store(false, std::memory_order_relaxed);
    return queued(shared_.control.request_event(OMNI_EVENT_ESTOP_CLEAR));
}

uint8_t Commands::set_mode(float mode) {
    if (mode == static_cast<float>(OMNI_MODE_HOLD)) {
        return trajectories_.stop();
    }
    if (mode == static_cast<float>(OMNI_MODE_TRAJECTORY)) {
        return trajectories_.start(-1.0f, -1.0f);
    }
    shared_.refuse(MAV_SEVERITY_NOTICE, Text().add("mode follows the set-points: hold 0, trajectory 3"));
    return MAV_RESULT_DENIED;
}

uint8_t Commands::set_pose(const omni_pose_t &pose) {
    const float limit = parameters_.config().limits.position_m;
    if (shared_.armed()) {
        return shared_.refuse_armed("pose not set");
    }
    if (!omni_pose_is_finite(&pose) || omni_absf(pose.x) > limit || omni_absf(pose.y) > limit) {
        shared_.refuse(MAV_SEVERITY_WARNING, Text().add("pose not set: not finite or beyond LIM_POS"));
        return MAV_RESULT_DENIED;
    }
    Request request;
    request.kind = Request::Kind::set_pose;
    request.pose = {pose.x, pose.y, omni_wrap_pi(pose.theta)};
    return queued(shared_.control.request(request));
}

uint8_t Commands::reboot(float what) {
    if (what != 1.0f) {
        return MAV_RESULT_UNSUPPORTED;
    }
    if (shared_.armed()) {
        return shared_.refuse_armed("reboot refused");
    }
    shared_.reboot = true;
    return MAV_RESULT_ACCEPTED;
}

uint8_t Commands::scan_i2c(const Sender &sender) {
    if (shared_.armed()) {
        return shared_.refuse_armed("I2C scan refused");
    }
    if (hil_.hil_silent()) {
        shared_.refuse(MAV_SEVERITY_WARNING, Text().add("I2C scan refused: no OMNI_HIL_SENSORS yet"));
        return MAV_RESULT_TEMPORARILY_REJECTED;
    }
    scan_sender_ = sender;
    if (shared_.i2c_scanning) {
        return MAV_RESULT_ACCEPTED; // a repeated command: one result for both
    }
    Request request;
    request.kind = Request::Kind::i2c_scan;
    scans_before_ = shared_.latest.i2c_found.scans;
    shared_.i2c_scanning = shared_.control.request(request);
    return queued(shared_.i2c_scanning);
}

uint8_t Commands::refuse_pin_test(uint8_t result, const char *why) {
    shared_.refuse(MAV_SEVERITY_WARNING, Text().add("OE test refused: ").add(why));
    return result;
}

uint8_t Commands::test_pin(float duration_s, float release) {
    const omni_outputs_t &now = shared_.latest.outputs;
    const bool in_range = duration_s >= PinTest::min_s && duration_s <= PinTest::max_s;
    if (!in_range || (release != 0.0f && release != 1.0f)) {
        return refuse_pin_test(MAV_RESULT_DENIED, "0.1 to 2 s, and 0 or 1");
    }
    if (!shared_.hil && !shared_.board.output_enable->wired()) {
        return refuse_pin_test(MAV_RESULT_UNSUPPORTED, "no output-enable pin");
    }
    const auto large = [](omni_real_t duty) { return omni_absf(duty) > PinTest::max_duty; };
    if (!now.drive || now.setpoint_kind != OMNI_SETPOINT_DUTY || std::any_of(now.duty, now.duty + OMNI_MAX_WHEELS, large)) {
        return refuse_pin_test(MAV_RESULT_DENIED, "arm, duties up to 0.3 first");
    }
    PinTest test;
    test.ticks = static_cast<uint32_t>(duration_s * (1e6f / static_cast<float>(OMNI_TICK_US))) + 1;
    test.release = release == 1.0f;
    shared_.control.test_pin(test);
    return MAV_RESULT_ACCEPTED;
}

void Commands::restart() {
    if (shared_.i2c_scanning) {
        shared_.i2c_scanning = false;
        shared_.say_on(scan_sender_.link, MAV_SEVERITY_WARNING, Text().add("I2C scan cancelled: host-in-the-loop switched"));
    }
}

void Commands::serve() {
    const I2cFound &found = shared_.latest.i2c_found;
    if (!shared_.i2c_scanning || found.scans == scans_before_) {
        return;
    }
    shared_.i2c_scanning = false;
    mavlink_omni_i2c_scan_t message{};
    message.time_boot_ms = shared_.now_ms();
    std::copy(found.addresses, found.addresses + sizeof found.addresses, message.found);
    message.stuck = found.stuck ? 1 : 0;
    shared_.reply(scan_sender_, MAVLINK_MSG_ID_OMNI_I2C_SCAN, message);
}

uint8_t Commands::request_message(size_t link, float id) {
    if (!(id >= 0.0f && id < 16777216.0f)) {
        return MAV_RESULT_DENIED;
    }
    const auto wanted = static_cast<uint32_t>(id);
    if (wanted == MAVLINK_MSG_ID_AUTOPILOT_VERSION) {
        return queued(report_version(shared_.links[link]));
    }
    return telemetry_.send_once(link, wanted) ? MAV_RESULT_ACCEPTED : MAV_RESULT_UNSUPPORTED;
}

} // namespace omni
