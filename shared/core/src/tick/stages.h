/* SPDX-License-Identifier: MIT */
/**
 * @file stages.h Stages of omni_robot_tick and the data between them. A stage reads const inputs, writes its result and
 * owns its state. Arrays per wheel: entries beyond the number of wheels are unused, and zero in the outputs.
 *
 *   stage        reads                                        writes
 *   estimate     inputs, last actuation                       omni_estimate_t, faults
 *   supervise    inputs, estimate, last actuation             faults, the kind of setpoint that may be followed
 *   transition   inputs, faults                               the safety state
 *   reference    inputs, estimate, safety state               omni_target_t
 *   excite       inputs, target                               the target's pose, the excitation of wheels
 *   control      inputs, estimate, target                     omni_actuation_t
 *   limit        motor speeds, omni_actuation_t               omni_actuation_t, if LIM_I is set
 *   gain margin  estimate, target                             margins, a warning
 *   overspeed    counts, target, omni_actuation_t             a fault of the next tick
 *   report       all results                                  omni_outputs_t
 */
#ifndef OMNI_STAGES_H
#define OMNI_STAGES_H

#include "omni/robot.h"

/** Estimated state of the robot in this tick. */
typedef struct omni_estimate_t {
    omni_real_t wheel_rad_s[OMNI_MAX_WHEELS];
    omni_real_t slip_m_s[OMNI_MAX_WHEELS];   /**< v_s */
    omni_real_t slip_ratio[OMNI_MAX_WHEELS]; /**< s; 0 unless the filter estimates it */
    omni_real_t supply_V;                    /**< > 0 */
    omni_pose_t pose;
    omni_twist_t rate; /**< world twist from the wheels */
    omni_real_t nis;
    omni_uint_t fixes_accepted;
    omni_uint_t fixes_refused;
    omni_rotation_t heading;                  /**< of `pose` */
    omni_int_t delta_counts[OMNI_MAX_WHEELS]; /**< in the wheel's direction */
    uint32_t steps;                           /**< tick periods since the last tick, 0 on the first */
    bool fix_is_fresh;                        /**< a pose fix has been accepted within FIX_TIMEOUT */
} omni_estimate_t;

/** Reference of this tick. */
typedef struct omni_target_t {
    omni_reference_t reference;
    omni_twist_t body_rate;                    /**< velocity reference, body frame; used unless `position_loop` */
    omni_real_t velocity_scale;                /**< limiting factor of the velocity, 1: none */
    omni_uint_t velocity_limits;               /**< active omni_velocity_limit_t */
    const omni_excitation_state_t *excitation; /**< excitation of wheels in this tick; NULL: none */
    uint8_t kind;                              /**< omni_setpoint_kind_t in use */
    bool armed;                                /**< false: the wheels are not driven */
    bool position_loop;                        /**< the reference's pose is to be tracked; false unless armed */
} omni_target_t;

/** Actuation of the wheels, positive in the wheels' directions. */
typedef struct omni_actuation_t {
    omni_real_t duty[OMNI_MAX_WHEELS];            /**< -1..1 after the gate at the end of the tick */
    omni_real_t wheel_reference[OMNI_MAX_WHEELS]; /**< rad/s */
    omni_real_t wheel_scale;                      /**< saturation factor of the wheel speeds, 1: none */
    omni_real_t duty_scale;                       /**< saturation factor of the voltages, 1: none */
    bool drive;                                   /**< motors may have power */
} omni_actuation_t;

/** Estimation stage: time, counts, wheel filters, pose filter. @return faults and warnings. */
omni_uint_t omni_robot_estimate(omni_estimator_t *estimator, const omni_robot_config_t *config,
                                const omni_inputs_t *inputs, const omni_applied_t *last, omni_estimate_t *estimate);

/** Restart the pose estimate at inputs->pose, which must be finite. Slip and wheel speeds of this tick's estimate are
 * kept. */
void omni_robot_set_pose(omni_estimator_t *estimator, const omni_robot_config_t *config, const omni_inputs_t *inputs,
                         omni_estimate_t *estimate);

/** Restart a filter whose state has become not finite. */
void omni_robot_restart_filters(omni_estimator_t *estimator, const omni_robot_config_t *config,
                                const omni_estimate_t *estimate);

/** Seconds from `since_us` to `now_us`; 0 for a stamp from the future, at most 4295 s. */
omni_real_t omni_robot_age_s(uint64_t now_us, uint64_t since_us);

/**
 * Supervision stage: fault detection.
 * @param reference the last tick's pose reference.
 * @param kind out: omni_setpoint_kind_t of the setpoint if it may be followed, else OMNI_SETPOINT_NONE.
 * @return stop faults and warnings.
 */
omni_uint_t omni_robot_supervise(omni_supervisor_t *supervisor, const omni_robot_config_t *config,
                                 const omni_inputs_t *inputs, const omni_estimate_t *estimate,
                                 const omni_pose_t *reference, const omni_applied_t *last, uint8_t *kind);

/** Apply events and faults to the safety state machine. @return true if the robot was armed in this tick, even if
 * another event disarmed it again. */
bool omni_robot_transition(omni_supervisor_t *supervisor, const omni_inputs_t *inputs, omni_uint_t faults);

/** Apply a stop fault of a late stage to the history and the safety state machine. */
void omni_robot_stop(omni_supervisor_t *supervisor, uint32_t fault);

/** Apply the events that start and stop the trajectory. */
void omni_robot_reference_events(omni_reference_generator_t *generator, const omni_inputs_t *inputs,
                                 const omni_estimate_t *estimate);

/** Reset the reference on arming: hold the estimated pose at rest; a trajectory starts now. */
void omni_robot_reference_arm(omni_reference_generator_t *generator, const omni_inputs_t *inputs,
                              const omni_estimate_t *estimate);

/** Reference stage. @param kind from omni_robot_supervise. @param target in: `armed`;
 * out: all else. */
void omni_robot_reference(omni_reference_generator_t *generator, const omni_robot_config_t *config,
                          const omni_inputs_t *inputs, const omni_estimate_t *estimate, uint8_t kind,
                          omni_target_t *target);

/**
 * Advance or end a running excitation. One of the pose is added to the target's reference here.
 * @return the excitation if it is to be added to wheels in this tick, else NULL.
 */
const omni_excitation_state_t *omni_robot_excite(omni_excitation_state_t *exciter, const omni_robot_config_t *config,
                                                 const omni_inputs_t *inputs, omni_target_t *target);

/** Add this tick's excitation times `factor` to its wheels' values, clamped to +-limit. */
void omni_add_wheel_excitation(const omni_excitation_state_t *exciter, uint8_t wheels, omni_real_t factor,
                               omni_real_t limit, omni_real_t *values);

/** Reset all controllers and wheel loops to their initial state. */
void omni_robot_control_reset(omni_control_state_t *control);

/**
 * Control stage: reference to duties.
 * @param applied in: saturation in the last tick; out: saturation and tracking error in this one.
 */
void omni_robot_control(omni_control_state_t *control, const omni_robot_config_t *config, const omni_inputs_t *inputs,
                        const omni_estimate_t *estimate, const omni_target_t *target, omni_applied_t *applied,
                        omni_actuation_t *actuation);

/**
 * Check whether the controller's gains exceed the bound of the slip error (condition 44 of the integral sliding mode).
 * Evaluated in every eighth tick; the result is held in between.
 * @param state out: `margin` per axis; 0 unless a controller with such a condition is tracking.
 * @return OMNI_WARN_ISMC_GAIN, or 0.
 */
omni_uint_t omni_robot_gain_margin(omni_gain_margin_t *state, const omni_robot_config_t *config,
                                   const omni_pose_ekf_state_t *ekf, const omni_estimate_t *estimate,
                                   const omni_target_t *target);

/**
 * Overspeed detection: a wheel faster than its reference for OMNI_OVERSPEED_CHECKS checks, or faster than a tenth of
 * LIM_WHEEL while the robot is not armed. Called every OMNI_OVERSPEED_CHECK_TICKS ticks, and on arming and disarming.
 * Not active with duty setpoints. omni_robot_supervise reports the fault in the next tick; for a robot that is not
 * armed only omni_robot_arming_faults does.
 */
void omni_robot_watch_speeds(omni_speed_watch_t *watch, const omni_robot_config_t *config,
                             const omni_estimator_t *estimator, const omni_estimate_t *estimate,
                             const omni_target_t *target, const omni_actuation_t *actuation)
    __attribute__((noinline, cold));

/**
 * The motors' currents and their heat; called only if config->current.enabled. @param last actuation of the last tick.
 * @return OMNI_FAULT_MOTOR_HEAT and OMNI_WARN_MOTOR_WARM, or 0.
 */
omni_uint_t omni_robot_watch_currents(omni_supervisor_t *supervisor, const omni_robot_config_t *config,
                                      const omni_estimate_t *estimate, const omni_applied_t *last);

/** Apply the current limit to the final duties; called only if config->current.limit_enabled, while armed. */
void omni_robot_limit_currents(omni_control_state_t *control, const omni_robot_config_t *config,
                               const omni_current_state_t *state, omni_real_t supply_V, omni_applied_t *applied,
                               omni_actuation_t *actuation);

/** Report currents and heat; called only if config->current.enabled, otherwise the wheel filter's currents are. */
void omni_robot_report_currents(const omni_current_state_t *state, const omni_applied_t *applied,
                                omni_outputs_t *outputs);

#endif
