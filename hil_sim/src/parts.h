/* SPDX-License-Identifier: MIT */
/** @file parts.h  What the parts of the world offer each other. */
#ifndef HIL_SIM_PARTS_H
#define HIL_SIM_PARTS_H

#include "hil_sim/world.h"

static const double HIL_PI = 3.14159265358979323846;

/* Random streams of a run; those per wheel take HIL_MAX_WHEELS numbers from their start. */
enum {
    HIL_STREAM_SLIP = 0,
    HIL_STREAM_SLIP_SPEED = 4,
    HIL_STREAM_FIX_X = 16,
    HIL_STREAM_FIX_Y,
    HIL_STREAM_FIX_THETA,
    HIL_STREAM_FIX_DROP,
    HIL_STREAM_ENCODER = 24 /* per wheel */
};

/** How the electrics act on the motion during a step: V_i = gain_i * supply + offset_i, or a current that the winding can't change. */
typedef struct hil_electrics_t {
    double gain[HIL_MAX_WHEELS];
    double offset_V[HIL_MAX_WHEELS];
    double closed[HIL_MAX_WHEELS]; /**< 1: the winding is connected, 0: open */
    double battery_V;
    double drive[HIL_MAX_WHEELS]; /**< share of the motor current that the battery sees */
} hil_electrics_t;

/* config.c */
hil_result_t hil_config_check(const hil_world_config_t *config, char *why, uint32_t why_size);

/* plant.c */
void hil_plant_init(hil_plant_t *plant, const hil_world_config_t *config);
/** Can this plant be driven by this source? */
bool hil_plant_takes(uint32_t plant, uint32_t source);
/** Drive the wheels by this source from now on. */
void hil_plant_source(hil_world_t *world, uint32_t source);
void hil_plant_step(hil_world_t *world, const hil_electrics_t *electrics, double step_s);

/* motors.c */
void hil_motors_apply_inputs(hil_world_t *world, uint32_t wheel, double phase1, double phase2, double period_s);
void hil_motors_begin(hil_world_t *world, hil_electrics_t *electrics, double step_s, double *open_end_A);
void hil_motors_end(hil_world_t *world, const hil_electrics_t *electrics, const double *open_end_A);

/* sensors.c */
void hil_encoders_update(hil_world_t *world);
/** What the robot reads of its counters. */
void hil_encoders_read(const hil_world_t *world, int32_t *counts);
void hil_pose_sensor_update(hil_world_t *world);

/* slip.c */
void hil_slip_init(hil_world_t *world);
/** Slip ratios of a time. */
void hil_slip_update(hil_world_t *world, double time_s);
/** Slip speeds of the step that begins now. */
void hil_slip_hold(hil_world_t *world);

/** The active fault of this kind that concerns the wheel (HIL_MAX_WHEELS or above: any), or NULL. */
const hil_fault_t *hil_fault_find(const hil_world_t *world, uint8_t kind, uint32_t wheel);
/** Value of an active fault of this kind, or `otherwise`. */
double hil_fault_value(const hil_world_t *world, uint8_t kind, double otherwise);

#endif
