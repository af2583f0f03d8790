/* SPDX-License-Identifier: MIT */
/**
 * @file timeline.h
 * Event scheduler of a scenario: when its events are applied and when its run ends. Shared by runs in this process
 * (player.h) and over a link (timeline.py). The timeline returns the next step; its caller executes it, closes the loop
 * and calls again.
 *
 * A run is divided into segments: to the next event, to the end, or to the next multiple of HIL_UPDATE_TICKS. After
 * each segment the timeline is updated with the run's milestones: path started, path completed, robot stopped. So an
 * event at a fraction of the path is applied at the earliest at the first update after the path has started.
 */
#ifndef HIL_SIM_TIMELINE_H
#define HIL_SIM_TIMELINE_H

#include "hil_sim/milestones.h"
#include "hil_sim/real.h"
#include "omni/types.h"

enum {
    HIL_UPDATE_TICKS = 200,
    HIL_AFTER_TICKS = 500,    /**< duration of a run after its path's end or the robot's own stop [ticks] */
    HIL_DISARMED_TICKS = 100, /**< duration of a run after the final disarm [ticks] */
    HIL_START_TICKS = 2000,   /**< a robot not armed this long after the last timed event will not start */
    HIL_MAX_TICKS = 3600000
};

/** Action of an event. */
typedef enum hil_action_t {
    HIL_ACTION_SET = 0,  /**< change parameters */
    HIL_ACTION_VELOCITY, /**< body twist setpoint: value = m/s, m/s, rad/s */
    HIL_ACTION_DUTY,     /**< duty setpoint: value per wheel */
    HIL_ACTION_ARM,
    HIL_ACTION_DISARM,
    HIL_ACTION_ESTOP,
    HIL_ACTION_TRAJECTORY_START,
    HIL_ACTION_TRAJECTORY_STOP,
    HIL_ACTION_COUNT
} hil_action_t;

/** Event, applied to the robot before a tick. */
typedef struct hil_event_t {
    uint32_t action;        /**< hil_action_t */
    uint32_t first_setting; /**< of the scenario's settings, for HIL_ACTION_SET */
    uint32_t setting_count;
    bool on_path;  /**< timed by `share`; otherwise by `tick` */
    uint64_t tick; /**< ticks before it */
    double share;  /**< of the path, 0..1 */
    omni_real_t value[OMNI_MAX_WHEELS];
} hil_event_t;

/** An event and its times. */
typedef struct hil_moment_t {
    uint32_t event;
    uint64_t due_tick;
    uint64_t applied_tick; /**< when it was applied: over a link, the acknowledgement takes a tick or more */
} hil_moment_t;

/** Next step. */
typedef enum hil_step_kind_t {
    HIL_STEP_RUN = 0, /**< run `ticks` ticks, then show the milestones to hil_timeline_update() */
    HIL_STEP_PLACE,   /**< set the robot's initial pose */
    HIL_STEP_APPLY,   /**< apply `event` */
    HIL_STEP_LOCATE,  /**< give hil_timeline_set_offset() the ticks from the path's start to the share of `event` */
    HIL_STEP_DISARM,  /**< disarm: the run is ending */
    HIL_STEP_OVER     /**< nothing: the run is over */
} hil_step_kind_t;

typedef struct hil_step_t {
    uint32_t kind;  /**< hil_step_kind_t */
    uint32_t event; /**< index */
    uint64_t ticks;
} hil_step_t;

/** State of a scenario's events during a run. */
typedef struct hil_timeline_t {
    const hil_event_t *events;
    uint32_t event_count;
    uint32_t located;      /**< events up to here have their ticks, if the path's start is known */
    hil_moment_t *moments; /**< the first `applied` have been applied, those up to `known` are due at their ticks */
    uint32_t applied;
    uint32_t known;
    uint64_t end_tick;    /**< UINT64_MAX: when the path is done or the robot stops by itself */
    uint64_t start_limit; /**< tick */
    uint64_t path_start;  /**< ticks as of the last look; UINT64_MAX: not yet */
    uint64_t done;
    uint64_t stopped;
    bool was_armed;
    bool applying; /**< events are being applied that were due before the end was looked at */
    uint8_t stage; /**< own */
    uint8_t last;  /**< hil_step_kind_t of the last step */
} hil_timeline_t;

/**
 * Begin. @param events `event_count` of them, and @param moments room for as many: both stay the caller's.
 * @param end_tick UINT64_MAX: when the path is done or the robot stops by itself.
 */
void hil_timeline_init(hil_timeline_t *timeline, const hil_event_t *events, uint32_t event_count, uint64_t end_tick,
                       hil_moment_t *moments);

/** Get the next step, after the last one was executed. @param now ticks run so far. */
hil_step_t hil_timeline_next(hil_timeline_t *timeline, uint64_t now);

/** Set the time of HIL_STEP_LOCATE's event, in ticks after the path's start. */
void hil_timeline_set_offset(hil_timeline_t *timeline, uint64_t ticks);

/** Update the state after the ticks of HIL_STEP_RUN. */
void hil_timeline_update(hil_timeline_t *timeline, const hil_milestones_t *milestones);

/** Expected last tick of the run; UINT64_MAX: not known yet. @param path_ticks of the whole path; UINT64_MAX:
 * without end. */
uint64_t hil_timeline_expected_end(const hil_timeline_t *timeline, uint64_t path_ticks);

#endif
