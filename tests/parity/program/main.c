/* SPDX-License-Identifier: MIT */
/**
 * @file main.c
 * The parity program. It runs the control tick over seeded, varied input. It prints a hash over the bits of all its
 * outputs, every 10 000 ticks. Two builds of the core agree if they print the same.
 *
 *   parity [--ticks N] [--seed S] [--dump FROM TO] [--least N]
 *
 * --dump prints every output's bits from tick FROM to before tick TO. --least: ticks that everything has to be reached
 * in. Exit code 1: something was not reached, or an output was not finite; 2: wrong use.
 */
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "coverage.h"
#include "digest.h"
#include "scene.h"

enum { REPORT_TICKS = 10000 };

typedef struct options_t {
    uint32_t ticks;
    uint32_t seed;
    uint32_t dump_from;
    uint32_t dump_to;
    uint32_t least;
} options_t;

static bool parse(int argc, char **argv, options_t *options) {
    for (int i = 1; i < argc; ++i) {
        const int left = argc - i - 1;
        if (strcmp(argv[i], "--ticks") == 0 && left >= 1) {
            options->ticks = (uint32_t)strtoul(argv[++i], NULL, 10);
        } else if (strcmp(argv[i], "--seed") == 0 && left >= 1) {
            options->seed = (uint32_t)strtoul(argv[++i], NULL, 10);
        } else if (strcmp(argv[i], "--least") == 0 && left >= 1) {
            options->least = (uint32_t)strtoul(argv[++i], NULL, 10);
        } else if (strcmp(argv[i], "--dump") == 0 && left >= 2) {
            options->dump_from = (uint32_t)strtoul(argv[++i], NULL, 10);
            options->dump_to = (uint32_t)strtoul(argv[++i], NULL, 10);
        } else {
            return false;
        }
    }
    return true;
}

/* In halves: not every C library prints 64 bits. */
static void print_hash(uint32_t ticks, uint64_t outputs, uint64_t background) {
    printf("hash %" PRIu32 " %08" PRIx32 "%08" PRIx32 " %08" PRIx32 "%08" PRIx32 "\n", ticks, (uint32_t)(outputs >> 32),
           (uint32_t)outputs, (uint32_t)(background >> 32), (uint32_t)background);
}

/* @return false if an output was not finite. */
static bool run(scene_t *scene, coverage_t *coverage, const options_t *options) {
    uint64_t hash = 0;
    for (uint32_t tick = 0; tick < options->ticks; ++tick) {
        scene_step(scene);
        coverage_note(coverage, scene);
        hash = digest_outputs(hash, &scene->outputs);
        if (tick >= options->dump_from && tick < options->dump_to) {
            digest_print(tick, &scene->outputs);
        }
        const char *bad = digest_not_finite(&scene->outputs);
        if (bad != NULL) {
            printf("tick %" PRIu32 ": %s is not finite\n", tick, bad);
            return false;
        }
        if ((tick + 1) % REPORT_TICKS == 0 || tick + 1 == options->ticks) {
            print_hash(tick + 1, hash, scene->background);
        }
    }
    return true;
}

int main(int argc, char **argv) {
    static scene_t scene;
    static coverage_t coverage;
    options_t options = {.ticks = 1000000, .seed = 1};
    if (!parse(argc, argv, &options)) {
        (void)fprintf(stderr, "usage: parity [--ticks N] [--seed S] [--dump FROM TO] [--least N]\n");
        return 2;
    }
    if (!digest_is_complete()) {
        (void)fprintf(stderr, "omni_outputs_t has changed: bring the table of fields in digest.c up to date\n");
        return 2;
    }
    scene_init(&scene, options.seed);
    if (!run(&scene, &coverage, &options)) {
        return 1;
    }
    return coverage_report(&coverage, &scene, options.least) ? 0 : 1;
}
