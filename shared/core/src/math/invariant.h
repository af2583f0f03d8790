/* SPDX-License-Identifier: MIT */
/**
 * @file invariant.h
 * Statements that hold whatever comes in. The core checks its inputs; these say what the code relies on afterwards.
 *
 * OMNI_INVARIANT(condition) ends the program where the condition does not hold. It does so if OMNI_ASSERTS is defined:
 * in tests, sanitizers, fuzzers and the parity gate on the PC (cmake/flags.cmake). Otherwise nothing is computed: on
 * the robot a tick goes on, and seals what it gives out. A condition on numbers goes into omni_all (omni/numbers.h).
 */
#ifndef OMNI_INVARIANT_H
#define OMNI_INVARIANT_H

#ifdef OMNI_ASSERTS
#define OMNI_INVARIANT(condition) ((condition) ? (void)0 : __builtin_trap())
#else
#define OMNI_INVARIANT(condition) ((void)0)
#endif

#endif
