/* SPDX-License-Identifier: MIT */
/**
 * @file builtins.h
 * The two compiler builtins that the core uses, as Frama-C 25 can follow them. It knows neither; read as they stand,
 * their results could be anything. Included before every source (-include).
 */
#ifndef OMNI_PROOF_BUILTINS_H
#define OMNI_PROOF_BUILTINS_H

/* As an expression, because a call would not carry what a comparison says about |x| over to x. For -0 it gives 0, a NaN
 * stays one. */
#define __builtin_fabsf(x) ((x) == (x) ? ((x) > 0.0f ? (x) : 0.0f - (x)) : 0.0f / 0.0f)

/* Eva knows C's own. */
float sqrtf(float value);
#define __builtin_sqrtf sqrtf

#endif
