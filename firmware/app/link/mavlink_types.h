// SPDX-License-Identifier: MIT
/// @file mavlink_types.h  The generated dialect: payload structs, message ids and enums. Of the C library
/// nothing else is used: framing is in codec.h. The structs have wire order; all targets are little-endian.
#pragma once

#include <cstddef>
#include <cstdint>

#include "omni/familiar_messages.h"
#include "omni/mavlink.h"
