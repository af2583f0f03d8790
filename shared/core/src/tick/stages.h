/* SPDX-License-Identifier: MIT */
/**
 * @file stages.h
 * The stages of omni_robot_tick, and what they hand on. A stage reads what it is given as const, writes its own result
 * and keeps its own state. Per wheel: as many entries count as there are wheels; the others are zero in what is
 * reported.
 *
 *   stage        reads                                        writes
 *   estimate     inputs, what the last tick did               omni_estimate_t, faults
 *   supervise    inputs, estimate, what the last tick did     faults, the kind of set-point that may be followed
 *   transition   inputs, faults                               the safety state
 *   reference    inputs, estimate, safety state               omni_target_t
 *   excite       inputs, target                               the target's pose, what `control` adds (if anything)
 *   control      inputs, estimate, target                     omni_actuation_t
 *   limit        the motors' speeds, omni_actuation_t         omni_actuation_t, if LIM_I is set
 *   gain margin  estimate, target                             margins that it keeps, a warning
 *   watch speeds counts, target, omni_actuation_t             a fault of the next tick
 *   report       all of these                                 omni_outputs_t
 */
#ifndef OMNI_STAGES_H
#define OMNI_STAGES_H

#include "omni/robot.h"

/** What the robot knows of itself in this tick. */
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

/** What is wanted of the robot in this tick. */
typedef struct omni_target_t {
    omni_reference_t reference;
    omni_twist_t body_rate;        /**< velocity demand, body frame; used unless `position_loop` */
    omni_real_t velocity_scale;    /**< factor that the limits left of the velocity asked for, 1: all of it */
    omni_uint_t velocity_limits;   /**< omni_velocity_limit_t that cut it */
    const omni_exciter_t *exciter; /**< what is added to wheels in this tick; NULL: nothing */
    uint8_t kind;                  /**< omni_setpoint_kind_t in force */
    bool armed;                    /**< false: nothing is wanted of the wheels */
    bool position_loop;            /**< the reference's pose is to be tracked; false unless armed */
} omni_target_t;

/** What the wheels are to be given. Everything is in the wheels' directions. */
typedef struct omni_actuation_t {
    omni_real_t duty[OMNI_MAX_WHEELS];            /**< -1..1 once it is sealed */
    omni_real_t wheel_reference[OMNI_MAX_WHEELS]; /**< rad/s */
    omni_real_t wheel_scale;                      /**< factor the wheel speeds were cut by, 1: none */
    omni_real_t duty_scale;                       /**< factor the voltages were cut by, 1: none */
    bool drive;                                   /**< motors may be powered */
} omni_actuation_t;

/** Time, counts, filters, pose. @return faults found on the way. */
omni_uint_t omni_robot_estimate(omni_estimator_t *estimator, const omni_robot_config_t *config,
                                const omni_inputs_t *inputs, const omni_applied_t *last, omni_estimate_t *estimate);

/** Restart the pose estimate at inputs->pose, which must be finite. Slip and its speeds stay as they were estimated in
 * this tick. */
void omni_robot_set_pose(omni_estimator_t *estimator, const omni_robot_config_t *config, const omni_inputs_t *inputs,
                         omni_estimate_t *estimate);

/** A filter that has met a number it cannot digest starts over instead of staying lost. */
void omni_robot_restart_filters(omni_estimator_t *estimator, const omni_robot_config_t *config,
                                const omni_estimate_t *estimate);

/** Seconds from `since_us` to `now_us`; 0 for a stamp from the future, at most 4295 s. */
omni_real_t omni_robot_age_s(uint64_t now_us, uint64_t since_us);

/**
 * Is anything wrong?
 * @param kind out: omni_setpoint_kind_t of the set-point if it may be followed, else OMNI_SETPOINT_NONE.
 * @return stop faults and warnings.
 */
omni_uint_t omni_robot_supervise(omni_supervisor_t *supervisor, const omni_robot_config_t *config,
                                 const omni_inputs_t *inputs, const omni_estimate_t *estimate,
                                 const omni_applied_t *last, uint8_t *kind);

/** Events and faults through the safety table. @return true if the robot has just been armed, whatever came after that.
 */
bool omni_robot_transition(omni_supervisor_t *supervisor, const omni_inputs_t *inputs, omni_uint_t faults);

/** A stop fault of the tick's last stages: into the history and through the safety table. */
void omni_robot_stop(omni_supervisor_t *supervisor, uint32_t fault);

/** Events that start or stop the trajectory. */
void omni_robot_guide_events(omni_guide_t *guide, const omni_inputs_t *inputs, const omni_estimate_t *estimate);

/** On arming: hold the pose, at rest; a trajectory starts now. */
void omni_robot_guide_arm(omni_guide_t *guide, const omni_inputs_t *inputs, const omni_estimate_t *estimate);

/** The set-point in force and its reference. @param kind as omni_robot_supervise gave it. @param target in: `armed`;
 * out: all else. */
void omni_robot_reference(omni_guide_t *guide, const omni_robot_config_t *config, const omni_inputs_t *inputs,
                          const omni_estimate_t *estimate, uint8_t kind, omni_target_t *target);

/**
 * One tick of an excitation that goes on, or its end. A pose is added to the target's reference.
 * @return the exciter if wheels get something in this tick, else NULL.
 */
const omni_exciter_t *omni_robot_excite(omni_exciter_t *exciter, const omni_robot_config_t *config,
                                        const omni_inputs_t *inputs, omni_target_t *target);

/** Add this tick's value times `factor` to the wheels it is for, within +-limit. */
void omni_robot_excite_wheels(const omni_exciter_t *exciter, uint8_t wheels, omni_real_t factor, omni_real_t limit,
                              omni_real_t *values);

/** All controllers as after switching on. */
void omni_robot_control_reset(omni_control_state_t *control);

/**
 * Reference to duties.
 * @param applied in: was the last tick saturated? out: is this one, and is the robot off its track?
 */
void omni_robot_control(omni_control_state_t *control, const omni_robot_config_t *config, const omni_inputs_t *inputs,
                        const omni_estimate_t *estimate, const omni_target_t *target, omni_applied_t *applied,
                        omni_actuation_t *actuation);

/**
 * Do the controller's gains cover the slip error that may be there? The integral sliding mode has such a condition
 * (44).
 * It is looked at in every eighth tick; the last answer stands in between.
 * @param state out: its `margin`, per axis; 0 unless a controller that has one is tracking.
 * @return OMNI_WARN_ISMC_GAIN, or 0.
 */
omni_uint_t omni_robot_gain_margin(omni_gain_margin_t *state, const omni_robot_config_t *config,
                                   const omni_pose_ekf_state_t *ekf, const omni_estimate_t *estimate,
                                   const omni_target_t *target);

/**
 * Does a wheel turn faster than its reference for long, or at all (a tenth of LIM_WHEEL) while the robot is not armed?
 * Called in every OMNI_SPEED_TICKS-th tick, and when it is armed or disarmed. Not judged while duties are set.
 * omni_robot_supervise reports it in the next tick; of a robot that is not armed, omni_robot_arming_faults alone does.
 */
void omni_robot_watch_speeds(omni_speed_watch_t *watch, const omni_robot_config_t *config,
                             const omni_estimator_t *estimator, const omni_estimate_t *estimate,
                             const omni_target_t *target, const omni_actuation_t *actuation)
    __attribute__((noinline, cold));

/**
 * The motors' currents and their heat; called only if config->current.watched. @param last what the last tick did.
 * @return OMNI_FAULT_MOTOR_HEAT and OMNI_WARN_MOTOR_WARM, or 0.
 */
omni_uint_t omni_robot_watch_currents(omni_supervisor_t *supervisor, const omni_robot_config_t *config,
                                      const omni_estimate_t *estimate, const omni_applied_t *last);

/** After everything else that decides duties; called only if config->current.limited, while armed. */
void omni_robot_limit_currents(omni_control_state_t *control, const omni_robot_config_t *config,
                               const omni_current_state_t *state, omni_real_t supply_V, omni_applied_t *applied,
                               omni_actuation_t *actuation);

/** Currents and heat; called only if config->current.watched. While nobody watches, currents are the wheel filter's. */
void omni_robot_report_currents(const omni_current_state_t *state, const omni_applied_t *applied,
                                omni_outputs_t *outputs);

#endif
