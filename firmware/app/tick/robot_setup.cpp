// SPDX-License-Identifier: MIT
#include "app/tick/robot_setup.h"

namespace omni {
namespace {

Wiring wiring_of(const omni_real_t *values) {
    Wiring wiring;
    wiring.driver = static_cast<uint8_t>(values[OMNI_PARAM_MOT_DRIVER]);
    wiring.wheels = static_cast<uint8_t>(values[OMNI_PARAM_WHEELS]);
    for (size_t i = 0; i < OMNI_MAX_WHEELS; ++i) {
        wiring.in1[i] = static_cast<uint8_t>(values[OMNI_PARAM_W1_IN1_CH + i]);
        wiring.in2[i] = static_cast<uint8_t>(values[OMNI_PARAM_W1_IN2_CH + i]);
    }
    return wiring;
}

/// Parameter of a bridge's input: IN1 of all wheels, then IN2.
int32_t input_parameter(int32_t input, int32_t wheels) {
    return input < wheels ? OMNI_PARAM_W1_IN1_CH + input : OMNI_PARAM_W1_IN2_CH + input - wheels;
}

/// @return parameter that assigns a channel of the PWM chip twice, or -1.
int32_t shared_channel(const omni_real_t *values) {
    const auto wheels = static_cast<int32_t>(values[OMNI_PARAM_WHEELS]);
    for (int32_t i = 0; i < 2 * wheels; ++i) {
        for (int32_t j = 0; j < i; ++j) {
            if (values[input_parameter(i, wheels)] == values[input_parameter(j, wheels)]) {
                return input_parameter(i, wheels);
            }
        }
    }
    return -1;
}

} // namespace

omni_result_t make_robot_setup(RobotSetup &setup, const omni_real_t *values, int32_t *bad_index) {
    *bad_index = -1;
    const omni_result_t result = omni_robot_config(&setup.config, values, bad_index);
    if (result != OMNI_OK) {
        return result;
    }
    setup.wiring = wiring_of(values);
    if (setup.wiring.driver == OMNI_MOT_DRIVER_PCA9685) {
        *bad_index = shared_channel(values);
    }
    return *bad_index < 0 ? OMNI_OK : OMNI_ERR_RANGE;
}

void fallback_parameters(omni_real_t *values) {
    omni_params_defaults(values);
    const auto wheels = static_cast<size_t>(values[OMNI_PARAM_WHEELS]);
    for (size_t i = 0; i < wheels; ++i) {
        values[OMNI_PARAM_W1_ANGLE + i] = 360.0f / static_cast<float>(wheels) * static_cast<float>(i);
        values[OMNI_PARAM_W1_IN1_CH + i] = static_cast<float>(2 * i);
        values[OMNI_PARAM_W1_IN2_CH + i] = static_cast<float>(2 * i + 1);
    }
}

} // namespace omni
