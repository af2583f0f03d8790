// SPDX-License-Identifier: MIT
// The model of the chip behind fakes_system/Arduino.h, and extern "C" functions that move it and look at it.
#include <CrashReport.h>
#include <csetjmp>
#include <cstdlib>
#include <initializer_list>
#include <IntervalTimer.h>

#include "boards/teensy40/encoders.h"
#include "boards/teensy40/faults.h"
#include "boards/teensy40/i2c.h"
#include "boards/teensy40/memory.h"
#include "boards/teensy40/processor.h"

volatile uint32_t F_CPU_ACTUAL = 600'000'000;
FakeCycleCounter ARM_DWT_CYCCNT;
volatile uint32_t SRC_GPR5, CCM_CCGR5;
FakeResetFlags SRC_SRSR;
volatile uint32_t HW_OCOTP_MAC0 = 0x04E5A0B1;
volatile uint32_t ADC1_HC0, ADC1_HS, ADC1_R0, ADC2_HC0, ADC2_HS, ADC2_R0;
FakeWatchdogCounter WDOG3_CNT;
FakeWatchdogControl WDOG3_CS;
FakeWatchdogLimit WDOG3_TOVAL, WDOG3_WIN;
FakeCrashReport CrashReport;
extern "C" const uint8_t pin_to_channel[32] = {7, 8, 12, 11, 6, 5, 15, 0, 13, 14, 1, 2, 128 + 3, 128 + 4,
                                               7, 8, 12, 11, 6, 5, 15, 0, 13, 14, 1, 2, 128 + 3, 128 + 4};

void fake_ports_reset(); // fake_ports.cpp

namespace {

/// Everything that happened in order, one letter each; see the functions below.
struct Journal {
    char text[4096];
    size_t length;
    void add(char letter) {
        if (length + 1 < sizeof text) {
            text[length++] = letter;
            text[length] = '\0';
        }
    }
};

struct Model {
    Journal journal;
    uint32_t cycles, cycles_per_look;
    uint32_t feeds, control, locks;
    bool lock_was_open;
    arm_fault_info_struct fault;
    uint8_t latch[40], direction[40]; ///< pins
    bool grounded[40];                ///< from outside
    uint32_t glitches;                ///< an output that was switched on while its latch was low
    void (*timer)();
    uint8_t timer_priority;
    uint32_t timer_period;
    uint8_t fault_pin;
} model;

// ---- I2C: one answer per batch, at the next poll
struct Bus {
    const char *answers; ///< for the batches to come: d done, n nack, s stuck, b busy; then always done
    bool waiting;
    uint32_t looks; ///< on_wire() says yes so many times more
} bus;

/// RTWDOG chapter of the i.MX RT1060 reference manual. The counter's clock is slow: a command to it and a new
/// configuration take some of the counter's periods to arrive there.
struct WatchdogModel {
    uint32_t counts, refresh_in, applied_in;
    uint32_t limit; ///< in force
    bool unlocked, enabled, bitten, misused;
} watchdog;
constexpr uint32_t sync_looks = 3; ///< how often one must look at a register until something has arrived

std::jmp_buf reset_point;
constexpr uint8_t no_pin = 255;

} // namespace

FakeCycleCounter::operator uint32_t() {
    return model.cycles += model.cycles_per_look;
}

// ---- watchdog
namespace {

void watchdog_bites_at_limit() {
    watchdog.bitten = watchdog.bitten || (watchdog.enabled && watchdog.counts >= watchdog.limit);
}

/// The processor looks at a register: a moment goes by.
void watchdog_look() {
    if (watchdog.refresh_in > 0 && --watchdog.refresh_in == 0) {
        watchdog.counts = 0;
    }
    watchdog.applied_in -= watchdog.applied_in > 0 ? 1 : 0;
}

} // namespace

void FakeWatchdogCounter::operator=(uint32_t command) {
    if (command == 0xD928C520) {
        watchdog.misused = watchdog.misused || watchdog.applied_in > 0; // the last configuration is on its way still
        watchdog.unlocked = true;
        WDOG3_TOVAL.written = WDOG3_WIN.written = false;
        model.lock_was_open = model.lock_was_open || model.locks == 0;
    } else if (command == 0xB480A602) {
        watchdog.refresh_in = sync_looks;
        ++model.feeds;
        model.journal.add('f');
    } else {
        watchdog.bitten = true;
    }
}

FakeWatchdogCounter::operator uint32_t() const {
    watchdog_look();
    return watchdog.counts;
}

void FakeWatchdogLimit::operator=(uint32_t counts) {
    watchdog.misused = watchdog.misused || !watchdog.unlocked || counts > 0xFFFF;
    value = watchdog.unlocked ? counts : value;
    written = true;
}

void FakeWatchdogControl::operator=(uint32_t value) {
    watchdog.misused = watchdog.misused || !watchdog.unlocked || !WDOG3_TOVAL.written || !WDOG3_WIN.written;
    if (watchdog.misused) {
        return;
    }
    model.control = value;
    model.journal.add('w');
    watchdog.unlocked = false;
    watchdog.enabled = (value & WDOG_CS_EN) != 0;
    watchdog.limit = WDOG3_TOVAL.value;
    watchdog.applied_in = sync_looks;
    watchdog_bites_at_limit();
}

FakeWatchdogControl::operator uint32_t() const {
    watchdog_look();
    return model.control | (watchdog.unlocked ? WDOG_CS_ULK : 0) | (watchdog.applied_in == 0 ? WDOG_CS_RCS : 0);
}

void FakeResetFlags::operator=(uint32_t written) {
    flags &= ~(written & 0xFF) & (written | ~SRC_SRSR_TEMPSENSE_RST_B);
}

void FakeCrashReport::clear() {
    SRC_SRSR = uint32_t{SRC_SRSR}; // as Teensyduino's does
    SRC_GPR5 = 0;
    model.fault = {};
}

namespace omni {

InterruptLock::InterruptLock() {
    ++model.locks;
}
InterruptLock::~InterruptLock() {
    --model.locks;
}
const arm_fault_info_struct *fault_info() {
    return &model.fault;
}
void system_reset() {
    model.journal.add('R');
    std::longjmp(reset_point, 1);
}
void on_fault(volatile uint32_t *, uint32_t) {}
void set_on_fault(volatile FakeSetRegister *target, uint32_t) {
    model.fault_pin = target->pin;
}
void paint_stack() {
    model.journal.add('p');
}
MemoryFree memory_free() {
    return {1000, 2000};
}
void Teensy40Encoders::begin() {
    model.journal.add('e');
}
void Teensy40I2c::begin() {
    model.journal.add('i');
}
bool Teensy40I2c::submit(const I2cTransaction *batch, size_t count) {
    constexpr uint8_t all_off[] = {0xFD, 0x10};
    const bool off = count == 1 && batch->address == 0x40 && batch->write_length == sizeof all_off &&
                     std::memcmp(batch->write, all_off, sizeof all_off) == 0;
    model.journal.add(off ? 'x' : '?');
    bus.waiting = true;
    return true;
}
I2cStatus Teensy40I2c::poll(uint8_t *) {
    if (!bus.waiting) {
        return I2cStatus::idle;
    }
    const char answer = bus.answers != nullptr && *bus.answers != 0 ? *bus.answers++ : 'd';
    bus.waiting = answer == 'b';
    switch (answer) {
    case 'n':
        return I2cStatus::nack;
    case 's':
        return I2cStatus::stuck;
    case 'b':
        return I2cStatus::busy;
    default:
        return I2cStatus::done;
    }
}
bool Teensy40I2c::on_wire() const {
    const bool busy = bus.looks > 0;
    bus.looks -= busy ? 1 : 0;
    model.journal.add(busy ? 'b' : 'q');
    return busy;
}
void Teensy40I2c::recover() {
    model.journal.add('c');
}

} // namespace omni

// ---- pins
volatile FakeSetRegister *portSetRegister(uint8_t pin) {
    static FakeSetRegister registers[40];
    registers[pin].pin = pin;
    return &registers[pin];
}
void FakeSetRegister::operator=(uint32_t) volatile {
    model.latch[pin] = HIGH;
}
/// The robot here has a PWM chip: nobody may ask for a motor's pin.
volatile uint32_t *portClearRegister(uint8_t) {
    std::abort();
}
volatile uint32_t *portConfigRegister(uint8_t) {
    std::abort();
}
void analogWriteResolution(unsigned) {}
void analogWriteFrequency(uint8_t, float) {
    std::abort();
}
void analogWrite(uint8_t, int) {
    std::abort();
}
void pinMode(uint8_t pin, uint8_t mode) {
    model.direction[pin] = mode;
    model.glitches += mode == OUTPUT && model.latch[pin] == LOW ? 1 : 0;
}
void digitalWrite(uint8_t pin, uint8_t level) {
    model.latch[pin] = level;
    if (pin == 9) {
        model.journal.add(level == LOW ? 'O' : 'o');
    }
}

/// A pin that nothing pulls up reads low at best by luck: here it always does.
uint8_t digitalRead(uint8_t pin) {
    return model.direction[pin] == INPUT_PULLUP && !model.grounded[pin] ? HIGH : LOW;
}

// ---- converters
void analogReadResolution(unsigned) {}
int analogRead(uint8_t) {
    return 0;
}

// ---- timer
void IntervalTimer::priority(uint8_t number) {
    model.timer_priority = number;
}
bool IntervalTimer::begin(void (*callback)(), uint32_t period_us) {
    model.timer = callback;
    model.timer_period = period_us;
    model.journal.add('t');
    return true;
}
void IntervalTimer::end() {
    model.timer = nullptr;
    model.journal.add('T');
}

extern "C" {

void fake_reset() {
    model = {};
    model.fault_pin = no_pin;
    bus = {};
    fake_ports_reset();
    SRC_SRSR.flags = SRC_SRSR_IPP_RESET_B;
    SRC_GPR5 = 0;
    watchdog = {};
    for (FakeWatchdogLimit *limit : {&WDOG3_TOVAL, &WDOG3_WIN}) {
        limit->value = 0;
        limit->written = false;
    }
    CCM_CCGR5 = 0;
    ADC1_HS = ADC2_HS = 0;
}
const char *fake_journal() {
    return model.journal.text;
}
void fake_journal_add(char letter) {
    model.journal.add(letter);
}
uint32_t fake_feeds() {
    return model.feeds;
}
uint32_t fake_watchdog_control() {
    return model.control;
}
uint32_t fake_watchdog_counts() {
    return watchdog.limit;
}
/// Time goes by.
void fake_watchdog_elapse_ms(uint32_t ms) {
    watchdog.counts = watchdog.refresh_in > 0 ? 0 : watchdog.counts;
    watchdog.refresh_in = watchdog.applied_in = 0;
    watchdog.counts += ms * 32768 / 1000;
    watchdog_bites_at_limit();
}
/// It has reset the processor.
bool fake_watchdog_bitten() {
    return watchdog.bitten;
}
/// A register was written while it is locked, or unlocked before the last configuration had arrived.
bool fake_watchdog_misused() {
    return watchdog.misused;
}
/// The unlocking sequence was never open to an interrupt.
bool fake_watchdog_atomic() {
    return !model.lock_was_open;
}
void fake_reset_flags(uint32_t flags, uint32_t mark) {
    SRC_SRSR.flags = flags;
    SRC_GPR5 = mark;
}
uint32_t fake_reset_flags_left() {
    return SRC_SRSR;
}
uint32_t fake_reset_mark() {
    return SRC_GPR5;
}
void fake_fault(const uint32_t *words) {
    std::memcpy(&model.fault, words, sizeof model.fault);
}
int fake_pin(uint8_t pin) {
    return model.direction[pin] == OUTPUT ? model.latch[pin] : -1;
}
void fake_ground_pin(uint8_t pin, bool grounded) {
    model.grounded[pin] = grounded;
}
uint32_t fake_pin_glitches() {
    return model.glitches;
}
uint8_t fake_fault_pin() {
    return model.fault_pin;
}
void fake_cycles(uint32_t cycles) {
    model.cycles = cycles;
}
/// Each look at the cycle counter finds a millisecond gone.
void fake_time_passes(bool passes) {
    model.cycles_per_look = passes ? 600'000 : 0;
}
uint32_t fake_timer_period() {
    return model.timer_period;
}
uint8_t fake_timer_priority() {
    return model.timer_priority;
}
bool fake_timer_fires() {
    if (model.timer != nullptr) {
        model.timer();
    }
    return model.timer != nullptr;
}
/// Run something that may reset the processor. @return true if it did.
bool fake_resets(void (*function)()) {
    if (setjmp(reset_point) != 0) {
        return true;
    }
    function();
    return false;
}
void fake_i2c_on_wire(uint32_t looks) {
    bus.looks = looks;
}
bool fake_i2c_waits_for_interrupts() {
    return bus.looks > 0;
}
void fake_i2c_answers(const char *answers) {
    bus.answers = answers;
}
void fake_burnt_address(uint32_t lower) {
    HW_OCOTP_MAC0 = lower;
}
void fake_conversion(int converter, uint32_t result) {
    (converter == 2 ? ADC2_R0 : ADC1_R0) = result;
    (converter == 2 ? ADC2_HS : ADC1_HS) = ADC_HS_COCO0;
    (converter == 2 ? ADC2_HC0 : ADC1_HC0) = 0x1F;
}
/// @return channel of the conversion under way, 31: none.
uint32_t fake_converting(int converter) {
    (converter == 2 ? ADC2_HS : ADC1_HS) = 0;
    return converter == 2 ? ADC2_HC0 : ADC1_HC0;
}
}
