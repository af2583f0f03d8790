// SPDX-License-Identifier: MIT
/// @file ism330dhcx.h  The gyro in an ISM330DHCX (ST data sheet DS13012): see lsm6dso.h.
#pragma once

#include "app/drivers/lsm6dso.h"

namespace omni::ism330dhcx {

inline constexpr GyroRegisters registers = lsm6dso::with_identity(0x6B);

} // namespace omni::ism330dhcx
