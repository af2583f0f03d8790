/* SPDX-License-Identifier: MIT */
#include "omni/safety.h"

/* Rows: state. Columns: READY, ARM, DISARM, FAULT, ESTOP, ESTOP_CLEAR. */
static const uint8_t next_state[OMNI_STATE_COUNT][OMNI_SAFETY_EVENT_COUNT] = {
    [OMNI_STATE_INIT] = {OMNI_STATE_DISARMED, OMNI_STATE_INIT, OMNI_STATE_INIT, OMNI_STATE_INIT, OMNI_STATE_ESTOP,
                         OMNI_STATE_INIT},
    [OMNI_STATE_DISARMED] = {OMNI_STATE_DISARMED, OMNI_STATE_ARMED, OMNI_STATE_DISARMED, OMNI_STATE_DISARMED,
                             OMNI_STATE_ESTOP, OMNI_STATE_DISARMED},
    [OMNI_STATE_ARMED] = {OMNI_STATE_ARMED, OMNI_STATE_ARMED, OMNI_STATE_DISARMED, OMNI_STATE_FAILSAFE,
                          OMNI_STATE_ESTOP, OMNI_STATE_ARMED},
    [OMNI_STATE_FAILSAFE] = {OMNI_STATE_FAILSAFE, OMNI_STATE_FAILSAFE, OMNI_STATE_DISARMED, OMNI_STATE_FAILSAFE,
                             OMNI_STATE_ESTOP, OMNI_STATE_FAILSAFE},
    [OMNI_STATE_ESTOP] = {OMNI_STATE_ESTOP, OMNI_STATE_ESTOP, OMNI_STATE_ESTOP, OMNI_STATE_ESTOP, OMNI_STATE_ESTOP,
                          OMNI_STATE_DISARMED},
};

static const char *const state_names[OMNI_STATE_COUNT] = {
    [OMNI_STATE_INIT] = "init",         [OMNI_STATE_DISARMED] = "disarmed", [OMNI_STATE_ARMED] = "armed",
    [OMNI_STATE_FAILSAFE] = "failsafe", [OMNI_STATE_ESTOP] = "estop",
};

typedef struct fault_name_t {
    uint32_t bit;
    const char *name;
} fault_name_t;

static const fault_name_t fault_names[] = {
    {OMNI_FAULT_NOT_FINITE, "not finite"},
    {OMNI_FAULT_TIME, "time"},
    {OMNI_FAULT_ENCODER, "encoder"},
    {OMNI_FAULT_STALL, "stall"},
    {OMNI_FAULT_COMMAND_LOSS, "command loss"},
    {OMNI_FAULT_LINK_LOSS, "link loss"},
    {OMNI_FAULT_BATTERY, "battery"},
    {OMNI_FAULT_DRIVER, "driver"},
    {OMNI_FAULT_TRACKING, "tracking"},
    {OMNI_FAULT_CONFIG, "config"},
    {OMNI_FAULT_OVERRUN, "overrun"},
    {OMNI_FAULT_POSITION, "position"},
    {OMNI_FAULT_MOTOR_HEAT, "motor heat"},
    {OMNI_FAULT_OVERSPEED, "overspeed"},
    {OMNI_WARN_POSE_STALE, "pose stale"},
    {OMNI_WARN_FIX_REFUSED, "fix refused"},
    {OMNI_WARN_SETPOINT, "setpoint"},
    {OMNI_WARN_SATURATED, "saturated"},
    {OMNI_WARN_ENCODER, "encoder glitch"},
    {OMNI_WARN_ISMC_GAIN, "ismc gain"},
    {OMNI_WARN_GYRO, "gyro"},
    {OMNI_WARN_MOTOR_WARM, "motor warm"},
    {OMNI_WARN_FLOW, "floor motion"},
};

omni_safety_state_t omni_safety_next(omni_safety_state_t state, omni_safety_event_t event) {
    if ((uint32_t)state >= (uint32_t)OMNI_STATE_COUNT || (uint32_t)event >= (uint32_t)OMNI_SAFETY_EVENT_COUNT) {
        return OMNI_STATE_ESTOP;
    }
    return (omni_safety_state_t)next_state[state][event];
}

const char *omni_safety_state_name(omni_safety_state_t state) {
    return (uint32_t)state < (uint32_t)OMNI_STATE_COUNT ? state_names[state] : "?";
}

const char *omni_fault_name(uint32_t single_bit) {
    for (size_t i = 0; i < sizeof fault_names / sizeof fault_names[0]; i++) {
        if (fault_names[i].bit == single_bit) {
            return fault_names[i].name;
        }
    }
    return "?";
}
