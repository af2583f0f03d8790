/* SPDX-License-Identifier: MIT */
/**
 * @file timeline.h
 * A scenario as C needs it, and how it is played on a run in this process. timeline.py does the same over a link, look by look and tick
 * by tick; a test holds the two together.
 *
 * A run is cut into pieces: to the next event, to the end, or to the next multiple of HIL_LOOK_TICKS. After each piece the timeline looks
 * at what the run has measured: whether the robot is on its path, done, or has stopped. Only then it finds out: an event at a share
 * of the path is never applied before the first look that sees the path.
 */
#ifndef HIL_SIM_TIMELINE_H
#define HIL_SIM_TIMELINE_H

#include "hil_sim/dispersion.h"
#include "hil_sim/run.h"

enum {
    HIL_LOOK_TICKS = 200,
    HIL_AFTER_TICKS = 500,    /**< a run goes on for this long after its path's end or the robot's own stop */
    HIL_DISARMED_TICKS = 100, /**< and for this long after the final disarm */
    HIL_START_TICKS = 2000,   /**< a robot not armed this long after the last timed event will not start */
    HIL_MAX_TICKS = 3600000,
    HIL_WHY_SIZE = 160
};

/** What an event does. */
typedef enum hil_action_t {
    HIL_ACTION_SET = 0,  /**< change parameters */
    HIL_ACTION_VELOCITY, /**< ask for a body twist: value = m/s, m/s, rad/s */
    HIL_ACTION_DUTY,     /**< ask for duties: value per wheel */
    HIL_ACTION_ARM,
    HIL_ACTION_DISARM,
    HIL_ACTION_ESTOP,
    HIL_ACTION_TRAJECTORY_START,
    HIL_ACTION_TRAJECTORY_STOP,
    HIL_ACTION_COUNT
} hil_action_t;

/** A parameter by its index, and its new value. */
typedef struct hil_setting_t {
    uint32_t parameter;
    omni_real_t value;
} hil_setting_t;

/** Something that is done to the robot before a tick. */
typedef struct hil_event_t {
    uint32_t action;        /**< hil_action_t */
    uint32_t first_setting; /**< of the scenario's settings, for HIL_ACTION_SET */
    uint32_t setting_count;
    bool on_path;  /**< `share` says when; otherwise `tick` */
    uint64_t tick; /**< ticks before it */
    double share;  /**< of the path, 0..1 */
    omni_real_t value[OMNI_MAX_WHEELS];
} hil_event_t;

/** Everything but the seed. Must stay valid and constant while runs use it; they may do so in several threads. */
typedef struct hil_scenario_t {
    const hil_world_config_t *world;  /**< its seed does not count */
    const omni_real_t *values;        /**< OMNI_PARAM_COUNT parameters that runs start with ... */
    const omni_robot_config_t *robot; /**< ... and what omni_robot_config made of them */
    const hil_event_t *events;
    uint32_t event_count;
    const hil_setting_t *settings; /**< of all events */
    const hil_dispersion_t *dispersion;
    uint32_t dispersion_count;
    uint64_t end_tick; /**< UINT64_MAX: when the path is done or the robot stops by itself */
} hil_scenario_t;

/** How a run came out. */
typedef enum hil_run_status_t {
    HIL_RUN_OK = 0,     /**< played to its end */
    HIL_RUN_WORLD,      /**< the world is refused; `why` says which field */
    HIL_RUN_ARMING,     /**< the robot refuses to arm: `detail` = its faults */
    HIL_RUN_PARAMETERS, /**< the core refuses a change of parameters: `detail` = index, -1: the combination */
    HIL_RUN_TRAJECTORY, /**< the trajectory cannot be planned */
    HIL_RUN_ENDLESS,    /**< an event at a share of a path without end */
    HIL_RUN_STATUS_COUNT
} hil_run_status_t;

/** An event and its times. */
typedef struct hil_moment_t {
    uint32_t event;
    uint64_t due_tick;
    uint64_t applied_tick;
} hil_moment_t;

/** The bare path of a configuration, planned from its own start; kept from run to run because planning takes a while. */
typedef struct hil_path_t {
    bool known;
    omni_trajectory_config_t config;
    omni_kinematics_t kinematics;
    omni_trajectory_t plan;
} hil_path_t;

typedef enum hil_stage_t { HIL_STAGE_PLACE = 0, HIL_STAGE_PLAY, HIL_STAGE_DISARMED, HIL_STAGE_OVER } hil_stage_t;

/** A scenario on its way through a run. */
typedef struct hil_timeline_t {
    const hil_scenario_t *scenario;
    hil_run_t *run;
    hil_path_t *path;
    hil_moment_t *moments; /**< the first `applied` have been applied, those up to `known` are due at their ticks */
    uint32_t applied;
    uint32_t known;
    bool path_resolved;   /**< events at shares of the path have their ticks */
    uint8_t stage;        /**< hil_stage_t */
    uint16_t sequence;    /**< of the last configuration */
    uint64_t start_limit; /**< tick */
    uint64_t path_start;  /**< ticks as of the last look; UINT64_MAX: not yet */
    uint64_t done;
    uint64_t stopped;
    bool was_armed;
    uint32_t status; /**< hil_run_status_t */
    int32_t detail;
    omni_real_t values[OMNI_PARAM_COUNT];
    char why[HIL_WHY_SIZE];
} hil_timeline_t;

/**
 * Begin. A run that cannot is over at once; its status says why.
 * @param moments room for the scenario's event_count. @param path one per thread, zero at first.
 */
void hil_timeline_init(hil_timeline_t *timeline, const hil_scenario_t *scenario, uint64_t seed, hil_run_t *run,
                       hil_moment_t *moments, hil_path_t *path);

/** Do what is due. @return ticks that the run is to be advanced by before hil_timeline_look; 0: the run is over. */
uint64_t hil_timeline_due(hil_timeline_t *timeline);

/** Look at what these ticks brought. */
void hil_timeline_look(hil_timeline_t *timeline);

/** Play on for `ticks` ticks, and to the next look after them. @return false: the run is over. */
bool hil_timeline_play(hil_timeline_t *timeline, uint64_t ticks);

/** Tick at which the run will probably end; UINT64_MAX: not known yet. */
uint64_t hil_timeline_expected_end(const hil_timeline_t *timeline);

/** Ticks from the path's start until `share` of it is driven, lead-in left out. @return UINT64_MAX: the path has no end. */
uint64_t hil_path_ticks(hil_path_t *path, const omni_robot_config_t *config, double share);

#endif
