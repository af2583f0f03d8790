/* SPDX-License-Identifier: MIT */
/**
 * @file robot.h
 * The complete control core as one function per tick: omni_robot_tick. It is called by firmware, PC process, emulator,
 * Python and Monte Carlo.
 *
 * Ownership: the caller owns every struct. The configuration is read through a pointer and never written by the tick.
 * To change parameters, build a second omni_robot_config_t and hand it over with omni_robot_set_config between two
 * ticks.
 */
#ifndef OMNI_ROBOT_H
#define OMNI_ROBOT_H

#include "omni/current.h"
#include "omni/excitation.h"
#include "omni/flow.h"
#include "omni/gyro.h"
#include "omni/kinematics.h"
#include "omni/modules_gen.h"
#include "omni/motor.h"
#include "omni/motor_kf.h"
#include "omni/params.h"
#include "omni/pose_ekf.h"
#include "omni/safety.h"
#include "omni/torque_curve.h"
#include "omni/trajectory.h"
#include "omni/types.h"
#include "omni/wheel_speed.h"

enum {
    OMNI_TICK_US = 1000,       /**< nominal tick period */
    OMNI_TICK_JUMP_US = 10000, /**< a step longer than this raises OMNI_FAULT_TIME */
    OMNI_OVERSPEED_CHECKS = 4, /**< consecutive checks with overspeed that raise OMNI_FAULT_OVERSPEED: half a second */
    OMNI_OVERSPEED_CHECK_TICKS = 127, /**< ticks between checks; prime: not in phase with periodic chatter */
    OMNI_ENCODER_TICKS = 3,           /**< impossible or missing counts in a row that raise OMNI_FAULT_ENCODER */
    OMNI_BATTERY_TICKS = 50           /**< low readings in a row that raise OMNI_FAULT_BATTERY */
};

/** Limits and timeouts, from the parameters LIM_*, SAFE_*, FIX_TIMEOUT, TRJ_MARGIN and BAT_*. */
typedef struct omni_limits_t {
    omni_real_t wheel_rad_s;
    omni_real_t speed_m_s;
    omni_real_t turn_rad_s;
    omni_real_t acceleration_m_s2;
    omni_real_t position_m;
    omni_real_t wheel_speed_fraction; /**< fraction of wheel_rad_s used when driving to a pose setpoint */
    omni_real_t command_timeout_s;
    omni_real_t link_timeout_s;
    omni_real_t fix_timeout_s;
    omni_real_t error_m;
    omni_real_t error_rad;
    omni_real_t stall_s;
    omni_real_t stall_V;
    omni_real_t
        volt_ticks_per_count_V; /**< voltage x ticks in which a wheel at 1/10 of its no-load speed gives a count */
    omni_real_t battery_min_V;
    omni_real_t supply_nominal_V;
    uint16_t driver_failures;
} omni_limits_t;

/** Everything derived from a parameter set. Build with omni_robot_config. */
typedef struct omni_robot_config_t {
    omni_kinematics_t kinematics;
    omni_motor_config_t motor;
    omni_motor_kf_config_t motor_kf;
    omni_pose_ekf_config_t pose_ekf;
    omni_gyro_config_t gyro;
    omni_flow_config_t flow;
    omni_torque_curve_t torque_curve;
    OMNI_CTL_MODE_CONFIG_MEMBERS /* of the controllers: omni_ismc_config_t ismc; and so on */
        omni_wheel_speed_config_t wheel_speed;
    omni_body_load_t body_load; /**< body inertia in the feed-forward of the wheel loops */
    omni_trajectory_config_t trajectory;
    omni_limits_t limits;
    omni_current_config_t current;
    uint8_t controller;                        /**< enum omni_ctl_mode */
    uint8_t control_period;                    /**< period of the position controller in ticks, >= 1 */
    int8_t encoder_direction[OMNI_MAX_WHEELS]; /**< -1 or 1 */
    int8_t motor_direction[OMNI_MAX_WHEELS];   /**< -1 or 1 */
    omni_real_t rad_per_count;
    omni_real_t speed_gain_V_s;   /**< omni_motor_speed_gain of `motor` */
    omni_real_t slip_feedforward; /**< 0..1, fraction of the slip estimate that is compensated */
    omni_real_t
        emf_compensation; /**< 0..1, fraction of back-EMF and viscous friction compensated in direct torque control */
    omni_real_t step_s;
    omni_real_t tracked_x_m; /**< the point that pose fixes are of, body frame */
    omni_real_t tracked_y_m;
    omni_real_t tracked_heading_rad; /**< of the tracked body's x axis, body frame */
    uint16_t sequence;               /**< caller's number of this set, copied to the outputs */
} omni_robot_config_t;

/**
 * Derive a configuration from a parameter set (OMNI_PARAM_COUNT values). Too slow for the tick: call it in the
 * background.
 * @param bad_index out, may be NULL: index of the invalid parameter, or -1 if the combination is.
 * @return OMNI_OK, or the reason for rejection; `config` is then not usable.
 */
omni_result_t omni_robot_config(omni_robot_config_t *config, const omni_real_t *values, int32_t *bad_index);

typedef enum omni_setpoint_kind_t {
    OMNI_SETPOINT_NONE = 0, /**< hold the pose (zero wheel speed if CTL_MODE is none) */
    OMNI_SETPOINT_POSE,     /**< world pose and its rate, approached within the speed and acceleration limits */
    OMNI_SETPOINT_VELOCITY_BODY,
    OMNI_SETPOINT_VELOCITY_WORLD,
    OMNI_SETPOINT_TRAJECTORY, /**< the plan given with OMNI_EVENT_TRAJECTORY_START */
    OMNI_SETPOINT_DUTY        /**< open loop, per wheel, for bring-up and identification */
} omni_setpoint_kind_t;

typedef struct omni_setpoint_t {
    uint8_t kind;     /**< omni_setpoint_kind_t */
    uint64_t time_us; /**< when it arrived; ages against command_timeout_s (not for TRAJECTORY) */
    omni_pose_t pose;
    omni_twist_t twist;
    omni_real_t duty[OMNI_MAX_WHEELS]; /**< -1..1, in the wheel's direction */
} omni_setpoint_t;

typedef enum omni_event_t {
    OMNI_EVENT_ARM = 1 << 0,
    OMNI_EVENT_DISARM = 1 << 1,
    OMNI_EVENT_ESTOP = 1 << 2,
    OMNI_EVENT_ESTOP_CLEAR = 1 << 3,
    OMNI_EVENT_TRAJECTORY_START = 1 << 4, /**< follow inputs.trajectory from this tick on */
    OMNI_EVENT_TRAJECTORY_STOP = 1 << 5,  /**< hold the pose of this tick */
    OMNI_EVENT_SET_POSE = 1 << 6          /**< restart the pose estimate at inputs.pose */
} omni_event_t;

/** Inputs of one tick. The sensor readings, such as counts and battery_V, are generated from [sensors] of
 * shared/world.toml. */
typedef struct omni_inputs_t {
    uint64_t time_us; /**< robot clock, monotonic */
#include "omni/input_readings_gen.h"
    bool has_fix;
    omni_pose_fix_t fix;                 /**< of the tracked point; applied if has_fix */
    uint32_t events;                     /**< omni_event_t bits, for this tick only */
    uint32_t faults;                     /**< stop faults detected by the caller (OMNI_FAULT_OVERRUN, ...) */
    omni_setpoint_t setpoint;            /**< latest setpoint received */
    uint64_t heartbeat_us;               /**< arrival of the latest ground-station heartbeat; 0: none yet */
    uint16_t driver_failures;            /**< failed motor-driver updates in a row */
    const omni_trajectory_t *trajectory; /**< must stay valid and constant while followed */
    omni_pose_t pose;                    /**< for OMNI_EVENT_SET_POSE */
} omni_inputs_t;

/** Limits that reduce a velocity setpoint, one bit each. */
typedef enum omni_velocity_limit_t {
    OMNI_LIMIT_WHEEL = 1 << 0, /**< LIM_WHEEL */
    OMNI_LIMIT_SPEED = 1 << 1, /**< LIM_V */
    OMNI_LIMIT_TURN = 1 << 2   /**< LIM_W */
} omni_velocity_limit_t;

/** Snapshot at the tick of the last stop fault, for diagnosis. All zero before; cleared by arming. */
typedef struct omni_stop_t {
    uint8_t wheel;           /**< wheel that caused the fault, from 1; 0: no wheel did */
    omni_real_t voltage_V;   /**< voltage of this wheel */
    omni_real_t wheel_rad_s; /**< speed of this wheel by its encoder; by the filter if counts are missing */
    omni_real_t supply_V;
    omni_real_t current_A;        /**< estimated current of this wheel's motor; 0 while LIM_I and SAFE_I are 0 */
    omni_real_t error[OMNI_AXES]; /**< pose error, world frame [m, m, rad]; 0 unless a pose was tracked */
} omni_stop_t;

/** Outputs of one tick. */
typedef struct omni_outputs_t {
    uint64_t time_us;
    uint8_t state;          /**< omni_safety_state_t */
    bool drive;             /**< motors may have power; false: switch the bridges off */
    uint8_t controller;     /**< enum omni_ctl_mode in use */
    uint8_t setpoint_kind;  /**< in use */
    omni_uint_t faults;     /**< omni_fault_t bits present now */
    uint32_t fault_history; /**< stop faults since arming */
    uint16_t config_sequence;
    omni_real_t duty[OMNI_MAX_WHEELS];            /**< -1..1, positive in the motor's direction; 0 unless `drive` */
    omni_real_t voltage_V[OMNI_MAX_WHEELS];       /**< positive in the wheel's direction */
    omni_real_t wheel_rad_s[OMNI_MAX_WHEELS];     /**< estimated wheel speeds */
    omni_real_t wheel_reference[OMNI_MAX_WHEELS]; /**< rad/s */
    omni_real_t current_A[OMNI_MAX_WHEELS];       /**< by omni/current.h; while that is disabled, by the motor
                                                       filter; 0 while both are */
    omni_real_t motor_heat[OMNI_MAX_WHEELS];      /**< h of omni/current.h, 1: fault; 0 while SAFE_I is 0 */
    omni_pose_t pose;                             /**< estimate */
    omni_twist_t rate;                            /**< world twist by the wheels */
    omni_real_t pose_sd[OMNI_AXES];               /**< standard deviations: m, m, rad */
    omni_reference_t reference;
    omni_control_terms_t terms;
    /** Margin of condition 44, k - |B+ (v_s - v_s_hat)|, per world axis [m/s, m/s, rad/s], with 3 sigma of the slip
     * ratios as the error. 0 unless the ISMC is tracking. Updated in every eighth tick. */
    omni_real_t ismc_margin[OMNI_AXES];
    omni_real_t slip_m_s[OMNI_MAX_WHEELS]; /**< estimated v_s */
    omni_real_t slip_residual_m_s;
    omni_real_t
        wheel_scale; /**< saturation factor of the wheel speeds (direct torque: of the runaway protection), 1: none */
    omni_real_t duty_scale;        /**< saturation factor of the voltages (direct torque: of the torques), 1: none */
    omni_real_t current_reduction; /**< fraction by which LIM_I reduces the motor torques, 0: none */
    omni_real_t velocity_scale;    /**< limiting factor of a velocity setpoint, or of the approach to a pose, 1: none */
    omni_uint_t velocity_limits;   /**< active omni_velocity_limit_t; the highest bit is the binding one */
    omni_stop_t stop;
    omni_real_t supply_V;
    omni_real_t pose_xy_m2; /**< covariance of the estimate's x and y, world frame */
    omni_real_t nis;
    omni_uint_t fixes_accepted;
    omni_uint_t fixes_refused;
    omni_real_t gyro_rad_s;   /**< yaw rate by the gyro, bias removed; 0 while it is not used */
    omni_real_t gyro_bias;    /**< rad/s */
    omni_real_t gyro_bias_sd; /**< standard deviation */
    bool gyro_used;           /**< it gives the turn, or measures its bias */
    /* Floor odometry; 0 while FLOW_MODE is 0. */
    omni_real_t flow_sum[OMNI_AXES];   /**< sum of all plausible readings in body axes: m, m, rad */
    omni_real_t flow_nis;              /**< normalised innovation squared of the last reading */
    omni_uint_t flow_used;             /**< number of readings used */
    omni_uint_t flow_refused;          /**< number of readings rejected */
    omni_uint_t flow_received;         /**< number of readings, valid or not */
    omni_uint_t flow_dropped;          /**< number of readings without a valid displacement */
    omni_real_t flow_misalignment_rad; /**< deviation of its mounting angle; 0: not known */
    bool flow_usable;                  /**< neither faulty nor timed out */
    bool flow_overriding;              /**< it overrides wheels that spin or slide */
} omni_outputs_t;

/** Output of a position controller, which selects the actuation that follows it. */
typedef enum omni_demand_kind_t {
    OMNI_DEMAND_NONE = 0, /**< none: poses are not tracked, only their rates are followed */
    OMNI_DEMAND_TWIST,    /**< body twist -> inverse kinematics, slip compensation, wheel-speed loops */
    OMNI_DEMAND_TORQUE,   /**< wheel torques -> runaway protection, torque curve */
    OMNI_DEMAND_DUTY,     /**< duties of open-loop setpoints, limited only; not by a controller */
    OMNI_DEMAND_VOLTAGE   /**< wheel voltages, limited only; such a controller is stepped every tick */
} omni_demand_kind_t;

/**
 * Output of the position controller, held until its next step (CTL_PERIOD). omni_controller_demand says which member is
 * used.
 */
typedef struct omni_demand_t {
    omni_control_terms_t terms;
    omni_twist_t twist;                       /**< body frame */
    omni_real_t torque_N_m[OMNI_MAX_WHEELS];  /**< at the wheels */
    omni_real_t torque_scale;                 /**< saturation factor of the torques, eq. 30 */
    omni_real_t voltage_V[OMNI_MAX_WHEELS];   /**< in the wheel's direction */
    omni_real_t wheel_rad_s[OMNI_MAX_WHEELS]; /**< wheel speed reference that belongs to the voltages */
} omni_demand_t;

/** State of the estimation stage. */
typedef struct omni_estimator_t {
    uint64_t last_time_us;
    omni_motor_kf_state_t motor_kf[OMNI_MAX_WHEELS];
    omni_int_t last_counts[OMNI_MAX_WHEELS];
    omni_real_t
        extrapolated_rad[OMNI_MAX_WHEELS]; /**< rotation extrapolated since the last valid count, already in the pose */
    uint32_t missing_count_ticks[OMNI_MAX_WHEELS]; /**< ticks in a row without a valid count */
    bool primed;                                   /**< last_* are valid */
    omni_pose_ekf_state_t pose_ekf;
    omni_gyro_state_t gyro;
    omni_flow_state_t flow;
} omni_estimator_t;

/** Stall detection of a wheel. All 0 while its voltage is below `stall_V`. */
typedef struct omni_stall_watch_t {
    omni_real_t ticks;               /**< ticks since the last check */
    omni_real_t expected_volt_ticks; /**< |voltage| summed over these ticks: proportional to the expected counts */
    omni_real_t counts;              /**< counts in these ticks, positive in the direction of the voltage */
    omni_real_t stalled_s;           /**< time for which it has been stalled or reversed: 0..2 stall_s */
    omni_real_t braked_s;            /**< time for which it has been braked; 0: not braked, -1: braking may start */
    omni_real_t rate;                /**< speed at the start of braking [counts/tick] */
    omni_real_t last_V;              /**< voltage in the last tick; 0 while below `stall_V` */
} omni_stall_watch_t;

/** Overspeed detection of the wheels, every OMNI_OVERSPEED_CHECK_TICKS ticks. */
typedef struct omni_speed_watch_t {
    omni_int_t counts[OMNI_MAX_WHEELS];                /**< encoder counts at the last check */
    omni_real_t peak_reference_rad_s[OMNI_MAX_WHEELS]; /**< peak since the last check, sampled every 16th tick */
    omni_real_t initial_speed_rad_s[OMNI_MAX_WHEELS];  /**< speed when a wheel's overspeed began; 0: no overspeed */
    omni_real_t
        overspeed_checks[OMNI_MAX_WHEELS]; /**< consecutive checks with overspeed; > OMNI_OVERSPEED_CHECKS: fault */
    omni_uint_t overspeed_fault;           /**< OMNI_FAULT_OVERSPEED or 0 */
    uint32_t ticks_left;                   /**< ticks until the next check; arming and disarming set it to 0 */
    bool armed;                            /**< the robot was armed at the last check */
} omni_speed_watch_t;

/** State of the supervision stage: safety state and fault detection. */
typedef struct omni_supervisor_t {
    uint64_t armed_since_us;
    omni_safety_state_t state;
    omni_uint_t faults;     /**< omni_fault_t bits present in the last tick */
    uint32_t fault_history; /**< stop faults since arming */
    omni_stop_t stop;       /**< snapshot of the latest stop fault */
    omni_stall_watch_t stall[OMNI_MAX_WHEELS];
    omni_speed_watch_t speeds;
    omni_current_state_t current; /**< all 0 while LIM_I and SAFE_I are 0 */
    uint32_t battery_ticks;       /**< ticks in a row with too little voltage */
} omni_supervisor_t;

/** State of the reference stage. */
typedef struct omni_reference_generator_t {
    uint64_t trajectory_start_us;
    const omni_trajectory_t *trajectory; /**< being followed, or NULL */
    omni_pose_t reference_pose;          /**< reference approaching a pose setpoint; otherwise the pose to hold */
    omni_twist_t reference_rate; /**< its rate (world frame), or the acceleration-limited velocity (body frame) */
    uint8_t last_kind;           /**< setpoint kind of the last tick */
} omni_reference_generator_t;

/** State of the control stage. */
typedef struct omni_control_state_t {
    OMNI_CTL_MODE_STATE_MEMBERS /* of the controllers: omni_ismc_state_t ismc; and so on */
        omni_wheel_speed_state_t wheel_speed;
    uint8_t last_controller;     /**< enum omni_ctl_mode of the last tick */
    uint8_t last_actuation_mode; /**< omni_demand_kind_t of the last armed tick */
    bool tracking;               /**< the last tick tracked a pose */
    uint8_t ticks;               /**< since the position controller's last step began its period */
    omni_demand_t demand;
} omni_control_state_t;

/** State of the gain condition's check (condition 44 of the report). */
typedef struct omni_gain_margin_t {
    omni_real_t margin[OMNI_AXES]; /**< of the latest update */
    omni_real_t violated_s;        /**< time for which the condition has been violated, debounced */
    omni_flag_t violated;          /**< debounced result */
    uint8_t ticks;                 /**< since the latest update */
} omni_gain_margin_t;

/** Actuation of the last tick: input of the filters and the supervision. */
typedef struct omni_applied_t {
    omni_real_t voltage_V[OMNI_MAX_WHEELS]; /**< in the wheel's direction */
    omni_real_t current_reduction;          /**< fraction by which the current limit reduced the torques */
    omni_flag_t saturated;                  /**< wheel speeds, duties or currents were limited */
    bool tracking_error_exceeded;           /**< the pose error was beyond SAFE_ERR_* */
} omni_applied_t;

/** State of the whole core, by stage of the tick. Opaque by convention: use the functions. */
typedef struct omni_robot_t {
    const omni_robot_config_t *config;
    omni_applied_t applied;
    omni_supervisor_t supervisor;
    omni_reference_generator_t reference_generator;
    omni_gain_margin_t margin;
    omni_control_state_t control;
    omni_excitation_state_t excitation; /**< omni_excitation_start() begins one between two ticks */
    omni_estimator_t estimator;
} omni_robot_t;

/** Initialise in OMNI_STATE_INIT at pose zero; the first tick goes to DISARMED. `config` must outlive `robot`. */
void omni_robot_init(omni_robot_t *robot, const omni_robot_config_t *config);

/** Replace the configuration between two ticks. Controller and filter states are kept (bumpless). */
void omni_robot_set_config(omni_robot_t *robot, const omni_robot_config_t *config);

/** One tick. Never fails: for any input, duties and voltages are finite, |duty| <= 1, and 0 unless armed without a stop
 * fault. Other outputs are finite for poses within LIM_POS. */
/*@ ensures duty_in_range: \forall integer i; 0 <= i < OMNI_MAX_WHEELS ==>
        \is_finite(outputs->duty[i]) && -1.0 <= outputs->duty[i] <= 1.0;
    ensures voltage_finite: \forall integer i; 0 <= i < OMNI_MAX_WHEELS ==> \is_finite(outputs->voltage_V[i]);
    ensures armed_to_drive: outputs->drive ==> outputs->state == OMNI_STATE_ARMED;
    ensures off_is_zero: !outputs->drive ==> \forall integer i; 0 <= i < OMNI_MAX_WHEELS ==> outputs->duty[i] == 0.0; */
void omni_robot_tick(omni_robot_t *robot, const omni_inputs_t *inputs, omni_outputs_t *outputs);

/** Name of a position controller, as in CTL_MODE. @return NULL beyond OMNI_CTL_MODE_COUNT. */
const char *omni_controller_name(uint8_t controller);

/** Output kind of a position controller, omni_demand_kind_t. @return OMNI_DEMAND_NONE beyond OMNI_CTL_MODE_COUNT. */
uint8_t omni_controller_demand(uint8_t controller);

/** Clear the state of all position controllers: integrals and the phase of their period. */
void omni_controllers_reset(omni_control_state_t *control);

/**
 * One step of the position controller of `config` outside of a tick, for a host that drives without encoders. Only for
 * controllers with OMNI_DEMAND_TWIST. Call it every config->step_s * config->control_period.
 * @param rate measured, world frame. @param reference its pose and rate.
 * @param control out: `demand.twist` (body frame) and `demand.terms`.
 * @return OMNI_OK; OMNI_ERR_RANGE for another kind of controller, without effect.
 */
omni_result_t omni_controller_step(omni_control_state_t *control, const omni_robot_config_t *config,
                                   const omni_pose_t *pose, const omni_twist_t *rate, const omni_reference_t *reference,
                                   omni_flag_t saturated);

/** Is an excitation at this place (omni_excitation_place_t) allowed with this kind of setpoint
 * (omni_setpoint_kind_t)? */
bool omni_excitation_fits(uint8_t place, uint8_t kind);

/** Stop faults that prevent arming now; 0: it may be armed. In a state other than DISARMED: OMNI_FAULT_CONFIG. */
uint32_t omni_robot_arming_faults(const omni_robot_t *robot);

#endif
