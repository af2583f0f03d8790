/* SPDX-License-Identifier: MIT */
/**
 * @file types.h
 * Numbers, frames and small value types shared by every module of the control core.
 *
 * Frames. World: x, y on the floor, theta counter-clockwise [rad]. Body: x forward, y left; wheel i sits at bearing
 * alpha_i from body x. Positive wheel speed drives the body counter-clockwise. SI units unless a name says otherwise.
 */
#ifndef OMNI_TYPES_H
#define OMNI_TYPES_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

/*
 * The simulation compiles this core for eight runs at once, with numbers of its own (hil_sim/lanes). What may differ from run to
 * run is therefore one of these types; everything else is common to the runs, as are the ways through `if` and `?:`.
 */
#ifndef OMNI_OWN_NUMBERS
/** Scalar of the control core: IEEE-754 binary32 on every target. */
typedef float omni_real_t;

typedef int32_t omni_int_t;
typedef uint32_t omni_uint_t;
typedef uint64_t omni_ns_t; /**< nanoseconds */
typedef bool omni_flag_t;

/** For conditions that the data often decide. Both values may be evaluated: they have no side effects. */
#define omni_select(condition, a, b) ((condition) ? (a) : (b))

/** For short cuts: the condition holds in every run, or in one at least. What comes after must do without the short cut, too. */
#define omni_all(condition) (condition)
#define omni_any(condition) (condition)

#define OMNI_FABSF __builtin_fabsf
#define OMNI_SQRTF __builtin_sqrtf
#endif

enum {
    OMNI_MAX_WHEELS = 4, /**< array length of everything per wheel */
    OMNI_AXES = 3        /**< x, y, theta */
};

/** Pose in the world frame: metres and radians. */
typedef struct omni_pose_t {
    omni_real_t x;
    omni_real_t y;
    omni_real_t theta;
} omni_pose_t;

/** Rate of a pose, or the rate of that rate; the name of the variable says in which frame. m/s, rad/s (or m/s^2 ...). */
typedef struct omni_twist_t {
    omni_real_t vx;
    omni_real_t vy;
    omni_real_t wz;
} omni_twist_t;

/** Result of the functions that can refuse their input. */
typedef enum omni_result_t {
    OMNI_OK = 0,
    OMNI_ERR_NOT_FINITE, /**< a NaN or an infinity */
    OMNI_ERR_RANGE,      /**< outside the documented range */
    OMNI_ERR_SINGULAR,   /**< the wheels cannot produce every motion, or a matrix has no inverse */
    OMNI_ERR_UNKNOWN,    /**< no such name or index */
    OMNI_ERR_LOCKED,     /**< not in this state (armed) */
    OMNI_ERR_TIME        /**< time stamp outside the usable window */
} omni_result_t;

#endif
