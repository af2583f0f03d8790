/* SPDX-License-Identifier: MIT */
/**
 * @file controllers.h
 * Position controllers as rows of a table. CTL_MODE picks the row; what selects, resets, hands over and drives the
 * wheels reads the row and knows no controller by name. The values of CTL_MODE in params.toml are the table. For a
 * value `name` a source in this folder has the row `omni_controller_row_name` and the function `omni_configure_name`.
 * docs/how-to-add/controller.md is the recipe.
 *
 * What a row points to is called controller_reset_..., controller_step_... and controller_margin_...: the bounds of
 * stack and run time find it by that.
 */
#ifndef OMNI_CONTROLLERS_H
#define OMNI_CONTROLLERS_H

#include "../tick/stages.h"

/** A row. */
typedef struct omni_controller_t {
    uint8_t demand; /**< omni_demand_kind_t */
    /** A robot arms, or begins or stops to track: integrals of another time would make the wheels jerk. */
    void (*reset)(omni_control_state_t *control);
    /**
     * Pose error to control->demand: all of `terms`, and what belongs to the row's kind.
     * @param saturated the wheels were cut in the last tick: integrals may shrink but not grow.
     */
    void (*step)(omni_control_state_t *control, const omni_robot_config_t *config, const omni_estimate_t *estimate,
                 const omni_reference_t *reference, omni_flag_t saturated);
    /**
     * By how much the gains cover a slip error, per axis; NULL: the controller knows no such condition.
     * @param slip the largest plausible slip error, as a world twist.
     * @return whether a negative margin is worth a warning.
     */
    bool (*margin)(const omni_robot_config_t *config, const omni_twist_t *slip, omni_real_t margin[OMNI_AXES]);
} omni_controller_t;

/** By value of CTL_MODE. */
extern const omni_controller_t *const omni_controllers[OMNI_CTL_MODE_COUNT];

/**
 * omni_configure_name: the controller's configuration from a set of checked parameters. The fields before the
 * controllers' in omni_robot_config_t are there already, step_s and control_period, too. Background work, never in a
 * tick. It is called for every row, and once more for the row in use: rows may share their configuration's place.
 * @return OMNI_OK, or why the set is refused, with the parameter at fault in `bad_index`.
 */
#define OMNI_ROW(NAME, name)                                                                                           \
    extern const omni_controller_t omni_controller_row_##name;                                                         \
    omni_result_t omni_configure_##name(omni_robot_config_t *config, const omni_real_t *values, int32_t *bad_index);
OMNI_CTL_MODE_ROWS(OMNI_ROW)
#undef OMNI_ROW

#endif
