// SPDX-License-Identifier: MIT
#include "app/services/excitations.h"

#include <cmath>

#include "app/base/core.h"
#include "app/base/flash_code.h"
#include "app/base/integer_check.h"
#include "app/link/mavlink_types.h"

namespace omni {
namespace {

constexpr float tick_s = 1e-6f * static_cast<float>(OMNI_TICK_US);
/// Maximum amplitude as a fraction of SAFE_ERR_XY or SAFE_ERR_TH: a step is an immediate tracking error.
constexpr float error_share = 0.5f;
static_assert(OMNI_EXCITATION_MAX_TICKS * (OMNI_TICK_US / 1000) >= 120000, "Excitations::max_s");

OMNI_COLD bool is_frequency(float hz) {
    return hz >= 0.0f && hz <= Excitations::max_hz;
}

OMNI_COLD omni_excitation_t plan_of(const Excitations::Wanted &wanted) {
    omni_excitation_t plan{};
    plan.place = static_cast<uint8_t>(wanted.place);
    const auto index = static_cast<uint8_t>(wanted.index);
    const bool wheels = plan.place != OMNI_EXCITATION_POSE;
    plan.index = !wheels ? index : index == 0 ? static_cast<uint8_t>(OMNI_MAX_WHEELS) : static_cast<uint8_t>(index - 1);
    plan.ticks = static_cast<uint32_t>(std::lround(wanted.duration_s / tick_s));
    plan.amplitude = wanted.amplitude;
    plan.step_rad = 2.0f * OMNI_PI_F * tick_s * wanted.from_hz;
    plan.phase_acceleration_rad =
        2.0f * OMNI_PI_F * tick_s * (wanted.to_hz - wanted.from_hz) / static_cast<float>(plan.ticks);
    return plan;
}

} // namespace

OMNI_COLD uint8_t Excitations::refuse(const char *why) {
    texts_.refuse(MAV_SEVERITY_WARNING, Text().add("not excited: ").add(why));
    return MAV_RESULT_DENIED;
}

/// @return nullptr, or the reason for refusal. NaN is out of range.
OMNI_COLD const char *Excitations::check_numbers(const Wanted &wanted) const {
    if (!is_integer_within(wanted.place, 1.0f, OMNI_EXCITATION_COUNT - 1)) {
        return "no such place";
    }
    const auto wheels = static_cast<float>(parameters_.config().kinematics.wheels);
    const bool pose = wanted.place == static_cast<float>(OMNI_EXCITATION_POSE);
    if (!is_integer_within(wanted.index, 0.0f, pose ? static_cast<float>(OMNI_AXES - 1) : wheels)) {
        return "no such wheel or axis";
    }
    if (!(wanted.duration_s >= tick_s && wanted.duration_s <= max_s)) {
        return "0.001 to 120 s";
    }
    return is_frequency(wanted.from_hz) && is_frequency(wanted.to_hz) ? nullptr : "0 to 400 Hz";
}

OMNI_COLD const char *Excitations::check_amplitude(const Wanted &wanted) const {
    const omni_robot_config_t &config = parameters_.config();
    const float size = omni_absf(wanted.amplitude);
    switch (static_cast<uint8_t>(wanted.place)) {
    case OMNI_EXCITATION_WHEEL:
        return size <= config.limits.wheel_rad_s ? nullptr : "beyond LIM_WHEEL";
    case OMNI_EXCITATION_VOLTAGE:
        return size <= config.wheel_speed.duty_limit * config.limits.supply_nominal_V ? nullptr
                                                                                      : "beyond LIM_DUTY of BAT_V_NOM";
    default:
        if (wanted.index == static_cast<float>(OMNI_AXES - 1)) {
            return size <= error_share * config.limits.error_rad ? nullptr : "beyond half of SAFE_ERR_TH";
        }
        return size <= error_share * config.limits.error_m ? nullptr : "beyond half of SAFE_ERR_XY";
    }
}

OMNI_COLD const char *Excitations::check_state(uint8_t place) const {
    if (robot_.state() != OMNI_STATE_ARMED || robot_.stopping()) {
        return "arm first";
    }
    if (omni_excitation_fits(place, robot_.latest().outputs.setpoint_kind)) {
        return nullptr;
    }
    switch (place) {
    case OMNI_EXCITATION_WHEEL:
        return "needs velocity setpoints";
    case OMNI_EXCITATION_VOLTAGE:
        return "not with open-loop duties";
    default:
        return "needs a held pose, or pose setpoints";
    }
}

OMNI_COLD uint8_t Excitations::start(const Wanted &wanted) {
    if (wanted.place == static_cast<float>(OMNI_EXCITATION_NONE)) {
        control_.excite({});
        return MAV_RESULT_ACCEPTED;
    }
    const char *why = check_numbers(wanted);
    why = why != nullptr ? why : check_amplitude(wanted);
    if (why == nullptr && robot_.state() != OMNI_STATE_ARMED && robot_.arming() && !robot_.stopping()) {
        return MAV_RESULT_TEMPORARILY_REJECTED; // arming is pending: the setpoint in use is not in a report yet
    }
    why = why != nullptr ? why : check_state(static_cast<uint8_t>(wanted.place));
    if (why != nullptr) {
        return refuse(why);
    }
    control_.excite(plan_of(wanted));
    return MAV_RESULT_ACCEPTED;
}

} // namespace omni
