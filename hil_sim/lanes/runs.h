/* SPDX-License-Identifier: MIT */
/** @file runs.h  Eight whole runs in lanes, for each CPU level that this was built for. */
#ifndef HIL_LANES_RUNS_H
#define HIL_LANES_RUNS_H

#include "core.h"

#ifdef __cplusplus
extern "C" {
#endif

/** Eight runs, packed: memory for the structs of this name, as hil_lanes_runs_t and hil_lanes_core_t say. */
typedef struct hil_lanes_group_t {
    void *world;
    void *metrics;
    void *robot;
    void *inputs;
    void *outputs;
} hil_lanes_group_t;

typedef struct hil_lanes_runs_t {
    const hil_lanes_core_t *core;
    size_t world_bytes;
    size_t metrics_bytes;
    hil_layout_t world;
    hil_layout_t metrics;
    /** As hil_run_advance. @return ticks before the lanes parted; if that is less than asked for, the group is
     * worthless. */
    uint64_t (*advance)(const hil_lanes_group_t *group, uint64_t ticks);
} hil_lanes_runs_t;

extern const hil_lanes_runs_t hil_lanes_runs_baseline;
#ifdef __x86_64__
extern const hil_lanes_runs_t hil_lanes_runs_avx2;
extern const hil_lanes_runs_t hil_lanes_runs_avx512_eight;
#endif

#ifdef __cplusplus
}
#endif

#endif
