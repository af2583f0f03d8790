/* SPDX-License-Identifier: MIT */
/**
 * @file dispersion.h
 * Quantities of the world that differ from run to run: a run's world is a pure function of scenario and seed.
 */
#ifndef HIL_SIM_DISPERSION_H
#define HIL_SIM_DISPERSION_H

#include "hil_sim/world.h"

typedef enum hil_dispersion_kind_t {
    HIL_DISPERSION_UNIFORM = 0, /**< deviation between a and b */
    HIL_DISPERSION_NORMAL       /**< deviation of mean a and standard deviation b, drawn again beyond 3 of them */
} hil_dispersion_kind_t;

/** How one quantity deviates. Several for the same field add up in their order. */
typedef struct hil_dispersion_t {
    uint32_t offset; /**< of the first double in hil_world_config_t */
    uint32_t count;  /**< doubles from there on, each with its own draw */
    uint32_t stream; /**< random stream; hil_dispersion_stream of the quantity's name */
    uint32_t kind;   /**< hil_dispersion_kind_t */
    bool relative;   /**< value (1 + deviation); otherwise value + deviation */
    double a;
    double b;
} hil_dispersion_t;

/** The stream of a quantity by its name: the same whatever else varies, apart from all streams of the world itself. */
uint32_t hil_dispersion_stream(const char *name);

/** Give the world of this seed its numbers. */
void hil_disperse(hil_world_config_t *config, const hil_dispersion_t *dispersion, uint32_t count, uint64_t seed);

#endif
