/* SPDX-License-Identifier: MIT */
/**
 * @file dispersion.h
 * Random variation of the world's parameters per run, as a pure function of scenario and seed.
 */
#ifndef HIL_SIM_DISPERSION_H
#define HIL_SIM_DISPERSION_H

#include "hil_sim/world.h"

typedef enum hil_dispersion_kind_t {
    HIL_DISPERSION_UNIFORM = 0, /**< deviation between a and b */
    HIL_DISPERSION_NORMAL       /**< deviation of mean a and standard deviation b, truncated at 3 standard deviations */
} hil_dispersion_kind_t;

/** Deviation of one quantity. Several for one field are added in order. */
typedef struct hil_dispersion_t {
    uint32_t offset; /**< of the first double in hil_world_config_t */
    uint32_t count;  /**< doubles from there on, each with its own draw */
    uint32_t stream; /**< random stream; hil_dispersion_stream of the quantity's name */
    uint32_t kind;   /**< hil_dispersion_kind_t */
    bool relative;   /**< value (1 + deviation); otherwise value + deviation */
    double a;
    double b;
} hil_dispersion_t;

/** Random stream of a quantity, from its name: independent of other quantities and of the world's own streams. */
uint32_t hil_dispersion_stream(const char *name);

/** Apply the deviations of this seed to a configuration. */
void hil_apply_dispersion(hil_world_config_t *config, const hil_dispersion_t *dispersion, uint32_t count,
                          uint64_t seed);

#endif
