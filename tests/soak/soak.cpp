// SPDX-License-Identifier: MIT
/// @file soak.cpp  Days on end. usage: soak hours WORLD PARAMETERS STATE ROBOT | soak jumps WORLD PARAMETERS DAYS ROBOT
///
/// `hours` does the next simulated hour. It goes on from STATE (a file; begun anew if it is not there), prints one line
/// of JSON and writes STATE back. `jumps` lets the robot's clock cross every wrap of 32 bits in so many days, and
/// drives across each of them. WORLD holds a hil_world_config_t, PARAMETERS lines of NAME VALUE, ROBOT is a built-in
/// robot's name: tests/soak/soak.py writes them.
#include <malloc.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <string>
#include <utility>
#include <vector>

#include "app/base/core.h"
#include "bench.h"
#include "check.h"

namespace soak {
namespace {

using fuzz::check;
using Values = std::vector<std::pair<std::string, float>>;

/// The calendar begins in 2026 [10 us since 2015].
constexpr uint64_t begin_time = 11ull * 365 * 24 * 3600 * 100'000;

bool read_file(const char *path, void *to, size_t size) {
    std::FILE *file = std::fopen(path, "rb");
    if (file == nullptr) {
        return false;
    }
    const bool whole = std::fread(to, 1, size, file) == size && std::fgetc(file) == EOF;
    std::fclose(file);
    check(whole, "a file is as long as what it holds", static_cast<long>(size));
    return true;
}

void write_file(const std::string &path, const void *from, size_t size) {
    const std::string part = path + ".part";
    std::FILE *file = std::fopen(part.c_str(), "wb");
    const bool written = file != nullptr && std::fwrite(from, 1, size, file) == size && std::fclose(file) == 0;
    check(written && std::rename(part.c_str(), path.c_str()) == 0, "the state is kept");
}

Values read_values(const char *path) {
    Values values;
    std::FILE *file = std::fopen(path, "r");
    check(file != nullptr, "the parameters can be read");
    char name[32];
    float value = 0.0f;
    while (std::fscanf(file, "%31s %f", name, &value) == 2) {
        values.emplace_back(name, value);
    }
    std::fclose(file);
    return values;
}

State new_state(const char *world) {
    State state;
    state.signing_time = begin_time;
    std::memset(state.storage, 0xFF, sizeof state.storage);
    hil_world_config_t config;
    check(read_file(world, &config, sizeof config), "the world can be read");
    char why[160] = "";
    if (hil_world_init(&state.world, &config, why, sizeof why) != HIL_OK) {
        std::printf("%s\n", why);
        fuzz::broken("the world makes sense", 0);
    }
    return state;
}

/// A robot out of its box: key, parameters, everything kept.
void prepare(Bench &bench, const Values &values) {
    bench.station.set_key();
    bench.run(0.1);
    for (const auto &[name, value] : values) {
        bench.station.set_parameter(usb, name.c_str(), value);
        bench.run(0.01);
    }
    bench.command(usb, MAV_CMD_PREFLIGHT_STORAGE, 1.0f);
}

void stop_and_go(Bench &bench, size_t stopper) {
    bench.station.expect_stop(true);
    bench.command(stopper, MAV_CMD_OMNI_ESTOP, 1.0f);
    bench.run(1.0);
    bench.station.expect_stop(false);
    check(bench.station.state == MAV_STATE_EMERGENCY && !bench.robot.bench_moves(), "an emergency stop holds");
    bench.command(usb, MAV_CMD_OMNI_ESTOP, 0.0f);
    bench.run(0.1);
    bench.start(1 - stopper);
}

void save_and_go(Bench &bench) {
    bench.disarm(radio);
    bench.command(usb, MAV_CMD_PREFLIGHT_STORAGE, 1.0f);
    bench.command(radio, MAV_CMD_PREFLIGHT_STORAGE, 0.0f);
    bench.start(radio);
}

/// A minute while driving: a gain changes, lists are asked for, the robot must go on.
void minute(Bench &bench, unsigned number) {
    bench.station.set_parameter(number % 2, "ISMC_LAM_XY", number % 3 == 0 ? 4.0f : 8.0f);
    if (number % 10 == 9) {
        bench.station.list_parameters(number % 4 < 2 ? usb : radio);
    }
    bench.command(usb, MAV_CMD_REQUEST_MESSAGE, MAVLINK_MSG_ID_OMNI_SIGNING);
    for (int second = 0; second < 60; ++second) {
        bench.run(1.0);
        check(bench.armed(), "the robot drives on (MAV_STATE)", bench.station.state);
    }
}

size_t heap_in_use() {
    return mallinfo2().uordblks;
}

void print_hour(const Bench &bench, uint64_t hour, uint64_t calendar_begin) {
    const Station &said = bench.station;
    std::printf(
        "{\"hour\": %llu, \"ticks\": %llu, \"distance_m\": %.3f, \"error_m_max\": %.6f, \"frames_usb\": %llu, "
        "\"frames_radio\": %llu, \"heartbeats_usb\": %llu, \"parameters\": %llu, \"acknowledged\": %llu, "
        "\"overruns\": %u, \"i2c_errors\": %u, \"rx_errors\": %u, \"signing_refused\": %u, \"signing_ahead_ms\": %.1f, "
        "\"heap\": %zu, \"calendar_s\": %.1f}\n",
        static_cast<unsigned long long>(hour), static_cast<unsigned long long>(bench.ticks()), bench.distance_m(),
        bench.error_m_max, static_cast<unsigned long long>(said.frames[usb]),
        static_cast<unsigned long long>(said.frames[radio]), static_cast<unsigned long long>(said.heartbeats[usb]),
        static_cast<unsigned long long>(said.parameters), static_cast<unsigned long long>(said.acknowledged),
        said.status.overruns, said.status.i2c_errors, said.status.rx_errors, said.health.signing_refused,
        said.signing_ahead_ms, heap_in_use(), static_cast<double>(said.signing_time() - calendar_begin) * 1e-5);
}

void hour(const char *world, const Values &values, const char *path, const char *robot) {
    State state = new_state(world);
    read_file(path, &state, sizeof state);
    const uint64_t calendar_begin = state.signing_time;
    Bench bench(robot, state);
    bench.run(1.0);
    if (state.hour == 0) {
        prepare(bench, values);
    }
    bench.start(radio);
    for (unsigned number = 0; number < 59; ++number) {
        minute(bench, number);
        if (number % 20 == 19) {
            stop_and_go(bench, number % 40 == 39 ? usb : radio);
        } else if (number % 20 == 9) {
            save_and_go(bench);
        }
    }
    constexpr double hour_s = 3600.0;
    bench.run(hour_s - 5.0 - static_cast<double>(bench.ticks()) * 1e-3);
    bench.disarm(usb);
    bench.run(2.0);
    print_hour(bench, state.hour, calendar_begin);
    const uint64_t boots = bench.robot.boots;
    bench.station.command(radio, MAV_CMD_PREFLIGHT_REBOOT_SHUTDOWN, 1.0f);
    bench.run(hour_s - static_cast<double>(bench.ticks()) * 1e-3);
    check(bench.robot.boots == boots + 1, "the robot reboots when asked to");
    const State next = bench.state(state.hour + 1);
    write_file(path, &next, sizeof next);
}

// ---- Clocks that wrap

/// When something of 32 bits wraps or changes its sign in so many days [us since boot]: microseconds and milliseconds.
std::vector<uint64_t> crossings(uint64_t days) {
    std::vector<uint64_t> all;
    const uint64_t end = days * 24 * 3600 * 1'000'000;
    for (uint64_t us = uint64_t{1} << 31; us < end; us += uint64_t{1} << 31) {
        all.push_back(us);
    }
    for (uint64_t ms = uint64_t{1} << 31; ms * 1000 < end; ms += uint64_t{1} << 31) {
        all.push_back(ms * 1000);
    }
    all.push_back(end);
    std::sort(all.begin(), all.end());
    return all;
}

/// Nobody is heard any more: the robot stops by itself, across the wrap, as soon as it should.
void fall_silent(Bench &bench, double most_s) {
    bench.station.expect_stop(true);
    bench.beats = false;
    bench.run(most_s);
    check(bench.station.state == MAV_STATE_CRITICAL, "silence stops the robot across a wrap (MAV_STATE)",
          bench.station.state);
    bench.beats = true;
    bench.disarm(usb);
    bench.station.expect_stop(false);
}

/// From three seconds before to three seconds after.
void cross(Bench &bench, uint64_t at_us, bool silent) {
    constexpr uint64_t span_us = 3'000'000;
    const uint64_t now = bench.robot.clock.us;
    if (at_us > now + 2 * span_us) {
        bench.jump(at_us - now - span_us);
    }
    bench.run(1.0);
    bench.start(at_us / 1'000'000 % 2 == 0 ? usb : radio);
    const uint64_t usb_before = bench.station.frames[usb];
    const uint64_t beats_before = bench.station.heartbeats[usb];
    constexpr double drive_s = 4.0;
    bench.run(silent ? 1.0 : drive_s);
    check(bench.armed(), "the robot drives across a wrap of the clock (s)", static_cast<long>(at_us / 1'000'000));
    if (silent) {
        fall_silent(bench, 4.0);
        return;
    }
    const uint64_t frames = bench.station.frames[usb] - usb_before;
    const uint64_t beats = bench.station.heartbeats[usb] - beats_before;
    check(frames >= 200, "telemetry goes on across a wrap (frames)", static_cast<long>(frames));
    check(beats >= 3 && beats <= 6, "heartbeats go on across a wrap (number)", static_cast<long>(beats));
    bench.disarm(radio);
}

void jumps(const char *world, const Values &values, uint64_t days, const char *robot) {
    Bench bench(robot, new_state(world));
    bench.run(1.0);
    prepare(bench, values);
    uint64_t number = 0;
    for (const uint64_t at_us : crossings(days)) {
        cross(bench, at_us, ++number % 8 == 0);
        if (number % 64 == 0) {
            bench.command(usb, MAV_CMD_PREFLIGHT_STORAGE, 1.0f);
        }
    }
    std::printf("{\"days\": %.3f, \"crossings\": %llu, \"ticks\": %llu, \"distance_m\": %.3f, \"error_m_max\": %.6f, "
                "\"acknowledged\": %llu, \"signing_refused\": %u, \"heap\": %zu}\n",
                static_cast<double>(bench.robot.clock.us) / 86400e6, static_cast<unsigned long long>(number),
                static_cast<unsigned long long>(bench.ticks()), bench.distance_m(), bench.error_m_max,
                static_cast<unsigned long long>(bench.station.acknowledged), bench.station.health.signing_refused,
                heap_in_use());
}

} // namespace
} // namespace soak

int main(int argc, char **argv) {
    const std::string mode = argc == 6 ? argv[1] : "";
    if (mode == "hours") {
        soak::hour(argv[2], soak::read_values(argv[3]), argv[4], argv[5]);
        return 0;
    }
    if (mode == "jumps") {
        soak::jumps(argv[2], soak::read_values(argv[3]), std::strtoull(argv[4], nullptr, 10), argv[5]);
        return 0;
    }
    std::fprintf(stderr, "usage: %s hours WORLD PARAMETERS STATE ROBOT | jumps WORLD PARAMETERS DAYS ROBOT\n", argv[0]);
    return 2;
}
