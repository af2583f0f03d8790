/* SPDX-License-Identifier: MIT */
/**
 * @file ticks.c
 * Ticks of whole simulated runs, for counting their instructions without Python. `counted` is what callgrind is told to
 * collect.
 * usage: ticks in_process|run|lanes WORLD CONFIG TICKS. The first two are files of a hil_world_config_t and an
 * omni_robot_config_t. Prints the ticks counted, over all runs, and the true pose (m, m, rad) of the first at the end.
 */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "hil_sim/lanes.h"
#include "hil_sim/run.h"

enum { RUNS = 8, CHUNK = 200, START = 500, WARM_UP = 2500 };

static hil_run_t runs[RUNS];

typedef uint64_t advance_t(uint64_t ticks);

/* Each returns how many ticks it did, over all runs. */
static uint64_t advance_in_process(uint64_t ticks) {
    hil_run_in_process(&runs[0].world, &runs[0].robot, &runs[0].inputs, &runs[0].outputs, ticks, NULL);
    return ticks;
}

static uint64_t advance_run(uint64_t ticks) {
    hil_run_advance(&runs[0], ticks);
    return ticks;
}

static uint64_t advance_lanes(uint64_t ticks) {
    hil_run_t *all[RUNS];
    for (int i = 0; i < RUNS; i++) {
        all[i] = &runs[i];
    }
    const uint64_t done = hil_lanes_advance(all, ticks);
    for (int i = 0; i < RUNS; i++) {
        hil_run_advance(all[i], ticks - done);
    }
    return RUNS * ticks;
}

__attribute__((noinline)) uint64_t counted(advance_t *advance, uint64_t ticks);

uint64_t counted(advance_t *advance, uint64_t ticks) {
    uint64_t done = 0;
    for (uint64_t tick = 0; tick < ticks; tick += CHUNK) {
        done += advance(CHUNK);
    }
    return done;
}

static int load(const char *path, void *into, size_t size) {
    FILE *file = fopen(path, "rb");
    const size_t got = file == NULL ? 0 : fread(into, 1, size, file);
    if (file != NULL) {
        (void)fclose(file);
    }
    return got == size;
}

/* Armed and on its path, as a scenario would have it. */
static int start(hil_run_t *run, const hil_world_config_t *world, const omni_robot_config_t *robot) {
    char why[128];
    if (hil_run_init(run, world, robot, why, sizeof why) != HIL_OK) {
        (void)fprintf(stderr, "%s\n", why);
        return 0;
    }
    hil_run_advance(run, 1);
    run->inputs.pose = (omni_pose_t){(float)run->world.pose[0], (float)run->world.pose[1], (float)run->world.pose[2]};
    run->inputs.events |= OMNI_EVENT_SET_POSE;
    hil_run_advance(run, START);
    if (hil_run_start_trajectory(run) != OMNI_OK) {
        return 0;
    }
    run->inputs.events |= OMNI_EVENT_ARM;
    hil_run_advance(run, WARM_UP);
    return run->outputs.state == OMNI_STATE_ARMED;
}

static advance_t *chosen(const char *name) {
    if (strcmp(name, "lanes") == 0) {
        return advance_lanes;
    }
    return strcmp(name, "run") == 0 ? advance_run : strcmp(name, "in_process") == 0 ? advance_in_process : NULL;
}

int main(int argc, char **argv) {
    static hil_world_config_t world;
    static omni_robot_config_t robot;
    advance_t *const advance = argc == 5 ? chosen(argv[1]) : NULL;
    if (advance == NULL || !load(argv[2], &world, sizeof world) || !load(argv[3], &robot, sizeof robot)) {
        return 2;
    }
    const uint64_t needed = advance == advance_run || advance == advance_in_process ? 1 : RUNS;
    for (uint64_t i = 0; i < needed; i++) {
        world.seed += i > 0;
        if (!start(&runs[i], &world, &robot)) {
            return 1;
        }
    }
    const uint64_t ticks = counted(advance, strtoull(argv[4], NULL, 10));
    const double *pose = runs[0].world.pose;
    printf("ticks %llu\npose %.17g %.17g %.17g\n", (unsigned long long)ticks, pose[0], pose[1], pose[2]);
    return 0;
}
