// SPDX-License-Identifier: MIT
#include "app/services/status_light.h"

namespace omni {

uint32_t light_pattern(omni_safety_state_t state, bool ground_station) {
    switch (state) {
    case OMNI_STATE_INIT:
        return 0xFFFFFu; // steady
    case OMNI_STATE_DISARMED:
        return ground_station ? 0x00001u : 0x00005u; // one short flash, or two
    case OMNI_STATE_ARMED:
        return 0x55555u; // five flashes a second
    case OMNI_STATE_FAILSAFE:
        return 0x01CE7u; // three flashes and a pause
    case OMNI_STATE_ESTOP:
    default:
        return 0x003FFu; // one second on, one second off
    }
}

bool light_on(omni_safety_state_t state, bool ground_station, uint64_t now_us) {
    const auto slot = static_cast<uint32_t>(now_us / light_slot_us % light_slots);
    return (light_pattern(state, ground_station) >> slot & 1u) != 0;
}

} // namespace omni
