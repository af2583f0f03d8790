/* SPDX-License-Identifier: MIT */
/**
 * @file controllers.h
 * Table of position controllers. CTL_MODE selects the row; selection, reset, takeover and actuation use the row and no
 * controller's name. The rows are the values of CTL_MODE in params.toml. For a value `name` a source in this folder
 * defines the row `omni_controller_row_name` and the function `omni_configure_name`. Recipe:
 * docs/how-to-add/controller.md.
 *
 * Functions of a row are named controller_reset_..., controller_step_... and controller_margin_...: the analyses of
 * stack and run time resolve the function pointers by these prefixes.
 */
#ifndef OMNI_CONTROLLERS_H
#define OMNI_CONTROLLERS_H

#include "../tick/stages.h"

/** Position controller: row of the table. */
typedef struct omni_controller_t {
    uint8_t demand; /**< omni_demand_kind_t */
    /** Reset on arming and when tracking starts or stops: old integrals would cause a jump. */
    void (*reset)(omni_control_state_t *control);
    /**
     * Compute control->demand from the pose error: `terms`, and the member that belongs to `demand`.
     * @param saturated actuation was limited in the last tick: integrals may shrink but not grow (anti-windup).
     */
    void (*step)(omni_control_state_t *control, const omni_robot_config_t *config, const omni_estimate_t *estimate,
                 const omni_reference_t *reference, omni_flag_t saturated);
    /**
     * Margin of the gains over a slip error, per axis; NULL: no such condition.
     * @param slip the largest plausible slip error, as a world twist.
     * @return true: a negative margin raises a warning.
     */
    bool (*margin)(const omni_robot_config_t *config, const omni_twist_t *slip, omni_real_t margin[OMNI_AXES]);
} omni_controller_t;

/** Indexed by CTL_MODE. */
extern const omni_controller_t *const omni_controllers[OMNI_CTL_MODE_COUNT];

/**
 * omni_configure_name: derive the controller's configuration from range-checked parameters. Members before the
 * controllers' in omni_robot_config_t, step_s and control_period are already set. Runs in the background. Called for
 * every row, then again for the row in use, as rows may share their configuration.
 * @return OMNI_OK, or the reason for rejection, with the invalid parameter in `bad_index`.
 */
#define OMNI_ROW(NAME, name)                                                                                           \
    extern const omni_controller_t omni_controller_row_##name;                                                         \
    omni_result_t omni_configure_##name(omni_robot_config_t *config, const omni_real_t *values, int32_t *bad_index);
OMNI_CTL_MODE_ROWS(OMNI_ROW)
#undef OMNI_ROW

#endif
