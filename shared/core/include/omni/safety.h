/* SPDX-License-Identifier: MIT */
/**
 * @file safety.h
 * The safety state machine: one constant table, state x event -> state. Motors may move in OMNI_STATE_ARMED only.
 *
 *   INIT -> DISARMED -> ARMED -> FAILSAFE (stop fault) -> DISARMED (disarm)
 *
 * ESTOP is latched: whatever the state was, an emergency stop leads to it, and only a clear leads out, to DISARMED.
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
    OMNI_SAFETY_ARM,       /**< asked for; the caller has checked that no stop fault is present */
    OMNI_SAFETY_DISARM,
    OMNI_SAFETY_FAULT, /**< a stop fault is present */
    OMNI_SAFETY_ESTOP,
    OMNI_SAFETY_ESTOP_CLEAR,
    OMNI_SAFETY_EVENT_COUNT
} omni_safety_event_t;

/** Faults, one bit each. Stop faults stop an armed robot and refuse arming; warnings only show. */
typedef enum omni_fault_t {
    OMNI_FAULT_NOT_FINITE = 1 << 0,   /**< a NaN or infinity reached the tick or came out of it */
    OMNI_FAULT_TIME = 1 << 1,         /**< time stood still, went back or jumped ahead */
    OMNI_FAULT_ENCODER = 1 << 2,      /**< impossible count increment or a dead encoder */
    OMNI_FAULT_STALL = 1 << 3,        /**< voltage, but the wheel does not turn or turns the wrong way */
    OMNI_FAULT_COMMAND_LOSS = 1 << 4, /**< set-points stopped coming */
    OMNI_FAULT_LINK_LOSS = 1 << 5,    /**< heartbeats stopped coming */
    OMNI_FAULT_BATTERY = 1 << 6,      /**< supply below BAT_V_MIN */
    OMNI_FAULT_DRIVER = 1 << 7,       /**< the PWM chip does not answer */
    OMNI_FAULT_TRACKING = 1 << 8,     /**< pose error beyond SAFE_ERR_* */
    OMNI_FAULT_CONFIG = 1 << 9,       /**< no valid configuration */
    OMNI_FAULT_OVERRUN = 1 << 10,     /**< ticks missed their time (set by the firmware) */
    OMNI_FAULT_POSITION = 1 << 11,    /**< the estimated pose is beyond LIM_POS */
    OMNI_FAULT_MOTOR_HEAT = 1 << 12,  /**< a motor had more than SAFE_I for too long */
    OMNI_FAULT_OVERSPEED = 1 << 13,   /**< a wheel turns faster than it is asked to */
    OMNI_WARN_POSE_STALE = 1 << 16,   /**< no pose fix for FIX_TIMEOUT although fixes had come */
    OMNI_WARN_FIX_REFUSED = 1 << 17,  /**< the latest pose fix was refused */
    OMNI_WARN_SETPOINT = 1 << 18,     /**< the latest set-point was refused */
    OMNI_WARN_SATURATED = 1 << 19,    /**< wheel speeds or duties are being cut */
    OMNI_WARN_ENCODER = 1 << 20,      /**< a single impossible count was thrown away */
    OMNI_WARN_ISMC_GAIN = 1 << 21,    /**< k of the ISMC does not cover the slip that may be there (condition 44) */
    OMNI_WARN_GYRO = 1 << 22,         /**< the gyro's readings are missing, cannot be true, or contradict the wheels */
    OMNI_WARN_MOTOR_WARM = 1 << 23,   /**< a motor's heat is beyond OMNI_WARM_SHARE of what stops it */
    OMNI_WARN_FLOW = 1 << 24,         /**< readings of the motion over the floor are missing, cannot be true, or do not
                                           fit the wheels */
    OMNI_FAULT_STOP_MASK = 0x3fff,
    OMNI_WARN_MASK = 0x1ff0000
} omni_fault_t;

/** The next state. An event or state out of range gives OMNI_STATE_ESTOP. */
omni_safety_state_t omni_safety_next(omni_safety_state_t state, omni_safety_event_t event);

/** Short lower-case name of a state ("armed"), or of a single fault bit ("encoder"); "?" if there is none. */
const char *omni_safety_state_name(omni_safety_state_t state);
const char *omni_fault_name(uint32_t single_bit);

#endif
