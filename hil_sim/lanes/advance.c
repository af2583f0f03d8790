/* SPDX-License-Identifier: MIT */
#include "hil_sim/lanes.h"

#include <stdlib.h>
#include <string.h>

#include "divergence.h"
#include "processor.h"

enum {
    STRIDE = 100,     /* ticks from one checkpoint to the next */
    ALONE_MAX = 64,   /* most ticks run by run before lanes are tried again */
    ALONE_UNLIKE = 20 /* least, if runs are not alike: until the next fix makes those alike of which some lost one */
};

typedef struct lanes_t {
    const hil_lanes_runs_t *how;
    hil_lanes_group_t live;
    char *block;
    size_t bytes; /* of the live part of the block, which begins it; its checkpoint follows */
    void *config;
    hil_lanes_plans_t following;
    hil_lanes_plans_t offered;
} lanes_t;

static __thread hil_lanes_stats_t stats_of_thread;
static volatile hil_lanes_level_t level = HIL_LANES_BEST;

void hil_lanes_set_level(hil_lanes_level_t wanted) {
    level = wanted;
}

void hil_lanes_take_stats(hil_lanes_stats_t *stats) {
    *stats = stats_of_thread;
    memset(&stats_of_thread, 0, sizeof stats_of_thread);
}

static size_t aligned(size_t bytes) {
    return (bytes + HIL_LANES_ALIGNMENT - 1) / HIL_LANES_ALIGNMENT * HIL_LANES_ALIGNMENT;
}

static bool open_lanes(lanes_t *lanes) {
    const hil_lanes_runs_t *how = hil_lanes_runs(level);
    const size_t size[5] = {how->world_bytes, how->metrics_bytes, how->core->robot_bytes, how->core->inputs_bytes,
                            how->core->outputs_bytes};
    void **part[5] = {&lanes->live.world, &lanes->live.metrics, &lanes->live.robot, &lanes->live.inputs,
                      &lanes->live.outputs};
    lanes->how = how;
    lanes->bytes = 0;
    for (int i = 0; i < 5; i++) {
        lanes->bytes += aligned(size[i]);
    }
    lanes->block = aligned_alloc(HIL_LANES_ALIGNMENT, 2 * lanes->bytes + aligned(how->core->config_bytes));
    char *next = lanes->block;
    for (int i = 0; i < 5 && next != NULL; i++) {
        *part[i] = next;
        next += aligned(size[i]);
    }
    lanes->config = lanes->block + 2 * lanes->bytes;
    return lanes->block != NULL;
}

/* Addresses of one member of all runs. */
static void collect(hil_run_t *const runs[HIL_LANES], size_t offset, void *each[HIL_LANES]) {
    for (int lane = 0; lane < HIL_LANES; lane++) {
        each[lane] = (char *)runs[lane] + offset;
    }
}

static bool pack_member(const hil_layout_t *layout, hil_run_t *const runs[HIL_LANES], size_t offset, void *to) {
    const void *each[HIL_LANES];
    for (int lane = 0; lane < HIL_LANES; lane++) {
        each[lane] = (const char *)runs[lane] + offset;
    }
    return hil_lanes_pack(layout, each, to);
}

static const omni_trajectory_t *trajectory_of(const hil_run_t *run, bool offered) {
    return offered ? run->inputs.trajectory : run->robot.reference_generator.trajectory;
}

/* Plans that the robots follow, or that their inputs offer. @return false if some have one and some don't. */
static bool pack_plans(hil_lanes_plans_t *plans, hil_run_t *const runs[HIL_LANES], bool offered) {
    const void *each[HIL_LANES];
    const bool none = trajectory_of(runs[0], offered) == NULL;
    for (int lane = 0; lane < HIL_LANES; lane++) {
        each[lane] = trajectory_of(runs[lane], offered);
        if ((each[lane] == NULL) != none) {
            return false;
        }
    }
    if (!none) {
        hil_lanes_plans_set(plans, each);
    }
    return true;
}

static bool pack_config(const lanes_t *lanes, hil_run_t *const runs[HIL_LANES]) {
    const void *each[HIL_LANES];
    for (int lane = 0; lane < HIL_LANES; lane++) {
        each[lane] = runs[lane]->robot.config;
    }
    return hil_lanes_pack(&lanes->how->core->config, each, lanes->config);
}

static bool pack(lanes_t *lanes, hil_run_t *const runs[HIL_LANES]) {
    const hil_lanes_runs_t *how = lanes->how;
    const hil_lanes_core_t *core = how->core;
    const bool packed = pack_config(lanes, runs) && pack_plans(&lanes->following, runs, false) &&
                        pack_plans(&lanes->offered, runs, true) &&
                        pack_member(&how->world, runs, offsetof(hil_run_t, world), lanes->live.world) &&
                        pack_member(&how->metrics, runs, offsetof(hil_run_t, metrics), lanes->live.metrics) &&
                        pack_member(&core->robot, runs, offsetof(hil_run_t, robot), lanes->live.robot) &&
                        pack_member(&core->inputs, runs, offsetof(hil_run_t, inputs), lanes->live.inputs) &&
                        pack_member(&core->outputs, runs, offsetof(hil_run_t, outputs), lanes->live.outputs);
    if (packed) {
        core->connect(lanes->live.robot, lanes->config,
                      trajectory_of(runs[0], false) == NULL ? NULL : &lanes->following);
        core->offer(lanes->live.inputs, trajectory_of(runs[0], true) == NULL ? NULL : &lanes->offered);
        stats_of_thread.packed++;
    } else {
        stats_of_thread.pack_failures++;
    }
    return packed;
}

static void unpack_member(const hil_layout_t *layout, hil_run_t *const runs[HIL_LANES], size_t offset,
                          const void *from) {
    void *each[HIL_LANES];
    collect(runs, offset, each);
    hil_lanes_unpack(layout, from, each);
}

/* Is this lane the first once more? */
static bool repeats(hil_run_t *const runs[HIL_LANES], int lane) {
    /* cppcheck-suppress arrayIndexOutOfBoundsCond ; lane < HIL_LANES */
    return lane > 0 && runs[lane] == runs[0];
}

static void unpack(const lanes_t *lanes, hil_run_t *const runs[HIL_LANES], uint64_t ticks) {
    const hil_lanes_runs_t *how = lanes->how;
    const hil_lanes_core_t *core = how->core;
    const hil_lanes_plans_t *plans = core->plans_of(lanes->live.robot);
    unpack_member(&how->world, runs, offsetof(hil_run_t, world), lanes->live.world);
    unpack_member(&how->metrics, runs, offsetof(hil_run_t, metrics), lanes->live.metrics);
    unpack_member(&core->robot, runs, offsetof(hil_run_t, robot), lanes->live.robot);
    unpack_member(&core->inputs, runs, offsetof(hil_run_t, inputs), lanes->live.inputs);
    unpack_member(&core->outputs, runs, offsetof(hil_run_t, outputs), lanes->live.outputs);
    for (int lane = 0; lane < HIL_LANES; lane++) {
        runs[lane]->robot.reference_generator.trajectory =
            plans == NULL ? NULL : (const omni_trajectory_t *)plans->plan[lane];
        runs[lane]->ticks += repeats(runs, lane) ? 0 : ticks;
    }
}

static void save(const lanes_t *lanes) {
    memcpy(lanes->block + lanes->bytes, lanes->block, lanes->bytes);
}

/* As they were `since` ticks after they were packed: from the checkpoint, or from the runs themselves. */
static void restore(lanes_t *lanes, hil_run_t *const runs[HIL_LANES], uint64_t since) {
    if (since == 0) {
        (void)pack(lanes, runs);
    } else {
        memcpy(lanes->block, lanes->block + lanes->bytes, lanes->bytes);
    }
}

/* @return ticks until the lanes would part; they are as after these. */
static uint64_t together(lanes_t *lanes, hil_run_t *const runs[HIL_LANES], uint64_t ticks) {
    uint64_t done = 0;
    while (done < ticks) {
        const uint64_t stride = ticks - done < STRIDE ? ticks - done : STRIDE;
        if (done > 0) {
            save(lanes);
        }
        const uint64_t got = lanes->how->advance(&lanes->live, stride);
        if (got < stride) {
            restore(lanes, runs, done);
            (void)lanes->how->advance(&lanes->live, got);
            stats_of_thread.divergences++;
            stats_of_thread.repeated_ticks += got + 1;
            return done + got;
        }
        done += stride;
    }
    return done;
}

static void each_alone(hil_run_t *const runs[HIL_LANES], uint64_t ticks) {
    for (int lane = 0; lane < HIL_LANES; lane++) {
        if (!repeats(runs, lane)) {
            hil_run_advance(runs[lane], ticks);
        }
    }
    stats_of_thread.scalar_ticks += ticks;
}

/* @return ticks that all of them go alone before lanes are tried again. */
static uint64_t next_alone(uint64_t before, uint64_t least, uint64_t left) {
    const uint64_t twice = 2 * before < ALONE_MAX ? 2 * before : ALONE_MAX;
    const uint64_t alone = twice > least ? twice : least;
    return alone < left ? alone : left;
}

static uint64_t advance(lanes_t *lanes, hil_run_t *const runs[HIL_LANES], uint64_t ticks) {
    uint64_t done = 0;
    uint64_t alone = 0;
    while (done < ticks) {
        uint64_t least = ALONE_UNLIKE;
        if (pack(lanes, runs)) {
            const uint64_t got = together(lanes, runs, ticks - done);
            unpack(lanes, runs, got);
            stats_of_thread.lane_ticks += got;
            done += got;
            alone = got > 0 ? 0 : alone;
            least = 1;
        } else if (done == 0) {
            return 0;
        }
        alone = next_alone(alone, least, ticks - done);
        each_alone(runs, alone);
        done += alone;
    }
    return done;
}

uint64_t hil_lanes_advance(hil_run_t *const runs[HIL_LANES], uint64_t ticks) {
    lanes_t lanes;
    for (int lane = 0; lane < HIL_LANES; lane++) {
        if (runs[lane]->record != NULL || runs[lane]->ticks != runs[0]->ticks) {
            return 0;
        }
    }
    if (level == HIL_LANES_NONE || !open_lanes(&lanes)) {
        return 0;
    }
    (void)hil_lanes_take_diverged();
    const uint64_t done = advance(&lanes, runs, ticks);
    free(lanes.block);
    return done;
}
