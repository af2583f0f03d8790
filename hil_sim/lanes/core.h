/* SPDX-License-Identifier: MIT */
/**
 * @file core.h
 * omni_robot_tick for eight runs at once, for each CPU level that this was built for. Structs in lanes are opaque here:
 * memory aligned to HIL_LANES_ALIGNMENT, as many bytes as said, filled by hil_lanes_pack.
 */
#ifndef HIL_LANES_CORE_H
#define HIL_LANES_CORE_H

#include "pack.h"
#include "plans.h"

#ifdef __cplusplus
extern "C" {
#endif

enum { HIL_LANES_ALIGNMENT = 64 };

typedef struct hil_lanes_core_t {
    size_t robot_bytes;
    size_t config_bytes;
    size_t inputs_bytes;
    size_t outputs_bytes;
    hil_layout_t robot;   /**< omni_robot_t */
    hil_layout_t config;  /**< omni_robot_config_t */
    hil_layout_t inputs;  /**< omni_inputs_t */
    hil_layout_t outputs; /**< omni_outputs_t */
    /** One tick of all eight. Whatever it computed is worthless if hil_lanes_take_diverged (divergence.h) says so
     * afterwards. */
    void (*tick)(void *robot, const void *inputs, void *outputs);
    /** Set a packed robot's pointers: configuration in lanes, plans being followed or NULL. */
    void (*connect)(void *robot, const void *config, hil_lanes_plans_t *plans);
    /** Plans that a robot follows now, or NULL. */
    const hil_lanes_plans_t *(*plans_of)(const void *robot);
    /** Set the pointer of packed inputs: plans for OMNI_EVENT_TRAJECTORY_START, or NULL. */
    void (*offer)(void *inputs, hil_lanes_plans_t *plans);
} hil_lanes_core_t;

extern const hil_lanes_core_t hil_lanes_core_baseline;
#ifdef __x86_64__
extern const hil_lanes_core_t hil_lanes_core_avx2;
extern const hil_lanes_core_t hil_lanes_core_avx512_eight;
#endif

#ifdef __cplusplus
}
#endif

#endif
