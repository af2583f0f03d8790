/* SPDX-License-Identifier: MIT */
/**
 * @file robot.h
 * The whole control core as one step: omni_robot_tick. Firmware, PC process, emulator, Python and Monte Carlo call
 * this.
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
    OMNI_SPEED_LOOKS = 4,      /**< that a wheel must stay too fast: half a second */
    OMNI_SPEED_TICKS = 127,    /**< between looks at the wheels' speeds; prime: no periodic chatter hides from it */
    OMNI_ENCODER_TICKS = 3,    /**< impossible or missing counts in a row that raise OMNI_FAULT_ENCODER */
    OMNI_BATTERY_TICKS = 50    /**< low readings in a row that raise OMNI_FAULT_BATTERY */
};

/** Limits and time-outs, from the parameters LIM_*, SAFE_*, FIX_TIMEOUT, TRJ_MARGIN and BAT_*. */
typedef struct omni_limits_t {
    omni_real_t wheel_rad_s;
    omni_real_t speed_m_s;
    omni_real_t turn_rad_s;
    omni_real_t acceleration_m_s2;
    omni_real_t position_m;
    omni_real_t reference_share; /**< share of wheel_rad_s for the way to a pose set-point */
    omni_real_t command_timeout_s;
    omni_real_t link_timeout_s;
    omni_real_t fix_timeout_s;
    omni_real_t error_m;
    omni_real_t error_rad;
    omni_real_t stall_s;
    omni_real_t stall_V;
    omni_real_t count_due; /**< voltage times ticks after which a wheel at a tenth of its speed gives a count [V] */
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
    omni_body_load_t body_load; /**< what the wheel loops feed forward of the body */
    omni_trajectory_config_t trajectory;
    omni_limits_t limits;
    omni_current_config_t current;
    uint8_t controller;                        /**< enum omni_ctl_mode */
    uint8_t control_period;                    /**< ticks from one step of the position controller to the next, >= 1 */
    int8_t encoder_direction[OMNI_MAX_WHEELS]; /**< -1 or 1 */
    int8_t motor_direction[OMNI_MAX_WHEELS];   /**< -1 or 1 */
    omni_real_t rad_per_count;
    omni_real_t speed_gain_V_s; /**< omni_motor_speed_gain of `motor` */
    omni_real_t slip_feed;      /**< 0..1 share of the slip estimate fed forward */
    omni_real_t torque_emf;     /**< 0..1 share of back-EMF and viscous friction made up for in direct torque control */
    omni_real_t step_s;
    omni_real_t tracked_x_m; /**< the point that pose fixes are of, body frame */
    omni_real_t tracked_y_m;
    omni_real_t tracked_heading_rad; /**< of the tracked body's x axis, body frame */
    uint16_t sequence;               /**< caller's number of this set; telemetry repeats it */
} omni_robot_config_t;

/**
 * Derive a configuration from a parameter set (OMNI_PARAM_COUNT values). Too slow for the tick: background work.
 * @param bad_index out, may be NULL: index of the offending parameter, or -1 if it is the combination.
 * @return OMNI_OK, or why the set is refused; `config` is then not usable.
 */
omni_result_t omni_robot_config(omni_robot_config_t *config, const omni_real_t *values, int32_t *bad_index);

typedef enum omni_setpoint_kind_t {
    OMNI_SETPOINT_NONE = 0, /**< hold the pose (zero wheel speed if CTL_MODE is none) */
    OMNI_SETPOINT_POSE,     /**< world pose and its rate; approached within the limits of speed and acceleration */
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

/** What one tick gets. The readings of the sensors, counts and battery_V among them, come from [sensors] of
 * shared/world.toml. */
typedef struct omni_inputs_t {
    uint64_t time_us; /**< robot clock, monotonic */
#include "omni/input_readings_gen.h"
    bool has_fix;
    omni_pose_fix_t fix;                 /**< of the tracked point; applied if has_fix */
    uint32_t events;                     /**< omni_event_t bits, for this tick only */
    uint32_t faults;                     /**< stop faults seen outside the core (OMNI_FAULT_OVERRUN, ...) */
    omni_setpoint_t setpoint;            /**< the latest */
    uint64_t heartbeat_us;               /**< arrival of the latest ground-station heartbeat; 0: none yet */
    uint16_t driver_failures;            /**< failed motor-driver updates in a row */
    const omni_trajectory_t *trajectory; /**< must stay valid and constant while followed */
    omni_pose_t pose;                    /**< for OMNI_EVENT_SET_POSE */
} omni_inputs_t;

/** Limits of a velocity, one bit each. */
typedef enum omni_velocity_limit_t {
    OMNI_LIMIT_WHEEL = 1 << 0, /**< LIM_WHEEL */
    OMNI_LIMIT_SPEED = 1 << 1, /**< LIM_V */
    OMNI_LIMIT_TURN = 1 << 2   /**< LIM_W */
} omni_velocity_limit_t;

/** What the robot saw when a stop fault stopped it. All zero until one does; kept until the next arming. */
typedef struct omni_stop_t {
    uint8_t wheel;           /**< that stalled, was too fast or blind, from 1; 0: the fault is not about a wheel */
    omni_real_t voltage_V;   /**< that this wheel was given */
    omni_real_t wheel_rad_s; /**< at which it turned: by its encoder in that tick, by the filter while it is blind */
    omni_real_t supply_V;
    omni_real_t current_A;        /**< that this wheel's motor had, estimated; 0 while LIM_I and SAFE_I are 0 */
    omni_real_t error[OMNI_AXES]; /**< of the pose, world frame [m, m, rad]; 0 unless a pose was tracked */
} omni_stop_t;

/** What one tick decided and knows. */
typedef struct omni_outputs_t {
    uint64_t time_us;
    uint8_t state;          /**< omni_safety_state_t */
    bool drive;             /**< motors may be powered; false: switch the bridges off */
    uint8_t controller;     /**< enum omni_ctl_mode in use */
    uint8_t setpoint_kind;  /**< in use */
    omni_uint_t faults;     /**< omni_fault_t bits present now */
    uint32_t fault_history; /**< stop faults since arming */
    uint16_t config_sequence;
    omni_real_t duty[OMNI_MAX_WHEELS];            /**< -1..1 in the motor's own direction; 0 unless `drive` */
    omni_real_t voltage_V[OMNI_MAX_WHEELS];       /**< in the wheel's direction */
    omni_real_t wheel_rad_s[OMNI_MAX_WHEELS];     /**< estimate */
    omni_real_t wheel_reference[OMNI_MAX_WHEELS]; /**< rad/s */
    omni_real_t current_A[OMNI_MAX_WHEELS];  /**< estimate of omni/current.h; while that is off, the motor filter's;
                                                       0 when that is off, too */
    omni_real_t motor_heat[OMNI_MAX_WHEELS]; /**< 1 stops the motors; 0 while SAFE_I is 0 */
    omni_pose_t pose;                        /**< estimate */
    omni_twist_t rate;                       /**< world twist from the wheels */
    omni_real_t pose_sd[OMNI_AXES];
    omni_reference_t reference;
    omni_control_terms_t terms;
    /** k - |B+ (v_s - v_s_hat)| of condition 44 per world axis [m/s, m/s, rad/s], with 3 sigma of the slip ratios'
     * estimate as the error. 0 unless the ISMC is tracking. Looked at in every eighth tick. */
    omni_real_t ismc_margin[OMNI_AXES];
    omni_real_t slip_m_s[OMNI_MAX_WHEELS]; /**< estimated v_s */
    omni_real_t slip_residual_m_s;
    omni_real_t
        wheel_scale; /**< factor the wheel speeds (direct torque: by the runaway protection) were cut by, 1: none */
    omni_real_t duty_scale;      /**< factor the voltages (direct torque: the torques) were cut by, 1: none */
    omni_real_t current_cut;     /**< share of the motors' pushes that LIM_I takes away, 0: none */
    omni_real_t velocity_scale;  /**< factor left of a velocity set-point, or of the way to a pose, 1: all of it */
    omni_uint_t velocity_limits; /**< omni_velocity_limit_t that cut it; the highest bit is the one that decided */
    omni_stop_t stop;
    omni_real_t supply_V;
    omni_real_t pose_xy_m2; /**< covariance of the estimate's x and y, world frame */
    omni_real_t nis;
    omni_uint_t fixes_accepted;
    omni_uint_t fixes_refused;
    omni_real_t gyro_rad_s;   /**< turn rate by the gyro, bias taken off; 0 while its readings are left out */
    omni_real_t gyro_bias;    /**< rad/s */
    omni_real_t gyro_bias_sd; /**< standard deviation */
    omni_flag_t gyro_used;    /**< it gives the turn, or learns its bias */
    /** Of the motion over the floor; 0 while FLOW_MODE is. */
    omni_real_t flow_sum[OMNI_AXES]; /**< readings so far, in body axes: m, m, rad */
    omni_real_t flow_nis;            /**< normalised innovation squared of the last reading */
    omni_uint_t flow_used;           /**< readings used so far */
    omni_uint_t flow_refused;
    omni_uint_t flow_came;    /**< readings so far, good or not */
    omni_uint_t flow_lost;    /**< those without a way */
    omni_real_t flow_off_rad; /**< direction of its x axis, seen from where it should point; 0: not known */
    omni_flag_t flow_usable;
    omni_flag_t flow_leads; /**< it has taken the place of wheels that spin */
} omni_outputs_t;

/** What a position controller asks for, and so what follows it on the way to the wheels. */
typedef enum omni_demand_kind_t {
    OMNI_DEMAND_NONE = 0, /**< nothing: poses are not tracked, only their rates are followed */
    OMNI_DEMAND_TWIST,    /**< a body twist: inverse kinematics, slip, wheel-speed loops; held for CTL_PERIOD */
    OMNI_DEMAND_TORQUE,   /**< torques: runaway protection, torque curve; held for CTL_PERIOD */
    OMNI_DEMAND_DUTY,     /**< duties as they are: of open-loop set-points; no controller asks for them */
    OMNI_DEMAND_VOLTAGE   /**< voltages: nothing but the duty limit; stepped in every tick, it counts its own period */
} omni_demand_kind_t;

/**
 * What the position controller asks for, in force until its next step. omni_controller_demand says which of them
 * counts.
 */
typedef struct omni_demand_t {
    omni_control_terms_t terms;
    omni_twist_t twist;                       /**< body frame */
    omni_real_t torque_N_m[OMNI_MAX_WHEELS];  /**< at the wheels */
    omni_real_t torque_scale;                 /**< what eq. 30 left of them */
    omni_real_t voltage_V[OMNI_MAX_WHEELS];   /**< in the wheel's direction */
    omni_real_t wheel_rad_s[OMNI_MAX_WHEELS]; /**< wanted with these voltages */
} omni_demand_t;

/** What the estimating stage keeps from tick to tick. */
typedef struct omni_estimator_t {
    uint64_t last_time_us;
    omni_motor_kf_state_t motor_kf[OMNI_MAX_WHEELS];
    omni_int_t last_counts[OMNI_MAX_WHEELS];
    omni_real_t
        guessed_rad[OMNI_MAX_WHEELS];        /**< turned since the last valid count, as far as the pose has been told */
    uint32_t encoder_ticks[OMNI_MAX_WHEELS]; /**< ticks in a row without a valid count */
    bool primed;                             /**< last_* hold a first sample */
    omni_pose_ekf_state_t pose_ekf;
    omni_gyro_state_t gyro;
    omni_flow_state_t flow;
} omni_estimator_t;

/** Whether a wheel under voltage turns. All 0 while its voltage is below `stall_V`. */
typedef struct omni_stall_watch_t {
    omni_real_t ticks;     /**< since the wheel was last judged */
    omni_real_t due;       /**< its voltage over these ticks [V ticks]: what it should have turned */
    omni_real_t counts;    /**< what it did turn, by its encoder; positive the way it is driven */
    omni_real_t stalled_s; /**< how long it has looked stalled or reversed: 0 to 2 stall_s */
    omni_real_t back_s;    /**< how long it has been braked; 0 it is not, -1 it may begin to be */
    omni_real_t rate;      /**< how fast it turned before that, or at first [counts/tick] */
    omni_real_t last_V;    /**< its voltage in the last tick; 0 while it is below `stall_V` */
} omni_stall_watch_t;

/** Whether the wheels turn faster than they are asked to. Looked at in every OMNI_SPEED_TICKS-th tick. */
typedef struct omni_speed_watch_t {
    omni_int_t counts[OMNI_MAX_WHEELS];     /**< of the encoders, at the last look */
    omni_real_t reference[OMNI_MAX_WHEELS]; /**< largest magnitude since the last look, every 16th tick [rad/s] */
    omni_real_t first[OMNI_MAX_WHEELS];     /**< speed when a wheel became too fast [rad/s]; 0: it is not */
    omni_real_t looks[OMNI_MAX_WHEELS];     /**< for how many looks it has been; more than OMNI_SPEED_LOOKS: a fault */
    omni_uint_t fault;                      /**< OMNI_FAULT_OVERSPEED: any wheel has; or 0 */
    uint32_t left;                          /**< ticks until the next look; 0 at once, when armed or disarmed */
    bool armed;                             /**< at the last look */
} omni_speed_watch_t;

/** What the supervising stage keeps: the safety state, and for how long things have looked wrong. */
typedef struct omni_supervisor_t {
    uint64_t armed_since_us;
    omni_safety_state_t state;
    omni_uint_t faults;     /**< omni_fault_t bits present in the last tick */
    uint32_t fault_history; /**< stop faults since arming */
    omni_stop_t stop;       /**< of the latest one */
    omni_stall_watch_t stall[OMNI_MAX_WHEELS];
    omni_speed_watch_t speeds;
    omni_current_state_t current; /**< all 0 while LIM_I and SAFE_I are 0 */
    uint32_t battery_ticks;       /**< ticks in a row with too little voltage */
} omni_supervisor_t;

/** What the stage that makes the reference keeps. */
typedef struct omni_guide_t {
    uint64_t trajectory_start_us;
    const omni_trajectory_t *trajectory; /**< being followed, or NULL */
    omni_pose_t governed;                /**< reference on its way to a pose set-point; the pose held otherwise */
    omni_twist_t ramped;                 /**< its rate (world), or the ramped velocity demand (body) */
    uint8_t last_kind;                   /**< set-point kind of the last tick */
} omni_guide_t;

/** What the controlling stage keeps. */
typedef struct omni_control_state_t {
    OMNI_CTL_MODE_STATE_MEMBERS /* of the controllers: omni_ismc_state_t ismc; and so on */
        omni_wheel_speed_state_t wheel_speed;
    uint8_t last_controller; /**< enum omni_ctl_mode of the last tick */
    uint8_t last_way;        /**< to the wheels: omni_demand_kind_t of the last tick that drove them */
    bool tracking;           /**< the last tick tracked a pose */
    uint8_t ticks;           /**< since the position controller's last step began its period */
    omni_demand_t demand;
} omni_control_state_t;

/** What the check of the ISMC's gain keeps (the report's condition 44). */
typedef struct omni_gain_margin_t {
    omni_real_t margin[OMNI_AXES]; /**< of the latest look */
    omni_real_t uncovered_s;       /**< how long the condition has been violated */
    omni_flag_t uncovered;         /**< it counts as violated */
    uint8_t ticks;                 /**< since the latest look */
} omni_gain_margin_t;

/** What the last tick did: the filters predict with it, and the supervision judges it. */
typedef struct omni_applied_t {
    omni_real_t voltage_V[OMNI_MAX_WHEELS]; /**< in the wheel's direction */
    omni_real_t current_cut;                /**< share of the pushes that the current limit took away */
    omni_flag_t saturated;                  /**< wheel speeds, duties or currents were cut */
    bool off_track;                         /**< the pose error was beyond the limit */
} omni_applied_t;

/** State of the whole core, by stage of the tick. Opaque by convention: use the functions. */
typedef struct omni_robot_t {
    const omni_robot_config_t *config;
    omni_applied_t applied;
    omni_supervisor_t supervisor;
    omni_guide_t guide;
    omni_gain_margin_t margin;
    omni_control_state_t control;
    omni_exciter_t exciter; /**< omni_excitation_start() begins one between two ticks */
    omni_estimator_t estimator;
} omni_robot_t;

/** Start in OMNI_STATE_INIT at pose zero; the first tick goes to DISARMED. `config` must outlive its use. */
void omni_robot_init(omni_robot_t *robot, const omni_robot_config_t *config);

/** Hand over another configuration between two ticks; controller and filter states go on without a bump. */
void omni_robot_set_config(omni_robot_t *robot, const omni_robot_config_t *config);

/** One tick. Never fails: whatever comes in, duties and voltages are finite, |duty| <= 1, and 0 unless armed and
 * healthy. Other outputs are finite for poses within LIM_POS; a pose of 3e38 m, say, gives a reference that is not. */
/*@ ensures duty_in_range: \forall integer i; 0 <= i < OMNI_MAX_WHEELS ==>
        \is_finite(outputs->duty[i]) && -1.0 <= outputs->duty[i] <= 1.0;
    ensures voltage_finite: \forall integer i; 0 <= i < OMNI_MAX_WHEELS ==> \is_finite(outputs->voltage_V[i]);
    ensures armed_to_drive: outputs->drive ==> outputs->state == OMNI_STATE_ARMED;
    ensures off_is_zero: !outputs->drive ==> \forall integer i; 0 <= i < OMNI_MAX_WHEELS ==> outputs->duty[i] == 0.0; */
void omni_robot_tick(omni_robot_t *robot, const omni_inputs_t *inputs, omni_outputs_t *outputs);

/** Name of a position controller, as CTL_MODE has it. @return NULL beyond OMNI_CTL_MODE_COUNT. */
const char *omni_controller_name(uint8_t controller);

/** What a position controller asks for, omni_demand_kind_t. @return OMNI_DEMAND_NONE beyond OMNI_CTL_MODE_COUNT. */
uint8_t omni_controller_demand(uint8_t controller);

/** Clear the state of all position controllers: integrals, and the tick of their period. */
void omni_controllers_reset(omni_control_state_t *control);

/**
 * One step of the position controller of `config` outside of a robot's tick, for a host that drives without encoders.
 * Control behaviour is the tick's, by the same table. It has to ask for a twist (OMNI_DEMAND_TWIST); others need what
 * only the tick knows. Call it every config->step_s * config->control_period.
 * @param rate measured, world frame. @param reference its pose and rate.
 * @param control out: `demand.twist` (body frame) and `demand.terms`.
 * @return OMNI_OK; OMNI_ERR_RANGE if this controller asks for something else. Nothing is done then.
 */
omni_result_t omni_controller_step(omni_control_state_t *control, const omni_robot_config_t *config,
                                   const omni_pose_t *pose, const omni_twist_t *rate, const omni_reference_t *reference,
                                   omni_flag_t saturated);

/** May a signal be added at this place (omni_excitation_place_t) while this kind of set-point
 * (omni_setpoint_kind_t) is in force? */
bool omni_excitation_fits(uint8_t place, uint8_t kind);

/** May the robot be armed now? @return 0, or the stop fault bits that prevent it; state other than DISARMED:
 * OMNI_FAULT_CONFIG. */
uint32_t omni_robot_arming_faults(const omni_robot_t *robot);

#endif
