/* SPDX-License-Identifier: MIT */
/**
 * @file trajectory.h Reference trajectories with exact first and second derivatives: a path and a time scaling (path
 * clock) that starts and ends at rest and may be slowed down to the limits of the wheels.
 *
 * The path p(u) is a function of path time u in [0, duration]. The rate u'(t) of the clock rises with a quintic over
 * ramp_s, stays at 1/scale and falls likewise. Chain rule: xi' = p'(u) u',  xi'' = p''(u) u'^2 + p'(u) u''. If the
 * robot isn't at the path's start, a quintic lead-in within the limits of wheels and acceleration precedes it.
 *
 * Type report, with a = size_m and u in seconds [report eq. 81]:
 *
 *   x = a [sin(2 pi u/12) + cos(2 pi u/14)],  y = a [sin(2 pi u/5) + cos(2 pi u/4)]
 *   theta = 0.5 [sin(2 pi u/16) + cos(2 pi u/8)]
 *
 * Type identify is the excitation of [report Appendix D]. It drives `laps` circles counter-clockwise with fixed
 * heading, and as many clockwise. Then it spins on the spot by rotation_amplitude_rad per lap, both ways. Each of the
 * four goes from rest to rest in laps * period_s. Its rate rises and falls with a quintic over a quarter of a period.
 * With `laps` = 0 it is one lap each way, again and again.
 *
 * Type spline interpolates the given points by a cubic B-spline without stops. Each leg between two points takes the
 * same time, so equidistant points give a constant speed.
 *
 * Planning (omni_trajectory_plan) scans the path and belongs in the background; evaluation is cheap and belongs in the
 * tick.
 */
#ifndef OMNI_TRAJECTORY_H
#define OMNI_TRAJECTORY_H

#include "omni/kinematics.h"
#include "omni/motor.h"
#include "omni/params_gen.h"
#include "omni/types.h"

enum { OMNI_MAX_WAYPOINTS = 32 };

typedef struct omni_trajectory_config_t {
    uint8_t type;         /**< enum omni_trj_type */
    uint8_t rotation;     /**< enum omni_trj_rot */
    uint16_t petals;      /**< rose: 1..32. Odd n: r = cos(n f), f in [0, pi]; n = 4m: cos(n/2 f), [0, 2 pi];
                                       else cos(n/4 f), [0, 4 pi] */
    omni_real_t size_m;   /**< radius (rose, circle), length (line, from the origin along x), half width of the random
                                       points' square. Amplitude of x and y of type report; its heading has 0.5 rad
                                       always */
    omni_real_t period_s; /**< path time of a lap; line, waypoints and random points: of a leg */
    omni_real_t laps;     /**< 0: endless. Line: legs, there and back. Waypoints and random points: rounds; the
                                       last round ends at the last point, an earlier one goes on to the first.
                                       Spline: up to 1 it ends at the last point, else it is closed */
    omni_real_t rotation_amplitude_rad; /**< turn per lap (spin), amplitude (sine), half range of the random headings */
    omni_real_t rotation_cycles;        /**< sine periods per lap */
    uint32_t seed;                      /**< random points: the same points for the same seed on every machine */
    bool scale;                         /**< slow down to the limits */
    omni_real_t margin;                 /**< fraction of the limits that may be used */
    omni_real_t ramp_s;
    omni_real_t wheel_limit_rad_s;
    omni_real_t voltage_limit_V;
    omni_real_t ff_speed_V_s; /**< motor: V per rad/s, for the voltage limit */
    omni_real_t ff_acceleration_V_s2;
    omni_body_load_t body_load; /**< body inertia, for the voltage limit */
    omni_real_t lead_in_m_s2;   /**< acceleration limit of the lead-in; 0: only speed and voltage limit it */
    omni_real_t lead_in_rad_s2; /**< angular acceleration limit of the lead-in */
} omni_trajectory_config_t;

typedef struct omni_waypoints_t {
    uint8_t count; /**< 2..OMNI_MAX_WAYPOINTS */
    omni_pose_t pose[OMNI_MAX_WAYPOINTS];
} omni_waypoints_t;

/** Times of a plan as integers, precomputed for the tick. UINT64_MAX: endless. */
typedef struct omni_trajectory_timing_t {
    omni_ns_t lead_in_us;   /**< microseconds */
    omni_ns_t period_ns;    /**< path time of config.period_s */
    omni_ns_t lap_ns;       /**< path time of a lap: one period, or all legs of a round */
    omni_real_t period_s;   /**< period_ns as a float */
    omni_real_t lap_s;      /**< lap_ns as a float */
    omni_ns_t duration_ns;  /**< path time of the whole path */
    omni_ns_t rate;         /**< of the path clock, fraction of 2^24 */
    omni_ns_t ramp_ns;      /**< real time */
    omni_ns_t ramp_path_ns; /**< path time that a ramp covers: half of what it would be at full rate */
    omni_ns_t cruise_ns;    /**< real time at full rate */
} omni_trajectory_timing_t;

/** A planned path; constant after planning. */
typedef struct omni_trajectory_t {
    omni_trajectory_config_t config;
    omni_waypoints_t waypoints;     /**< given, or drawn for the random points; spline: its control points */
    omni_real_t lap_turn_rad;       /**< spline: whole turns of the heading from a point to the same one a lap later */
    omni_pose_t origin;             /**< pose at plan time */
    omni_pose_t start;              /**< first pose of the path */
    omni_real_t heading_offset_rad; /**< added to the path's own heading: whole turns, or the heading held */
    omni_real_t lead_in_s;          /**< duration of the lead-in, 0 if none */
    omni_real_t duration_s;         /**< path time; infinity is written as a negative number */
    omni_real_t scale;              /**< clock runs at 1/scale, >= 1 if scaled */
    omni_real_t peak_wheel_rad_s;   /**< demanded at scale 1 */
    omni_real_t peak_voltage_V;     /**< demanded at scale 1 */
    bool by_voltage;                /**< binding limit for `scale`: true: motor voltage; false: wheel speed */
    omni_real_t needed_scale;       /**< scale required by the limits, applied or not; < 1: there is room;
                                       > scale: infeasible by that factor */
    omni_trajectory_timing_t timing;
} omni_trajectory_t;

typedef enum omni_trajectory_phase_t {
    OMNI_PHASE_NONE = 0,
    OMNI_PHASE_LEAD_IN,
    OMNI_PHASE_PATH,
    OMNI_PHASE_DONE
} omni_trajectory_phase_t;

typedef struct omni_reference_t {
    omni_pose_t pose;          /**< theta continuous within a lap, not wrapped; whole turns are dropped between laps */
    omni_twist_t rate;         /**< world frame */
    omni_twist_t acceleration; /**< world frame */
    omni_real_t path_time_s;   /**< u */
    omni_uint_t phase;         /**< omni_trajectory_phase_t */
} omni_reference_t;

/** Does this TRJ_TYPE need uploaded waypoints? @param type >= OMNI_TRJ_TYPE_COUNT: false. */
bool omni_trajectory_needs_waypoints(omni_uint_t type);

/**
 * Plan a trajectory. @param waypoints required if omni_trajectory_needs_waypoints(), else NULL. Headings turn by less
 * than pi. Type waypoints drives straight quintic legs of period_s, type spline a smooth path.
 * @param at current pose; whole turns of its heading are kept (no unwinding). Type hold stays there.
 * @return OMNI_ERR_RANGE / OMNI_ERR_NOT_FINITE for a bad configuration, or a heading beyond 1e6 rad; the plan then
 * holds `at`.
 */
omni_result_t omni_trajectory_plan(omni_trajectory_t *plan, const omni_trajectory_config_t *config,
                                   const omni_kinematics_t *k, const omni_waypoints_t *waypoints,
                                   const omni_pose_t *at);

/** Evaluate the reference at time_us after the start. Path time is an integer in nanoseconds: exact for years. */
void omni_trajectory_evaluate(const omni_trajectory_t *plan, uint64_t time_us, omni_reference_t *reference);

/** Evaluate the path without time scaling at path time u >= 0 (clamped to the duration; NaN: 0): pose, and its first
 * and second derivative by u. */
void omni_path_evaluate(const omni_trajectory_t *plan, omni_real_t path_time_s, omni_pose_t *pose, omni_twist_t *first,
                        omni_twist_t *second);

#endif
