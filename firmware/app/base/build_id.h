// SPDX-License-Identifier: MIT
/// @file build_id.h  Version and commit of the build.
#pragma once

#include <cstdint>

namespace omni {

struct BuildId {
    uint64_t commit;  ///< its first 64 bits; 0: built outside a git work tree
    uint32_t version; ///< major, minor, patch from the highest byte on, as in AUTOPILOT_VERSION; the lowest is 0
    bool changed;     ///< tracked files differed from that commit
};

/// In a separate object file, so that images of different commits differ in these bytes only.
extern const BuildId build_id;

} // namespace omni
