/* SPDX-License-Identifier: MIT */
#include "hil_sim/filter_study.h"

#include <string.h>

#include "filter_study_lanes.h"
#include "filter_study_parts.h"
#include "hil_sim/lanes.h"

_Static_assert(sizeof(hil_filter_sums_t) == sizeof(hil_filter_result_t), "sums become results in place");

static void record(const hil_filter_run_t *run, const hil_filter_config_t *config, const double *fix,
                   hil_filter_sample_t *sample) {
    memset(sample, 0, sizeof *sample);
    memcpy(sample->truth, run->truth.pose, sizeof sample->truth);
    memcpy(sample->fix, fix, sizeof sample->fix);
    for (int f = 0; f < HIL_FILTER_COUNT; f++) {
        const omni_pose_t *pose = &run->stack.ekf[f].pose;
        sample->estimate[f][0] = (double)pose->x;
        sample->estimate[f][1] = (double)pose->y;
        sample->estimate[f][2] = (double)pose->theta;
    }
    for (uint32_t i = 0; i < config->wheels; i++) {
        sample->voltage_V[i] = (double)run->stack.voltage[i];
        sample->wheel_true[i] = run->truth.motor[i][0];
        sample->wheel_measured[i] = run->truth.measured[i];
        sample->wheel_raw[i] = hil_filter_raw_speed(config, &run->truth, i);
        sample->wheel_filtered[i] = (double)run->stack.filtered[i];
    }
}

/* Means and their roots of the sums over the steps. */
static void finish(const hil_filter_config_t *config, const hil_filter_sums_t *sums, hil_filter_result_t *result) {
    const double steps = (double)config->steps;
    memcpy(result, sums, sizeof *result);
    for (int f = 0; f < HIL_FILTER_COUNT; f++) {
        for (int axis = 0; axis < 3; axis++) {
            result->rmse[f][axis] = sqrt(sums->square[f][axis] / steps);
        }
        result->closer[f] /= steps;
    }
    result->nis[0] /= steps;
    result->nis[1] /= steps;
    result->motor_nis /= steps;
    for (int axis = 0; axis < 3; axis++) {
        result->tracking[axis] = sqrt(sums->tracking[axis] / steps);
    }
}

static bool in_range(const hil_filter_config_t *config) {
    return config->steps > 0 && config->step_s > 0.0 && config->step_s <= 1.0 &&
           (config->wheels == 3 || config->wheels == 4) && config->controlled < HIL_FILTER_COUNT &&
           config->drive <= HIL_FILTER_DRIVE_ESTIMATE && config->raw <= HIL_FILTER_RAW_OPEN_LOOP &&
           config->fix <= HIL_FILTER_FIX_OWN;
}

int32_t hil_filter_study(const hil_filter_config_t *config, const double *reference, const double *rate, uint64_t seed,
                         hil_filter_result_t *result, hil_filter_sample_t *samples) {
    const omni_uint_t words[2] = {(uint32_t)seed, (uint32_t)(seed >> 32)};
    hil_filter_run_t run;
    if (!in_range(config) || !hil_filter_begin(&run, config, reference, words)) {
        return -1;
    }
    for (uint32_t step = 0; step < config->steps; step++) {
        double fix[3];
        hil_filter_step(&run, config, reference, rate, step, fix);
        if (samples != NULL) {
            record(&run, config, fix, &samples[step]);
        }
    }
    hil_filter_end(&run);
    finish(config, &run.sums, result);
    return 0;
}

/* A way to go, and how many seeds go at once. */
typedef struct way_t {
    hil_filter_lanes_t *run;
    uint32_t lanes;
} way_t;

/* @param left  seeds still to be run: wide vectors that are half empty are no gain */
static way_t way_of(hil_filter_path_t path, uint32_t left) {
    const way_t baseline = {hil_filter_lanes_baseline, HIL_FILTER_LANES};
    const way_t none = {NULL, 1};
#ifdef HIL_LANES_X86
    const way_t avx2 = {hil_filter_lanes_avx2, HIL_FILTER_LANES};
    const way_t avx512 = {hil_filter_lanes_avx512, HIL_FILTER_MOST_LANES};
    const bool best = path == HIL_FILTER_PATH_BEST;
    if (hil_lanes_has_avx512() && (path == HIL_FILTER_PATH_AVX512 || (best && left > HIL_FILTER_LANES))) {
        return avx512;
    }
    if (hil_lanes_has_avx2() && (best || path == HIL_FILTER_PATH_AVX2)) {
        return avx2;
    }
#else
    (void)left;
#endif
    return path == HIL_FILTER_PATH_BASELINE || path == HIL_FILTER_PATH_BEST ? baseline : none;
}

/* As many seeds as there are lanes; too few are filled up. @return false if they cannot go together. */
static bool run_together(const way_t *way, const hil_filter_config_t *config, const double *reference,
                         const double *rate, const uint64_t *seeds, uint32_t count, hil_filter_result_t *results) {
    uint64_t seed[HIL_FILTER_MOST_LANES];
    hil_filter_sums_t sums[HIL_FILTER_MOST_LANES];
    for (uint32_t i = 0; i < way->lanes; i++) {
        seed[i] = seeds[i < count ? i : 0];
    }
    if (!way->run(config, reference, rate, seed, sums)) {
        return false;
    }
    for (uint32_t i = 0; i < count; i++) {
        finish(config, &sums[i], &results[i]);
    }
    return true;
}

int32_t hil_filter_study_many(const hil_filter_config_t *config, const double *reference, const double *rate,
                              const uint64_t *seeds, uint32_t count, hil_filter_path_t path,
                              hil_filter_result_t *results) {
    if (!in_range(config)) {
        return -1;
    }
    if (path != HIL_FILTER_PATH_SINGLE && way_of(path, count).run == NULL) {
        return -2;
    }
    for (uint32_t done = 0; done < count;) {
        const uint32_t left = count - done;
        const way_t way = way_of(path, left);
        const uint32_t group = left < way.lanes ? left : way.lanes;
        if (group == 1 || !run_together(&way, config, reference, rate, seeds + done, group, results + done)) {
            for (uint32_t i = done; i < done + group; i++) {
                if (hil_filter_study(config, reference, rate, seeds[i], &results[i], NULL) != 0) {
                    return -1;
                }
            }
        }
        done += group;
    }
    return 0;
}
