// SPDX-License-Identifier: MIT
#include "app/services/pose_fixes.h"

#include <algorithm>

#include "app/base/core.h"
#include "app/base/flash_code.h"
#include "app/link/frames.h"

namespace omni {
namespace {

constexpr uint64_t oldest_us = 250'000;
constexpr uint64_t ahead_us = 5'000;
/// Motion [m or rad] after which even a coarse sensor cannot repeat a pose exactly.
constexpr float frozen_travel = 0.005f;
/// Distance [m, rad] from the estimate beyond which three exact zeros are not a measurement.
constexpr float most_zero_offset = 0.02f;
/// A fix with a larger standard deviation of x and y [m] is dropped: it has no information, but would prevent `pose
/// stale`.
constexpr float most_sd_xy = 1.0f;

/// Standard deviation from a variance; 0 (take the configured one) if the sender gave none. An infinite one is large.
float standard_deviation(float variance) {
    constexpr float most = 1e6f;
    return variance > 0.0f ? omni_sqrtf(variance < most ? variance : most) : 0.0f;
}

/// Is a quaternion of unit length, within rounding? The zeros of a lost tracker are not.
bool is_rotation(const float (&q)[4]) {
    constexpr float off = 0.01f;
    const float square = q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3];
    return square > (1.0f - off) * (1.0f - off) && square < (1.0f + off) * (1.0f + off);
}

/// Unwrap a 32-bit time stamp [ms] to the time nearest to now; it wraps every 49.7 days.
uint64_t whole_time_us(uint32_t time_ms, uint64_t now_us) {
    const uint64_t now_ms = now_us / 1000;
    const auto ahead_ms = static_cast<int32_t>(time_ms - static_cast<uint32_t>(now_ms));
    return (now_ms + static_cast<uint64_t>(static_cast<int64_t>(ahead_ms))) * 1000;
}

} // namespace

uint64_t PoseFixes::time_of(uint64_t stamp_us) const {
    const uint64_t now = clock_.now_us;
    if (stamp_us != 0 && stamp_us <= now + ahead_us && stamp_us + oldest_us >= now) {
        return stamp_us;
    }
    const auto delay_us = static_cast<uint64_t>(parameters_.values()[OMNI_PARAM_FIX_DELAY] * 1e6f);
    return now > delay_us ? now - delay_us : 0;
}

void PoseFixes::restart() {
    std::fill(last_text_us_, last_text_us_ + Board::max_ports, uint64_t{0});
    last_us_ = 0;
    travelled_ = 0.0f;
    count_ = 0;
    drift_.restart();
}

OMNI_COLD void PoseFixes::take_report() {
    const TickReport &report = robot_.latest();
    if (report.fix_restarts > restarts_) {
        texts_.say(MAV_SEVERITY_WARNING, Text().add("pose restarted: fixes agree, wheels do not"));
    }
    restarts_ = report.fix_restarts; // fewer after the control core has restarted
    drift_.take(report.outputs);
}

/// Queue a fix; replaces the oldest if the queue is full.
void PoseFixes::wait(const omni_pose_fix_t &fix) {
    if (count_ == most_waiting) {
        first_ = (first_ + 1) % most_waiting;
        --count_;
        warn("too many at once");
    }
    waiting_[(first_ + count_) % most_waiting] = fix;
    ++count_;
}

void PoseFixes::serve() {
    while (count_ > 0 && control_.offer_fix(waiting_[first_])) {
        first_ = (first_ + 1) % most_waiting;
        --count_;
    }
}

void PoseFixes::warn(const char *why) {
    texts_.refuse_rate_limited(last_text_us_, Text().add("pose fix refused: ").add(why));
}

/// Integrate the wheels' distance since the last fix: a working sensor must have seen that motion.
bool PoseFixes::frozen(const omni_pose_t &world) {
    const omni_twist_t &rate = robot_.latest().outputs.rate;
    const uint64_t elapsed_us = last_us_ != 0 && clock_.now_us > last_us_ ? clock_.now_us - last_us_ : 0;
    const float speed = omni_sqrtf(rate.vx * rate.vx + rate.vy * rate.vy) + omni_absf(rate.wz);
    const bool repeated = last_us_ != 0 && world.x == last_.x && world.y == last_.y && world.theta == last_.theta;
    travelled_ = repeated ? travelled_ + speed * static_cast<float>(elapsed_us) * 1e-6f : 0.0f;
    last_ = world;
    last_us_ = clock_.now_us > 0 ? clock_.now_us : 1;
    return travelled_ > frozen_travel;
}

/// A tracker that has lost its object sends exact zeros. A real measurement is exactly zero only without noise, as in a
/// simulation, and then near the estimate. Far from the estimate such fixes would restart it, and a robot that holds
/// its pose would drive away.
OMNI_COLD bool PoseFixes::is_lost_tracker_zero(const omni_pose_t &world) const {
    const omni_pose_t &at = robot_.latest().outputs.pose;
    const bool zeros = world.x == 0.0f && world.y == 0.0f && world.theta == 0.0f;
    return zeros && !(omni_absf(at.x) <= most_zero_offset && omni_absf(at.y) <= most_zero_offset &&
                      omni_absf(omni_wrap_pi(at.theta)) <= most_zero_offset);
}

/// @param covariance row-major upper triangle of 6 x 6: x, y, yaw are elements 0, 6, 20.
void PoseFixes::accept(const omni_pose_t &world, uint64_t stamp_us, const float *covariance) {
    const float x = standard_deviation(covariance[0]);
    const float y = standard_deviation(covariance[6]);
    accept(world, stamp_us, x > y ? x : y, standard_deviation(covariance[20]));
}

/// @param sd_xy, sd_theta standard deviations [m, rad]; 0: not known.
void PoseFixes::accept(const omni_pose_t &world, uint64_t stamp_us, float sd_xy, float sd_theta) {
    if (!omni_pose_is_finite(&world)) {
        warn("not finite");
        return;
    }
    if (sd_xy > most_sd_xy) {
        warn("it may be off by metres");
        return;
    }
    if (is_lost_tracker_zero(world)) {
        warn("zeros: is the tracker lost?");
        return;
    }
    if (frozen(world)) {
        warn("it repeats itself");
        return;
    }
    drift_.compare(world, robot_.armed());
    omni_pose_fix_t fix{};
    fix.time_us = time_of(stamp_us);
    fix.pose = {world.x, world.y, omni_wrap_pi(world.theta)};
    fix.sd_xy = sd_xy;
    fix.sd_theta = sd_theta;
    wait(fix);
    serve();
}

void PoseFixes::on_vicon(const Frame &frame) {
    const auto message = frame.as<mavlink_vicon_position_estimate_t>();
    accept(flip_frame(omni_pose_t{message.x, message.y, message.yaw}), message.usec, message.covariance);
}

void PoseFixes::on_mocap(const Frame &frame) {
    const auto message = frame.as<mavlink_att_pos_mocap_t>();
    const auto &q = message.q; // w, x, y, z
    if (!is_rotation(q)) {
        warn("its quaternion is no rotation");
        return;
    }
    const float yaw = omni_atan2f(2.0f * (q[0] * q[3] + q[1] * q[2]), 1.0f - 2.0f * (q[2] * q[2] + q[3] * q[3]));
    accept(flip_frame(omni_pose_t{message.x, message.y, yaw}), message.time_usec, message.covariance);
}

void PoseFixes::on_compact(const Frame &frame) {
    const auto message = frame.as<mavlink_omni_pose_fix_t>();
    const omni_pose_t pose = {static_cast<float>(message.x_mm) * 1e-3f, static_cast<float>(message.y_mm) * 1e-3f,
                              static_cast<float>(message.theta_mrad10) * 1e-4f};
    const uint64_t taken_us = message.time_boot_ms != 0 ? whole_time_us(message.time_boot_ms, clock_.now_us) : 0;
    if (taken_us != 0 && taken_us + oldest_us < clock_.now_us) {
        warn("older than 0.25 s"); // it has the robot's clock, so its age is known
        return;
    }
    accept(pose, taken_us, static_cast<float>(message.sd_xy_mm10) * 1e-4f,
           static_cast<float>(message.sd_theta_mrad10) * 1e-4f);
}

} // namespace omni
