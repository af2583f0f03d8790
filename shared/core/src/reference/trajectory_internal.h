/* SPDX-License-Identifier: MIT */
/**
 * @file trajectory_internal.h
 * Internal declarations of the trajectory sources. Not part of the API. Path time is an integer number of nanoseconds,
 * so that reducing it to a phase is exact however long a path runs.
 */
#ifndef OMNI_TRAJECTORY_INTERNAL_H
#define OMNI_TRAJECTORY_INTERNAL_H

#include <string.h>

#include "omni/trajectory.h"

enum { OMNI_JET_LENGTH = 4 };

/** Path time of an endless path. */
#define OMNI_ENDLESS_NS UINT64_MAX

static const omni_real_t omni_two_pi = 6.28318530717958647692f;

/** A function's value and its first three derivatives. */
typedef struct omni_jet_t {
    omni_real_t d[OMNI_JET_LENGTH];
} omni_jet_t;

/** Source of a path's points, if it has any. Unless it is smooth, a lap has a leg of TRJ_PERIOD per point. */
typedef enum omni_path_points_t {
    OMNI_POINTS_NONE = 0,
    OMNI_POINTS_GIVEN, /**< uploaded waypoints */
    OMNI_POINTS_DRAWN, /**< random, by TRJ_SEED */
    OMNI_POINTS_SMOOTH /**< uploaded waypoints, interpolated without stops in a lap of TRJ_PERIOD */
} omni_path_points_t;

/**
 * Kind of path: row of the table indexed by TRJ_TYPE of params.toml. For a value `name` a source in this folder defines
 * the row `omni_path_row_name`. Recipe: docs/how-to-add/trajectory.md. Functions of a row are named path_jets_...,
 * path_round_..., path_half_turns_... and path_accepts_...: the analyses of stack and run time resolve the function
 * pointers by these prefixes.
 */
typedef struct omni_path_row_t {
    /** Evaluate the path at path_ns: x, y and, if it has_heading, theta. Jets are zero on entry. */
    void (*jets)(const omni_trajectory_t *plan, omni_ns_t path_ns, omni_jet_t *x, omni_jet_t *y, omni_jet_t *theta);
    bool has_heading;   /**< theta is the path's own; otherwise TRJ_ROT gives it */
    uint8_t points;     /**< omni_path_points_t */
    uint16_t repeats_s; /**< path time after which the wheel demand repeats; 0: after a lap */
    /** Path time of a round that contains all of TRJ_LAPS. NULL: a lap takes TRJ_PERIOD. */
    omni_ns_t (*round_ns)(const omni_trajectory_t *plan);
    /** Phasors of the path in half turns per lap, for TRJ_ROT tangent (trajectory_rotation.c). NULL: constant
     * heading. */
    void (*half_turns)(const omni_trajectory_config_t *config, int32_t *sum, int32_t *difference);
    /** Are the parameters of this kind in range? NULL: it has none. */
    bool (*accepts)(const omni_trajectory_config_t *config);
} omni_path_row_t;

#define OMNI_ROW(NAME, name) extern const omni_path_row_t omni_path_row_##name;
OMNI_TRJ_TYPE_ROWS(OMNI_ROW)
#undef OMNI_ROW

/** Is TRJ_PERIOD the time of a leg, rather than of a lap? */
static inline bool omni_path_has_legs(const omni_path_row_t *row) {
    return row->points == OMNI_POINTS_GIVEN || row->points == OMNI_POINTS_DRAWN;
}

/** Indexed by TRJ_TYPE. */
extern const omni_path_row_t *const omni_path_rows[OMNI_TRJ_TYPE_COUNT];

/** The row of a plan's kind. */
static inline const omni_path_row_t *omni_path_row(const omni_trajectory_t *plan) {
    return omni_path_rows[plan->config.type];
}

/** State of the path clock. */
typedef struct omni_path_clock_t {
    omni_ns_t path_ns;       /**< u */
    omni_real_t rate;        /**< u' */
    omni_real_t rate_change; /**< u'', 1/s */
    bool done;
} omni_path_clock_t;

/** Seconds (0..1e9) as nanoseconds. */
omni_ns_t omni_nanoseconds(omni_real_t seconds);

/** 10 p^3 - 15 p^4 + 6 p^5 and its derivatives by p; at rest at p = 0 and p = 1. */
omni_jet_t omni_quintic(omni_real_t p);

/** jet += amplitude sin(2 pi turns), for a phase 2 pi turns that grows at omega [rad per s of path time]. */
void omni_jet_add_sine(omni_jet_t *jet, omni_real_t amplitude, omni_real_t turns, omni_real_t omega);

/** Nearest float of an integer, as by a cast, in a quarter of its time on a 32-bit processor. */
static inline float omni_float_of(uint64_t whole) {
    const uint32_t high = (uint32_t)(whole >> 32);
    if (high == 0) {
        return (float)(uint32_t)whole;
    }
    /* The leading 32 bits, with the last one sticky, so that the conversion rounds as with all bits. */
    const uint32_t shift = 32u - (uint32_t)__builtin_clz(high);
    const uint32_t rest = (uint32_t)(whole << (64u - shift) >> 32) | (uint32_t)(whole << (64u - shift));
    const uint32_t leading = (uint32_t)(whole >> shift) | (rest != 0 ? 1u : 0u);
    const uint32_t power_bits = (127u + shift) << 23;
    float power;
    memcpy(&power, &power_bits, sizeof power);
    return (float)leading * power;
}

/** ns modulo period_ns; most paths are in their first lap, and a 64-bit division costs 50 instructions on a 32-bit
 * processor. */
static inline omni_ns_t omni_modulo(omni_ns_t ns, omni_ns_t period_ns) {
    return omni_all(ns < period_ns) ? ns : ns % period_ns;
}

/** ns modulo period_ns as a fraction of it, 0..1. */
static inline omni_real_t omni_phase(omni_ns_t ns, omni_ns_t period_ns) {
    return omni_real_of(omni_modulo(ns, period_ns)) / omni_real_of(period_ns);
}

/** Path time of TRJ_PERIOD, at least 1. */
omni_ns_t omni_path_period_ns(const omni_trajectory_t *plan);

/** Path time of a lap: one period, or all legs of a round. */
omni_ns_t omni_path_lap_ns(const omni_trajectory_t *plan);

/** Path time of the whole path, or OMNI_ENDLESS_NS. */
omni_ns_t omni_path_duration_ns(const omni_trajectory_t *plan);

/** Fill period, lap and duration of plan->timing. Call it after configuration and points are set. */
void omni_path_set_lengths(omni_trajectory_t *plan);

/** Fill the clock's times of plan->timing. Call it after omni_path_set_lengths and after each change of plan->scale. */
void omni_path_set_clock(omni_trajectory_t *plan);

/** Real time of the whole path at plan->scale, or OMNI_ENDLESS_NS. */
omni_ns_t omni_path_real_ns(const omni_trajectory_t *plan);

/** Path clock at time_ns after the start of the path. */
omni_path_clock_t omni_path_clock(const omni_trajectory_t *plan, omni_ns_t time_ns);

/** omni_path_evaluate at an exact path time. */
void omni_path_at(const omni_trajectory_t *plan, omni_ns_t path_ns, omni_pose_t *pose, omni_twist_t *first,
                  omni_twist_t *second);

/** Heading by TRJ_ROT, without heading_offset_rad, for the jets of x and y at path_ns. */
omni_jet_t omni_path_rotation(const omni_trajectory_t *plan, omni_ns_t path_ns, const omni_jet_t *x,
                              const omni_jet_t *y);

/** Draw the points of the random path, or take the waypoints; headings unwrapped to turns of less than pi. */
void omni_path_points(omni_trajectory_t *plan, const omni_waypoints_t *given);

/** Replace the points of a smooth path by the control points of its interpolating spline. */
void omni_path_spline(omni_trajectory_t *plan);

/** Fraction of a turn that `turns` per lap add up to after `laps`, -0.5..0.5: exact, so that laps join without a step.
 */
omni_real_t omni_whole_laps(omni_real_t turns, omni_ns_t laps);

/** Rate and acceleration from the derivatives by path time, by the chain rule. */
void omni_path_chain(const omni_path_clock_t *clock, const omni_twist_t *first, const omni_twist_t *second,
                     omni_twist_t *rate, omni_twist_t *acceleration);

/** Quintic from one pose to another over duration_s, at the fraction p of it. */
void omni_leg(const omni_pose_t *from, const omni_pose_t *to, omni_real_t duration_s, omni_real_t p, omni_pose_t *pose,
              omni_twist_t *rate, omni_twist_t *acceleration);

#endif
