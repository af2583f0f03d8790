/* SPDX-License-Identifier: MIT */
/**
 * @file filter_study_peer.h
 * What the native peers of the filter study have in common: the model, and the functions of each. The model is that of
 * bench/filter_model.py.
 */
#ifndef FILTER_STUDY_PEER_H
#define FILTER_STUDY_PEER_H

#include <stddef.h>
#include <stdint.h>

/** Normals per step: (w, i) per wheel, measured speeds, pose, fix. A row has two more, as that of
 * bench/filter_model.py, which nobody uses. */
enum { STUDY_WHEELS = 4, STUDY_ESTIMATES = 4, STUDY_NORMALS = 18, STUDY_ROW = 20 };
enum { STUDY_MOTOR = 0, STUDY_MEASURED = 8, STUDY_POSE = 12, STUDY_FIX = 15 };

/** Numbers that a model file begins with, in its order. bench/native_study.py writes them. */
typedef struct study_numbers_t {
    double steps;
    double step_s;
    double motor_a[2][2]; /**< (w [rad/s], i [A]), per step */
    double motor_b[2];
    double motor_sd[2];
    double measured_sd;
    double pose_sd[3];
    double fix_sd[3];
    double kf_q[2];
    double ekf_q[2][3];
    double to_body[3][STUDY_WHEELS];
    double to_wheels[STUDY_WHEELS][3];
    double ismc_lambda[3];
    double ismc_k[3];
    double drive_true; /**< 0 or 1, as the next two */
    double raw_measured;
    double stale;
} study_numbers_t;

typedef struct study_model_t {
    study_numbers_t is;
    size_t steps;
    const double (*poses)[3]; /**< steps + 1 rows */
    const double (*rates)[3]; /**< steps rows */
} study_model_t;

/** Sums over the steps of a run: squares of estimate - truth, per estimate and axis. */
typedef double study_square_t[STUDY_ESTIMATES][3];

/**
 * Do `runs` runs. A run's numbers depend on the seed and its place among the runs, not on how many there are.
 * @param normals  those to use, (runs, steps, STUDY_ROW), or NULL: draw them.
 * @param square  room for `runs`.
 */
void study_run(const study_model_t *model, size_t runs, uint64_t seed, const double *normals, study_square_t *square);

/** Draw what study_run would. @param normals room for (runs, steps, STUDY_ROW); the unused are 0. */
void study_draw(const study_model_t *model, size_t runs, uint64_t seed, double *normals);

/** What a program says of itself: runs that go at once, and bytes of a number. */
typedef struct study_width_t {
    int runs;
    int number_bytes;
} study_width_t;
study_width_t study_width(void);

/** Seeds of generators, one word after another (splitmix64). */
static inline uint64_t study_seed_word(uint64_t *state) {
    *state += 0x9E3779B97F4A7C15u;
    uint64_t z = *state;
    z = (z ^ (z >> 30)) * 0xBF58476D1CE4E5B9u;
    z = (z ^ (z >> 27)) * 0x94D049BB133111EBu;
    return z ^ (z >> 31);
}

/** Where the words of a run's generator begin: another hash of seed and run, so that runs share no words. */
static inline uint64_t study_run_seed(uint64_t seed, size_t run) {
    uint64_t state = seed;
    state = study_seed_word(&state) ^ (uint64_t)run * 0xD1342543DE82EF95u;
    return study_seed_word(&state);
}

#endif
