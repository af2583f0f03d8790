// SPDX-License-Identifier: MIT
/// @file mavlink_types.h  The generated dialect: payload structs, message ids and enums. Nothing else of the C library
/// is used: framing is in codec.h. The structs have wire order; every target is little-endian.
#pragma once

#include <cstddef>
#include <cstdint>

#include "omni/familiar_messages.h"
#include "omni/mavlink.h"
