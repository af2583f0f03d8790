// SPDX-License-Identifier: MIT
#include "app/services/fix_drift.h"

#include "app/base/core.h"
#include "app/base/flash_code.h"

namespace omni {
namespace {

constexpr uint64_t window_us = 2'000'000;
constexpr uint64_t longest_gap_us = 500'000; ///< maximum gap between fixes within a window
constexpr uint8_t windows = 2;               ///< consecutive windows: one may contain a jump by a reconfigured tracker
constexpr float most_m_s = 0.05f;            ///< maximum difference for a robot at rest
constexpr float most_rad_s = 0.03f;          ///< maximum drift rate of the heading
constexpr float most_share = 0.3f;           ///< of the wheels' distance: slip, wheel radii, scale of the tracker

} // namespace

void FixDrift::restart() {
    begun_ = false;
    now_us_ = 0;
    apart_ = 0;
}

OMNI_COLD void FixDrift::begin(const omni_pose_t &world) {
    begun_ = true;
    first_ = world;
    first_us_ = now_us_;
    x_ = y_ = theta_ = travelled_ = turned_ = 0.0f;
}

OMNI_COLD void FixDrift::take(const omni_outputs_t &outputs) {
    const uint64_t elapsed_us = now_us_ != 0 && outputs.time_us > now_us_ ? outputs.time_us - now_us_ : 0;
    const float elapsed_s = static_cast<float>(elapsed_us) * 1e-6f;
    now_us_ = outputs.time_us;
    x_ += outputs.rate.vx * elapsed_s;
    y_ += outputs.rate.vy * elapsed_s;
    theta_ += outputs.rate.wz * elapsed_s;
    travelled_ += omni_sqrtf(outputs.rate.vx * outputs.rate.vx + outputs.rate.vy * outputs.rate.vy) * elapsed_s;
    turned_ += omni_absf(outputs.rate.wz) * elapsed_s;
}

OMNI_COLD void FixDrift::compare(const omni_pose_t &world, bool armed) {
    const uint64_t gap_us = now_us_ - last_fix_us_;
    last_fix_us_ = now_us_;
    if (!begun_ || !armed || gap_us > longest_gap_us) {
        apart_ = 0;
        begin(world);
        return;
    }
    const uint64_t lasted_us = now_us_ - first_us_;
    if (lasted_us < window_us) {
        return;
    }
    const float lasted_s = static_cast<float>(lasted_us) * 1e-6f;
    const float dx = world.x - first_.x - x_;
    const float dy = world.y - first_.y - y_;
    const float apart_m = omni_sqrtf(dx * dx + dy * dy);
    const float apart_rad = omni_absf(omni_wrap_pi(world.theta - first_.theta - theta_));
    const bool place_agrees = apart_m <= most_m_s * lasted_s + most_share * travelled_;
    const bool agree = place_agrees && apart_rad <= most_rad_s * lasted_s + most_share * turned_;
    apart_ = agree ? uint8_t{0} : static_cast<uint8_t>(apart_ + 1);
    if (apart_ == windows) {
        apart_ = 0;
        const float milli_per_s = 1000.0f * (place_agrees ? apart_rad : apart_m) / lasted_s;
        texts_.say(MAV_SEVERITY_WARNING, Text()
                                             .add("fixes and wheels disagree by ")
                                             .add(static_cast<uint32_t>(milli_per_s))
                                             .add(place_agrees ? " mrad/s" : " mm/s"));
    }
    begin(world);
}

} // namespace omni
