// SPDX-License-Identifier: MIT
/// @file estimators.cpp  Runs the filters of one candidate. Usage: estimators NAME STEPS [ROUNDS]. It prints the least
/// cost of a step over the rounds, and the numbers of the last state. The cost is in ns here, in instructions on the
/// emulated Cortex-M7.
#include <cstdio>
#include <cstdlib>
#include <cstring>

#include "estimators.h"
#include "stopwatch.h"

namespace {

constexpr uint32_t most_steps = 20000;
bench_input_t inputs[most_steps];

struct Candidate {
    const char *name;
    bench_run_t *run;
};

constexpr Candidate candidates[] = {
    {"core_pose", core_pose},   {"core_motor", core_motor},   {"tiny_pose", tiny_pose},
    {"tiny_motor", tiny_motor},
#ifdef BENCH_EIGEN
    {"eigen_pose", eigen_pose}, {"eigen_motor", eigen_motor}, {"eigen_late_pose", eigen_late_pose},
#endif
};

/// Uniform in [-1, 1); Numerical Recipes' constants.
float draw(uint32_t &state) {
    state = 1664525u * state + 1013904223u;
    return static_cast<float>(static_cast<int32_t>(state)) * 0x1p-31f;
}

/// Four wheels at 45, 135, 225, 315 degrees; a motor of the report's Table 4, exactly discretised for 20 ms.
bench_model_t make_model() {
    bench_model_t model = {};
    model.step_s = 0.02f;
    model.radius_m = 0.03275f;
    model.distance_m = 0.195f;
    const float half = 0.70710678f * model.radius_m / 2.0f;
    const float turn = model.radius_m / (4.0f * model.distance_m);
    const float to_body[3][BENCH_WHEELS] = {
        {-half, -half, half, half}, {half, -half, -half, half}, {turn, turn, turn, turn}};
    std::memcpy(model.to_body, to_body, sizeof to_body);
    const float q[3] = {8e-7f, 8e-7f, 8e-7f};
    const float r[3] = {2.5e-3f, 2.5e-3f, 2.5e-3f};
    std::memcpy(model.pose_q, q, sizeof q);
    std::memcpy(model.fix_r, r, sizeof r);
    const float a[2][2] = {{0.81855f, 0.016417f}, {-0.0016417f, 0.81872f}};
    std::memcpy(model.motor_a, a, sizeof a);
    model.motor_b[0] = 0.0017463f;
    model.motor_b[1] = 0.18127f;
    model.motor_q[0] = 7.2e-4f;
    model.motor_q[1] = 6.4e-3f;
    model.motor_r = 0.1f;
    return model;
}

/// A robot that wanders about the origin, turning to and fro, so that its heading never comes round.
void make_inputs(uint32_t steps) {
    uint32_t state = 1;
    float heading = 0.0f;
    for (uint32_t k = 0; k < steps; ++k) {
        const float turning = (k / 50) % 2 == 0 ? 0.06f : -0.06f;
        heading += turning * 0.03275f / 0.195f;
        for (float &turned : inputs[k].turned_rad) {
            turned = turning + 0.02f * draw(state);
        }
        inputs[k].fix[0] = 0.05f * draw(state);
        inputs[k].fix[1] = 0.05f * draw(state);
        inputs[k].fix[2] = heading + 0.05f * draw(state);
        inputs[k].voltage_V = 3.0f * draw(state);
        inputs[k].speed_rad_s = draw(state);
    }
}

void print(const char *name, const float *values, int count) {
    std::printf("%s", name);
    for (int i = 0; i < count; ++i) {
        std::printf(" %.9g", static_cast<double>(values[i]));
    }
    std::printf("\n");
}

} // namespace

int main(int argc, char **argv) {
    const uint32_t steps = argc > 2 ? static_cast<uint32_t>(std::atoi(argv[2])) : 0;
    const int rounds = argc > 3 ? std::atoi(argv[3]) : 1;
    if (steps == 0 || steps > most_steps) {
        return 2;
    }
    const bench_model_t model = make_model();
    make_inputs(steps);
    stopwatch::start();
    for (const Candidate &candidate : candidates) {
        if (std::strcmp(candidate.name, argv[1]) != 0) {
            continue;
        }
        bench_output_t output = {};
        uint32_t least = UINT32_MAX;
        for (int round = 0; round < rounds; ++round) {
            const uint64_t begin = stopwatch::now();
            candidate.run(&model, inputs, steps, &output);
            const uint32_t taken = stopwatch::between(begin, stopwatch::now());
            least = taken < least ? taken : least;
        }
        const float cost = static_cast<float>(least) / static_cast<float>(steps);
        print("cost", &cost, 1);
        print("pose", output.pose, 3);
        print("pose_p", &output.pose_p[0][0], 9);
        print("motor", output.motor, 2);
        print("motor_p", &output.motor_p[0][0], 4);
        return 0;
    }
    return 2;
}
