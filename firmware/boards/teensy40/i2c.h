// SPDX-License-Identifier: MIT
/// @file i2c.h  Asynchronous I2C masters of a Teensy 4.0. LPI2C1 (SDA pin 18, SCL pin 19) is the motors' PWM chip's.
/// LPI2C3 (SDA pin 17, SCL pin 16) is a gyro's. LPI2C4 (SDA pin 25, SCL pin 24) is the floor odometry
/// sensor's.
///
/// submit() turns a batch into the words of the master's command FIFO. An interrupt refills its four places, some ten
/// times for an update of three motors. Nothing waits: if an interrupt comes late, the master stretches SCL. A batch
/// that takes too long is given up by poll(), from the tick. recover() frees the bus by a 100 kHz timer, without
/// blocking.
#pragma once

#include <core_pins.h>
#include <IntervalTimer.h>

#include <cstddef>
#include <cstdint>

#include "app/base/board.h"
#include "boards/teensy40/i2c_bus_clear.h"
#include "boards/teensy40/i2c_timing.h"
#include "omni/wiring_gen.h"

namespace omni {

/// Since boot.
struct I2cCounters {
    uint32_t batches = 0;
    uint32_t nacks = 0;
    uint32_t arbitration_losses = 0; ///< a line did not follow: another master, a short, or a chip out of step
    uint32_t timeouts = 0;
    uint32_t recoveries = 0; ///< bus clears begun
    uint32_t scl_stuck = 0;  ///< bus clears that failed because SCL stays low
    uint32_t sda_stuck = 0;  ///< bus clears that failed because SDA stays low
    uint32_t last_us = 0;    ///< the last complete batch, from submit() to its STOP
    uint32_t longest_us = 0;
};

/// Each port's registers and wires. Known to the compiler, so that a second port costs the first one nothing.
struct MotorsPort {
    static IMXRT_LPI2C_t &registers() { return IMXRT_LPI2C1; }
    static constexpr IRQ_NUMBER_t interrupt = IRQ_LPI2C1;
    static constexpr uint8_t sda_pin = 18;
    static constexpr uint8_t scl_pin = 19;
    static constexpr uint32_t mux = 3; ///< alternative of both pads that is the port
    static void open_clock() { CCM_CCGR2 = CCM_CCGR2 | CCM_CCGR2_LPI2C1(CCM_CCGR_ON); }
    static void select_inputs() {
        IOMUXC_LPI2C1_SDA_SELECT_INPUT = 1;
        IOMUXC_LPI2C1_SCL_SELECT_INPUT = 1;
    }
};

struct GyroPort {
    static IMXRT_LPI2C_t &registers() { return IMXRT_LPI2C3; }
    static constexpr IRQ_NUMBER_t interrupt = IRQ_LPI2C3;
    static constexpr uint8_t sda_pin = 17;
    static constexpr uint8_t scl_pin = 16;
    static constexpr uint32_t mux = 1;
    static void open_clock() { CCM_CCGR2 = CCM_CCGR2 | CCM_CCGR2_LPI2C3(CCM_CCGR_ON); }
    static void select_inputs() {
        IOMUXC_LPI2C3_SDA_SELECT_INPUT = 2;
        IOMUXC_LPI2C3_SCL_SELECT_INPUT = 2;
    }
};

struct FlowPort {
    static IMXRT_LPI2C_t &registers() { return IMXRT_LPI2C4; }
    static constexpr IRQ_NUMBER_t interrupt = IRQ_LPI2C4;
    static constexpr uint8_t sda_pin = 25;
    static constexpr uint8_t scl_pin = 24;
    static constexpr uint32_t mux = 0;
    static void open_clock() { CCM_CCGR6 = CCM_CCGR6 | CCM_CCGR6_LPI2C4_SERIAL(CCM_CCGR_ON); }
    static void select_inputs() {
        IOMUXC_LPI2C4_SDA_SELECT_INPUT = 1;
        IOMUXC_LPI2C4_SCL_SELECT_INPUT = 1;
    }
};

/// One instance for each port: it owns the interrupt. The tick and the interrupts here must have the same priority.
template <class Port>
class Teensy40I2cMaster final : public I2cBus {
public:
    static constexpr size_t max_batch = 9;

    explicit Teensy40I2cMaster(uint32_t speed_Hz = wiring::i2c_speed_Hz)
        : mode_(i2c_mode(speed_Hz)), timing_(i2c_timing(mode_)) {}

    /// Set up clock, pins and interrupt.
    void begin();
    /// Also false for an empty batch, one of more than max_batch transactions, and while the bus is being freed.
    bool submit(const I2cTransaction *batch, size_t count) override;
    /// A batch longer than twice its time on the wire plus 0.5 ms is given up as stuck. So is one that lost the bus.
    I2cStatus poll(uint8_t *read) override;
    uint32_t max_busy_us() override { return allowed_us_; }
    void recover() override;
    /// A batch that lost the bus counts as a timeout here.
    I2cStats stats() override;
    /// A batch is in progress, which needs interrupts.
    bool on_wire() const { return state_ == State::running || state_ == State::stopping; }
    const I2cCounters &counters() const { return counters_; }

    /// Interrupt context.
    void on_master();
    void on_clear_timer();

private:
    enum class State : uint8_t { idle, running, stopping, finished, clearing };

    void configure();
    void connect_pins();
    void release_pins();
    void drive(uint8_t pin, bool low);
    size_t compile(const I2cTransaction *batch, size_t count);
    void compile_one(const I2cTransaction &transaction);
    void allow(const I2cTransaction *batch, size_t count);
    void fill();
    void take_bytes();
    void fail(uint32_t flags);
    void finish(I2cStatus outcome);
    void give_up();
    void end_clear(I2cBusClear::Result result);

    const I2cMode &mode_;
    const I2cTiming timing_;
    // Address and bytes of the write, address and count of the read; one STOP.
    uint16_t words_[max_batch * (I2cTransaction::max_write + 3) + 1] = {};
    size_t word_count_ = 0;
    size_t next_word_ = 0;
    size_t read_skip_ = 0; ///< bytes of reads before the last one
    size_t read_count_ = 0;
    uint8_t read_[I2cTransaction::max_read] = {};
    volatile State state_ = State::idle;
    I2cStatus outcome_ = I2cStatus::idle;
    uint32_t begun_cycles_ = 0;
    uint32_t allowed_us_ = 0;
    bool timed_ = false; ///< the bus clear has a timer; otherwise poll() makes its steps
    I2cBusClear clear_;
    IntervalTimer timer_;
    I2cCounters counters_;
};

using Teensy40I2c = Teensy40I2cMaster<MotorsPort>;
using Teensy40GyroI2c = Teensy40I2cMaster<GyroPort>;
using Teensy40FlowI2c = Teensy40I2cMaster<FlowPort>;

} // namespace omni
