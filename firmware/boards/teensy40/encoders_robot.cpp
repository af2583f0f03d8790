// SPDX-License-Identifier: MIT
#include "boards/teensy40/encoders.h"
#include "omni/wiring_gen.h"

namespace omni {
namespace {

constexpr EncoderPlan plan = plan_encoders(wiring::encoder_pins, wiring::encoder_decoder);

static_assert(plan.problem != EncoderProblem::no_pins,
              "robot file: give wiring.encoder_pins, the Teensy pins [A, B] of every wheel's encoder");
static_assert(
    plan.problem != EncoderProblem::no_way_in,
    "robot file: wiring.encoder_decoder asks for hardware, which only pins 0 1 2 3 4 5 7 8 30 31 32 33 reach; "
    "move the wire to one of them or use \"auto\"");
static_assert(plan.problem != EncoderProblem::shared_input,
              "robot file: wiring.encoder_decoder asks for hardware on pins 0 and 5, which share one input; "
              "move one of the wires or use \"auto\"");

} // namespace

const EncoderPlan &robot_encoder_plan() {
    return plan;
}

} // namespace omni
