/* SPDX-License-Identifier: MIT */
#include "pack.h"

#include <string.h>

#ifdef __SSE2__
#include <xmmintrin.h>
#endif

/* A member of a lane struct: one word, double word per run. */
typedef struct lane_words_t {
    uint32_t lane[HIL_LANES];
} lane_words_t;

typedef struct lane_wides_t {
    uint64_t lane[HIL_LANES];
} lane_wides_t;

enum { TILE = 4 };

/* Four words from each of four places, turned: word j from place i becomes word i at place j. */
static inline void turn(const uint32_t *const from[TILE], uint32_t *const to[TILE]) {
#ifdef __SSE2__
    __m128 row[TILE];
    for (int i = 0; i < TILE; ++i) {
        row[i] = _mm_loadu_ps((const float *)(const void *)from[i]);
    }
    _MM_TRANSPOSE4_PS(row[0], row[1], row[2], row[3]);
    for (int i = 0; i < TILE; ++i) {
        _mm_storeu_ps((float *)(void *)to[i], row[i]);
    }
#else
    for (int i = 0; i < TILE; ++i) {
        for (int j = 0; j < TILE; ++j) {
            to[j][i] = from[i][j];
        }
    }
#endif
}

static const char *at(const void *base, uint32_t offset) {
    return (const char *)base + offset;
}

static bool pack_same(const hil_stretch_t *s, const void *const scalar[HIL_LANES], char *to) {
    const char *first = at(scalar[0], s->offset);
    bool same = true;
    for (int lane = 1; lane < HIL_LANES; ++lane) {
        same = same && memcmp(at(scalar[lane], s->offset), first, s->size) == 0;
    }
    memcpy(to, first, s->size);
    return same;
}

static void pack_words(const hil_stretch_t *s, const void *const scalar[HIL_LANES], char *to) {
    const uint32_t *from[HIL_LANES];
    lane_words_t *words = (lane_words_t *)(void *)to;
    for (int lane = 0; lane < HIL_LANES; ++lane) {
        from[lane] = (const uint32_t *)(const void *)at(scalar[lane], s->offset);
    }
    uint32_t i = 0;
    for (; i + TILE <= s->count; i += TILE) {
        for (int lane = 0; lane < HIL_LANES; lane += TILE) {
            const uint32_t *const rows[TILE] = {&from[lane][i], &from[lane + 1][i], &from[lane + 2][i],
                                                &from[lane + 3][i]};
            uint32_t *const turned[TILE] = {&words[i].lane[lane], &words[i + 1].lane[lane], &words[i + 2].lane[lane],
                                            &words[i + 3].lane[lane]};
            turn(rows, turned);
        }
    }
    for (; i < s->count; ++i) {
        for (int lane = 0; lane < HIL_LANES; ++lane) {
            words[i].lane[lane] = from[lane][i];
        }
    }
}

static void pack_wides(const hil_stretch_t *s, const void *const scalar[HIL_LANES], char *to) {
    const uint64_t *from[HIL_LANES];
    lane_wides_t *wides = (lane_wides_t *)(void *)to;
    for (int lane = 0; lane < HIL_LANES; ++lane) {
        from[lane] = (const uint64_t *)(const void *)at(scalar[lane], s->offset);
    }
    for (uint32_t i = 0; i < s->count; ++i) {
        for (int lane = 0; lane < HIL_LANES; ++lane) {
            wides[i].lane[lane] = from[lane][i];
        }
    }
}

static void pack_flags(const hil_stretch_t *s, const void *const scalar[HIL_LANES], char *to) {
    lane_words_t *words = (lane_words_t *)(void *)to;
    for (uint32_t i = 0; i < s->count; ++i) {
        for (int lane = 0; lane < HIL_LANES; ++lane) {
            words[i].lane[lane] = *at(scalar[lane], s->offset + i) != 0 ? UINT32_MAX : 0;
        }
    }
}

bool hil_lanes_pack(const hil_layout_t *layout, const void *const scalar[HIL_LANES], void *lanes) {
    for (size_t i = 0; i < layout->count; ++i) {
        const hil_stretch_t *s = &layout->scalar[i];
        char *to = (char *)lanes + layout->lanes[i].offset;
        if (s->kind == HIL_STRETCH_WORD) {
            pack_words(s, scalar, to);
        } else if (s->kind == HIL_STRETCH_WIDE) {
            pack_wides(s, scalar, to);
        } else if (s->kind == HIL_STRETCH_FLAG) {
            pack_flags(s, scalar, to);
        } else if (!pack_same(s, scalar, to)) {
            return false;
        }
    }
    return true;
}

static void unpack_words(const hil_stretch_t *s, const char *from, void *const scalar[HIL_LANES]) {
    const lane_words_t *words = (const lane_words_t *)(const void *)from;
    uint32_t *to[HIL_LANES];
    for (int lane = 0; lane < HIL_LANES; ++lane) {
        to[lane] = (uint32_t *)(void *)((char *)scalar[lane] + s->offset);
    }
    uint32_t i = 0;
    for (; i + TILE <= s->count; i += TILE) {
        for (int lane = 0; lane < HIL_LANES; lane += TILE) {
            const uint32_t *const rows[TILE] = {&words[i].lane[lane], &words[i + 1].lane[lane],
                                                &words[i + 2].lane[lane], &words[i + 3].lane[lane]};
            uint32_t *const turned[TILE] = {&to[lane][i], &to[lane + 1][i], &to[lane + 2][i], &to[lane + 3][i]};
            turn(rows, turned);
        }
    }
    for (; i < s->count; ++i) {
        for (int lane = 0; lane < HIL_LANES; ++lane) {
            to[lane][i] = words[i].lane[lane];
        }
    }
}

static void unpack_wides(const hil_stretch_t *s, const char *from, void *const scalar[HIL_LANES]) {
    const lane_wides_t *wides = (const lane_wides_t *)(const void *)from;
    for (int lane = 0; lane < HIL_LANES; ++lane) {
        uint64_t *to = (uint64_t *)(void *)((char *)scalar[lane] + s->offset);
        for (uint32_t i = 0; i < s->count; ++i) {
            to[i] = wides[i].lane[lane];
        }
    }
}

static void unpack_flags(const hil_stretch_t *s, const char *from, void *const scalar[HIL_LANES]) {
    const lane_words_t *words = (const lane_words_t *)(const void *)from;
    for (int lane = 0; lane < HIL_LANES; ++lane) {
        bool *to = (bool *)(void *)((char *)scalar[lane] + s->offset);
        for (uint32_t i = 0; i < s->count; ++i) {
            to[i] = words[i].lane[lane] != 0;
        }
    }
}

void hil_lanes_unpack(const hil_layout_t *layout, const void *lanes, void *const scalar[HIL_LANES]) {
    for (size_t i = 0; i < layout->count; ++i) {
        const hil_stretch_t *s = &layout->scalar[i];
        const char *from = at(lanes, layout->lanes[i].offset);
        if (s->kind == HIL_STRETCH_WORD) {
            unpack_words(s, from, scalar);
        } else if (s->kind == HIL_STRETCH_WIDE) {
            unpack_wides(s, from, scalar);
        } else if (s->kind == HIL_STRETCH_FLAG) {
            unpack_flags(s, from, scalar);
        } else {
            for (int lane = 0; lane < HIL_LANES; ++lane) {
                memcpy((char *)scalar[lane] + s->offset, from, s->size);
            }
        }
    }
}
