/* SPDX-License-Identifier: MIT */
/**
 * @file world.h
 * The simulated world around one robot: PWM chip, H-bridges, motors, wheels on the floor, rigid body, battery,
 * encoders, pose sensor, faults. Double precision, SI. Written from first principles: contact-point velocities by
 * cross products, a traction force per wheel, independent of the controller's matrices, so that errors there
 * become visible.
 *
 * Motion. Wheel i touches the floor at p_i = d (cos a, sin a), drives along t_i = (-sin a, cos a) and rolls freely
 * along p_i.
 *
 *   creep_i = r w_i (1 - s_i) - u_i - t_i . (v + wz x p_i)
 *   F_i = C creep_i / sqrt(1 + (C creep_i / (mu N))^2)       limited smoothly to mu N, N = m g / n
 *   J w_i' = K i_i - b w_i - T_c w_i / sqrt(w_i^2 + w_0^2) - r F_i     w_0 = 0.01 rad/s
 *   L i_i' = V_i - R i_i - K w_i                             the bridge decides V_i or open circuit
 *   m v' = sum (F_i t_i - roller drag across t_i);   I wz' = sum d_i F_i
 *   V_supply = V_battery - R_battery sum (drive_i i_i)
 *
 * s_i is an imposed slip ratio, u_i an imposed slip speed; encoders see neither.
 *
 * That is the plant `full`. The report's models are plants too (shared/world.toml). They have the report's
 * simplifications. Sensors, faults and bridges are common to all plants.
 * docs/concepts/derivations/slip_space.md derives them.
 */
#ifndef HIL_SIM_WORLD_H
#define HIL_SIM_WORLD_H

#include <stdbool.h>
#include <stdint.h>

#include "hil_sim/drv8871.h"
#include "hil_sim/pca9685.h"
#include "hil_sim/real.h"
#include "hil_sim/world_gen.h"

enum {
    HIL_MAX_WHEELS = 4,
    HIL_MAX_FAULTS = 16,
    HIL_MAX_PATCHES = 8, /**< of the floor, with another friction */
    HIL_MAX_FIXES = 64,  /**< pose fixes in transit */
    HIL_MAX_FLOWS = 32,  /**< floor odometry readings in transit */
    HIL_MAX_I2C = 128,   /**< bytes of the transactions of a tick */
    HIL_MAX_I2C_READ = 8
};

/** Result codes. HIL_ERR_CONFIG: invalid configuration; the text names the field. */
typedef enum hil_result_t {
    HIL_OK = 0,
    HIL_ERR_CONFIG,
    HIL_ERR_LINK,     /**< the link broke or was closed */
    HIL_ERR_TIMEOUT,  /**< the robot did not answer in time */
    HIL_ERR_PROTOCOL, /**< unexpected answer from the robot */
    HIL_ERR_OUTSIDE   /**< the robot is not in hardware-in-the-loop */
} hil_result_t;

/** What drives the wheels. */
typedef enum hil_source_t {
    HIL_SOURCE_BRIDGES = 0, /**< battery, bridges, motors */
    HIL_SOURCE_SPEED,       /**< imposed wheel speeds */
    HIL_SOURCE_VOLTAGE,     /**< ideal voltage sources at the windings */
    HIL_SOURCE_TORQUE       /**< torques at the wheels in place of the motors' K i */
} hil_source_t;

/** Value of HIL_FAULT_I2C_STUCK that holds SCL. */
enum { HIL_STUCK_SCL = 1 };

typedef struct hil_fault_t {
    uint8_t kind; /**< hil_fault_kind_t */
    uint8_t wheel;
    double start_s;
    double stop_s; /**< exclusive */
    double value;
} hil_fault_t;

/** A part of the floor with another friction: a rectangle along the world's axes, or a circle. */
typedef struct hil_patch_t {
    double x_m[2]; /**< from, to; a circle's middle is the first of each */
    double y_m[2];
    double radius_m; /**< 0: a rectangle */
    double friction; /**< factor on the friction coefficient, 0.001..10 */
} hil_patch_t;

/** Configuration of a world; numbers are generated from shared/world.toml (unit, range, meaning). */
typedef struct hil_world_config_t {
    uint32_t wheels; /**< 3 or 4 */
    uint32_t plant;  /**< hil_plant_kind_t */
    uint32_t driver; /**< motor driver: hil_driver_t */
#include "hil_sim/world_members_gen.h"
    hil_seed_t seed;
    uint32_t fault_count;
    hil_fault_t fault[HIL_MAX_FAULTS];
    uint32_t patch_count;               /**< plant full only */
    hil_patch_t patch[HIL_MAX_PATCHES]; /**< in overlaps the later one applies */
} hil_world_config_t;

typedef struct hil_fix_t {
    uint64_t taken_us; /**< time of measurement */
    uint64_t arrives_us;
    hil_real_t pose[3]; /**< x, y, theta wrapped to -pi..pi */
    hil_flag_t dropped; /**< lost: it only occupies a place in the queue */
} hil_fix_t;

/** Sensor readings at one tick; readings are generated from [sensors] of shared/world.toml. */
typedef struct hil_sensors_t {
    uint64_t time_us;
#include "hil_sim/sensor_members_gen.h"
    uint8_t i2c_status; /**< bit 0: not acknowledged, bit 1: bus stuck (of the last tick's transactions) */
    uint8_t i2c_read_length;
    uint8_t i2c_read[HIL_MAX_I2C_READ];
    bool has_fix; /**< a pose fix arrives with this tick */
    hil_fix_t fix;
    bool stop_button; /**< its contact is open */
    bool link_silent; /**< the ground station's messages are lost now */
} hil_sensors_t;

/** A symmetric positive definite 3 x 3 matrix as L D L'. */
typedef struct hil_spd3_t {
    hil_real_t inv_d[3];
    hil_real_t l10, l20, l21;
} hil_spd3_t;

/** Constants of the motion. Entries of wheels that the robot doesn't have are zero. */
typedef struct hil_plant_t {
    hil_real_t radius_m[HIL_MAX_WHEELS];
    hil_real_t along_x[HIL_MAX_WHEELS]; /**< t_i in the body frame */
    hil_real_t along_y[HIL_MAX_WHEELS];
    hil_real_t arm_m[HIL_MAX_WHEELS]; /**< p_i x t_i */
    hil_real_t drag_xx;               /**< roller drag, sum over the wheels [N s/m] */
    hil_real_t drag_xy;
    hil_real_t drag_yy;
    hil_real_t stiffness_N_s_m;
    hil_real_t inverse_limit_N[HIL_MAX_WHEELS]; /**< 1 / (mu N), N: the wheel's load */
    hil_real_t friction[HIL_MAX_WHEELS];        /**< mu of each wheel, without patches */
    hil_real_t dry_drag[HIL_MAX_WHEELS];        /**< dry drag across each wheel over its load */
    hil_real_t inverse_mass;
    hil_real_t inverse_inertia;
    hil_real_t inverse_motor_inertia;
    hil_real_t inverse_inductance;
    hil_real_t viscous_N_m_s; /**< of a wheel */
    hil_real_t coulomb_N_m;
    hil_real_t battery_resistance_ohm;
    hil_spd3_t rolling;           /**< sum over the wheels of the square of (along_x, along_y, arm) */
    hil_real_t linear_viscous[3]; /**< plant `linear`: along body x, y, about z */
    hil_real_t linear_coulomb[3];
    hil_real_t coulomb_width[3];             /**< speed [m/s, m/s, rad/s] below which Coulomb friction fades */
    bool uneven;                             /**< floor.c changes arms, radii and limits with each tick */
    hil_real_t roller_phase[HIL_MAX_WHEELS]; /**< where on the rollers a wheel stands at angle 0 [rollers] */
    hil_real_t inverse_tilt_inertia;         /**< of the body about x and y, 1 / (kg m^2) */
    bool limits;                             /**< bridges, motors or supply have some: bridge_limits.c */
    bool play;                               /**< gears have play: backlash.c */
    hil_real_t inverse_wheel_inertia;        /**< 1 / (kg m^2) of a wheel whose motor turns freely */
    hil_real_t inverse_rotor_inertia;        /**< of motor and gear without the wheel */
    hil_real_t weight_N;                     /**< of the robot, across the floor */
    hil_real_t downhill_N;                   /**< the same along it */
} hil_plant_t;

/** Floor odometry reading in transit. */
typedef struct hil_flow_t {
    uint64_t arrives_us;
    hil_real_t moved[3]; /**< x, y [m], turn [rad] */
    hil_flag_t dropped;  /**< marked as invalid */
} hil_flow_t;

typedef struct hil_world_t {
    hil_world_config_t config;
    hil_plant_t plant;
    uint64_t time_us;
    uint64_t steps;
    uint32_t active_faults; /**< bit per hil_fault_kind_t, of now */
    hil_real_t pose[3];     /**< truth; theta not wrapped */
    hil_real_t twist[3];    /**< truth, world frame */
    hil_real_t wheel_angle_rad[HIL_MAX_WHEELS];
    hil_real_t wheel_rad_s[HIL_MAX_WHEELS];
    hil_real_t motor_rad_s[HIL_MAX_WHEELS]; /**< with play: of motor and gear, referred to the wheel */
    hil_real_t gap_rad[HIL_MAX_WHEELS];     /**< with play: how far the motor is ahead of its wheel */
    hil_real_t mesh[HIL_MAX_WHEELS];        /**< with play: 1 or -1, the side on which the motor pushes; 0: none */
    hil_real_t current_A[HIL_MAX_WHEELS];
    hil_real_t voltage_V[HIL_MAX_WHEELS];      /**< mean bridge voltage, wheel direction; 0 while the winding is open */
    hil_real_t bridge_rest_s[HIL_MAX_WHEELS];  /**< overcurrent: remaining time open */
    hil_real_t bridge_off[HIL_MAX_WHEELS];     /**< 1: too hot to drive */
    hil_real_t bridge_trips[HIL_MAX_WHEELS];   /**< times that it has opened by itself */
    hil_real_t bridge_K[HIL_MAX_WHEELS];       /**< temperature rise over ambient */
    hil_real_t winding_K[HIL_MAX_WHEELS];      /**< temperature rise of the motor's winding */
    hil_real_t source_V;                       /**< open-circuit voltage of a current-limited supply */
    hil_real_t slip_ratio[HIL_MAX_WHEELS];     /**< imposed */
    hil_real_t slip_speed_m_s[HIL_MAX_WHEELS]; /**< imposed, in the current step */
    hil_real_t traction_N[HIL_MAX_WHEELS];     /**< 0 on plants without a contact */
    hil_real_t load_N[HIL_MAX_WHEELS];         /**< of the floor on each wheel, across the floor; 0: it has lifted */
    hil_real_t rise[3];                        /**< displacement from rest: up [m], about body x and y [rad] */
    hil_real_t rise_rate[3];                   /**< of that [m/s, rad/s] */
    hil_real_t floor_N[2];                     /**< body frame: slope and dry drag of the rollers */
    hil_real_t supply_V;                       /**< under load */
    hil_real_t in1[HIL_MAX_WHEELS];            /**< duty cycle of IN1 */
    hil_real_t in2[HIL_MAX_WHEELS];
    hil_drv8871_t bridge[HIL_MAX_WHEELS];
    uint32_t source;                          /**< hil_source_t */
    hil_real_t driven[HIL_MAX_WHEELS];        /**< value imposed by the source [rad/s, V or N m] */
    hil_real_t encoder_edges[HIL_MAX_WHEELS]; /**< edges the disc has passed, a whole number */
    hil_int_t counts[HIL_MAX_WHEELS];         /**< encoder counter, wraps */
    uint64_t slip_knot;                       /**< index of the last draw */
    hil_real_t slip_before[HIL_MAX_WHEELS];
    hil_real_t slip_after[HIL_MAX_WHEELS];
    uint64_t slip_speed_knot;
    hil_pca9685_t chip;
    bool stranger_addressed;               /**< config.i2c_stranger is being written to */
    bool direct;                           /**< the bridges follow hil_world_bridge instead of the chip */
    hil_real_t direct_in1[HIL_MAX_WHEELS]; /**< duty cycle set by it, as far as transmitted by the bus */
    hil_real_t direct_in2[HIL_MAX_WHEELS];
    hil_real_t direct_phase1[HIL_MAX_WHEELS]; /**< where in the period they rise, 0..1 */
    hil_real_t direct_phase2[HIL_MAX_WHEELS];
    uint8_t i2c_status;
    uint8_t i2c_read_length;
    uint8_t i2c_read[HIL_MAX_I2C_READ];
    uint64_t fixes_taken;
    hil_real_t frozen_pose[3]; /**< of the last fix before the pose sensor froze */
    hil_real_t gyro_bias[3];   /**< of each axis of its chip [rad/s] */
    hil_real_t gyro_warmth_K;  /**< temperature rise of its chip since the start */
    hil_real_t gyro_rate[3];   /**< true rates about its chip's axes [rad/s], the upright one last */
    hil_real_t gyro_late[3];   /**< rates after its chip's filter */
    uint64_t gyro_late_us;     /**< time of both */
    hil_real_t gyro_rad_s[3];  /**< latest sample */
    uint64_t gyro_samples;     /**< taken so far */
    uint64_t gyro_bias_step;   /**< number of the bias's last draw */
    bool gyro_new;             /**< the latest sample is of this tick */
    hil_real_t flow_pose[3];   /**< body pose at the last update of `flow_sum` */
    hil_real_t flow_sum[3];    /**< displacement in the sensor's axes and turn since the last reading */
    hil_real_t flow_read[3];   /**< its counters at the last reading */
    uint64_t flow_samples;     /**< taken so far */
    uint32_t flow_head;
    uint32_t flow_count;
    hil_flow_t flow[HIL_MAX_FLOWS];
    uint32_t fix_head;
    uint32_t fix_count;
    hil_fix_t fix[HIL_MAX_FIXES];
} hil_world_t;

/** Validate the configuration and initialise. @param why out, text of at most `why_size` bytes naming the invalid
 * field. */
hil_result_t hil_world_init(hil_world_t *world, const hil_world_config_t *config, char *why, uint32_t why_size);

/** Read the sensors at world->time_us. At most one due pose fix per call; each is returned once. */
void hil_world_sense(hil_world_t *world, hil_sensors_t *sensors);

/** Read the encoder counts only, as in hil_world_sense(). */
void hil_world_counts(const hil_world_t *world, hil_int_t *counts);

/**
 * Apply one tick's I2C transactions, coded as in OMNI_HIL_ACTUATORS (address, count written, bytes, count to read), all
 * or none.
 * @return HIL_ERR_PROTOCOL if the bytes do not parse; the bridges then keep what they have.
 */
hil_result_t hil_world_i2c(hil_world_t *world, const uint8_t *bytes, uint32_t length);

/**
 * Byte-level interface to the I2C bus: START or repeated START with an address, bytes, STOP. The bridges are updated on
 * STOP. Bus faults suppress the acknowledge; a caller with real lines must hold them low itself.
 * @param address 7 bit. @return true if the byte is acknowledged; hil_world_i2c_get: the byte.
 */
bool hil_world_i2c_start(hil_world_t *world, uint8_t address, bool read);
bool hil_world_i2c_put(hil_world_t *world, uint8_t byte);
uint8_t hil_world_i2c_get(hil_world_t *world);
void hil_world_i2c_stop(hil_world_t *world);

/**
 * Set the bridge inputs directly, in PWM steps 0..4096 per wheel, instead of through the chip (in-process runs). They
 * switch at the chip's 1526 Hz or at motor_pwm_Hz. I2C faults act as on the chip, if there is one: the bridges keep
 * what they have and the next i2c_status says so. Drivers on the processor's
 * pins are simulated by hil_world_motor_pins(). Both 0: off, bridges as with their pins low.
 */
void hil_world_bridge(hil_world_t *world, const hil_steps_t *in1_steps, const hil_steps_t *in2_steps);

/**
 * Set the processor's motor pins. @param steps high time of the first and second pin of each wheel, 0..4096 steps of a
 * period of 1 / motor_pwm_Hz; 2 * HIL_MAX_WHEELS entries. Both pins of a wheel rise together. The bridge's
 * truth table is in `motor_drivers` of shared/params.toml. No effect for motors on the PWM chip.
 */
void hil_world_motor_pins(hil_world_t *world, const uint16_t *steps);

/** Level from which the chip takes OE for high: V_IH = 0.7 VDD at 3.3 V (NXP PCA9685, static characteristics). */
#define HIL_OE_HIGH_V 2.31

/** State of the output-enable pin, as in OMNI_HIL_ACTUATORS. */
typedef enum hil_output_enable_t {
    HIL_OE_OFF = 0,
    HIL_OE_ON = 1,
    HIL_OE_RELEASED = 2 /**< high impedance, as in reset: level output_enable_rest_V */
} hil_output_enable_t;

/**
 * Set the output-enable pin. Off: all bridge inputs are low and the motors coast, independently of the bus. Released
 * after hil_world_init. Of no effect on a robot whose pin is not wired. @param drive hil_output_enable_t; other values
 * count as on.
 */
void hil_world_output_enable(hil_world_t *world, uint8_t drive);

/**
 * For studies: impose wheel speeds [rad/s] in place of bridges and motors until the bridges are set again.
 * @return HIL_ERR_CONFIG, nothing changed, if one is not finite or the plant is not kinematic.
 */
hil_result_t hil_world_drive_speed(hil_world_t *world, const double *wheel_rad_s);

/** For studies: ideal voltage sources [V] at the windings, positive: counter-clockwise; no battery, no limit. All
 * plants. */
hil_result_t hil_world_drive_voltage(hil_world_t *world, const double *volts);

/** For studies: impose torques [N m] at the wheels in place of the motors' K i. Plants full, slip and linear. */
hil_result_t hil_world_drive_torque(hil_world_t *world, const double *torque_N_m);

/** Advance by one tick, in substeps of at most 0.25 ms. @param step_us e.g. 1000. */
void hil_world_step(hil_world_t *world, uint32_t step_us);

/** Kinetic energy of body and wheels [J], for the energy tests. */
double hil_world_kinetic_energy(const hil_world_t *world);

/** Time from this tick to the next one: OMNI_TICK_US unless a fault makes ticks late. @param usual_us e.g. 1000. */
uint32_t hil_world_tick_us(const hil_world_t *world, uint32_t usual_us);

/** Is a fault of this kind active for this wheel (or any wheel, wheel >= HIL_MAX_WHEELS)? */
bool hil_world_fault_active(const hil_world_t *world, uint8_t kind, uint32_t wheel);

/**
 * Displacement of the floor odometry sensor since `pose`, in the sensor's axes at mid-interval.
 * @param pose in and out: x, y [m], heading [rad]; set to the current pose. @param way out: x, y [m], turn [rad].
 */
void hil_world_flow_way(const hil_world_t *world, hil_real_t *pose, hil_real_t *way);

/** Value of an active fault of this kind; 0 if there is none. */
double hil_world_fault_value(const hil_world_t *world, uint8_t kind);

#endif
