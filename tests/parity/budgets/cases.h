// SPDX-License-Identifier: MIT
/// @file cases.h  What the budgets are measured in.
#pragma once

#include <cstddef>
#include <cstdint>

#include "app/base/core.h"

struct Setting {
    int32_t parameter;
    omni_real_t value;
};

struct Case {
    static constexpr size_t max_settings = 6;
    const char *name;
    const char *robot;
    uint8_t setpoint;    ///< omni_setpoint_kind_t
    uint32_t fix_period; ///< ticks; 0: none
    uint32_t fix_age;    ///< ticks
    Setting settings[max_settings];
    size_t settings_used;
    bool burst = false; ///< everything is being recorded meanwhile
    bool gyro = false;  ///< it reads in every tick
    bool flow = false;  ///< a sensor of motion over the floor reads in every twentieth, that of a fix
};

extern const Case cases[];
extern const size_t case_count;
