// SPDX-License-Identifier: MIT
#include "boards/teensy40/i2c.h"

#include <algorithm>

#include "boards/teensy40/priorities.h"

namespace omni {
namespace {

constexpr uint8_t sda_pin = 18;
constexpr uint8_t scl_pin = 19;
constexpr uint32_t mux_master = 3 | 0x10; ///< LPI2C1, input path forced on
constexpr uint32_t mux_gpio = 5 | 0x10;
constexpr uint32_t pad_open_drain = IOMUXC_PAD_ODE | IOMUXC_PAD_HYS | IOMUXC_PAD_PKE | IOMUXC_PAD_PUE |
                                    IOMUXC_PAD_PUS(3) | IOMUXC_PAD_DSE(2); ///< 22 kohm pull-up
constexpr uint32_t half_clock_us = 5;
constexpr size_t fifo_size = 4;
constexpr size_t refill_below = 2; ///< words left: two bytes of time until the clock would have to be stretched
constexpr uint32_t failures = LPI2C_MSR_NDF | LPI2C_MSR_ALF | LPI2C_MSR_FEF;
constexpr uint32_t all_flags = failures | LPI2C_MSR_DMF | LPI2C_MSR_PLTF | LPI2C_MSR_SDF | LPI2C_MSR_EPF;
constexpr uint32_t interrupts =
    LPI2C_MIER_RDIE | LPI2C_MIER_SDIE | LPI2C_MIER_NDIE | LPI2C_MIER_ALIE | LPI2C_MIER_FEIE | LPI2C_MIER_TDIE;
constexpr uint32_t spare_us = 500;

Teensy40I2c *owner = nullptr;

void on_interrupt() {
    owner->on_master();
}

void on_timer() {
    owner->on_clear_timer();
}

bool is_high(uint8_t pin) {
    return (*portInputRegister(pin) & digitalPinToBitMask(pin)) != 0;
}

uint32_t cycles_per_us() {
    return F_CPU_ACTUAL / 1'000'000;
}

constexpr uint16_t command(uint32_t what, uint32_t data) {
    return static_cast<uint16_t>(what | data);
}

} // namespace

void Teensy40I2c::configure() {
    IMXRT_LPI2C1.MCR = LPI2C_MCR_RST;
    IMXRT_LPI2C1.MCR = 0;
    IMXRT_LPI2C1.MCFGR0 = 0;
    IMXRT_LPI2C1.MCFGR1 = LPI2C_MCFGR1_PRESCALE(timing_.prescale);
    IMXRT_LPI2C1.MCFGR2 = LPI2C_MCFGR2_FILTSDA(timing_.filter) | LPI2C_MCFGR2_FILTSCL(timing_.filter) |
                          LPI2C_MCFGR2_BUSIDLE(timing_.bus_idle);
    IMXRT_LPI2C1.MCFGR3 = 0; // no pin-low time-out: poll() watches the time of the whole batch
    IMXRT_LPI2C1.MCCR0 = LPI2C_MCCR0_CLKLO(timing_.clk_low) | LPI2C_MCCR0_CLKHI(timing_.clk_high) |
                         LPI2C_MCCR0_SETHOLD(timing_.set_hold) | LPI2C_MCCR0_DATAVD(timing_.data_valid);
    IMXRT_LPI2C1.MFCR = LPI2C_MFCR_TXWATER(refill_below - 1) | LPI2C_MFCR_RXWATER(0);
    IMXRT_LPI2C1.MCR = LPI2C_MCR_MEN;
}

void Teensy40I2c::connect_pins() {
    *portConfigRegister(sda_pin) = mux_master;
    *portConfigRegister(scl_pin) = mux_master;
    IOMUXC_LPI2C1_SDA_SELECT_INPUT = 1;
    IOMUXC_LPI2C1_SCL_SELECT_INPUT = 1;
}

/// Pull a line low, or let it go.
void Teensy40I2c::drive(uint8_t pin, bool low) {
    auto &direction = *portModeRegister(pin);
    const uint32_t mask = digitalPinToBitMask(pin);
    direction = low ? direction | mask : direction & ~mask;
}

void Teensy40I2c::release_pins() {
    for (const uint8_t pin : {sda_pin, scl_pin}) {
        drive(pin, false);
        *portClearRegister(pin) = digitalPinToBitMask(pin);
        *portConfigRegister(pin) = mux_gpio;
    }
}

void Teensy40I2c::begin() {
    owner = this;
    constexpr uint32_t divider_mask = 0x3Fu << 19; // LPI2C_CLK_PODF
    CCM_CSCDR2 = CCM_CSCDR2 & ~(divider_mask | CCM_CSCDR2_LPI2C_CLK_SEL);
    CCM_CCGR2 = CCM_CCGR2 | CCM_CCGR2_LPI2C1(CCM_CCGR_ON);
    *portControlRegister(sda_pin) = pad_open_drain;
    *portControlRegister(scl_pin) = pad_open_drain;
    connect_pins();
    configure();
    timer_.priority(priority_i2c);
    attachInterruptVector(IRQ_LPI2C1, on_interrupt);
    NVIC_SET_PRIORITY(IRQ_LPI2C1, priority_i2c);
    NVIC_ENABLE_IRQ(IRQ_LPI2C1);
}

void Teensy40I2c::compile_one(const I2cTransaction &transaction) {
    const uint32_t address = static_cast<uint32_t>(transaction.address) << 1;
    if (transaction.write_length > 0 || transaction.read_length == 0) {
        words_[word_count_++] = command(LPI2C_MTDR_CMD_START, address);
        for (size_t i = 0; i < transaction.write_length; ++i) {
            words_[word_count_++] = command(LPI2C_MTDR_CMD_TRANSMIT, transaction.write[i]);
        }
    }
    if (transaction.read_length > 0) {
        words_[word_count_++] = command(LPI2C_MTDR_CMD_START, address | 1);
        words_[word_count_++] = command(LPI2C_MTDR_CMD_RECEIVE, transaction.read_length - 1u);
    }
}

/// @return bytes to read.
size_t Teensy40I2c::compile(const I2cTransaction *batch, size_t count) {
    word_count_ = 0;
    next_word_ = 0;
    size_t read_total = 0;
    size_t last_read = 0;
    for (size_t i = 0; i < count; ++i) {
        compile_one(batch[i]);
        read_total += batch[i].read_length;
        last_read = batch[i].read_length > 0 ? batch[i].read_length : last_read;
    }
    words_[word_count_++] = command(LPI2C_MTDR_CMD_STOP, 0);
    read_skip_ = read_total - last_read;
    read_count_ = 0;
    return read_total;
}

/// Set the batch's time limit from its length and the slowest edges that the mode allows.
void Teensy40I2c::allow(const I2cTransaction *batch, size_t count) {
    uint32_t bytes = 0;
    for (size_t i = 0; i < count; ++i) {
        bytes += 2u + batch[i].write_length + batch[i].read_length;
    }
    const uint64_t wire_ns = i2c_batch_ns(timing_, mode_.rise_ns, bytes, 2 * static_cast<uint32_t>(count));
    allowed_us_ = static_cast<uint32_t>(wire_ns / 1000) * 2 + spare_us;
    begun_cycles_ = ARM_DWT_CYCCNT;
}

bool Teensy40I2c::submit(const I2cTransaction *batch, size_t count) {
    const bool fits = count > 0 && count <= max_batch;
    if (!fits || (state_ != State::idle && state_ != State::finished)) {
        return false;
    }
    compile(batch, count);
    allow(batch, count);
    std::fill(read_, read_ + sizeof read_, uint8_t{0});
    ++counters_.batches;
    IMXRT_LPI2C1.MCR = LPI2C_MCR_MEN | LPI2C_MCR_RTF | LPI2C_MCR_RRF;
    IMXRT_LPI2C1.MSR = all_flags;
    state_ = State::running;
    fill();
    IMXRT_LPI2C1.MIER = next_word_ < word_count_ ? interrupts : interrupts & ~LPI2C_MIER_TDIE;
    return true;
}

void Teensy40I2c::fill() {
    size_t room = fifo_size - (IMXRT_LPI2C1.MFSR & 7u);
    for (; room > 0 && next_word_ < word_count_; --room) {
        IMXRT_LPI2C1.MTDR = words_[next_word_++];
    }
}

void Teensy40I2c::take_bytes() {
    for (size_t waiting = (IMXRT_LPI2C1.MFSR >> 16) & 7u; waiting > 0; --waiting) {
        const uint32_t data = IMXRT_LPI2C1.MRDR;
        const size_t index = read_count_ - read_skip_;
        if (read_count_ >= read_skip_ && index < sizeof read_) {
            read_[index] = static_cast<uint8_t>(data & 0xFFu);
        }
        ++read_count_;
    }
}

void Teensy40I2c::finish(I2cStatus outcome) {
    IMXRT_LPI2C1.MIER = 0;
    outcome_ = outcome;
    state_ = State::finished;
    counters_.last_us = (ARM_DWT_CYCCNT - begun_cycles_) / cycles_per_us();
    counters_.longest_us = std::max(counters_.longest_us, counters_.last_us);
}

/// Drop what is left and end with a STOP, unless the master has sent one itself or lost the bus.
void Teensy40I2c::fail(uint32_t flags) {
    outcome_ = (flags & LPI2C_MSR_NDF) != 0 ? I2cStatus::nack : I2cStatus::stuck;
    counters_.nacks += (flags & LPI2C_MSR_NDF) != 0;
    counters_.arbitration_losses += (flags & LPI2C_MSR_ALF) != 0;
    state_ = State::stopping;
    IMXRT_LPI2C1.MIER = LPI2C_MIER_SDIE;
    IMXRT_LPI2C1.MCR = LPI2C_MCR_MEN | LPI2C_MCR_RTF | LPI2C_MCR_RRF;
    IMXRT_LPI2C1.MSR = failures;
    const uint32_t now = IMXRT_LPI2C1.MSR;
    if ((now & LPI2C_MSR_MBF) != 0 && (now & LPI2C_MSR_SDF) == 0) {
        IMXRT_LPI2C1.MTDR = LPI2C_MTDR_CMD_STOP;
    } else {
        finish(outcome_);
    }
}

// The read of MFSR or MSR after the last write makes sure that the request is down before this interrupt ends.
void Teensy40I2c::on_master() {
    const uint32_t flags = IMXRT_LPI2C1.MSR;
    if (state_ == State::running && (flags & failures) != 0) {
        fail(flags);
    } else if (state_ == State::running || state_ == State::stopping) {
        take_bytes();
        if ((flags & LPI2C_MSR_SDF) != 0) {
            finish(state_ == State::running ? I2cStatus::done : outcome_);
        } else if (state_ == State::running) {
            fill();
            if (next_word_ == word_count_) {
                IMXRT_LPI2C1.MIER = interrupts & ~LPI2C_MIER_TDIE;
            }
        }
    } else {
        IMXRT_LPI2C1.MIER = 0;
    }
    static_cast<void>(uint32_t{IMXRT_LPI2C1.MSR});
}

void Teensy40I2c::give_up() {
    IMXRT_LPI2C1.MIER = 0;
    configure();
    state_ = State::idle;
}

I2cStatus Teensy40I2c::poll(uint8_t *read) {
    switch (state_) {
    case State::running:
    case State::stopping:
        if (ARM_DWT_CYCCNT - begun_cycles_ < allowed_us_ * cycles_per_us()) {
            return I2cStatus::busy;
        }
        ++counters_.timeouts;
        give_up();
        return I2cStatus::stuck;
    case State::finished:
        state_ = State::idle;
        std::copy(read_, read_ + sizeof read_, read);
        return outcome_;
    case State::clearing:
        if (!timed_) {
            on_clear_timer();
        }
        return I2cStatus::idle;
    case State::idle:
        return I2cStatus::idle;
    }
    return I2cStatus::idle;
}

void Teensy40I2c::recover() {
    if (state_ == State::clearing) {
        return;
    }
    ++counters_.recoveries;
    give_up();
    state_ = State::clearing;
    release_pins();
    clear_.begin();
    timed_ = timer_.begin(on_timer, half_clock_us);
}

I2cStats Teensy40I2c::stats() {
    I2cStats stats;
    stats.nacks = counters_.nacks;
    stats.timeouts = counters_.timeouts + counters_.arbitration_losses;
    stats.recoveries = counters_.recoveries;
    stats.last_us = static_cast<uint16_t>(std::min(counters_.last_us, uint32_t{UINT16_MAX}));
    return stats;
}

void Teensy40I2c::end_clear(I2cBusClear::Result result) {
    counters_.scl_stuck += result == I2cBusClear::Result::scl_stuck;
    counters_.sda_stuck += result == I2cBusClear::Result::sda_stuck;
    if (timed_) {
        timer_.end();
    }
    connect_pins();
    configure();
    state_ = State::idle;
}

void Teensy40I2c::on_clear_timer() {
    if (state_ != State::clearing) {
        return;
    }
    const I2cBusClear::Result result = clear_.step(is_high(scl_pin), is_high(sda_pin));
    // SDA only while SCL is low or alone: the two never move together.
    drive(scl_pin, result == I2cBusClear::Result::working && clear_.pulls_scl());
    drive(sda_pin, result == I2cBusClear::Result::working && clear_.pulls_sda());
    if (result != I2cBusClear::Result::working) {
        end_clear(result);
    }
}

} // namespace omni
