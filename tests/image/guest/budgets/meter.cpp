// SPDX-License-Identifier: MIT
#include "meter.h"

// The host counts.
namespace meter {

void start() {}

uint32_t timer() {
    return 0;
}

uint32_t between(uint32_t, uint32_t) {
    return 0;
}

} // namespace meter
