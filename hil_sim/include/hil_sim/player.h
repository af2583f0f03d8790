/* SPDX-License-Identifier: MIT */
/**
 * @file player.h
 * A scenario as C needs it, and how it is played on a run in this process. What its timeline says is done to robot and
 * world.
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

/** The bare path of a configuration, planned from its own start; kept from run to run because planning takes a while.
 */
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
 * Begin. A run that cannot is over at once; its status says why.
 * @param moments room for the scenario's event_count. @param path one per thread, zero at first.
 */
void hil_player_init(hil_player_t *player, const hil_scenario_t *scenario, uint64_t seed, hil_run_t *run,
                     hil_moment_t *moments, hil_path_t *path);

/** Do what is due. @return ticks that the run is to be advanced by before hil_player_look; 0: the run is over. */
uint64_t hil_player_due(hil_player_t *player);

/** Look at what these ticks brought. */
void hil_player_look(hil_player_t *player);

/** Play on for `ticks` ticks, and to the next look after them. @return false: the run is over. */
bool hil_player_play(hil_player_t *player, uint64_t ticks);

/** Tick at which the run will probably end; UINT64_MAX: not known yet. */
uint64_t hil_player_expected_end(const hil_player_t *player);

/** Ticks from the path's start until `share` of it is driven, lead-in left out. @return UINT64_MAX: the path has no
 * end. */
uint64_t hil_path_ticks(hil_path_t *path, const omni_robot_config_t *config, double share);

#endif
