// SPDX-License-Identifier: MIT
#include "app/services/commands.h"

#include <algorithm>
#include <cstring>

#include "app/base/core.h"
#include "app/base/crc32.h"
#include "app/base/flash_code.h"
#include "app/link/stops.h"
#include "app/services/reports.h"

namespace omni {
namespace {

/// Short names of command numbers in common.xml.
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

/// Parameters of a COMMAND_LONG or COMMAND_INT: seven values of four bytes at the start of both.
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

uint8_t queued_result(bool done) {
    return done ? MAV_RESULT_ACCEPTED : MAV_RESULT_TEMPORARILY_REJECTED;
}

} // namespace

OMNI_COLD void Commands::on_command_long(const Frame &frame, const Sender &sender) {
    const auto message = frame.as<mavlink_command_long_t>();
    handle({message.command,
            {message.param1, message.param2, message.param3, message.param4, message.param6, message.param7},
            sender,
            receipt_of(message, message.param5 != 0.0f),
            is_stop(frame),
            message.confirmation > 0});
}

OMNI_COLD void Commands::on_command_int(const Frame &frame, const Sender &sender) {
    const auto message = frame.as<mavlink_command_int_t>();
    handle({message.command,
            {message.param1, message.param2, message.param3, message.param4, static_cast<float>(message.y), message.z},
            sender,
            receipt_of(message, message.x != 0),
            is_stop(frame),
            false});
}

OMNI_COLD void Commands::on_set_mode(const Frame &frame, const Sender &sender) {
    const ModeRequest mode = requested_mode(frame.as<mavlink_set_mode_t>().custom_mode);
    if (mode == ModeRequest::hold) {
        memory_.stopped(sender, clock_.now_us);
    }
    set_mode(mode, sender);
}

OMNI_COLD Commands::Effect Commands::effect_of(const Command &command) {
    switch (command.id) {
    case cmd_arm:
    case cmd_terminate:
    case MAV_CMD_OMNI_ESTOP:
        return command.stops ? Effect::ends : Effect::begins;
    case MAV_CMD_OMNI_TRAJECTORY_STOP:
        return Effect::ends;
    case MAV_CMD_OMNI_TRAJECTORY_START:
    case MAV_CMD_OMNI_OE_TEST:
        return Effect::begins;
    case MAV_CMD_OMNI_EXCITE:
    case MAV_CMD_OMNI_HIL:
        return command.param[0] == 0.0f ? Effect::ends : Effect::begins;
    case cmd_do_set_mode:
        return requested_mode(command.param[1], command.param[2]) == ModeRequest::hold ? Effect::ends : Effect::begins;
    default:
        return Effect::other;
    }
}

OMNI_COLD uint8_t Commands::execute_or_deny(const Command &command) {
    const Effect effect = effect_of(command);
    if (effect == Effect::ends) {
        memory_.stopped(command.sender, clock_.now_us);
    }
    if (effect == Effect::ends || command.receipt == 0) {
        return run(command);
    }
    const CommandMemory::Key key{command.sender, command.id, command.receipt};
    switch (memory_.take(key, command.repeated, effect == Effect::begins, clock_.now_us)) {
    case CommandMemory::Verdict::overtaken:
        texts_.refuse(MAV_SEVERITY_WARNING, Text().add("command refused: a stop came first"));
        return MAV_RESULT_DENIED;
    case CommandMemory::Verdict::executed:
        return MAV_RESULT_ACCEPTED;
    default:
        break;
    }
    const uint8_t result = run(command);
    if (result == MAV_RESULT_ACCEPTED) {
        memory_.accepted(key);
    }
    return result;
}

void Commands::handle(const Command &command) {
    mavlink_command_ack_t ack{};
    ack.command = command.id;
    ack.result = execute_or_deny(command);
    ack.result_param2 = command.receipt;
    ack.target_system = command.sender.system;
    ack.target_component = command.sender.component;
    links_[command.sender.link].send(MAVLINK_MSG_ID_COMMAND_ACK, ack, command.stops ? Priority::stop : Priority::reply);
}

/// @param holds it holds the pose or ends an excitation: no drive is started.
void Commands::record_motion(bool holds, const Sender &sender) {
    if (holds) {
        services_.heartbeats.held(sender);
    } else {
        services_.heartbeats.commanded(sender);
    }
}

/// Motion commands.
uint8_t Commands::run_motion(const Command &command) {
    const float *p = command.param;
    const bool holds = effect_of(command) == Effect::ends;
    if (!holds && !services_.heartbeats.may_move(command.sender)) {
        return MAV_RESULT_DENIED;
    }
    uint8_t result = MAV_RESULT_UNSUPPORTED;
    if (command.id == MAV_CMD_OMNI_TRAJECTORY_START) {
        result = services_.trajectories.start(p[0], p[1], p[2], command.sender);
    } else if (command.id == MAV_CMD_OMNI_TRAJECTORY_STOP) {
        result = services_.trajectories.stop();
    } else if (command.id == MAV_CMD_OMNI_EXCITE) {
        result = services_.excitations.start({p[0], p[1], p[2], p[3], p[4], p[5]});
    }
    if (result == MAV_RESULT_ACCEPTED) {
        record_motion(holds, command.sender);
    }
    return result;
}

OMNI_COLD uint8_t Commands::run(const Command &command) {
    const float *p = command.param;
    switch (command.id) {
    case cmd_arm:
        return services_.arming.command(p[0], command.sender);
    case cmd_do_set_mode:
        return set_mode(requested_mode(p[1], p[2]), command.sender);
    case MAV_CMD_OMNI_TRAJECTORY_START:
    case MAV_CMD_OMNI_TRAJECTORY_STOP:
    case MAV_CMD_OMNI_EXCITE:
        return run_motion(command);
    case cmd_terminate:
        return p[0] > 0.5f ? services_.arming.estop(command.sender) : static_cast<uint8_t>(MAV_RESULT_DENIED);
    case cmd_storage:
        return storage(p[0]);
    case cmd_reboot:
        return reboot(p[0]);
    case cmd_interval:
        return services_.telemetry.set_interval(command.sender.link, p[0], p[1], services_.parameters.values());
    case cmd_request_message:
        return request_message(command.sender.link, p[0]);
    case cmd_capabilities:
        return request_message(command.sender.link, MAVLINK_MSG_ID_AUTOPILOT_VERSION);
    default:
        return run_omni_command(command);
    }
}

OMNI_COLD uint8_t Commands::run_omni_command(const Command &command) {
    const float *p = command.param;
    switch (command.id) {
    case MAV_CMD_OMNI_HIL:
        return hil_command(p[0], command.sender.link);
    case MAV_CMD_OMNI_SET_POSE:
        return set_pose({p[0], p[1], p[2]});
    case MAV_CMD_OMNI_WAYPOINT:
        return services_.trajectories.set_waypoint(p[0], {p[1], p[2], p[3]}, command.sender);
    case MAV_CMD_OMNI_ESTOP:
        return services_.arming.estop_or_release(p[0], command.sender);
    case MAV_CMD_OMNI_I2C_SCAN:
        return services_.scan.start(command.sender);
    case MAV_CMD_OMNI_OE_TEST:
        return test_pin(p[0], p[1]);
    case MAV_CMD_OMNI_BURST:
        return services_.burst_log.start(p[0], p[1], p[2], p[3], p[4]);
    case MAV_CMD_OMNI_TRIAL:
        return services_.trial.command(p[0], command.sender);
    default:
        return MAV_RESULT_UNSUPPORTED;
    }
}

OMNI_COLD uint8_t Commands::hil_command(float enable, size_t link) {
    if (enable != 0.0f && enable != 1.0f) {
        return MAV_RESULT_DENIED;
    }
    return services_.hil.switch_hil(enable == 1.0f, link);
}

/// Parameters on trial are not stored, as they may be restored.
OMNI_COLD uint8_t Commands::storage(float action) {
    if (action == 1.0f && services_.trial.on()) {
        texts_.refuse(MAV_SEVERITY_WARNING, Text().add("nothing stored: parameters are on trial"));
        return MAV_RESULT_DENIED;
    }
    return services_.parameters.storage_command(action);
}

OMNI_COLD uint8_t Commands::set_mode(ModeRequest mode, const Sender &sender) {
    if (mode == ModeRequest::hold) {
        const uint8_t result = services_.trajectories.stop();
        record_motion(true, sender);
        return result;
    }
    if (mode == ModeRequest::follow_setpoints) {
        return follow_setpoints(sender);
    }
    texts_.refuse(MAV_SEVERITY_NOTICE, Text().add("no such mode: hold, or follow setpoints"));
    return MAV_RESULT_DENIED;
}

/// Not needed to follow setpoints while armed. It starts a drive of the station, as arming does: after the end of its
/// last drive its setpoints are accepted again. No effect while disarmed, so that another station's arming does not
/// enable them.
OMNI_COLD uint8_t Commands::follow_setpoints(const Sender &sender) {
    if (!services_.heartbeats.may_move(sender)) {
        return MAV_RESULT_DENIED;
    }
    const float timeout_s = services_.parameters.config().limits.command_timeout_s;
    const bool is_streaming = services_.heartbeats.is_streaming(sender, static_cast<uint64_t>(timeout_s * 1e6f));
    if (!is_streaming || services_.setpoints.refused()) {
        texts_.refuse(MAV_SEVERITY_NOTICE, Text().add("mode refused: send valid setpoints first"));
        return MAV_RESULT_TEMPORARILY_REJECTED;
    }
    if (robot_.armed()) {
        record_motion(false, sender);
    }
    return MAV_RESULT_ACCEPTED;
}

OMNI_COLD uint8_t Commands::set_pose(const omni_pose_t &pose) {
    const float limit = services_.parameters.config().limits.position_m;
    if (robot_.armed()) {
        return robot_.refuse_armed("pose not set");
    }
    if (!omni_pose_is_finite(&pose) || omni_absf(pose.x) > limit || omni_absf(pose.y) > limit) {
        texts_.refuse(MAV_SEVERITY_WARNING, Text().add("pose not set: not finite or beyond LIM_POS"));
        return MAV_RESULT_DENIED;
    }
    Request request;
    request.kind = Request::Kind::set_pose;
    request.pose = {pose.x, pose.y, omni_wrap_pi(pose.theta)};
    return queued_result(control_.request(request));
}

OMNI_COLD uint8_t Commands::reboot(float what) {
    if (what != 1.0f) {
        return MAV_RESULT_UNSUPPORTED;
    }
    if (robot_.armed()) {
        return robot_.refuse_armed("reboot refused");
    }
    robot_.request_reboot();
    return MAV_RESULT_ACCEPTED;
}

uint8_t Commands::refuse_pin_test(uint8_t result, const char *why) {
    texts_.refuse(MAV_SEVERITY_WARNING, Text().add("OE test refused: ").add(why));
    return result;
}

OMNI_COLD uint8_t Commands::test_pin(float duration_s, float release) {
    const omni_outputs_t &now = robot_.latest().outputs;
    const bool in_range = duration_s >= PinTester::min_s && duration_s <= PinTester::max_s;
    if (!in_range || (release != 0.0f && release != 1.0f)) {
        return refuse_pin_test(MAV_RESULT_DENIED, "0.1 to 2 s, and 0 or 1");
    }
    if (!robot_.hil() && !output_enable_.wired()) {
        return refuse_pin_test(MAV_RESULT_UNSUPPORTED, "no output-enable pin");
    }
    const auto large = [](omni_real_t duty) { return omni_absf(duty) > PinTester::max_duty; };
    if (!now.drive || now.setpoint_kind != OMNI_SETPOINT_DUTY ||
        std::any_of(now.duty, now.duty + OMNI_MAX_WHEELS, large)) {
        return refuse_pin_test(MAV_RESULT_DENIED, "arm, duties up to 0.3 first");
    }
    const auto ticks = static_cast<uint32_t>(duration_s * (1e6f / static_cast<float>(OMNI_TICK_US))) + 1;
    control_.request_pin_test(ticks, release == 1.0f);
    return MAV_RESULT_ACCEPTED;
}

OMNI_COLD uint8_t Commands::request_message(size_t link, float id) {
    if (!(id >= 0.0f && id < 16777216.0f)) {
        return MAV_RESULT_DENIED;
    }
    const auto wanted = static_cast<uint32_t>(id);
    if (wanted == MAVLINK_MSG_ID_AUTOPILOT_VERSION) {
        return queued_result(services_.telemetry.send_version(link));
    }
    return services_.telemetry.send_once(link, wanted) ? MAV_RESULT_ACCEPTED : MAV_RESULT_UNSUPPORTED;
}

} // namespace omni
