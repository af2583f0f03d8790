// SPDX-License-Identifier: MIT
// What the Python tests call: the board's encoders and I2C master on the fake chip.
#include <algorithm>
#include <cstring>
#include <optional>

#include "app/drivers/pca9685.h"
#include "boards/teensy40/encoders.h"
#include "boards/teensy40/i2c.h"
#include "boards/teensy40/motor_stop.h"
#include "chip.h"

extern "C" {
#include "hil_sim/pca9685.h"
}

namespace fake {
hil_pca9685_t &chip();
}

namespace {

using namespace omni;

EncoderPlan plan;
std::optional<Teensy40Encoders> encoders;
#ifdef GYRO_PORT
using Master = Teensy40GyroI2c;
#elif defined(FLOW_PORT)
using Master = Teensy40FlowI2c;
#else
using Master = Teensy40I2c;
#endif
std::optional<Master> i2c;
std::optional<Pca9685> driver;
MotorStop motor_stop;

template <size_t wheels>
EncoderPlan plan_of(const uint8_t *pins, const uint8_t *wanted) {
    uint8_t pairs[wheels][2];
    wiring::Decoder decoders[wheels];
    for (size_t i = 0; i < wheels; ++i) {
        pairs[i][0] = pins[2 * i];
        pairs[i][1] = pins[2 * i + 1];
        decoders[i] = static_cast<wiring::Decoder>(wanted[i]);
    }
    return plan_encoders(pairs, decoders);
}

/// A batch as the tests write it: per transaction address, write length, read length, bytes.
size_t unpack(const uint8_t *packed, size_t count, I2cTransaction *batch) {
    for (size_t i = 0; i < count; ++i) {
        batch[i] = {};
        batch[i].address = *packed++;
        batch[i].write_length = *packed++;
        batch[i].read_length = *packed++;
        std::copy(packed, packed + batch[i].write_length, batch[i].write);
        packed += batch[i].write_length;
    }
    return count;
}

class NoPin final : public OutputEnable {
public:
    bool wired() override { return false; }
    void set(bool) override {}
};

bool tick_driver(const Wiring &wiring, uint64_t now_us, const float *duty, bool on) {
    NoPin pin;
    MotorWires wires{*i2c, pin, nullptr};
    driver->set_wiring(wiring);
    driver->poll(wires);
    driver->drive(wires, now_us, duty, on);
    fake::advance_us(1000);
    return driver->ready();
}

} // namespace

extern "C" {

void chip_reset() {
    encoders.reset();
    i2c.reset();
    fake::reset();
}

int encoder_plan(size_t wheels, const uint8_t *pins, const uint8_t *wanted, uint8_t *units) {
    plan = wheels == 3 ? plan_of<3>(pins, wanted) : plan_of<4>(pins, wanted);
    for (size_t i = 0; i < wheels; ++i) {
        units[i] = plan.wheel[i].unit;
    }
    return static_cast<int>(plan.problem);
}

void robot_plan(uint8_t *units) {
    for (size_t i = 0; i < robot_encoder_plan().wheels; ++i) {
        units[i] = robot_encoder_plan().wheel[i].unit;
    }
}

/// Begin with the latest plan.
void encoders_begin() {
    encoders.emplace(plan);
    encoders->begin();
}

int encoders_read(int32_t *counts) {
    return encoders->read(counts);
}

void encoders_errors(uint32_t *errors) {
    encoders->errors(errors);
}

void pin_level(uint8_t pin, bool high) {
    fake::set_level(pin, high);
}

void interrupts_held(bool held) {
    fake::hold_interrupts(held);
}

uint32_t pin_interrupts() {
    return fake::take_pin_interrupts();
}

uint32_t encoder_edge_limit() {
    return Teensy40Encoders::edge_limit;
}

void decoder_position(uint8_t unit, uint32_t position) {
    fake::set_decoder(unit, position);
}

void decoder_both_changed(uint8_t unit) {
    fake::report_both_changed(unit);
}

int irq_priority(int irq) {
    return fake::priority_of(irq);
}

void i2c_begin(uint32_t speed_Hz) {
    i2c.emplace(speed_Hz);
    i2c->begin();
    driver.emplace();
    motor_stop = MotorStop();
}

bool i2c_submit(const uint8_t *packed, size_t count) {
    I2cTransaction batch[2 * Master::max_batch];
    unpack(packed, count, batch);
    return i2c->submit(batch, count);
}

int i2c_poll(uint8_t *read) {
    return static_cast<int>(i2c->poll(read));
}

void i2c_recover() {
    i2c->recover();
}

void i2c_counters(uint32_t *out) {
    std::memcpy(out, &i2c->counters(), sizeof(I2cCounters));
}

void i2c_stats(uint32_t *out) {
    const I2cStats stats = i2c->stats();
    out[0] = stats.nacks;
    out[1] = stats.timeouts;
    out[2] = stats.recoveries;
    out[3] = stats.last_us;
}

void bus_advance_us(uint32_t us) {
    fake::advance_us(us);
}

void bus_refuse_byte(int n) {
    fake::refuse_byte(n);
}

void bus_hold(int line, int after_events, int clocks) {
    fake::hold_line(static_cast<fake::Line>(line), after_events, clocks);
}

void bus_let_go() {
    fake::let_lines_go();
}

void bus_leave_stop(bool leave) {
    fake::leave_stop(leave);
}

void bus_rise_time(uint32_t ns) {
    fake::set_rise_time(ns);
}

void timer_allowed(bool allowed) {
    fake::timer_allowed(allowed);
}

/// @return events put into `out`, which are then forgotten.
size_t bus_events(uint16_t *out, size_t capacity) {
    const size_t count = std::min(capacity, fake::event_count());
    for (size_t i = 0; i < count; ++i) {
        out[i] = fake::event(i);
    }
    fake::clear_events();
    return count;
}

uint32_t bus_clocks() {
    return fake::take_gpio_clocks();
}

uint32_t bus_mistakes() {
    return fake::mistakes();
}

/// One tick of the motor driver, then a millisecond. @param duty of each of three wheels; nullptr: off. @return ready
bool driver_tick(uint64_t now_us, const float *duty) {
    static const Wiring wiring{3, {9, 13, 3}, {8, 14, 2}};
    static const float still[OMNI_MAX_WHEELS] = {};
    return tick_driver(wiring, now_us, duty != nullptr ? duty : still, duty != nullptr);
}

/// The same for four wheels on channels of which no two are neighbours: the longest batch that there is. A quarter
/// voltage.
bool driver_tick_scattered(uint64_t now_us) {
    static const Wiring wiring{4, {0, 4, 8, 12}, {2, 6, 10, 14}};
    static const float duty[OMNI_MAX_WHEELS] = {0.25f, 0.25f, 0.25f, 0.25f};
    return tick_driver(wiring, now_us, duty, true);
}

/// A step without the driver, then 50 us.
bool motor_stop_step() {
    const bool stopped = motor_stop.step(*i2c);
    fake::advance_us(50);
    return stopped;
}

uint32_t driver_errors() {
    return driver->errors();
}

uint32_t driver_failures() {
    return driver->failures();
}

double chip_duty(uint32_t channel) {
    return hil_pca9685_duty(&fake::chip(), channel);
}

void chip_power_cycle() {
    hil_pca9685_reset(&fake::chip(), 0x40);
}

uint32_t timing_field(uint32_t speed_Hz, int field) {
    const I2cTiming t = i2c_timing(i2c_mode(speed_Hz));
    const uint32_t fields[] = {t.prescale, t.clk_low, t.clk_high, t.set_hold, t.data_valid, t.filter, t.bus_idle};
    return fields[field];
}

uint64_t batch_ns(uint32_t speed_Hz, uint32_t rise_ns, uint32_t bytes, uint32_t starts) {
    return i2c_batch_ns(i2c_timing(i2c_mode(speed_Hz)), rise_ns, bytes, starts);
}
}

static_assert(i2c_batch_ns(i2c_timing(i2c_mode(1'000'000)), 120, 30, 3) <= 300'000,
              "an update takes too long at 1 MHz");
