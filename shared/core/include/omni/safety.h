/* SPDX-License-Identifier: MIT */
/**
 * @file safety.h
 * The safety state machine: one constant table, state x event -> state. Motors may move in OMNI_STATE_ARMED only.
 *
 *   INIT -> DISARMED -> ARMED -> FAILSAFE (stop fault) -> DISARMED (disarm)
 *
 * ESTOP is latched: an emergency stop enters it from any state; only a clear leaves it, to DISARMED.
 */
#ifndef OMNI_SAFETY_H
#define OMNI_SAFETY_H

#include "omni/types.h"

typedef enum omni_safety_state_t {
    OMNI_STATE_INIT = 0,
    OMNI_STATE_DISARMED,
    OMNI_STATE_ARMED,
    OMNI_STATE_FAILSAFE, /**< a stop fault while armed: zero duty until disarmed */
    OMNI_STATE_ESTOP,    /**< latched: zero duty until cleared */
    OMNI_STATE_COUNT
} omni_safety_state_t;

typedef enum omni_safety_event_t {
    OMNI_SAFETY_READY = 0, /**< boot checks passed */
    OMNI_SAFETY_ARM,       /**< arm command; the caller has checked that no stop fault is present */
    OMNI_SAFETY_DISARM,
    OMNI_SAFETY_FAULT, /**< a stop fault is present */
    OMNI_SAFETY_ESTOP,
    OMNI_SAFETY_ESTOP_CLEAR,
    OMNI_SAFETY_EVENT_COUNT
} omni_safety_event_t;

/** Faults, one bit each. A stop fault stops an armed robot and prevents arming; a warning is only reported. */
typedef enum omni_fault_t {
    OMNI_FAULT_NOT_FINITE = 1 << 0,   /**< NaN or infinity in an input or a result of the tick */
    OMNI_FAULT_TIME = 1 << 1,         /**< the clock did not advance, went back or jumped ahead */
    OMNI_FAULT_ENCODER = 1 << 2,      /**< impossible count increment or a dead encoder */
    OMNI_FAULT_STALL = 1 << 3,        /**< a wheel under voltage does not turn, or turns backwards */
    OMNI_FAULT_COMMAND_LOSS = 1 << 4, /**< setpoint timeout (SAFE_CMD_TO) */
    OMNI_FAULT_LINK_LOSS = 1 << 5,    /**< heartbeat timeout (SAFE_LINK_TO) */
    OMNI_FAULT_BATTERY = 1 << 6,      /**< supply below BAT_V_MIN */
    OMNI_FAULT_DRIVER = 1 << 7,       /**< the motor driver does not respond (SAFE_I2C_N) */
    OMNI_FAULT_TRACKING = 1 << 8,     /**< pose error beyond SAFE_ERR_* */
    OMNI_FAULT_CONFIG = 1 << 9,       /**< no valid configuration */
    OMNI_FAULT_OVERRUN = 1 << 10,     /**< tick overrun (set by the firmware) */
    OMNI_FAULT_POSITION = 1 << 11,    /**< the estimated pose is beyond LIM_POS */
    OMNI_FAULT_MOTOR_HEAT = 1 << 12,  /**< thermal model of a motor has reached its limit (SAFE_I) */
    OMNI_FAULT_OVERSPEED = 1 << 13,   /**< a wheel turns faster than its reference */
    OMNI_WARN_POSE_STALE = 1 << 16,   /**< no pose fix for FIX_TIMEOUT after fixes had been used */
    OMNI_WARN_FIX_REFUSED = 1 << 17,  /**< the latest pose fix was refused */
    OMNI_WARN_SETPOINT = 1 << 18,     /**< the latest setpoint was refused */
    OMNI_WARN_SATURATED = 1 << 19,    /**< wheel speeds, duties or currents are saturated */
    OMNI_WARN_ENCODER = 1 << 20,      /**< an implausible count was discarded */
    OMNI_WARN_ISMC_GAIN = 1 << 21,    /**< switching gain k is below the slip error bound (condition 44) */
    OMNI_WARN_GYRO = 1 << 22,         /**< gyro readings are missing, implausible, or contradict the wheels */
    OMNI_WARN_MOTOR_WARM = 1 << 23,   /**< heat of a motor is above OMNI_HEAT_WARNING_FRACTION of its limit */
    OMNI_WARN_FLOW = 1 << 24,         /**< floor odometry readings are missing, implausible, or contradict the wheels */
    OMNI_FAULT_STOP_MASK = 0x3fff,
    OMNI_WARN_MASK = 0x1ff0000
} omni_fault_t;

/** Next state of the state machine. An event or state out of range gives OMNI_STATE_ESTOP. */
omni_safety_state_t omni_safety_next(omni_safety_state_t state, omni_safety_event_t event);

/** Short lower-case name of a state ("armed"), or of a single fault bit ("encoder"); "?" if there is none. */
const char *omni_safety_state_name(omni_safety_state_t state);
const char *omni_fault_name(uint32_t single_bit);

#endif
