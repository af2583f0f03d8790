/* SPDX-License-Identifier: MIT */
#include "layout.h"

#include "layout_headers.h"

#define DEFINE(type) const hil_stretch_t hil_stretches_##type[] = {HIL_LAYOUT_##type(HIL_STRETCH)};
HIL_LAYOUT_TYPES(DEFINE)

/* A stretch has no holes. */
enum { BYTES_WORD = 4, BYTES_WIDE = 8, BYTES_FLAG = 1, BYTES_SAME = 0 };
#define CHECK(kind, type, first, last, count)                                                                          \
    _Static_assert(offsetof(type, last) == offsetof(type, first) + ((count)-1) * (size_t)BYTES_##kind,                 \
                   #type "." #first);
#define CHECK_TYPE(type) HIL_LAYOUT_##type(CHECK)
HIL_LAYOUT_TYPES(CHECK_TYPE)
