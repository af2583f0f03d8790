// SPDX-License-Identifier: MIT
/// @file app_shim.cpp  The whole firmware on a board made of memory, in simulated time. Port 1 is USB, the last one a
/// serial line with a baud rate: the radio. The storage has a Teensy's size and counts what wears it.
#include <algorithm>
#include <cstring>
#include <deque>
#include <optional>

#include "app/app.h"
#include "app/drivers/icm42688.h"
#include "app/drivers/register_gyro.h"
#include "gyro_bus.h"

extern "C" {
#include "hil_sim/random.h"
}

using namespace omni;

namespace {

constexpr size_t storage_size = 1080;

struct FakeClock final : Clock {
    uint64_t time_us = 0;
    uint64_t now_us() override { return time_us; }
    uint64_t stopwatch_ns() override { return time_us * 1000; }
};

struct FakeEncoders final : Encoders {
    uint8_t read(int32_t *counts) override {
        std::fill(counts, counts + OMNI_MAX_WHEELS, 0);
        return 0xF;
    }
    void errors(uint32_t *errors) override { std::fill(errors, errors + OMNI_MAX_WHEELS, 0u); }
};

/// A chip that keeps what is written.
struct FakeBus final : I2cBus {
    uint8_t registers[256] = {};
    uint8_t pointer = 0;
    bool submitted = false;
    bool submit(const I2cTransaction *batch, size_t count) override {
        for (size_t i = 0; i < count; ++i) {
            for (size_t at = 0; at < batch[i].write_length; ++at) {
                if (at == 0) {
                    pointer = batch[i].write[0];
                } else {
                    registers[static_cast<uint8_t>(pointer + at - 1)] = batch[i].write[at];
                }
            }
        }
        submitted = true;
        return true;
    }
    I2cStatus poll(uint8_t *read) override {
        read[0] = registers[pointer];
        const bool done = submitted;
        submitted = false;
        return done ? I2cStatus::done : I2cStatus::idle;
    }
    void recover() override {}
};

struct FakeOutputEnable final : OutputEnable {
    bool wired() override { return false; }
    void set(bool) override {}
};

struct FakePort final : SerialPort {
    static constexpr size_t capacity = 1024;
    std::deque<uint8_t> in, line, out;
    bool paced = false;
    uint32_t baud = 0;
    double credit = 0.0;
    uint32_t connection = 1;

    size_t read(uint8_t *data, size_t room) override {
        const size_t count = std::min(room, in.size());
        std::copy_n(in.begin(), count, data);
        in.erase(in.begin(), in.begin() + static_cast<std::ptrdiff_t>(count));
        return count;
    }
    size_t write_space() override { return paced ? capacity - line.size() : 65536; }
    bool write(const uint8_t *data, size_t length) override {
        if (length > write_space()) {
            return false;
        }
        auto &queue = paced ? line : out;
        queue.insert(queue.end(), data, data + length);
        return true;
    }
    uint32_t session() override { return connection; }
    bool radio = false;
    bool is_radio() override { return radio; }
    bool has_baud() override { return paced; }
    void set_baud(uint32_t bits_s) override { baud = bits_s; }
    /// One tick of the line: ten bits are a byte.
    void drain() {
        credit = line.empty() ? 0.0 : credit + baud * 1e-4;
        while (credit >= 1.0 && !line.empty()) {
            out.push_back(line.front());
            line.pop_front();
            credit -= 1.0;
        }
    }
};

struct FakeStorage final : Storage {
    uint8_t bytes[storage_size];
    uint32_t writes[storage_size] = {};
    uint32_t calls = 0;
    bool broken = false;
    size_t size() override { return storage_size; }
    bool read(size_t offset, uint8_t *data, size_t length) override {
        if (offset + length > storage_size) {
            return false;
        }
        std::memcpy(data, bytes + offset, length);
        return true;
    }
    bool write(size_t offset, const uint8_t *data, size_t length) override {
        if (broken || offset + length > storage_size) {
            return false;
        }
        ++calls;
        for (size_t i = 0; i < length; ++i) { // as the core's emulation: a byte that stays wears nothing
            writes[offset + i] += bytes[offset + i] != data[i] ? 1 : 0;
            bytes[offset + i] = data[i];
        }
        return true;
    }
};

struct FakeWatchdog final : Watchdog {
    void feed() override {}
    ResetCause reset_cause() override { return ResetCause::power_on; }
    const char *crash_line(size_t) override { return nullptr; }
    void reset() override {}
};

struct Robot {
    FakeClock clock;
    FakeEncoders encoders;
    FakeBus bus;
    FakeOutputEnable output_enable;
    FakePort ports[Board::max_ports];
    FakeStorage storage;
    FakeWatchdog watchdog;
    GyroBus gyro_bus;
    std::optional<RegisterGyro> gyro; ///< none: not on this board
    double gyro_rates[HIL_GYRO_AXES] = {};
    Board board;
    std::optional<App> app;
    bool lockstep = false;
    uint32_t radio = 1; ///< port
    omni_real_t own[OMNI_PARAM_COUNT] = {};
    alignas(8) uint8_t burst_memory[64 * 1024];

    void boot() {
        clock.time_us = 0;
        if (gyro) {
            gyro.emplace(gyro_bus, gyro_bus.chip.address, icm42688::registers);
            hil_gyro_chip_reset(&gyro_bus.chip, HIL_GYRO_ICM42688, gyro_bus.chip.address);
        }
        board.gyro_chip = gyro ? &*gyro : nullptr;
        app.emplace(board, lockstep);
    }
};

} // namespace

extern "C" {

Robot *robot_new(const uint8_t *image, int lockstep, uint32_t radio) {
    auto *robot = new Robot;
    Board &board = robot->board;
    board.clock = &robot->clock;
    board.burst_memory = robot->burst_memory;
    board.burst_bytes = sizeof robot->burst_memory;
    board.encoders = &robot->encoders;
    board.i2c = &robot->bus;
    board.output_enable = &robot->output_enable;
    board.storage = &robot->storage;
    board.watchdog = &robot->watchdog;
    board.port_count = radio + 1;
    for (size_t i = 0; i < board.port_count; ++i) {
        board.ports[i] = &robot->ports[i];
    }
    robot->ports[radio].radio = true;
    robot->radio = radio;
    std::copy_n(omni_builtin_robots[omni_builtin_robot_find("three_wheel")].values, OMNI_PARAM_COUNT, robot->own);
    board.robot_values = robot->own;
    robot->ports[radio].paced = true;
    std::memcpy(robot->storage.bytes, image, storage_size);
    robot->lockstep = lockstep != 0;
    robot->boot();
    return robot;
}

void robot_delete(Robot *robot) {
    delete robot;
}

/// As another robot's image would: from the next boot on. @return 0 if there is no such parameter.
int robot_set_own(Robot *robot, const char *name, float value) {
    const int32_t index = omni_param_find(name);
    if (index >= 0) {
        robot->own[index] = value;
    }
    return index >= 0 ? 1 : 0;
}

void robot_reboot(Robot *robot) {
    robot->boot();
}

/// Ticks of 1 ms; in lockstep only the background and the line go on.
void robot_run(Robot *robot, uint32_t ticks) {
    for (uint32_t i = 0; i < ticks; ++i) {
        robot->clock.time_us += 1000;
        double seen[HIL_GYRO_AXES];
        for (uint32_t axis = 0; axis < HIL_GYRO_AXES; ++axis) {
            seen[axis] = robot->gyro_rates[axis] + 1e-3 * hil_normal(1, axis, robot->clock.time_us);
        }
        hil_gyro_chip_sense(&robot->gyro_bus.chip, robot->clock.time_us, seen);
        robot->app->tick();
        robot->app->background();
        robot->ports[robot->radio].drain();
    }
    if (robot->app->reboot_wanted()) {
        robot->boot();
    }
}

/// Put a gyro's chip on the board: from the next boot on.
void robot_add_gyro(Robot *robot) {
    robot->gyro.emplace(robot->gyro_bus, robot->gyro_bus.chip.address, icm42688::registers);
}

/// @param rates about the chip's axes; white noise is added.
void robot_turn_gyro(Robot *robot, const double *rates) {
    std::copy_n(rates, HIL_GYRO_AXES, robot->gyro_rates);
}

hil_gyro_faults_t *robot_gyro_faults(Robot *robot) {
    return &robot->gyro_bus.chip.faults;
}

void robot_hold_gyro(Robot *robot, int held) {
    robot->gyro_bus.held = held != 0;
}

void robot_background(Robot *robot) {
    robot->app->background();
}

void robot_write(Robot *robot, uint32_t port, const uint8_t *data, uint32_t length) {
    auto &queue = robot->ports[port].in;
    queue.insert(queue.end(), data, data + length);
}

uint32_t robot_read(Robot *robot, uint32_t port, uint8_t *data, uint32_t room) {
    auto &queue = robot->ports[port].out;
    const auto count = std::min<size_t>(room, queue.size());
    std::copy_n(queue.begin(), count, data);
    queue.erase(queue.begin(), queue.begin() + static_cast<std::ptrdiff_t>(count));
    return static_cast<uint32_t>(count);
}

/// Whether the chip drives any of its channels.
int robot_driven(Robot *robot) {
    constexpr size_t first = 6, channels = 16, high_byte_off = 3, full = 0x10;
    int driven = 0;
    for (size_t i = 0; i < channels; ++i) {
        const uint8_t *channel = robot->bus.registers + first + 4 * i;
        const bool some = (channel[1] | channel[2] | channel[3]) != 0;
        driven |= some && (channel[high_byte_off] & full) == 0 ? 1 : 0;
    }
    return driven;
}

uint32_t robot_baud(Robot *robot) {
    return robot->ports[robot->radio].baud;
}

void robot_break_storage(Robot *robot, int broken) {
    robot->storage.broken = broken != 0;
}

/// @param image out, @param writes out: how often each byte has changed. @return write calls
uint32_t robot_storage(Robot *robot, uint8_t *image, uint32_t *writes) {
    std::memcpy(image, robot->storage.bytes, storage_size);
    std::memcpy(writes, robot->storage.writes, sizeof robot->storage.writes);
    return robot->storage.calls;
}
}
