/* SPDX-License-Identifier: MIT */
/** @file motion.h  The state of the motion in the body frame, and the plants that move it. */
#ifndef HIL_SIM_MOTION_H
#define HIL_SIM_MOTION_H

#include "parts.h"

typedef struct hil_motion_t {
    hil_real_t v[3]; /**< body frame: vx, vy, wz */
    hil_real_t w[HIL_MAX_WHEELS];
    hil_real_t i[HIL_MAX_WHEELS];
} hil_motion_t;

/** Constants of the wheel-floor contact during a tick. g h: of a substep (plant_contact.c). */
typedef struct hil_contact_t {
    hil_real_t h;
    hil_real_t gh;
    hil_real_t rim_m[HIL_MAX_WHEELS];      /**< r (1 - s): floor that a radian covers */
    hil_real_t inductance[HIL_MAX_WHEELS]; /**< 1 / L, 0 for an open winding */
    hil_real_t current[HIL_MAX_WHEELS];    /**< 1 / (1 + g h R / L), 0 for an open winding */
    hil_real_t emf[HIL_MAX_WHEELS];        /**< g h K / L of that */
    hil_real_t diagonal[HIL_MAX_WHEELS];   /**< of the wheel's equation, without traction and Coulomb friction */
    hil_real_t torque;                     /**< g h K / J */
    hil_real_t per_inertia;                /**< g h / J */
    hil_real_t coulomb_slope;              /**< T_c w_0^2 */
    hil_real_t mass[6];                    /**< of the body's equation, without the wheels */
} hil_contact_t;

/** Parameters of hil_contact_t and hil_plant_t per wheel, for gears with backlash. */
typedef struct hil_wheel_params_t {
    hil_real_t inverse_inertia[HIL_MAX_WHEELS]; /**< 1 / J of all that turns with the wheel */
    hil_real_t constant[HIL_MAX_WHEELS];        /**< K, 0 without a motor */
    hil_real_t viscous[HIL_MAX_WHEELS];         /**< b of that */
    hil_real_t coulomb[HIL_MAX_WHEELS];         /**< T_c of that */
    hil_real_t torque[HIL_MAX_WHEELS];
    hil_real_t per_inertia[HIL_MAX_WHEELS];
    hil_real_t coulomb_slope[HIL_MAX_WHEELS];
} hil_wheel_params_t;

/** Width of the smoothed sign of Coulomb friction, at a wheel. */
static const double HIL_COULOMB_WIDTH_rad_s = 0.01;
static const double HIL_GRAVITY_m_s2 = 9.80665;
static const double HIL_ROSENBROCK_GAMMA = 0.29289321881345254;

/** Plant interface; hil_plant_NAME for each row of [plants] in shared/world.toml. */
typedef struct hil_plant_model_t {
    bool takes_speed;  /**< wheels can be given speeds in place of motors */
    bool takes_torque; /**< and torques */
    /** Plant-specific initialisation, after the common one. NULL: none. */
    void (*init)(hil_plant_t *plant, const hil_world_config_t *config);
    /** Handle a change of hil_source_t. NULL: none needed. */
    void (*source)(hil_world_t *world, uint32_t source);
    /** Advance wheels, currents, body and supply voltage by a tick. Encoders, slip and faults are handled by the world.
     */
    void (*step)(hil_world_t *world, const hil_electrics_t *electrics, double step_s);
} hil_plant_model_t;

/** Substep of a plant. */
typedef void hil_substep_t(hil_world_t *world, const hil_electrics_t *electrics, const hil_contact_t *contact,
                           hil_motion_t *y, double step_s);

/* plant.c */
const hil_plant_model_t *hil_plant_model(uint32_t plant);
/**
 * A tick in substeps of at most 0.25 ms, positions by the midpoint rule. @param fit makes wheels and body fit together
 * before the first one, because imposed slip may have changed since the last step; NULL: they need not.
 */
void hil_integrate_substeps(hil_world_t *world, const hil_electrics_t *electrics, double step_s,
                            void (*fit)(const hil_world_t *world, hil_motion_t *y), hil_substep_t *substep);
/** World frame from and to body frame; cos_sin: cosine and sine of the heading. */
void hil_motion_load(const hil_world_t *world, hil_motion_t *y, const hil_real_t *cos_sin);
void hil_motion_store(hil_world_t *world, const hil_motion_t *y, const hil_real_t *cos_sin);
/** Speed of the floor below the body at wheel i, along the wheel [m/s]: t_i . (v + wz x p_i). */
hil_real_t hil_floor_speed(const hil_plant_t *plant, const hil_real_t *v, uint32_t wheel);
/** The report's models leave out battery resistance and roller drag. */
static inline void hil_plant_ignore_losses(hil_plant_t *plant) {
    plant->battery_resistance_ohm = 0.0;
    plant->drag_xx = plant->drag_xy = plant->drag_yy = 0.0;
}

/* plant_contact.c: wheels on the floor, for plants with a contact or motors */
/** Before the substeps of a tick. */
void hil_contact_begin(hil_contact_t *contact, const hil_world_t *world, const hil_electrics_t *electrics,
                       double step_s);
void hil_contact_substep(hil_world_t *world, const hil_electrics_t *electrics, const hil_contact_t *contact,
                         hil_motion_t *y);
/** A substep with parameters per wheel. */
void hil_contact_wheel_substep(hil_world_t *world, const hil_electrics_t *electrics, const hil_contact_t *contact,
                               const hil_wheel_params_t *own, hil_motion_t *y);
/** Advance a plant that consists of the wheel-floor contact only by a tick. */
void hil_contact_step(hil_world_t *world, const hil_electrics_t *electrics, double step_s);

/* floor.c: real wheels on a real floor, for plant full */
/** Enable and initialise it if configured. After the common initialisation. */
void hil_floor_init(hil_plant_t *plant, const hil_world_config_t *config);
/** Before a tick: which roller carries each wheel, the wheels' loads, slope and dry drag. */
void hil_floor_step(hil_world_t *world, double step_s);

/* bridge_limits.c: what protects bridges and supply, and what makes them warm, for plants full and slip */
/** Electrics during a substep with bridge limits, and the currents of windings that were opened. */
typedef struct hil_limited_electrics_t {
    hil_electrics_t electrics;
    hil_real_t begin_A[HIL_MAX_WHEELS];
    hil_real_t end_A[HIL_MAX_WHEELS];
    hil_real_t opened[HIL_MAX_WHEELS]; /**< 1: a bridge that was to be closed is open; the current is its mean */
} hil_limited_electrics_t;

/** Enable it if configured. After the common initialisation. */
void hil_limits_init(hil_plant_t *plant, const hil_world_config_t *config);
/** Before a substep: `now` takes the place of the tick's electrics. */
void hil_limits_before_substep(hil_world_t *world, const hil_electrics_t *electrics, hil_motion_t *y, double step_s,
                               hil_limited_electrics_t *now);
/** After it. */
void hil_limits_after_substep(hil_world_t *world, const hil_electrics_t *electrics, hil_limited_electrics_t *now,
                              hil_motion_t *y, double step_s);

/* backlash.c: play of the gears, for plant full */
/** Enable it if configured. After the common initialisation. */
void hil_backlash_init(hil_plant_t *plant, const hil_world_config_t *config);
/** A tick of wheels on the floor behind gears with play. */
void hil_backlash_step(hil_world_t *world, const hil_electrics_t *electrics, double step_s);

/* plant_kinematic.c */
/** Body velocity that fits the wheels' speeds and the imposed slip best, in least squares. */
void hil_rolling_twist(const hil_world_t *world, const hil_real_t *wheel_rad_s, hil_real_t *v);

#endif
