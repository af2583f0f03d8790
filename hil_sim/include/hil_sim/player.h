/* SPDX-License-Identifier: MIT */
/**
 * @file player.h
 * Plays a scenario on an in-process run: applies the events of its timeline to robot and world.
 */
#ifndef HIL_SIM_PLAYER_H
#define HIL_SIM_PLAYER_H

#include "hil_sim/dispersion.h"
#include "hil_sim/run.h"
#include "hil_sim/timeline.h"

enum { HIL_WHY_SIZE = 160 };

/** A parameter by its index, and its new value. */
typedef struct hil_setting_t {
    uint32_t parameter;
    omni_real_t value;
} hil_setting_t;

/** Scenario without the seed. Must be valid and constant while runs use it, possibly in several threads. */
typedef struct hil_scenario_t {
    const hil_world_config_t *world;  /**< its seed is ignored */
    const omni_real_t *values;        /**< OMNI_PARAM_COUNT parameters that runs start with ... */
    const omni_robot_config_t *robot; /**< ... and what omni_robot_config made of them */
    const hil_event_t *events;
    uint32_t event_count;
    const hil_setting_t *settings; /**< of all events */
    const hil_dispersion_t *dispersion;
    uint32_t dispersion_count;
    uint64_t end_tick; /**< UINT64_MAX: when the path is done or the robot stops by itself */
} hil_scenario_t;

/** Result of a run. */
typedef enum hil_run_status_t {
    HIL_RUN_OK = 0,     /**< played to its end */
    HIL_RUN_WORLD,      /**< invalid world; `why` names the field */
    HIL_RUN_ARMING,     /**< the robot refuses to arm: `detail` = its faults */
    HIL_RUN_PARAMETERS, /**< the core refuses a change of parameters: `detail` = index, -1: the combination */
    HIL_RUN_TRAJECTORY, /**< the trajectory cannot be planned */
    HIL_RUN_ENDLESS,    /**< an event at a fraction of an endless path */
    HIL_RUN_STATUS_COUNT
} hil_run_status_t;

/** Cached plan of a configuration's path, from its own start; planning is slow. */
typedef struct hil_path_t {
    bool known;
    omni_trajectory_config_t config;
    omni_kinematics_t kinematics;
    omni_trajectory_t plan;
} hil_path_t;

/** A scenario and the run that it is played on. */
typedef struct hil_player_t {
    hil_timeline_t timeline;
    const hil_scenario_t *scenario;
    hil_run_t *run;
    hil_path_t *path;
    uint16_t sequence; /**< of the last configuration */
    uint32_t status;   /**< hil_run_status_t */
    int32_t detail;
    omni_real_t values[OMNI_PARAM_COUNT];
    char why[HIL_WHY_SIZE];
} hil_player_t;

/**
 * Start. A run that cannot start is over at once; see its status.
 * @param moments room for the scenario's event_count. @param path one per thread, zero at first.
 */
void hil_player_init(hil_player_t *player, const hil_scenario_t *scenario, uint64_t seed, hil_run_t *run,
                     hil_moment_t *moments, hil_path_t *path);

/** Apply due events. @return ticks to advance the run by before hil_player_update; 0: the run is over. */
uint64_t hil_player_due(hil_player_t *player);

/** Update the timeline after these ticks. */
void hil_player_update(hil_player_t *player);

/** Play for `ticks` ticks, and to the next update after them. @return false: the run is over. */
bool hil_player_play(hil_player_t *player, uint64_t ticks);

/** Expected last tick of the run; UINT64_MAX: not known yet. */
uint64_t hil_player_expected_end(const hil_player_t *player);

/** Ticks from the path's start until the fraction `share` of it, without the lead-in. @return UINT64_MAX: the path has
 * no end. */
uint64_t hil_path_ticks(hil_path_t *path, const omni_robot_config_t *config, double share);

#endif
