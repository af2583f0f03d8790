/* SPDX-License-Identifier: MIT */
/**
 * @file filter_study_program.c
 * Runs a native peer of the filter study.
 *
 *   program MODEL RUNS SEED own            noise from its own generator
 *   program MODEL RUNS SEED given FILE     noise from FILE: doubles, (RUNS, steps, 20)
 *   program MODEL RUNS SEED draw FILE      writes its generator's noise there, runs nothing
 *
 * MODEL: doubles, those of study_numbers_t, then poses (steps + 1, 3) and rates (steps, 3). Prints `width` (runs at
 * once, bytes of a number) and `seconds` (CPU time of all runs). Then come `run0`, `run1`, ..., each with its 12 sums
 * of squares. Exit code 1 and a sentence if something is wrong.
 */
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "filter_study_peer.h"

static double now_s(void) {
    struct timespec time;
    clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &time);
    return (double)time.tv_sec + 1e-9 * (double)time.tv_nsec;
}

/* Reads or writes `count` doubles. */
static bool pass(const char *path, double *values, size_t count, bool reading) {
    FILE *file = fopen(path, reading ? "rb" : "wb");
    if (file == NULL) {
        return false;
    }
    const size_t done =
        reading ? fread(values, sizeof *values, count, file) : fwrite(values, sizeof *values, count, file);
    return fclose(file) == 0 && done == count;
}

/* The whole model file as doubles; NULL if it cannot be read. */
static double *read_model(const char *path, study_model_t *model) {
    const size_t head = sizeof model->is / sizeof(double);
    if (!pass(path, (double *)&model->is, head, true) || model->is.steps < 1.0 || model->is.steps > 1e8) {
        return NULL;
    }
    model->steps = (size_t)model->is.steps;
    const size_t count = head + 6 * model->steps + 3;
    double *values = calloc(count, sizeof *values);
    if (values == NULL || !pass(path, values, count, true)) {
        free(values);
        return NULL;
    }
    model->poses = (const double(*)[3])(values + head);
    model->rates = model->poses + model->steps + 1;
    return values;
}

static void report(const study_square_t *square, size_t runs, double seconds) {
    const study_width_t width = study_width();
    printf("width %d %d\nseconds %.9f\n", width.runs, width.number_bytes, seconds);
    for (size_t run = 0; run < runs; run++) {
        printf("run%zu", run);
        for (int i = 0; i < STUDY_ESTIMATES * 3; i++) {
            printf(" %.17g", square[run][i / 3][i % 3]);
        }
        printf("\n");
    }
}

/* @return false if a file or the memory is not there. */
static bool perform(const study_model_t *model, size_t runs, uint64_t seed, const char *mode, const char *path) {
    const size_t count = runs * model->steps * STUDY_ROW;
    double *normals = path == NULL ? NULL : calloc(count, sizeof *normals);
    study_square_t *square = calloc(runs, sizeof *square);
    const bool given = strcmp(mode, "given") == 0;
    bool done = square != NULL && (path == NULL || normals != NULL) && (!given || pass(path, normals, count, true));
    if (done && strcmp(mode, "draw") == 0) {
        study_draw(model, runs, seed, normals);
        done = pass(path, normals, count, false);
    } else if (done) {
        const double start = now_s();
        study_run(model, runs, seed, normals, square);
        report((const study_square_t *)square, runs, now_s() - start);
    }
    free(normals);
    free(square);
    return done;
}

int main(int count, char **words) {
    const bool own = count == 5 && strcmp(words[4], "own") == 0;
    if (!own && (count != 6 || (strcmp(words[4], "given") != 0 && strcmp(words[4], "draw") != 0))) {
        fprintf(stderr, "usage: %s MODEL RUNS SEED own | given FILE | draw FILE\n", words[0]);
        return 1;
    }
    study_model_t model;
    double *room = read_model(words[1], &model);
    const unsigned long long runs = strtoull(words[2], NULL, 10);
    if (room == NULL || runs < 1 || runs > 1000000) {
        fprintf(stderr, "%s: no model, or too few or many runs: %s\n", words[1], words[2]);
        free(room);
        return 1;
    }
    const bool done = perform(&model, (size_t)runs, strtoull(words[3], NULL, 10), words[4], own ? NULL : words[5]);
    if (!done) {
        fprintf(stderr, "%s: cannot be read or written, or there is too little memory\n", own ? words[1] : words[5]);
    }
    free(room);
    return done ? 0 : 1;
}
