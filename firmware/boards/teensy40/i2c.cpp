// SPDX-License-Identifier: MIT
#include "boards/teensy40/i2c.h"

#include <algorithm>

#include "boards/teensy40/priorities.h"

namespace omni {
namespace {

constexpr uint32_t input_on = 0x10; ///< input path forced on
constexpr uint32_t mux_gpio = 5 | input_on;
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

template <class Port>
Teensy40I2cMaster<Port> *owner = nullptr;

template <class Port>
void on_interrupt() {
    owner<Port>->on_master();
}

template <class Port>
void on_timer() {
    owner<Port>->on_clear_timer();
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

template <class Port>
void Teensy40I2cMaster<Port>::configure() {
    Port::registers().MCR = LPI2C_MCR_RST;
    Port::registers().MCR = 0;
    Port::registers().MCFGR0 = 0;
    Port::registers().MCFGR1 = LPI2C_MCFGR1_PRESCALE(timing_.prescale);
    Port::registers().MCFGR2 = LPI2C_MCFGR2_FILTSDA(timing_.filter) | LPI2C_MCFGR2_FILTSCL(timing_.filter) |
                               LPI2C_MCFGR2_BUSIDLE(timing_.bus_idle);
    Port::registers().MCFGR3 = 0; // no pin-low time-out: poll() watches the time of the whole batch
    Port::registers().MCCR0 = LPI2C_MCCR0_CLKLO(timing_.clk_low) | LPI2C_MCCR0_CLKHI(timing_.clk_high) |
                              LPI2C_MCCR0_SETHOLD(timing_.set_hold) | LPI2C_MCCR0_DATAVD(timing_.data_valid);
    Port::registers().MFCR = LPI2C_MFCR_TXWATER(refill_below - 1) | LPI2C_MFCR_RXWATER(0);
    Port::registers().MCR = LPI2C_MCR_MEN;
}

template <class Port>
void Teensy40I2cMaster<Port>::connect_pins() {
    *portConfigRegister(Port::sda_pin) = Port::mux | input_on;
    *portConfigRegister(Port::scl_pin) = Port::mux | input_on;
    Port::select_inputs();
}

/// Pull a line low, or let it go.
template <class Port>
void Teensy40I2cMaster<Port>::drive(uint8_t pin, bool low) {
    auto &direction = *portModeRegister(pin);
    const uint32_t mask = digitalPinToBitMask(pin);
    direction = low ? direction | mask : direction & ~mask;
}

template <class Port>
void Teensy40I2cMaster<Port>::release_pins() {
    for (const uint8_t pin : {Port::sda_pin, Port::scl_pin}) {
        drive(pin, false);
        *portClearRegister(pin) = digitalPinToBitMask(pin);
        *portConfigRegister(pin) = mux_gpio;
    }
}

template <class Port>
void Teensy40I2cMaster<Port>::begin() {
    owner<Port> = this;
    constexpr uint32_t divider_mask = 0x3Fu << 19; // LPI2C_CLK_PODF
    CCM_CSCDR2 = CCM_CSCDR2 & ~(divider_mask | CCM_CSCDR2_LPI2C_CLK_SEL);
    Port::open_clock();
    *portControlRegister(Port::sda_pin) = pad_open_drain;
    *portControlRegister(Port::scl_pin) = pad_open_drain;
    connect_pins();
    configure();
    timer_.priority(priority_i2c);
    attachInterruptVector(Port::interrupt, on_interrupt<Port>);
    NVIC_SET_PRIORITY(Port::interrupt, priority_i2c);
    NVIC_ENABLE_IRQ(Port::interrupt);
}

template <class Port>
void Teensy40I2cMaster<Port>::compile_one(const I2cTransaction &transaction) {
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
template <class Port>
size_t Teensy40I2cMaster<Port>::compile(const I2cTransaction *batch, size_t count) {
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
template <class Port>
void Teensy40I2cMaster<Port>::allow(const I2cTransaction *batch, size_t count) {
    uint32_t bytes = 0;
    for (size_t i = 0; i < count; ++i) {
        bytes += 2u + batch[i].write_length + batch[i].read_length;
    }
    const uint64_t wire_ns = i2c_batch_ns(timing_, mode_.rise_ns, bytes, 2 * static_cast<uint32_t>(count));
    allowed_us_ = static_cast<uint32_t>(wire_ns / 1000) * 2 + spare_us;
    begun_cycles_ = ARM_DWT_CYCCNT;
}

template <class Port>
bool Teensy40I2cMaster<Port>::submit(const I2cTransaction *batch, size_t count) {
    const bool fits = count > 0 && count <= max_batch;
    if (!fits || (state_ != State::idle && state_ != State::finished)) {
        return false;
    }
    compile(batch, count);
    allow(batch, count);
    std::fill(read_, read_ + sizeof read_, uint8_t{0});
    ++counters_.batches;
    Port::registers().MCR = LPI2C_MCR_MEN | LPI2C_MCR_RTF | LPI2C_MCR_RRF;
    Port::registers().MSR = all_flags;
    state_ = State::running;
    fill();
    Port::registers().MIER = next_word_ < word_count_ ? interrupts : interrupts & ~LPI2C_MIER_TDIE;
    return true;
}

template <class Port>
void Teensy40I2cMaster<Port>::fill() {
    size_t room = fifo_size - (Port::registers().MFSR & 7u);
    for (; room > 0 && next_word_ < word_count_; --room) {
        Port::registers().MTDR = words_[next_word_++];
    }
}

template <class Port>
void Teensy40I2cMaster<Port>::take_bytes() {
    for (size_t waiting = (Port::registers().MFSR >> 16) & 7u; waiting > 0; --waiting) {
        const uint32_t data = Port::registers().MRDR;
        const size_t index = read_count_ - read_skip_;
        if (read_count_ >= read_skip_ && index < sizeof read_) {
            read_[index] = static_cast<uint8_t>(data & 0xFFu);
        }
        ++read_count_;
    }
}

template <class Port>
void Teensy40I2cMaster<Port>::finish(I2cStatus outcome) {
    Port::registers().MIER = 0;
    outcome_ = outcome;
    state_ = State::finished;
    counters_.last_us = (ARM_DWT_CYCCNT - begun_cycles_) / cycles_per_us();
    counters_.longest_us = std::max(counters_.longest_us, counters_.last_us);
}

/// Drop what is left and end with a STOP, unless the master has sent one itself or lost the bus.
template <class Port>
void Teensy40I2cMaster<Port>::fail(uint32_t flags) {
    outcome_ = (flags & LPI2C_MSR_NDF) != 0 ? I2cStatus::nack : I2cStatus::stuck;
    counters_.nacks += (flags & LPI2C_MSR_NDF) != 0;
    counters_.arbitration_losses += (flags & LPI2C_MSR_ALF) != 0;
    state_ = State::stopping;
    Port::registers().MIER = LPI2C_MIER_SDIE;
    Port::registers().MCR = LPI2C_MCR_MEN | LPI2C_MCR_RTF | LPI2C_MCR_RRF;
    Port::registers().MSR = failures;
    const uint32_t now = Port::registers().MSR;
    if ((now & LPI2C_MSR_MBF) != 0 && (now & LPI2C_MSR_SDF) == 0) {
        Port::registers().MTDR = LPI2C_MTDR_CMD_STOP;
    } else {
        finish(outcome_);
    }
}

// The read of MFSR or MSR after the last write makes sure that the request is down before this interrupt ends.
template <class Port>
void Teensy40I2cMaster<Port>::on_master() {
    const uint32_t flags = Port::registers().MSR;
    if (state_ == State::running && (flags & failures) != 0) {
        fail(flags);
    } else if (state_ == State::running || state_ == State::stopping) {
        take_bytes();
        if ((flags & LPI2C_MSR_SDF) != 0) {
            finish(state_ == State::running ? I2cStatus::done : outcome_);
        } else if (state_ == State::running) {
            fill();
            if (next_word_ == word_count_) {
                Port::registers().MIER = interrupts & ~LPI2C_MIER_TDIE;
            }
        }
    } else {
        Port::registers().MIER = 0;
    }
    static_cast<void>(uint32_t{Port::registers().MSR});
}

template <class Port>
void Teensy40I2cMaster<Port>::give_up() {
    Port::registers().MIER = 0;
    configure();
    state_ = State::idle;
}

template <class Port>
I2cStatus Teensy40I2cMaster<Port>::poll(uint8_t *read) {
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

template <class Port>
void Teensy40I2cMaster<Port>::recover() {
    if (state_ == State::clearing) {
        return;
    }
    ++counters_.recoveries;
    give_up();
    state_ = State::clearing;
    release_pins();
    clear_.begin();
    timed_ = timer_.begin(on_timer<Port>, half_clock_us);
}

template <class Port>
I2cStats Teensy40I2cMaster<Port>::stats() {
    I2cStats stats;
    stats.nacks = counters_.nacks;
    stats.timeouts = counters_.timeouts + counters_.arbitration_losses;
    stats.recoveries = counters_.recoveries;
    stats.last_us = static_cast<uint16_t>(std::min(counters_.last_us, uint32_t{UINT16_MAX}));
    return stats;
}

template <class Port>
void Teensy40I2cMaster<Port>::end_clear(I2cBusClear::Result result) {
    counters_.scl_stuck += result == I2cBusClear::Result::scl_stuck;
    counters_.sda_stuck += result == I2cBusClear::Result::sda_stuck;
    if (timed_) {
        timer_.end();
    }
    connect_pins();
    configure();
    state_ = State::idle;
}

template <class Port>
void Teensy40I2cMaster<Port>::on_clear_timer() {
    if (state_ != State::clearing) {
        return;
    }
    const I2cBusClear::Result result = clear_.step(is_high(Port::scl_pin), is_high(Port::sda_pin));
    // SDA only while SCL is low or alone: the two never move together.
    drive(Port::scl_pin, result == I2cBusClear::Result::working && clear_.pulls_scl());
    drive(Port::sda_pin, result == I2cBusClear::Result::working && clear_.pulls_sda());
    if (result != I2cBusClear::Result::working) {
        end_clear(result);
    }
}

template class Teensy40I2cMaster<MotorsPort>;
template class Teensy40I2cMaster<GyroPort>;
template class Teensy40I2cMaster<FlowPort>;

} // namespace omni
