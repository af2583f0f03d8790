// SPDX-License-Identifier: MIT
/// @file encoders.h  Wheel encoders on a Teensy 4.0: hardware decoders where the pins reach one, pin-change interrupts
/// elsewhere.
///
/// Load of the interrupts: 25 rad/s at 10000 counts per revolution are 40 k edges per second and wheel. One interrupt
/// is about 60 instructions with one such wheel and 90 with four; make tick-cycles estimates the cycles
/// (docs/checks/performance.md).
///
/// Noise on a pin (a loose wire beside a motor's) may bring millions of edges per second, and they come before
/// everything else. So an encoder gets no more than `edge_limit` interrupts per tick. Beyond, its pins stay silent
/// until the next read(), which calls its count untrusted and counts an error. Four wheels at the limit take some 0.2
/// ms of each tick.
#pragma once

#include <core_pins.h>

#include <cstddef>
#include <cstdint>

#include "app/base/board.h"
#include "boards/teensy40/encoders_quadrature.h"
#include "boards/teensy40/encoders_wiring.h"

namespace omni {

/// The wiring that the robot file gave this build.
const EncoderPlan &robot_encoder_plan();

/// One instance only: it owns the GPIO interrupt.
class Teensy40Encoders final : public Encoders {
public:
    explicit Teensy40Encoders(const EncoderPlan &plan = robot_encoder_plan()) : plan_(plan) {}

    /// Interrupts of one encoder per tick of 1 ms: 256000 edges per second, 160 rad/s at 10000 counts per revolution.
    static constexpr uint16_t edge_limit = 256;

    /// Set up pins, crossbar, decoders and the interrupt. Counts begin at 0.
    void begin();
    /// From the tick, once in each. A bit is missing for an encoder that went beyond the edge limit: edges were lost.
    uint8_t read(int32_t *counts) override;
    /// A hardware decoder reports only that some occurred since the last read(): at most one is counted per read().
    void errors(uint32_t *errors) override;
    /// A pin of an interrupt-counted encoder changed. Interrupt context.
    void pins_changed();

private:
    using Gpio = decltype(portOutputRegister(0)); ///< first register (DR) of a pin's port

    /// An encoder on plain pins.
    struct Watched {
        Gpio port[2]; ///< of A and B
        uint32_t mask[2];
        uint8_t wheel;
        QuadratureCounter counter;
        volatile uint16_t edges; ///< interrupts since the last read()
        volatile bool silent;    ///< its interrupts are masked; only read() ends that
    };

    void begin_hardware(const EncoderChannel &channel);
    void begin_interrupt(uint8_t wheel);
    static uint8_t levels(const Watched &watched);
    static void mask(const Watched &watched, bool masked);
    static void listen_again(Watched &watched);

    const EncoderPlan &plan_;
    Watched watched_[OMNI_MAX_WHEELS] = {};
    uint8_t watched_count_ = 0;
    uint32_t hardware_errors_[OMNI_MAX_WHEELS] = {};
};

} // namespace omni
