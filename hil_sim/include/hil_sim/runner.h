/* SPDX-License-Identifier: MIT */
/**
 * @file runner.h
 * Closes the loop around the world, by omni_robot_tick in this process, or by the real firmware over a byte link in
 * lockstep. Both record the same samples.
 */
#ifndef HIL_SIM_RUNNER_H
#define HIL_SIM_RUNNER_H

#include "hil_sim/milestones.h"
#include "hil_sim/waiting.h"
#include "hil_sim/world.h"
#include "omni/direct_torque.h"
#include "omni/robot.h"

/** One row of a run's record. Arrays per wheel have HIL_MAX_WHEELS entries. */
typedef struct hil_sample_t {
    double time_s;
    double truth[3]; /**< pose */
    double reference[3];
    double estimate[3];
    double wheel_rad_s[HIL_MAX_WHEELS]; /**< truth */
    double wheel_reference[HIL_MAX_WHEELS];
    double duty[HIL_MAX_WHEELS]; /**< mean bridge voltage / supply, from the bridge inputs */
    double current_A[HIL_MAX_WHEELS];
    double slip_ratio[HIL_MAX_WHEELS];
    double supply_V;
    double wheel_scale;
    double duty_scale;
    uint32_t faults;
    uint32_t config_sequence;
    uint32_t state; /**< omni_safety_state_t */
    uint32_t phase; /**< omni_trajectory_phase_t */
} hil_sample_t;

/** Record of samples, every `every`-th tick while there is room. */
typedef struct hil_record_t {
    hil_sample_t *samples;
    uint64_t capacity;
    uint64_t count;
    uint32_t every;
} hil_record_t;

/** Add the ticks of a record, one row per tick, in their order. */
void hil_milestones_from_record(hil_milestones_t *milestones, const hil_sample_t *samples, uint64_t count);

/**
 * Run `ticks` ticks of omni_robot_tick in this process: sense, tick, bridge, step. `inputs` keeps setpoint,
 * heartbeat etc. between calls. Its sensor fields are overwritten, and its events are cleared after the first
 * tick. Its heartbeat and setpoint time stamps follow the clock unless the world's link is silent. I2C faults count
 * as driver failures. Values of wheels the robot doesn't have are 0. @param record may be NULL.
 */
void hil_run_in_process(hil_world_t *world, omni_robot_t *robot, omni_inputs_t *inputs, omni_outputs_t *outputs,
                        uint64_t ticks, hil_record_t *record);

/** Per wheel the value of largest magnitude, with its sign; the slip speed is rim minus floor, after each tick. */
typedef struct hil_torque_peaks_t {
    double torque_N_m[HIL_MAX_WHEELS];
    double slip_m_s[HIL_MAX_WHEELS];
} hil_torque_peaks_t;

/**
 * For studies of direct torque control: one period of the law with ideal torques and perfect knowledge of pose and
 * twist. The law is evaluated once, its torques are held for `ticks` ticks of OMNI_TICK_US, and
 * omni_direct_torque_protect acts in each.
 * @param floor_world twist used by the protection as the floor's; NULL: the true one. @param peaks out.
 * @return HIL_ERR_CONFIG if the plant takes no torques or the wheels of `k` are not the world's.
 */
hil_result_t hil_run_direct_torque(hil_world_t *world, const omni_kinematics_t *k,
                                   const omni_direct_torque_config_t *config, const omni_reference_t *reference,
                                   const omni_twist_t *floor_world, uint32_t ticks, hil_torque_peaks_t *peaks);

enum { HIL_LOCKSTEP_RX = 65536, HIL_LOCKSTEP_INPUT = 4096, HIL_LOCKSTEP_SKIPPED = 16 };

/**
 * Simulator's end of a lockstep link. Between runs the caller may change all members not marked "own".
 *
 * Frames. OMNI_* messages carry world x, y, theta unconverted. VICON_POSITION_ESTIMATE is NED like all of standard
 * MAVLink: world x is North, world y West, z up, hence x_ned = x, y_ned = -y, yaw_ned = -theta.
 */
typedef struct hil_lockstep_t {
    int32_t fd;        /**< open, connected; owned by the caller */
    uint8_t system_id; /**< of this end */
    uint8_t component_id;
    uint32_t sequence;           /**< of the next tick; own */
    uint64_t ticks;              /**< run so far, the simulated clock; own */
    hil_waiting_t waiting;       /**< waiting strategy; a run with a realtime_factor sleeps */
    bool send_fixes;             /**< send pose fixes as VICON_POSITION_ESTIMATE */
    double timeout_s;            /**< timeout of an answer, wall time */
    double realtime_factor;      /**< 0: as fast as possible; 1: real time */
    uint8_t rx[HIL_LOCKSTEP_RX]; /**< all other frames from the robot, for the caller, which resets both lengths
                                    to 0 */
    uint32_t rx_length;
    uint32_t rx_served;                     /**< bytes of rx processed by hil_lockstep_serve() */
    uint32_t serve_ticks;                   /**< hil_lockstep_serve() before every tick divisible by this; 0: never */
    uint32_t skipped[HIL_LOCKSTEP_SKIPPED]; /**< messages that serving takes out of rx */
    uint32_t skipped_count;
    uint8_t *log; /**< owned by the caller, at least 4 HIL_LOCKSTEP_RX long; NULL: none */
    uint32_t log_capacity;
    uint32_t log_length;
    uint32_t log_frames;
    uint64_t log_epoch_us;             /**< time stamp at tick 0 */
    uint32_t bad_frames;               /**< frames with a wrong checksum or of an unknown message */
    uint32_t lost_frames;              /**< frames for which `rx` had no room */
    uint32_t stale_answers;            /**< answers to ticks of earlier runs that had timed out */
    uint8_t input[HIL_LOCKSTEP_INPUT]; /**< unparsed bytes; own */
    uint32_t input_length;
    int64_t deadline_us;    /**< deadline of the current answer; own */
    uint32_t outside;       /**< heartbeats of this tick without the HIL flag; own */
    uint8_t frame_sequence; /**< MAVLink sequence of the next frame */
    double pace_factor;     /**< pacing has been anchored for this factor ... */
    int64_t pace_wall_us;   /**< ... at this wall time ... */
    uint64_t pace_world_us; /**< ... and this world time */
} hil_lockstep_t;

void hil_lockstep_init(hil_lockstep_t *link, int32_t fd, uint8_t system_id, uint8_t component_id);

/**
 * Run up to `ticks` ticks of OMNI_TICK_US in lockstep. Each: sense, send OMNI_HIL_SENSORS (and a due pose fix before
 * it), wait for OMNI_HIL_ACTUATORS of the same sequence, apply its I2C bytes, step. Frames of other messages are
 * collected in `rx`. The run returns early when `rx` is three quarters full or `log` has no room for what may come. The
 * answer must be the last frame of a tick. While the link is silent (fault), due fixes are lost.
 * @param record may be NULL. @param done out: ticks run, also on failure.
 * @return HIL_ERR_LINK, HIL_ERR_TIMEOUT, HIL_ERR_PROTOCOL (an answer to a later tick, or I2C bytes that do not parse)
 * or HIL_ERR_OUTSIDE. That is when two heartbeats come without an answer and both say so. The first may be from before
 * the robot entered. The world then stands before the failed tick's step.
 */
hil_result_t hil_lockstep_run(hil_lockstep_t *link, hil_world_t *world, uint64_t ticks, hil_record_t *record,
                              uint64_t *done);

/**
 * First half of a tick with an external world: send the sensors of `electronics` to the robot. While it computes, the
 * world may do work that needs no motors. Must be followed by hil_lockstep_apply_actuators().
 * @param asked out: false where hil_lockstep_run() would return early: no answer will follow.
 */
hil_result_t hil_lockstep_send_sensors(hil_lockstep_t *link, hil_world_t *electronics, bool *asked);

/** Second half: apply the answer to the chip and bridges of `electronics`. Must be followed by hil_external_update().
 */
hil_result_t hil_lockstep_apply_actuators(hil_lockstep_t *link, hil_world_t *electronics, hil_record_t *record);

/**
 * Process the frames received since the last call. Append them to `log` as records of a telemetry log. Each has 8
 * bytes of time, big-endian (log_epoch_us and the simulated time now), then the frame. Take those that are `skipped`
 * out of `rx`.
 */
void hil_lockstep_serve(hil_lockstep_t *link);

#endif
