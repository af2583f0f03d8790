// SPDX-License-Identifier: MIT
/// Reception: bytes, frames and the original robot's lines.
#include <algorithm>
#include <iterator>
#include <type_traits>

#include "app/app.h"
#include "app/base/flash_code.h"
#include "app/base/text.h"
#include "app/services/services.h"

namespace omni {
namespace {

constexpr uint64_t greeting_us = 2'000'000; ///< a peer on a cable or network sends a heartbeat within this time

/// Message handler of a service: calls its method with the arguments that it has.
template <auto service, auto method>
void call_service(App &app, const Frame &frame, const Sender &sender) {
    auto &receiver = app.*service;
    if constexpr (std::is_invocable_v<decltype(method), decltype(receiver), const Frame &>) {
        (receiver.*method)(frame);
    } else if constexpr (std::is_invocable_v<decltype(method), decltype(receiver), const Sender &>) {
        (receiver.*method)(sender);
    } else {
        (receiver.*method)(frame, sender);
    }
}

/// Message handler of the App itself.
template <auto method>
void call_app(App &app, const Frame &frame, const Sender &sender) {
    (app.*method)(frame, sender);
}

} // namespace

void App::greet(size_t link) {
    parameters_.stop_list(link);
    burst_log_.forget(link);
    trajectories_.forget(link);
    telemetry_.set_rates(link, parameters_.values());
    telemetry_.restart(link);
    report_status_to_new_peer(link);
}

void App::report_status_to_new_peer(size_t link) {
    greeted_us_[link] = clock_.now_us;
    report_reset_cause(link);
    report_stop_latch(link);
    status_texts_.greet(link);
}

/// A radio is always connected, so texts sent before the ground station's radio was switched on are lost.
OMNI_COLD void App::on_peer_reappeared(size_t link) {
    const uint64_t now_us = clock_.now_us;
    const uint64_t heard_us = heartbeats_.stations.heard_us(link);
    const auto is_past = [now_us](uint64_t since_us, uint64_t us) {
        return now_us > since_us && now_us - since_us > us;
    };
    if ((heard_us == 0 || is_past(heard_us, Stations::away_us)) && is_past(greeted_us_[link], greeting_us)) {
        reset_cause_reported_[link] = false;
        report_status_to_new_peer(link);
    }
}

bool App::accepts_setpoints_of(const Sender &sender) {
    if (!heartbeats_.stations.accepts_setpoints(sender, clock_.now_us)) {
        setpoints_.refuse_ended();
        return false;
    }
    return heartbeats_.may_move(sender, true);
}

void App::on_heartbeat(const Frame &frame, const Sender &sender) {
    if (Heartbeats::is_ground_station(frame)) {
        on_peer_reappeared(sender.link);
        heartbeats_.record(sender);
    }
}

/// Requests of the log protocol are answered only if addressed to this robot: all robots on a shared radio would
/// respond to a broadcast at once.
void App::dispatch(const Frame &frame, const Sender &sender) {
    enum class Kind : uint8_t { any, setpoint, addressed };
    static constexpr struct {
        uint32_t id;
        Kind kind;
        void (*handle)(App &app, const Frame &frame, const Sender &sender);
    } handlers[] = {
        {MAVLINK_MSG_ID_OMNI_HIL_SENSORS, Kind::any, call_app<&App::on_hil_sensors>},
        {MAVLINK_MSG_ID_HEARTBEAT, Kind::any, call_app<&App::on_heartbeat>},
        {MAVLINK_MSG_ID_SET_POSITION_TARGET_LOCAL_NED, Kind::setpoint,
         call_service<&App::setpoints_, &Setpoints::on_position_target>},
        {MAVLINK_MSG_ID_MANUAL_CONTROL, Kind::setpoint, call_service<&App::setpoints_, &Setpoints::on_manual_control>},
        {MAVLINK_MSG_ID_OMNI_SETPOINT_DUTY, Kind::setpoint, call_service<&App::setpoints_, &Setpoints::on_duty>},
        {MAVLINK_MSG_ID_VICON_POSITION_ESTIMATE, Kind::any, call_service<&App::pose_fixes_, &PoseFixes::on_vicon>},
        {MAVLINK_MSG_ID_ATT_POS_MOCAP, Kind::any, call_service<&App::pose_fixes_, &PoseFixes::on_mocap>},
        {MAVLINK_MSG_ID_OMNI_POSE_FIX, Kind::any, call_service<&App::pose_fixes_, &PoseFixes::on_compact>},
        {MAVLINK_MSG_ID_PARAM_REQUEST_LIST, Kind::any, call_service<&App::parameters_, &Parameters::on_request_list>},
        {MAVLINK_MSG_ID_PARAM_REQUEST_READ, Kind::any, call_service<&App::parameters_, &Parameters::on_request_read>},
        {MAVLINK_MSG_ID_PARAM_SET, Kind::any, call_service<&App::parameters_, &Parameters::on_set>},
        {MAVLINK_MSG_ID_COMMAND_LONG, Kind::any, call_service<&App::commands_, &Commands::on_command_long>},
        {MAVLINK_MSG_ID_COMMAND_INT, Kind::any, call_service<&App::commands_, &Commands::on_command_int>},
        {MAVLINK_MSG_ID_SET_MODE, Kind::any, call_service<&App::commands_, &Commands::on_set_mode>},
        {MAVLINK_MSG_ID_SETUP_SIGNING, Kind::any, call_service<&App::signing_service_, &SigningService::on_setup>},
        {MAVLINK_MSG_ID_REQUEST_DATA_STREAM, Kind::any,
         call_service<&App::telemetry_, &Telemetry::on_request_data_stream>},
        {MAVLINK_MSG_ID_LOG_REQUEST_LIST, Kind::addressed, call_service<&App::burst_log_, &BurstLog::on_request_list>},
        {MAVLINK_MSG_ID_LOG_REQUEST_DATA, Kind::addressed, call_service<&App::burst_log_, &BurstLog::on_request_data>},
        {MAVLINK_MSG_ID_LOG_REQUEST_END, Kind::addressed, call_service<&App::burst_log_, &BurstLog::on_request_end>},
        {MAVLINK_MSG_ID_LOG_ERASE, Kind::addressed, call_service<&App::burst_log_, &BurstLog::on_erase>},
    };
    const auto *handler = std::find_if(std::begin(handlers), std::end(handlers),
                                       [&frame](const auto &row) { return row.id == frame.id; });
    if (handler == std::end(handlers)) {
        serve_small_protocols(links_, clock_, frame, sender);
    } else if (handler->kind == Kind::setpoint) {
        if (accepts_setpoints_of(sender)) {
            handler->handle(*this, frame, sender);
            if (!setpoints_.refused()) {
                heartbeats_.take_command_by_setpoint(sender);
            }
        }
    } else if (handler->kind == Kind::any || frame.target_system != 0) {
        handler->handle(*this, frame, sender);
    }
}

bool App::handing_over() const {
    return owner_.load(std::memory_order_acquire) == Owner::handing_over;
}

/// Read bytes; frames are processed later.
void App::receive(size_t link) {
    if (!handing_over()) { // the next frames may be for hardware-in-the-loop: wait a tick
        links_[link].receive(board_.clock->stopwatch_ns());
    }
}

void App::process_frames(size_t link) {
    Link &channel = links_[link];
    if (handing_over()) {
        return;
    }
    watch_hil_peer();
    if (channel.connected_anew()) {
        greet(link);
        serve();
    }
    const auto own = static_cast<uint8_t>(parameters_.values()[OMNI_PARAM_SYS_ID]);
    Frame frame;
    legacy_line_.set_on(parameters_.values()[OMNI_PARAM_LINK2_LEGACY] != 0.0f && !signing_.required());
    while (!handing_over() && channel.next(&frame)) {
        const bool for_us = frame.target_system == 0 || frame.target_system == own;
        const bool for_component = frame.target_component == 0 || frame.target_component == MAV_COMP_ID_AUTOPILOT1;
        // An echo of our own messages. A station with the same system id has another component id and is accepted.
        const bool by_us = frame.system == own && frame.component == MAV_COMP_ID_AUTOPILOT1;
        if (for_us && for_component && !by_us && channel.admits(frame)) {
            texts_.set_requester(link);
            dispatch(frame, {link, frame.system, frame.component});
            texts_.set_requester(no_link);
            if (robot_.hil() && frame.id != MAVLINK_MSG_ID_OMNI_HIL_SENSORS) {
                serve(); // output must depend on the frames, not on the call rate of background()
            }
        }
    }
    process_legacy_line(link);
}

/// A line's sender does not read MAVLink, so refusals go to all links. Each line counts as a heartbeat, as the original
/// robot's host sends nothing else. Lines never arm.
OMNI_COLD void App::apply_legacy_setpoint(const LegacySetpoint &setpoint, const Sender &sender) {
    const bool counts = heartbeats_.stations.accepts_setpoints(sender, clock_.now_us);
    heartbeats_.record(sender);
    if (!counts) {
        setpoints_.refuse_ended();
        return;
    }
    setpoints_.on_legacy_line(setpoint);
    if (!setpoints_.refused()) {
        heartbeats_.take_command_by_setpoint(sender);
    }
}

void App::process_legacy_line(size_t link) {
    LegacySetpoint setpoint;
    if (link == line_link_ && legacy_line_.take(&setpoint)) {
        apply_legacy_setpoint(setpoint, Sender{link}); // a line has no sender id
    }
}

/// Read the simulator's link first and process its frames last, so that frames on other links that were sent before a
/// tick's sensors, such as stops, act in that tick.
void App::receive_all() {
    const size_t world = robot_.hil() ? hil_link_ : no_link;
    if (world != no_link) {
        receive(world);
    }
    for (size_t i = 0; i < board_.port_count; ++i) {
        if (i != world) {
            receive(i);
            process_frames(i);
        }
    }
    if (world != no_link) {
        process_frames(world);
    }
}

} // namespace omni
