// SPDX-License-Identifier: MIT
#include "app/base/build_id.h"

#include "omni/version_gen.h"

namespace omni {

const BuildId build_id = {
    OMNI_GIT_HASH,
    uint32_t{OMNI_VERSION_MAJOR} << 24 | uint32_t{OMNI_VERSION_MINOR} << 16 | uint32_t{OMNI_VERSION_PATCH} << 8,
    OMNI_GIT_DIRTY != 0,
};

} // namespace omni
