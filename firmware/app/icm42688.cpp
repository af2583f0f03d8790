// SPDX-License-Identifier: MIT
#include "app/icm42688.h"

#include <algorithm>
#include <cstdlib>

#include "omni/gyro.h"

namespace omni {
namespace {

// DS-000347, user bank 0.
constexpr uint8_t reg_device_config = 0x11;
constexpr uint8_t reg_gyro_data = 0x25; ///< X, Y, Z, high byte first, to 0x2A
constexpr uint8_t reg_intf_config1 = 0x4D;
constexpr uint8_t reg_pwr_mgmt0 = 0x4E;
constexpr uint8_t reg_gyro_config0 = 0x4F;
constexpr uint8_t reg_gyro_config1 = 0x51; ///< GYRO_ACCEL_CONFIG0 follows
constexpr uint8_t reg_who_am_i = 0x75;
constexpr uint8_t reg_bank_select = 0x76; ///< in every bank
// User bank 1.
constexpr uint8_t reg_gyro_config_static3 = 0x0C; ///< anti-alias filter, to 0x0E

constexpr uint8_t identity = 0x47;
constexpr uint8_t soft_reset = 0x01;
/// Reset value 0x91, but with adaptive range (bits 7:6) off. The data sheet does not name these bits. Public drivers
/// switch it off, because readings stand still for moments while the chip changes its range.
constexpr uint8_t no_adaptive_range = 0x51;
constexpr uint8_t gyro_low_noise = 0x0C; ///< accelerometer off
constexpr uint8_t range_2000_dps_1_kHz = 0x06;
constexpr uint8_t accel_config0_reset = 0x06;
// Filters. Anti-alias filter 488 Hz: DELT 11, DELTSQR 122, BITSHIFT 8. Then the UI filter, first order, bandwidth half
// the data rate. The first is of second order: sqrt(2) / (2 pi f) = 0.46 ms late. The other is 1 / (2 pi f) = 0.32 ms
// late, which makes 0.8 ms in all (calculated). A reading is 0 to 1 ms old when the tick asks, and used in the next
// tick. Narrower ones would be quieter, but heading while turning would lag. Rollers shake at tens of hertz.
constexpr uint8_t aaf_delt = 11;
constexpr uint8_t aaf_delt_squared = 122;
constexpr uint8_t aaf_bitshift = 8u << 4;
constexpr uint8_t ui_first_order = 0x12;
constexpr uint8_t ui_half_rate = 0x10; ///< the accelerometer's as after reset

/// What reg_intf_config1 and the five behind it read while all is well.
constexpr uint8_t settings[] = {no_adaptive_range,   gyro_low_noise, range_2000_dps_1_kHz,
                                accel_config0_reset, ui_first_order, ui_half_rate};
constexpr uint8_t reading_bytes = 6;

constexpr float rad_s_per_step = 2000.0f / 32768.0f * 0.017453293f;
constexpr int16_t no_reading = INT16_MIN; ///< of a gyro that is off or still starting
constexpr int16_t end_of_range = INT16_MAX;
constexpr int jump_steps = 3754;       ///< 4 rad/s in a millisecond: 4000 rad/s^2
constexpr uint16_t jump_window = 1000; ///< readings
/// Of them. A wrong bit is one of the upper four in a quarter of all cases: so thrice as many are used unseen.
constexpr uint16_t jumps_allowed = 5;

constexpr uint64_t reset_us = 2000;   ///< the data sheet's 1 ms, and one more
constexpr uint64_t start_us = 60'000; ///< gyro start-up 30 ms, and at least 45 ms on
constexpr uint64_t retry_us = 200'000;
/// A reading that waited longer was asked for before a pause: the host was in the loop.
constexpr uint64_t stale_us = 10'000;
constexpr uint16_t look_interval = 50; ///< readings
/// Ticks that a batch may take. The longest, the set-up, is 0.6 ms at 400 kHz.
constexpr uint8_t busy_limit = 5;
constexpr uint8_t failures_allowed = 10;
constexpr uint8_t invalid_allowed = 10;
constexpr uint8_t same_allowed = OMNI_GYRO_STUCK_SAMPLES;
constexpr uint8_t good_enough = OMNI_GYRO_GOOD_SAMPLES;

int16_t value_of(const uint8_t *bytes) {
    return static_cast<int16_t>(static_cast<uint16_t>(bytes[0] << 8 | bytes[1]));
}

bool is_jump(int16_t from, int16_t to) {
    return std::abs(static_cast<int>(to) - static_cast<int>(from)) > jump_steps;
}

} // namespace

GyroTrouble Icm42688::trouble() const {
    const uint16_t packed = trouble_.load(std::memory_order_relaxed);
    return {static_cast<GyroCause>(packed & 0xFFu), static_cast<uint8_t>(packed >> 8)};
}

void Icm42688::show(GyroCause cause, uint8_t seen) {
    trouble_.store(static_cast<uint16_t>(static_cast<uint16_t>(cause) | seen << 8), std::memory_order_relaxed);
}

void Icm42688::start_again(uint64_t now_us, GyroCause cause, uint8_t seen) {
    show(cause, seen);
    phase_ = Phase::identify;
    good_ = 0;
    failures_ = 0;
    due_us_ = now_us + retry_us;
}

/// Another axis has another history. Without one the batch in flight is still waited for, and nothing else is sent.
void Icm42688::follow_axis() {
    const int8_t wanted = wanted_axis_.load(std::memory_order_relaxed);
    if (wanted == axis_) {
        return;
    }
    if (axis_ == 0 || wanted == 0) {
        phase_ = Phase::identify;
        due_us_ = 0;
        show(GyroCause::none);
    }
    axis_ = wanted;
    have_used_ = false;
    good_ = 0;
}

uint8_t Icm42688::read(uint64_t now_us, float *rad_s) {
    follow_axis();
    const uint8_t fresh = in_flight_ ? take_batch(now_us, rad_s) : uint8_t{0};
    if (axis_ != 0 && !in_flight_ && now_us >= due_us_) {
        send_next(now_us);
    }
    return fresh;
}

uint8_t Icm42688::take_batch(uint64_t now_us, float *rad_s) {
    uint8_t bytes[I2cTransaction::max_read] = {};
    const I2cStatus status = bus_.poll(bytes);
    if (status == I2cStatus::busy && ++busy_ticks_ < busy_limit) {
        return 0;
    }
    in_flight_ = false;
    busy_ticks_ = 0;
    if (axis_ == 0) {
        return 0;
    }
    if (status == I2cStatus::done) {
        return arrived(now_us, bytes, rad_s);
    }
    failed(now_us, status);
    return 0;
}

void Icm42688::failed(uint64_t now_us, I2cStatus status) {
    if (status != I2cStatus::nack) {
        bus_.recover();
    }
    if (phase_ != Phase::run || ++failures_ >= failures_allowed) {
        start_again(now_us, status == I2cStatus::nack ? GyroCause::absent : GyroCause::bus);
    }
}

uint8_t Icm42688::arrived(uint64_t now_us, const uint8_t *bytes, float *rad_s) {
    failures_ = 0;
    switch (phase_) {
    case Phase::identify:
        if (bytes[0] == identity) {
            phase_ = Phase::reset;
        } else {
            start_again(now_us, GyroCause::wrong_id, bytes[0]);
        }
        return 0;
    case Phase::reset:
        phase_ = Phase::configure;
        due_us_ = now_us + reset_us;
        return 0;
    case Phase::configure:
        phase_ = Phase::verify;
        due_us_ = now_us + start_us;
        return 0;
    case Phase::verify:
        begin_run();
        check_settings(now_us, bytes);
        return 0;
    case Phase::run:
        break;
    }
    if (looking_) {
        check_settings(now_us, bytes);
        return 0;
    }
    return now_us - sent_us_ < stale_us ? take_reading(now_us, bytes, rad_s) : uint8_t{0};
}

void Icm42688::begin_run() {
    phase_ = Phase::run;
    wrong_look_ = have_used_ = left_out_ = noisy_ = false;
    invalid_ = same_ = 0;
    window_ = jumps_ = 0;
}

/// Twice in a row, because a bit may have got lost on the wires.
void Icm42688::check_settings(uint64_t now_us, const uint8_t *bytes) {
    since_look_ = 0;
    suspicious_ = !std::equal(settings, settings + sizeof settings, bytes);
    if (suspicious_ && wrong_look_) {
        start_again(now_us, GyroCause::lost);
    }
    wrong_look_ = suspicious_;
}

uint8_t Icm42688::take_reading(uint64_t now_us, const uint8_t *bytes, float *rad_s) {
    int16_t raw[axes];
    for (size_t i = 0; i < axes; ++i) {
        raw[i] = value_of(bytes + 2 * i);
    }
    if (std::all_of(raw, raw + axes, [](int16_t value) { return value == no_reading; })) {
        suspicious_ = true;
        if (++invalid_ >= invalid_allowed) {
            start_again(now_us, GyroCause::silent);
        }
        return 0;
    }
    invalid_ = 0;
    const int16_t own = raw[std::abs(axis_) - 1];
    const bool jumped = jumps(own);
    if (stands_still(raw)) {
        start_again(now_us, GyroCause::stuck);
        return 0;
    }
    count_jump(jumped);
    if (jumped || noisy_) {
        return 0;
    }
    judge(own);
    for (size_t i = 0; i < axes; ++i) {
        rad_s[i] = static_cast<float>(raw[i]) * rad_s_per_step;
    }
    return (1u << axes) - 1u;
}

bool Icm42688::stands_still(const int16_t *raw) {
    same_ = std::equal(raw, raw + axes, last_) ? static_cast<uint8_t>(same_ + 1) : uint8_t{0};
    std::copy(raw, raw + axes, last_);
    return same_ >= same_allowed;
}

/// A jump is believed once the next reading is at the same place.
bool Icm42688::jumps(int16_t raw) {
    const int16_t before = last_[std::abs(axis_) - 1];
    left_out_ = have_used_ && is_jump(used_, raw) && (!left_out_ || is_jump(before, raw));
    have_used_ = true;
    used_ = left_out_ ? used_ : raw;
    return left_out_;
}

void Icm42688::count_jump(bool jumped) {
    jumps_ = static_cast<uint16_t>(jumps_ + (jumped ? 1 : 0));
    if (jumps_ > jumps_allowed && !noisy_) {
        noisy_ = true;
        good_ = 0;
        show(GyroCause::noisy);
    }
    if (++window_ >= jump_window) {
        noisy_ = jumps_ > jumps_allowed;
        window_ = jumps_ = 0;
    }
}

/// A saturated reading is handed on: the core knows GYRO_MAX.
void Icm42688::judge(int16_t raw) {
    if (raw >= end_of_range || raw <= -end_of_range) {
        good_ = 0;
        show(GyroCause::saturated);
        return;
    }
    good_ = good_ < good_enough ? static_cast<uint8_t>(good_ + 1) : good_;
    if (good_ == good_enough) {
        show(GyroCause::none);
    }
}

I2cTransaction Icm42688::write_of(std::initializer_list<uint8_t> bytes) const {
    I2cTransaction transaction;
    transaction.address = address_;
    transaction.write_length = static_cast<uint8_t>(bytes.size());
    std::copy(bytes.begin(), bytes.end(), transaction.write);
    return transaction;
}

void Icm42688::send(uint64_t now_us, const I2cTransaction *batch, size_t count) {
    sent_us_ = now_us;
    in_flight_ = bus_.submit(batch, count);
    if (!in_flight_) {
        failed(now_us, I2cStatus::stuck);
    }
}

void Icm42688::send_read(uint64_t now_us, uint8_t reg, uint8_t count) {
    I2cTransaction transaction = write_of({reg});
    transaction.read_length = count;
    send(now_us, &transaction, 1);
}

/// Whatever bank a start that was broken off has left.
void Icm42688::send_identify(uint64_t now_us) {
    ++starts_;
    I2cTransaction batch[] = {write_of({reg_bank_select, 0}), write_of({reg_who_am_i})};
    batch[1].read_length = 1;
    send(now_us, batch, sizeof batch / sizeof batch[0]);
}

/// Switched on last: nothing may be written in the 200 us after it.
void Icm42688::send_settings(uint64_t now_us) {
    const I2cTransaction batch[] = {
        write_of({reg_bank_select, 1}),
        write_of({reg_gyro_config_static3, aaf_delt, aaf_delt_squared, aaf_bitshift}),
        write_of({reg_bank_select, 0}),
        write_of({reg_intf_config1, no_adaptive_range}),
        write_of({reg_gyro_config0, range_2000_dps_1_kHz}),
        write_of({reg_gyro_config1, ui_first_order, ui_half_rate}),
        write_of({reg_pwr_mgmt0, gyro_low_noise}),
    };
    send(now_us, batch, sizeof batch / sizeof batch[0]);
}

void Icm42688::send_next(uint64_t now_us) {
    looking_ = phase_ == Phase::verify;
    switch (phase_) {
    case Phase::identify:
        send_identify(now_us);
        return;
    case Phase::reset: {
        const I2cTransaction reset = write_of({reg_device_config, soft_reset});
        send(now_us, &reset, 1);
        return;
    }
    case Phase::configure:
        send_settings(now_us);
        return;
    case Phase::verify:
        send_read(now_us, reg_intf_config1, sizeof settings);
        return;
    case Phase::run:
        break;
    }
    looking_ = suspicious_ || ++since_look_ >= look_interval;
    if (looking_) {
        send_read(now_us, reg_intf_config1, sizeof settings);
    } else {
        send_read(now_us, reg_gyro_data, reading_bytes);
    }
}

} // namespace omni
