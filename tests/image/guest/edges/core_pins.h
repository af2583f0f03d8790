/* SPDX-License-Identifier: MIT */
/* In the place of Teensyduino's: encoders.h asks only for the type of a port's registers. */
#pragma once

#include <stdint.h>

volatile uint32_t *portOutputRegister(uint8_t pin);
