// SPDX-License-Identifier: MIT
// Teensyduino's vector table, for the tests.
#pragma once

enum IRQ_NUMBER_t { IRQ_TEMPERATURE_PANIC = 64 };
#define NVIC_NUM_INTERRUPTS 160
extern "C" void (*volatile _VectorsRam[NVIC_NUM_INTERRUPTS + 16])();
