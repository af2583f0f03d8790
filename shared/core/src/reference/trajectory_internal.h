/* SPDX-License-Identifier: MIT */
/**
 * @file trajectory_internal.h
 * Parts of the trajectories that their files share. Not part of the API. Path time is an integer number of nanoseconds,
 * so that reducing it to a phase is exact however long a path runs.
 */
#ifndef OMNI_TRAJECTORY_INTERNAL_H
#define OMNI_TRAJECTORY_INTERNAL_H

#include <string.h>

#include "omni/trajectory.h"

enum { OMNI_JET_LENGTH = 4 };

/** "No end" as a path time. */
#define OMNI_ENDLESS_NS UINT64_MAX

static const omni_real_t omni_two_pi = 6.28318530717958647692f;

/** A function's value and its first three derivatives. */
typedef struct omni_jet_t {
    omni_real_t d[OMNI_JET_LENGTH];
} omni_jet_t;

/** Where a path's points come from, if it is a tour of points. Unless it is smooth, a lap has a leg of TRJ_PERIOD per
 * point. */
typedef enum omni_path_points_t {
    OMNI_POINTS_NONE = 0,
    OMNI_POINTS_GIVEN, /**< uploaded */
    OMNI_POINTS_DRAWN, /**< by TRJ_SEED */
    OMNI_POINTS_SMOOTH /**< uploaded; a lap of TRJ_PERIOD passes all of them without a stop */
} omni_path_points_t;

/**
 * A kind of path, as a row of a table. The values of TRJ_TYPE in params.toml are the table. For a value `name` a source
 * of this room has the row `omni_path_row_name`. docs/how-to-add/trajectory.md is the recipe. What a row points to is
 * called path_jets_..., path_round_..., path_half_turns_... and path_accepts_...: the bounds of stack and run time find
 * it by that.
 */
typedef struct omni_path_row_t {
    /** The path at path_ns: x, y and, if it has_heading, theta. Jets come in as zero. */
    void (*jets)(const omni_trajectory_t *plan, omni_ns_t path_ns, omni_jet_t *x, omni_jet_t *y, omni_jet_t *theta);
    bool has_heading; /**< theta is the path's own; otherwise TRJ_ROT gives it */
    uint8_t points;   /**< omni_path_points_t */
    uint16_t
        repeats_s; /**< path time after which it asks the same of the wheels again, where that is not a lap; 0: a lap */
    /** Path time of a round that has all of TRJ_LAPS in it. NULL: a lap takes TRJ_PERIOD. */
    omni_ns_t (*round_ns)(const omni_trajectory_t *plan);
    /** Phasors of the path in half turns per lap, for TRJ_ROT tangent (trajectory_rotation.c). NULL: the heading stays.
     */
    void (*half_turns)(const omni_trajectory_config_t *config, int32_t *sum, int32_t *difference);
    /** Are the numbers that only this kind looks at in their range? NULL: there are none. */
    bool (*accepts)(const omni_trajectory_config_t *config);
} omni_path_row_t;

#define OMNI_ROW(NAME, name) extern const omni_path_row_t omni_path_row_##name;
OMNI_TRJ_TYPE_ROWS(OMNI_ROW)
#undef OMNI_ROW

/** Does each leg take TRJ_PERIOD, rather than a lap? */
static inline bool omni_path_stops_at_points(const omni_path_row_t *row) {
    return row->points == OMNI_POINTS_GIVEN || row->points == OMNI_POINTS_DRAWN;
}

/** By value of TRJ_TYPE. */
extern const omni_path_row_t *const omni_path_rows[OMNI_TRJ_TYPE_COUNT];

/** The row of a plan's kind. */
static inline const omni_path_row_t *omni_path_row(const omni_trajectory_t *plan) {
    return omni_path_rows[plan->config.type];
}

/** Where the path clock stands. */
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

/** A whole number as the nearest float: what a cast gives, in a quarter of the time on a 32-bit processor. */
static inline float omni_float_of(uint64_t whole) {
    const uint32_t high = (uint32_t)(whole >> 32);
    if (high == 0) {
        return (float)(uint32_t)whole;
    }
    /* The leading 32 bits, the last of which stands for all that follow: then the conversion rounds as if it saw them
     * all. */
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

/** ns modulo period_ns as a share of it, 0..1. */
static inline omni_real_t omni_phase(omni_ns_t ns, omni_ns_t period_ns) {
    return omni_real_of(omni_modulo(ns, period_ns)) / omni_real_of(period_ns);
}

/** Path time of TRJ_PERIOD, at least 1. */
omni_ns_t omni_path_period_ns(const omni_trajectory_t *plan);

/** Path time of a lap: one period, or all legs of a round. */
omni_ns_t omni_path_lap_ns(const omni_trajectory_t *plan);

/** Path time of the whole path, or OMNI_ENDLESS_NS. */
omni_ns_t omni_path_duration_ns(const omni_trajectory_t *plan);

/** Fill plan->timing with the above, once configuration and points are known. */
void omni_path_set_lengths(omni_trajectory_t *plan);

/** Fill the rest of plan->timing but the lead-in, after omni_path_set_lengths and whenever plan->scale changes. */
void omni_path_set_clock(omni_trajectory_t *plan);

/** Real time that the path clock takes from start to end at scale plan->scale, or OMNI_ENDLESS_NS. */
omni_ns_t omni_path_real_ns(const omni_trajectory_t *plan);

/** The clock time_ns after the path began. */
omni_path_clock_t omni_path_clock(const omni_trajectory_t *plan, omni_ns_t time_ns);

/** omni_path_evaluate at an exact path time. */
void omni_path_at(const omni_trajectory_t *plan, omni_ns_t path_ns, omni_pose_t *pose, omni_twist_t *first,
                  omni_twist_t *second);

/** Heading by the rotation law (its offset not added), for the jets of x and y at path_ns. */
omni_jet_t omni_path_rotation(const omni_trajectory_t *plan, omni_ns_t path_ns, const omni_jet_t *x,
                              const omni_jet_t *y);

/** Draw the points of the random path, or take the waypoints; headings unwrapped to the short way round. */
void omni_path_points(omni_trajectory_t *plan, const omni_waypoints_t *given);

/** Make the points that a smooth path passes into the control points of its spline. */
void omni_path_spline(omni_trajectory_t *plan);

/** Fraction of a turn that `turns` per lap add up to after `laps`, -0.5..0.5: exact, so that laps join without a step.
 */
omni_real_t omni_whole_laps(omni_real_t turns, omni_ns_t laps);

/** Rate and acceleration of a pose on the path by the chain rule. */
void omni_path_chain(const omni_path_clock_t *clock, const omni_twist_t *first, const omni_twist_t *second,
                     omni_twist_t *rate, omni_twist_t *acceleration);

/** Quintic from one pose to another over duration_s, at share p of it. */
void omni_leg(const omni_pose_t *from, const omni_pose_t *to, omni_real_t duration_s, omni_real_t p, omni_pose_t *pose,
              omni_twist_t *rate, omni_twist_t *acceleration);

#endif
