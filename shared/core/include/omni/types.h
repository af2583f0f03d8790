/* SPDX-License-Identifier: MIT */
/**
 * @file types.h
 * Frames and small value types shared by every module of the control core.
 *
 * Frames. World: x, y on the floor, theta counter-clockwise [rad]. Body: x forward, y left; wheel i sits at bearing
 * alpha_i from body x. Positive wheel speed drives the body counter-clockwise. SI units unless a name says otherwise.
 */
#ifndef OMNI_TYPES_H
#define OMNI_TYPES_H

#include <stddef.h>

#include "omni/numbers.h"

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

/** First or second time derivative of a pose: m/s, rad/s (or m/s^2, rad/s^2). The variable's name gives the frame. */
typedef struct omni_twist_t {
    omni_real_t vx;
    omni_real_t vy;
    omni_real_t wz;
} omni_twist_t;

/** Result of functions that validate their input. */
typedef enum omni_result_t {
    OMNI_OK = 0,
    OMNI_ERR_NOT_FINITE, /**< a NaN or an infinity */
    OMNI_ERR_RANGE,      /**< outside the documented range */
    OMNI_ERR_SINGULAR,   /**< the wheels cannot produce every motion, or a matrix has no inverse */
    OMNI_ERR_UNKNOWN,    /**< unknown name or index */
    OMNI_ERR_LOCKED,     /**< not allowed while armed */
    OMNI_ERR_TIME        /**< time stamp outside the usable window */
} omni_result_t;

#endif
