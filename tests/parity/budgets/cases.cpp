// SPDX-License-Identifier: MIT
#include "cases.h"

namespace {

constexpr Setting ismc{OMNI_PARAM_CTL_MODE, OMNI_CTL_MODE_ISMC};
constexpr Setting gyro{OMNI_PARAM_GYRO_AXIS, 3};
constexpr Setting flow{OMNI_PARAM_FLOW_MODE, OMNI_FLOW_MODE_XY_TURN};
constexpr Setting rose{OMNI_PARAM_TRJ_TYPE, OMNI_TRJ_TYPE_ROSE};

constexpr Setting controller(int mode) {
    return {OMNI_PARAM_CTL_MODE, static_cast<omni_real_t>(mode)};
}

} // namespace

// The robots' own parameters: three-state motor filters and the pose filter with slip states, rose with a swinging
// heading.
constexpr Case cases[] = {
    {"every_filter", "three_wheel", OMNI_SETPOINT_TRAJECTORY, 20, 20, {ismc, rose}, 2},
    {"every_filter_burst", "three_wheel", OMNI_SETPOINT_TRAJECTORY, 20, 20, {ismc, rose}, 2, true},
    {"every_filter_no_fix", "three_wheel", OMNI_SETPOINT_TRAJECTORY, 0, 0, {ismc, rose}, 2},
    {"every_filter_late_fix", "three_wheel", OMNI_SETPOINT_TRAJECTORY, 20, 250, {ismc, rose}, 2},
    {"four_wheels", "four_wheel", OMNI_SETPOINT_TRAJECTORY, 20, 20, {ismc, rose}, 2},
    {"four_wheels_late_fix", "four_wheel", OMNI_SETPOINT_TRAJECTORY, 20, 250, {ismc, rose}, 2},
    {"gyro", "three_wheel", OMNI_SETPOINT_TRAJECTORY, 20, 20, {ismc, rose, gyro}, 3, false, true},
    {"gyro_late_fix", "three_wheel", OMNI_SETPOINT_TRAJECTORY, 20, 250, {ismc, rose, gyro}, 3, false, true},
    {"gyro_four_wheels", "four_wheel", OMNI_SETPOINT_TRAJECTORY, 20, 20, {ismc, rose, gyro}, 3, false, true},
    {"flow", "three_wheel", OMNI_SETPOINT_TRAJECTORY, 20, 20, {ismc, rose, flow}, 3, false, false, true},
    {"flow_gyro_late_fix",
     "three_wheel",
     OMNI_SETPOINT_TRAJECTORY,
     20,
     250,
     {ismc, rose, gyro, flow},
     4,
     false,
     true,
     true},
    {"super_twisting",
     "three_wheel",
     OMNI_SETPOINT_TRAJECTORY,
     20,
     20,
     {ismc, rose, {OMNI_PARAM_ISMC_SWITCH, OMNI_ISMC_SWITCH_SUPER_TWISTING}},
     3},
    {"p", "three_wheel", OMNI_SETPOINT_TRAJECTORY, 20, 20, {controller(OMNI_CTL_MODE_P), rose}, 2},
    {"pd", "three_wheel", OMNI_SETPOINT_TRAJECTORY, 20, 20, {controller(OMNI_CTL_MODE_PD), rose}, 2},
    {"pid", "three_wheel", OMNI_SETPOINT_TRAJECTORY, 20, 20, {controller(OMNI_CTL_MODE_PID), rose}, 2},
    {"original", "three_wheel", OMNI_SETPOINT_TRAJECTORY, 20, 20, {controller(OMNI_CTL_MODE_ORIGINAL), rose}, 2},
    {"torque", "three_wheel", OMNI_SETPOINT_TRAJECTORY, 20, 20, {controller(OMNI_CTL_MODE_TORQUE), rose}, 2},
    {"report_path",
     "three_wheel",
     OMNI_SETPOINT_TRAJECTORY,
     20,
     20,
     {ismc, {OMNI_PARAM_TRJ_TYPE, OMNI_TRJ_TYPE_REPORT}},
     2},
    {"pose_setpoint", "three_wheel", OMNI_SETPOINT_POSE, 20, 20, {ismc}, 1},
    {"velocity", "three_wheel", OMNI_SETPOINT_VELOCITY_BODY, 20, 20, {controller(OMNI_CTL_MODE_NONE)}, 1},
    {"filters_off",
     "three_wheel",
     OMNI_SETPOINT_TRAJECTORY,
     0,
     0,
     {ismc, rose, {OMNI_PARAM_KF_MODE, OMNI_KF_MODE_OFF}, {OMNI_PARAM_EKF_MODE, OMNI_EKF_MODE_ODOMETRY}},
     4},
};

namespace {

constexpr bool is_measured(int mode) {
    for (const Case &measured : cases) {
        for (size_t i = 0; i < measured.settings_used; ++i) {
            const Setting &setting = measured.settings[i];
            if (setting.parameter == OMNI_PARAM_CTL_MODE && setting.value == static_cast<omni_real_t>(mode)) {
                return true;
            }
        }
    }
    return false;
}

#define IS_MEASURED(NAME, name)                                                                                        \
    static_assert(is_measured(OMNI_CTL_MODE_##NAME), "the controller " #name " has no row in `cases`: add one there");
OMNI_CTL_MODE_ROWS(IS_MEASURED)
#undef IS_MEASURED

} // namespace

const size_t case_count = sizeof cases / sizeof cases[0];
