// SPDX-License-Identifier: MIT
/// @file excitations.h  MAV_CMD_OMNI_EXCITE: validates an excitation signal and passes it to the tick. A prepared burst
/// starts with it.
#pragma once

#include "app/services/parameters.h"
#include "app/services/robot_state.h"

namespace omni {

class Excitations {
public:
    static constexpr float max_s = 120.0f;
    static constexpr float max_hz = 400.0f;

    /// Parameters of the command.
    struct Wanted {
        float place = 0.0f;
        float index = 0.0f;
        float amplitude = 0.0f;
        float duration_s = 0.0f;
        float from_hz = 0.0f;
        float to_hz = 0.0f;
    };

    Excitations(Texts &texts, const RobotState &robot, ControlLoop &control, const Parameters &parameters)
        : texts_(texts), robot_(robot), control_(control), parameters_(parameters) {}

    /// @return MAV_RESULT
    uint8_t start(const Wanted &wanted);

private:
    uint8_t refuse(const char *why);
    const char *check_numbers(const Wanted &wanted) const;
    const char *check_amplitude(const Wanted &wanted) const;
    const char *check_state(uint8_t place) const;

    Texts &texts_;
    const RobotState &robot_;
    ControlLoop &control_;
    const Parameters &parameters_;
};

} // namespace omni
