/* SPDX-License-Identifier: MIT */
/** @file motion.h  The state of the motion in the body frame, and the plants that move it. */
#ifndef HIL_SIM_MOTION_H
#define HIL_SIM_MOTION_H

#include "parts.h"

typedef struct hil_motion_t {
    double v[3]; /**< body frame: vx, vy, wz */
    double w[HIL_MAX_WHEELS];
    double i[HIL_MAX_WHEELS];
} hil_motion_t;

/** Width of the smoothed sign of Coulomb friction, at a wheel. */
static const double HIL_COULOMB_WIDTH_rad_s = 0.01;
static const double HIL_ROSENBROCK_GAMMA = 0.29289321881345254;

/* plant.c */
/** World frame from and to body frame; cos_sin: cosine and sine of the heading. */
void hil_motion_load(const hil_world_t *world, hil_motion_t *y, const double *cos_sin);
void hil_motion_store(hil_world_t *world, const hil_motion_t *y, const double *cos_sin);
/** Speed of the floor below the body at wheel i, along the wheel [m/s]: t_i . (v + wz x p_i). */
double hil_floor_speed(const hil_plant_t *plant, const double *v, uint32_t wheel);

/* plant_contact.c: full, slip; the motors of kinematic+motors */
void hil_contact_substep(hil_world_t *world, const hil_electrics_t *electrics, hil_motion_t *y, double step_s);

/* plant_kinematic.c */
/** Body velocity that fits the wheels' speeds and the imposed slip best, in least squares. */
void hil_rolling_twist(const hil_world_t *world, const double *wheel_rad_s, double *v);
void hil_kinematic_step(hil_world_t *world, const hil_electrics_t *electrics, double step_s);

/* plant_linear.c */
void hil_linear_init(hil_plant_t *plant, const hil_world_config_t *config);
/** Wheel speeds of rolling at body velocity v with the imposed slip. */
void hil_linear_wheels(const hil_world_t *world, const double *v, double *wheel_rad_s);
void hil_linear_substep(hil_world_t *world, const hil_electrics_t *electrics, hil_motion_t *y, double step_s);

#endif
