// SPDX-License-Identifier: MIT
#include "app/services/trajectories.h"

#include "app/base/core.h"
#include "app/base/flash_code.h"

namespace omni {

/// Is an argument that replaces a parameter within its range? Otherwise refuse it.
bool Trajectories::accepts(int32_t parameter, float value, const char *name) {
    if (omni_param_check(parameter, value, false) == OMNI_OK) {
        return true;
    }
    const omni_param_info_t &info = omni_param_table[parameter];
    texts_.refuse(MAV_SEVERITY_WARNING, Text().add(name).add(": ").add(info.minimum).add("..").add(info.maximum));
    return false;
}

/// Plan into the scratch slot from the current pose. @param sender requester
OMNI_COLD uint8_t Trajectories::plan(const Sender &sender) {
    omni_trajectory_config_t config = parameters_.config().trajectory;
    if (type_ != -1.0f) {
        if (!accepts(OMNI_PARAM_TRJ_TYPE, type_, "trajectory type")) {
            return MAV_RESULT_DENIED;
        }
        config.type = static_cast<uint8_t>(type_);
    }
    if (laps_ != -1.0f) {
        if (!accepts(OMNI_PARAM_TRJ_LAPS, laps_, "laps")) {
            return MAV_RESULT_DENIED;
        }
        config.laps = laps_;
    }
    if (period_s_ != 0.0f) {
        if (!accepts(OMNI_PARAM_TRJ_PERIOD, period_s_, "period [s]")) {
            return MAV_RESULT_DENIED;
        }
        config.period_s = period_s_;
    }
    const bool listed = omni_trajectory_needs_waypoints(config.type);
    if (listed && waypoints_.count > 0 && !(waypoint_sender_ == sender)) {
        texts_.refuse(MAV_SEVERITY_WARNING, Text().add("trajectory refused: another station's waypoints"));
        return MAV_RESULT_DENIED;
    }
    if (listed && waypoints_.count < 2) {
        texts_.refuse(MAV_SEVERITY_WARNING, Text().add("trajectory refused: send two waypoints or more"));
        return MAV_RESULT_DENIED;
    }
    omni_trajectory_t &path = control_.plans.scratch();
    const omni_pose_t &at = robot_.latest().outputs.pose;
    if (omni_trajectory_plan(&path, &config, &parameters_.config().kinematics, listed ? &waypoints_ : nullptr, &at) !=
        OMNI_OK) {
        texts_.refuse(MAV_SEVERITY_WARNING, Text().add("trajectory refused: check the TRJ_ parameters"));
        return MAV_RESULT_FAILED;
    }
    if (waiting_) {
        return MAV_RESULT_ACCEPTED; // already reported at the request; now planned again from the current pose
    }
    if (path.needed_scale > path.scale * 1.001f) {
        texts_.refuse(MAV_SEVERITY_WARNING,
                      Text().add("path too fast for the wheels by ").add(path.needed_scale / path.scale));
    }
    report_slowdown(path);
    return MAV_RESULT_ACCEPTED;
}

/// Report to the requester that the path is slowed down, with the limit.
void Trajectories::report_slowdown(const omni_trajectory_t &path) {
    if (path.scale <= 1.001f) {
        return;
    }
    Text text;
    text.add("path slowed to ").add(static_cast<uint32_t>(100.0f / path.scale)).add(" %: ");
    if (path.by_voltage) {
        text.add("motor voltage");
    } else {
        text.add("LIM_WHEEL ").add(path.config.wheel_limit_rad_s).add(" rad/s");
    }
    texts_.refuse(MAV_SEVERITY_NOTICE, text.add(" x ").add(path.config.margin));
}

/// In e-stop or failsafe, or a stop is pending.
bool Trajectories::stopped() const {
    const uint8_t state = robot_.state();
    return state == OMNI_STATE_ESTOP || state == OMNI_STATE_FAILSAFE || control_.stopping(OMNI_EVENT_ESTOP);
}

OMNI_COLD uint8_t Trajectories::start(float type, float laps, float period_s, const Sender &sender) {
    if (robot_.disarming() || robot_.releasing()) {
        return MAV_RESULT_TEMPORARILY_REJECTED; // the resulting state is not in a report yet
    }
    if (stopped()) {
        texts_.refuse(MAV_SEVERITY_WARNING, Text().add("trajectory refused: release or disarm first"));
        return MAV_RESULT_DENIED;
    }
    type_ = type;
    laps_ = laps;
    period_s_ = period_s;
    waiting_ = false;
    const uint8_t result = plan(sender);
    if (result != MAV_RESULT_ACCEPTED) {
        return result;
    }
    requester_ = sender;
    requested_us_ = clock_.now_us;
    waiting_ = robot_.state() != OMNI_STATE_ARMED && !robot_.arming();
    if (!waiting_) {
        control_.plans.publish();
    }
    return result;
}

uint8_t Trajectories::stop() {
    waiting_ = false;
    control_.plans.withdraw();
    control_.hold();
    return MAV_RESULT_ACCEPTED;
}

OMNI_COLD uint8_t Trajectories::refuse_waypoint(const char *why) {
    texts_.refuse(MAV_SEVERITY_WARNING, Text().add("waypoint refused: ").add(why));
    return MAV_RESULT_DENIED;
}

OMNI_COLD uint8_t Trajectories::set_waypoint(float number, const omni_pose_t &pose, const Sender &sender) {
    const float expected = static_cast<float>(waypoints_.count);
    if (!omni_pose_is_finite(&pose)) {
        return refuse_waypoint("not finite");
    }
    const float limit = parameters_.config().limits.position_m;
    if (omni_absf(pose.x) > limit || omni_absf(pose.y) > limit) {
        return refuse_waypoint("beyond LIM_POS");
    }
    if (number == 0.0f) {
        waypoints_.count = 0;
        waypoint_sender_ = sender;
    } else if (waypoints_.count > 0 && !(waypoint_sender_ == sender)) {
        return refuse_waypoint("another's list, begin with 0");
    } else if (number == expected - 1.0f) {
        waypoints_.count--; // retransmission: its acknowledgement was lost
    } else if (!(number == expected && number < static_cast<float>(OMNI_MAX_WAYPOINTS))) {
        return refuse_waypoint("number without gaps, 0..31");
    }
    waypoints_.pose[waypoints_.count++] = pose;
    return MAV_RESULT_ACCEPTED;
}

OMNI_COLD void Trajectories::forget(size_t link) {
    waiting_ = waiting_ && requester_.link != link;
    waypoints_.count = static_cast<uint8_t>(waypoint_sender_.link == link ? 0 : waypoints_.count);
}

OMNI_COLD void Trajectories::watch_requester() {
    const bool silent = !heartbeats_.stations.present(requester_, requested_us_, clock_.now_us);
    if (silent) {
        texts_.send_to(requester_.link, MAV_SEVERITY_NOTICE, Text().add("path not started: its station was silent"));
    }
    waiting_ = !silent && !stopped();
}

void Trajectories::on_arm(const Sender &sender) {
    const bool own = requester_ == sender;
    if (waiting_ && !own) {
        texts_.say(MAV_SEVERITY_WARNING, Text().add("path not started: another station armed"));
    }
    if (waiting_ && own && plan(sender) == MAV_RESULT_ACCEPTED) {
        control_.plans.publish();
    }
    waiting_ = false;
}

} // namespace omni
