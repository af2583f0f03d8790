// SPDX-License-Identifier: MIT
/// @file tick_report.h  Report of a tick for the background.
#pragma once

#include <cstdint>

#include "app/base/board.h"
#include "app/base/core.h"
#include "app/tick/i2c_scan.h"

namespace omni {

/// Result of a pose fix; values of OMNI_FIX_RESULT.
enum class FixUse : uint8_t {
    none,     ///< no fix yet
    used,     ///< used by the estimator
    too_far,  ///< refused by the gate (EKF_GATE)
    unusable, ///< refused: too old, out of order, ahead of the robot's clock, or not finite
    ignored   ///< ignored: EKF_MODE is odometry
};

/// Pose fix processed by a tick.
struct FixReport {
    omni_pose_t pose{};
    uint32_t number = 0; ///< sequence number from 1; 0: none yet
    float age_s = 0.0f;  ///< age at arrival; negative: ahead of the robot's clock
    FixUse use = FixUse::none;
};

struct TickReport {
    omni_outputs_t outputs{};
    uint32_t arming_faults = OMNI_FAULT_CONFIG; ///< 0: arming is possible
    uint32_t ticks = 0;
    uint32_t overruns = 0;
    uint32_t i2c_errors = 0;
    float battery_V = 0.0f;    ///< as measured
    float tick_us_mean = 0.0f; ///< of the last complete window of ticks
    float tick_us_max = 0.0f;
    float tick_jitter_us_max = 0.0f; ///< TickJitter in that window; 0 in hardware-in-the-loop
    uint32_t last_tick_ns = 0;       ///< duration of the previous tick; only during a burst
    uint64_t fix_us = 0;             ///< arrival of the last used pose fix; 0: none since the pose was set
    float noise_factor = 1.0f;       ///< lambda of the pose filter, omni/pose_ekf.h
    float fix_factor = 1.0f;         ///< rho
    uint32_t fix_restarts = 0;       ///< restarts of the pose filter from consistent refused fixes
    int32_t counts[OMNI_MAX_WHEELS] = {};
    uint32_t volt_us[OMNI_MAX_WHEELS] = {}; ///< integral of the motor voltages before this tick [1e-6 V s], modulo 2^32
    uint32_t encoder_errors[OMNI_MAX_WHEELS] = {};
    I2cStats i2c;
    I2cFound i2c_found;
    bool read_back_missing = false; ///< MotorDriver::read_back_missing()
};

} // namespace omni
