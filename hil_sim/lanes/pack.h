/* SPDX-License-Identifier: MIT */
/**
 * @file pack.h
 * Structs of eight runs into one struct of lanes, and back. What a struct consists of comes from the types themselves
 * (make_layout.py); pointers are left alone, they are the caller's.
 */
#ifndef HIL_LANES_PACK_H
#define HIL_LANES_PACK_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

enum { HIL_LANES = 8 };

/** What the members of a stretch are. */
typedef enum hil_stretch_kind_t {
    HIL_STRETCH_SAME = 0, /**< common to all runs */
    HIL_STRETCH_WORD,     /**< 4 bytes per run: omni_real_t, omni_int_t, omni_uint_t */
    HIL_STRETCH_WIDE,     /**< 8 bytes per run: hil_real_t */
    HIL_STRETCH_FLAG      /**< bool per run; in lanes a word, all bits or none */
} hil_stretch_kind_t;

/** Neighbouring members of one kind. */
typedef struct hil_stretch_t {
    uint32_t offset; /**< of the first member */
    uint16_t count;  /**< members; 1 if SAME */
    uint16_t size;   /**< bytes, of SAME only */
    uint8_t kind;    /**< hil_stretch_kind_t */
} hil_stretch_t;

/** How a type lies in memory, for one run and in lanes: as many stretches of the same kinds. */
typedef struct hil_layout_t {
    const hil_stretch_t *scalar;
    const hil_stretch_t *lanes;
    size_t count;
} hil_layout_t;

/** Eight structs into lanes. @return false if something common to all runs differs; `lanes` is then not usable. */
bool hil_lanes_pack(const hil_layout_t *layout, const void *const scalar[HIL_LANES], void *lanes);

/** Lanes into eight structs. */
void hil_lanes_unpack(const hil_layout_t *layout, const void *lanes, void *const scalar[HIL_LANES]);

/* A table of stretches, X macro of layout_gen.h; the struct of whichever language includes this. */
#define HIL_STRETCH(stretch_kind, type, first, last, number)                                                           \
    {(uint32_t)offsetof(type, first), (uint16_t)(number),                                                              \
     (uint16_t)(HIL_STRETCH_##stretch_kind == HIL_STRETCH_SAME ? sizeof(((type *)0)->first) : 0),                      \
     (uint8_t)HIL_STRETCH_##stretch_kind},

#ifdef __cplusplus
}
#endif

#endif
