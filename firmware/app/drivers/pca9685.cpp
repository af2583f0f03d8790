// SPDX-License-Identifier: MIT
#include "app/drivers/pca9685.h"

#include <algorithm>
#include <initializer_list>

namespace omni {
namespace {

constexpr uint8_t reg_mode1 = 0x00;
constexpr uint8_t reg_mode2 = 0x01;
constexpr uint8_t reg_led0 = 0x06;
constexpr uint8_t channel_bytes = 4;
constexpr uint8_t reg_all_led_off_high = 0xFD;
constexpr uint8_t reg_prescale = 0xFE;
constexpr uint8_t mode1_sleep = 0x30; ///< auto-increment, asleep
constexpr uint8_t mode1_awake = 0x20; ///< auto-increment
constexpr uint8_t mode2_outdrv = 0x04;
constexpr uint8_t prescale_1526_Hz = 3;
constexpr uint8_t full = 0x10; ///< bit 4 of ON_H or OFF_H
constexpr uint64_t oscillator_start_us = 500;
constexpr uint16_t health_interval = 64; ///< updates between two read-backs of MODE1
/// Ticks after which a busy bus counts as stuck, for a bus without a timeout.
constexpr uint32_t busy_limit = 5;
/// Margin in ticks over the timeout of a bus that has one.
constexpr uint32_t busy_spare = 2;

uint32_t busy_ticks_allowed(I2cBus &bus) {
    return std::max(busy_limit, bus.max_busy_us() / OMNI_TICK_US + busy_spare);
}

I2cTransaction write_of(std::initializer_list<uint8_t> bytes) {
    I2cTransaction transaction;
    transaction.address = Pca9685::address;
    transaction.write_length = static_cast<uint8_t>(bytes.size());
    std::copy(bytes.begin(), bytes.end(), transaction.write);
    return transaction;
}

uint8_t register_of(uint8_t channel) {
    return static_cast<uint8_t>(reg_led0 + channel_bytes * channel);
}

/// ON_L, ON_H, OFF_L, OFF_H of a channel that is high for `count` of 4096 steps.
void encode_channel(uint8_t *bytes, uint16_t count) {
    const bool always = count >= OMNI_PWM_STEPS;
    const bool never = count == 0;
    bytes[0] = 0;
    bytes[1] = always ? full : 0;
    bytes[2] = always || never ? 0 : static_cast<uint8_t>(count);
    bytes[3] = never ? full : (always ? 0 : static_cast<uint8_t>(count >> 8));
}

} // namespace

bool operator==(const Wiring &a, const Wiring &b) {
    return a.driver == b.driver && a.wheels == b.wheels && std::equal(a.in1, a.in1 + a.wheels, b.in1) &&
           std::equal(a.in2, a.in2 + a.wheels, b.in2);
}

void Pca9685::restart() {
    phase_ = Phase::off;
    in_flight_ = false;
    readback_in_flight_ = false;
    suspicious_ = false;
    busy_ticks_ = 0;
    failures_ = 0;
    updates_since_readback_ = 0;
    readback_errors_ = min_failures_ = 0;
}

void Pca9685::set_wiring(const Wiring &wiring) {
    if (!(wiring == wiring_)) {
        wiring_ = wiring;
        build_update_layout();
        phase_ = Phase::off; // channels that are no longer ours must not stay on
    }
}

void Pca9685::succeeded(const uint8_t *read) {
    if (readback_in_flight_) {
        updates_since_readback_ = 0;
        suspicious_ = phase_ == Phase::ready && read[0] != mode1_awake;
        if (suspicious_) {
            readback_failed();
            return;
        }
        readback_errors_ = min_failures_ = 0;
    }
    failures_ = min_failures_;
    if (phase_ == Phase::off) {
        phase_ = Phase::configure;
    } else if (phase_ == Phase::configure) {
        phase_ = Phase::wake;
    } else if (phase_ == Phase::wake) {
        phase_ = Phase::settle;
    }
}

/// MODE1 was wrong: the chip lost its power, or reading back does not work, which an initialisation cannot fix.
void Pca9685::readback_failed() {
    phase_ = Phase::off;
    readback_errors_ = omni_add_failures(readback_errors_, 1);
    if (readback_errors_ >= max_readback_errors) {
        min_failures_ = UINT16_MAX;
        ++errors_;
    }
    failures_ = min_failures_;
}

void Pca9685::failed(I2cBus &bus, bool stuck, uint32_t updates) {
    ++errors_;
    failures_ = omni_add_failures(failures_, updates);
    suspicious_ = true;
    if (phase_ != Phase::ready) {
        phase_ = Phase::off;
    }
    if (stuck) {
        bus.recover();
    }
}

void Pca9685::poll(MotorWires &wires) {
    I2cBus &bus = wires.bus;
    uint8_t read[I2cTransaction::max_read] = {};
    const I2cStatus status = bus.poll(read);
    if (!in_flight_) {
        return;
    }
    if (status == I2cStatus::busy && busy_ticks_ + 1 < busy_ticks_allowed(bus)) {
        ++busy_ticks_;
        return;
    }
    in_flight_ = false;
    if (status == I2cStatus::done) {
        succeeded(read);
    } else {
        failed(bus, status != I2cStatus::nack, 1 + busy_ticks_);
    }
    busy_ticks_ = 0;
    readback_in_flight_ = false;
}

/// Addresses and lengths of the update, from the wiring; the tick fills in the counts.
void Pca9685::build_update_layout() {
    bool used[channels] = {};
    for (size_t i = 0; i < wiring_.wheels; ++i) {
        used[wiring_.in1[i] % channels] = true;
        used[wiring_.in2[i] % channels] = true;
    }
    bursts_ = 0;
    for (uint8_t channel = 0; channel < channels; ++channel) {
        if (!used[channel]) {
            continue;
        }
        if (channel == 0 || !used[channel - 1]) {
            update_[bursts_++] = write_of({register_of(channel)});
        }
        I2cTransaction &burst = update_[bursts_ - 1];
        burst.write_length = static_cast<uint8_t>(burst.write_length + channel_bytes);
    }
    update_[bursts_] = write_of({reg_mode1});
    update_[bursts_].read_length = 1;
    for (size_t i = 0; i < wiring_.wheels; ++i) {
        in1_[i] = channel_slot(wiring_.in1[i] % channels);
        in2_[i] = channel_slot(wiring_.in2[i] % channels);
    }
}

/// A channel's bytes in the update.
uint8_t *Pca9685::channel_slot(uint8_t channel) {
    const uint8_t wanted = register_of(channel);
    I2cTransaction *burst = update_;
    while (wanted >= burst->write[0] + burst->write_length - 1) {
        ++burst;
    }
    return burst->write + 1 + (wanted - burst->write[0]);
}

size_t Pca9685::fill_update(const omni_real_t *duty, bool on) {
    for (size_t i = 0; i < wiring_.wheels; ++i) {
        const omni_bridge_counts_t bridge = omni_bridge_counts(duty[i], on);
        encode_channel(in1_[i], bridge.in1);
        encode_channel(in2_[i], bridge.in2);
    }
    readback_in_flight_ = suspicious_ || ++updates_since_readback_ >= health_interval;
    return readback_in_flight_ ? bursts_ + 1 : bursts_;
}

void Pca9685::send(I2cBus &bus, const I2cTransaction *batch, size_t count) {
    in_flight_ = true;
    if (!bus.submit(batch, count)) {
        in_flight_ = false;
        failed(bus, true, 1);
    }
}

/// Send the next step of the power-up sequence.
void Pca9685::send_setup(I2cBus &bus, uint64_t now_us) {
    if (phase_ == Phase::off) {
        const I2cTransaction off = write_of({reg_all_led_off_high, full});
        send(bus, &off, 1);
    } else if (phase_ == Phase::configure) {
        const I2cTransaction setup[] = {write_of({reg_mode1, mode1_sleep}), write_of({reg_prescale, prescale_1526_Hz}),
                                        write_of({reg_mode2, mode2_outdrv})};
        send(bus, setup, sizeof setup / sizeof setup[0]);
    } else if (phase_ == Phase::wake) {
        const I2cTransaction wake = write_of({reg_mode1, mode1_awake});
        awake_us_ = now_us;
        send(bus, &wake, 1);
    }
}

void Pca9685::drive(MotorWires &wires, uint64_t now_us, const omni_real_t *duty, bool on) {
    if (in_flight_) {
        return; // the last update is still on the wire; skip this one
    }
    if (phase_ == Phase::settle && now_us - awake_us_ >= oscillator_start_us) {
        phase_ = Phase::ready;
    }
    if (phase_ == Phase::ready) {
        const size_t count = fill_update(duty, on);
        send(wires.bus, update_, count);
    } else {
        send_setup(wires.bus, now_us);
    }
}

bool Pca9685::submit_all_off(I2cBus &bus) {
    const I2cTransaction off = write_of({reg_all_led_off_high, full});
    return bus.submit(&off, 1);
}

bool Pca9685::all_off(MotorWires &wires) {
    restart();
    return submit_all_off(wires.bus);
}

} // namespace omni
