// SPDX-License-Identifier: MIT
/// @file encoders_wiring.h  Which decoder counts which wheel's encoder: decided at compile time.
///
/// The processor has four quadrature decoders (ENC1..4). They see a pin only through crossbar XBAR1 (i.MX RT1060
/// reference manual, chapters "External Signals and Pin Multiplexing" and "Inter-Peripheral Crossbar Switch A"). Pins 0
/// and 5 share one of the crossbar's inputs. Every other pin is counted by pin-change interrupts.
///
/// The same rules in Python, for `omni robots check`: shared/generate/omni_schema/encoder_plan.py.
#pragma once

#include <cstddef>
#include <cstdint>

#include "omni/types.h"

namespace omni {

/// A pin's crossbar input.
struct XbarPin {
    uint8_t pin;
    uint8_t input; ///< XBAR1_IN number
    uint8_t mux;   ///< alternative function of the pad
    uint8_t daisy; ///< value of the input's SELECT_INPUT register
};

constexpr XbarPin xbar_pins[] = {{0, 17, 1, 1},  {1, 16, 1, 0},  {2, 6, 3, 0},   {3, 7, 3, 0},
                                 {4, 8, 3, 0},   {5, 17, 3, 0},  {7, 15, 1, 1},  {8, 14, 1, 1},
                                 {30, 23, 1, 0}, {31, 22, 1, 0}, {32, 10, 1, 0}, {33, 9, 3, 0}};

/// @return the pin's crossbar input, or nullptr if it has none.
constexpr const XbarPin *find_xbar_pin(uint8_t pin) {
    for (const XbarPin &candidate : xbar_pins) {
        if (candidate.pin == pin) {
            return &candidate;
        }
    }
    return nullptr;
}

/// Error of a wiring.
enum class EncoderProblem : uint8_t {
    none,
    no_pins,      ///< the robot file gives no pins
    no_way_in,    ///< hardware is demanded for a pin without a crossbar input
    shared_input, ///< hardware is demanded for two pins that share a crossbar input
};

struct EncoderChannel {
    static constexpr uint8_t by_interrupt = 0xFF;
    uint8_t pin_a = 0;
    uint8_t pin_b = 0;
    uint8_t unit = by_interrupt; ///< 0..3: ENC1..4
};

struct EncoderPlan {
    uint8_t wheels = 0;
    EncoderProblem problem = EncoderProblem::none;
    EncoderChannel wheel[OMNI_MAX_WHEELS];
};

constexpr uint8_t encoder_no_pin = 0xFF;

/// @return none if a hardware decoder can count this pair of pins beside those planned already.
constexpr EncoderProblem hardware_problem(const EncoderPlan &plan, uint8_t pin_a, uint8_t pin_b) {
    const XbarPin *const a = find_xbar_pin(pin_a);
    const XbarPin *const b = find_xbar_pin(pin_b);
    if (a == nullptr || b == nullptr) {
        return EncoderProblem::no_way_in;
    }
    bool shared = a->input == b->input;
    for (const EncoderChannel &other : plan.wheel) {
        if (other.unit == EncoderChannel::by_interrupt) {
            continue;
        }
        const uint8_t taken[] = {find_xbar_pin(other.pin_a)->input, find_xbar_pin(other.pin_b)->input};
        for (const uint8_t input : taken) {
            shared = shared || a->input == input || b->input == input;
        }
    }
    return shared ? EncoderProblem::shared_input : EncoderProblem::none;
}

/// Assign the decoders: to wheels that demand one first, then to those that could use one.
/// @param pins A and B per wheel. @param wanted an enum with automatic, hardware, interrupt per wheel.
template <typename Decoder, size_t wheels>
constexpr EncoderPlan plan_encoders(const uint8_t (&pins)[wheels][2], const Decoder (&wanted)[wheels]) {
    static_assert(wheels <= OMNI_MAX_WHEELS, "there are only four hardware decoders");
    EncoderPlan plan;
    plan.wheels = wheels;
    uint8_t units = 0;
    const Decoder turns[] = {Decoder::hardware, Decoder::automatic, Decoder::interrupt};
    for (const Decoder turn : turns) {
        for (size_t i = 0; i < wheels; ++i) {
            if (wanted[i] != turn) {
                continue;
            }
            const bool missing = pins[i][0] == encoder_no_pin || pins[i][1] == encoder_no_pin;
            const EncoderProblem problem =
                missing ? EncoderProblem::no_pins : hardware_problem(plan, pins[i][0], pins[i][1]);
            plan.wheel[i].pin_a = pins[i][0];
            plan.wheel[i].pin_b = pins[i][1];
            if (problem == EncoderProblem::none && turn != Decoder::interrupt) {
                plan.wheel[i].unit = units++;
            } else if (missing || turn == Decoder::hardware) {
                plan.problem = problem;
            }
        }
    }
    return plan;
}

} // namespace omni
