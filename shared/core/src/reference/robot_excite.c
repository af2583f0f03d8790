/* SPDX-License-Identifier: MIT */
#include "../math/math_inline.h"
#include "../tick/stages.h"

bool omni_excitation_fits(uint8_t place, uint8_t kind) {
    switch (place) {
    case OMNI_EXCITATION_WHEEL:
        return kind == OMNI_SETPOINT_VELOCITY_BODY || kind == OMNI_SETPOINT_VELOCITY_WORLD;
    case OMNI_EXCITATION_VOLTAGE:
        return kind != OMNI_SETPOINT_DUTY;
    case OMNI_EXCITATION_POSE:
        return kind == OMNI_SETPOINT_NONE || kind == OMNI_SETPOINT_POSE;
    default:
        return false;
    }
}

static bool excitation_may_continue(omni_excitation_state_t *exciter, const omni_robot_config_t *c,
                                    const omni_inputs_t *inputs, const omni_target_t *target) {
    const uint32_t hold = (uint32_t)OMNI_EVENT_TRAJECTORY_STOP;
    if (!exciter->started) {
        exciter->started = true;
        exciter->kind = target->kind;
        exciter->controller = c->controller;
    }
    return target->armed && (inputs->events & hold) == 0 && target->kind == exciter->kind &&
           c->controller == exciter->controller && omni_excitation_fits(exciter->plan.place, target->kind);
}

static void add_to_reference_pose(const omni_excitation_state_t *exciter, omni_target_t *target) {
    omni_pose_t *pose = &target->reference.pose;
    switch (exciter->plan.index) {
    case 0:
        pose->x += exciter->value;
        break;
    case 1:
        pose->y += exciter->value;
        break;
    default:
        pose->theta += exciter->value;
        break;
    }
}

const omni_excitation_state_t *omni_robot_excite(omni_excitation_state_t *exciter, const omni_robot_config_t *config,
                                                 const omni_inputs_t *inputs, omni_target_t *target) {
    if (!excitation_may_continue(exciter, config, inputs, target)) {
        exciter->ticks_left = 0;
        return NULL;
    }
    omni_excitation_next(exciter);
    if (exciter->plan.place == OMNI_EXCITATION_POSE) {
        add_to_reference_pose(exciter, target);
        return NULL;
    }
    return exciter;
}

void omni_add_wheel_excitation(const omni_excitation_state_t *exciter, uint8_t wheels, omni_real_t factor,
                               omni_real_t limit, omni_real_t *values) {
    for (uint8_t i = 0; i < wheels; ++i) {
        if (exciter->plan.index == i || exciter->plan.index == OMNI_MAX_WHEELS) {
            values[i] = omni_clampf(values[i] + exciter->value * factor, -limit, limit);
        }
    }
}
