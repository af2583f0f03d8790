/* SPDX-License-Identifier: MIT */
/** @file law.h  One 20 ms period of the original robot's control law, as ours and the peer offer it: three wheels, pose
 * given. */
#ifndef BENCH_LAW_H
#define BENCH_LAW_H

#include <stdint.h>

enum { LAW_WHEELS = 3, LAW_TICKS = 20 };

#define LAW_RADIUS_M 0.03275
#define LAW_DISTANCE_M 0.195
#define LAW_SUPPLY_V 12.0
#define LAW_RAD_PER_COUNT (6.283185307179586 / 10000.0)

typedef struct law_input_t {
    int32_t moved_counts[LAW_WHEELS]; /**< in this period */
    float pose[3];                    /**< m, m, rad */
    float reference[3];
    float rate[3]; /**< m/s, m/s, rad/s */
} law_input_t;

/** Run periods; `voltage_V` gets LAW_WHEELS numbers for each. */
typedef void law_run_t(const law_input_t *inputs, uint32_t periods, float *voltage_V);

#ifdef __cplusplus
extern "C" {
#endif
law_run_t core_law, double_law;
#ifdef __cplusplus
}
#endif

#endif
