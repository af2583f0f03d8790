// SPDX-License-Identifier: MIT
/// @file motor_drivers.h  All motor drivers, generated from `motor_drivers` in shared/params.toml.
#pragma once

#include <cstdint>

#include "omni/motor_drivers_gen.h"

namespace omni {

class MotorDrivers {
public:
    /// Driver by number. @param number omni_mot_driver; an unknown one gives the PCA9685.
    MotorDriver &of(uint8_t number) {
        switch (number) {
#define OMNI_CASE(type, name, value)                                                                                   \
    case value:                                                                                                        \
        return name;
            OMNI_MOTOR_DRIVERS(OMNI_CASE)
#undef OMNI_CASE
        default:
            return pca9685;
        }
    }

private:
#define OMNI_MEMBER(type, name, value) type name;
    OMNI_MOTOR_DRIVERS(OMNI_MEMBER)
#undef OMNI_MEMBER
};

} // namespace omni
