/* SPDX-License-Identifier: MIT */
/**
 * @file invariant.h
 * Assertions of internal invariants: conditions that hold for any input after the core's input checks.
 *
 * OMNI_INVARIANT(condition) traps if the condition is false and OMNI_ASSERTS is defined: in tests, sanitizers, fuzzers
 * and the parity gate on the PC (cmake/flags.cmake). Otherwise it compiles to nothing: on the robot the tick continues,
 * and gate_actuation() checks its outputs. Conditions on numbers use omni_all (omni/numbers.h).
 */
#ifndef OMNI_INVARIANT_H
#define OMNI_INVARIANT_H

#ifdef OMNI_ASSERTS
#define OMNI_INVARIANT(condition) ((condition) ? (void)0 : __builtin_trap())
#else
#define OMNI_INVARIANT(condition) ((void)0)
#endif

#endif
