// SPDX-License-Identifier: MIT
#include "boards/teensy40/watchdog.h"

#include <Arduino.h>
#include <CrashReport.h>

#include <cstring>

#include "app/base/crc32.h"
#include "app/base/flash_code.h"
#include "boards/teensy40/processor.h"

namespace omni {
namespace {

// RTWDOG chapter of the i.MX RT1060 reference manual.
constexpr uint32_t unlock_word = 0xD928C520;
constexpr uint32_t feed_word = 0xB480A602;
constexpr uint32_t counts_per_ms =
    32; ///< of the 32.768 kHz low-power oscillator, which does not depend on the processor's clock
constexpr uint32_t low_power_clock = 1;
constexpr int unlock_polls = 1000;
/// Clock domain crossing to the oscillator: a command or a configuration takes a few of its 31 us periods.
constexpr uint32_t crossing_timeout_ms = 1;

/// In SRC_GPR5 across a requested reset.
constexpr uint32_t requested_reset = 0x4F4D4E49;
/// Left there by Teensyduino's fault handler if its wait was not interrupted.
constexpr uint32_t fault_handler = 0x0BAD00F1;

/// Bits of a SRC_SRSR and what they mean (reference manual, SRC Reset Status Register). The first row that fits counts.
struct ResetSource {
    uint32_t flags;
    ResetCause cause;
    const char *line;
};

/// SYSRESETREQ without our mark is the loader's way to start the program after an upload. A processor that locked up
/// does not leave that flag: lock-ups reset nothing (SRC_SCR.lockup_rst is 0 from reset on) until the watchdog does.
constexpr ResetSource sources[] = {
    {SRC_SRSR_WDOG3_RST_B | SRC_SRSR_WDOG_RST_B, ResetCause::watchdog, nullptr},
    {SRC_SRSR_TEMPSENSE_RST_B, ResetCause::over_temperature, nullptr},
    {SRC_SRSR_CSU_RESET_B, ResetCause::crash, "reset by the processor's security monitor"},
    {SRC_SRSR_LOCKUP_SYSRESETREQ, ResetCause::software, nullptr},
    {SRC_SRSR_JTAG_RST_B | SRC_SRSR_JTAG_SW_RST, ResetCause::software, nullptr},
    {SRC_SRSR_IPP_USER_RESET_B | SRC_SRSR_IPP_RESET_B, ResetCause::power_on, nullptr},
};
constexpr ResetSource handled_fault = {SRC_SRSR_LOCKUP_SYSRESETREQ, ResetCause::crash, "the fault's record is lost"};
constexpr ResetSource no_source = {0, ResetCause::power_on, nullptr};

// Exception numbers of ARMv7-M: below, the processor's own; from here on interrupts.
constexpr uint32_t first_interrupt = 16;
constexpr uint32_t exception_mask = 0x1FF; ///< IPSR
/// Teensyduino treats it as a fault, at 90 degrees Celsius (tempmon.c).
constexpr uint32_t too_hot = first_interrupt + IRQ_TEMPERATURE_PANIC;

constexpr uint32_t data_address_valid = 0x80;  ///< CFSR.MMARVALID
constexpr uint32_t bus_address_valid = 0x8000; ///< CFSR.BFARVALID

/// What kind of fault, by the configurable fault status register (ARMv7-M B3.2.15) and the exception's number.
Text &add_kind(Text &text, uint32_t cfsr, uint32_t exception) {
    if ((cfsr & 0xFF) != 0) {
        return text.add("forbidden memory");
    }
    if ((cfsr & 0xFF00) != 0) {
        return text.add("bus error");
    }
    if ((cfsr & 0xFFFF0000) != 0) {
        return text.add("bad instruction");
    }
    if (exception < first_interrupt) {
        return text.add("exception ").add(exception);
    }
    return text.add("unexpected interrupt ").add(exception - first_interrupt);
}

/// CRC-32 of the fault handler's words as Teensyduino computes it: no final inversion.
uint32_t fault_crc(const arm_fault_info_struct &info) {
    uint8_t bytes[sizeof info - sizeof info.crc];
    std::memcpy(bytes, &info, sizeof bytes);
    return ~crc32(bytes, sizeof bytes);
}

bool valid(const arm_fault_info_struct &info) {
    return info.len == sizeof info / 4 && info.crc == fault_crc(info);
}

const ResetSource &source_of(uint32_t flags, uint32_t mark) {
    for (const ResetSource &source : sources) {
        if ((flags & source.flags) != 0) {
            const bool handled = source.flags == handled_fault.flags && mark == fault_handler;
            return handled ? handled_fault : source;
        }
    }
    return no_source;
}

/// Wait until the watchdog has taken over a setting. @param there true once it has.
template <typename There>
void wait_for_crossing(There there) {
    const uint32_t begin = ARM_DWT_CYCCNT;
    while (!there() && ARM_DWT_CYCCNT - begin < F_CPU_ACTUAL / 1000 * crossing_timeout_ms) {}
}

} // namespace

bool AliveGate::both_alive() {
    const uint32_t ticks = ticks_.load(std::memory_order_relaxed);
    const bool alive = ticks != seen_;
    seen_ = ticks;
    return alive;
}

OMNI_COLD void CrashLines::compose(const CrashFacts &facts) {
    if (facts.exception == too_hot) {
        add(Text().add("too hot, above 90 C, at ").add_hex(facts.address));
        return;
    }
    Text what = Text().add("crash at ").add_hex(facts.address).add(": ");
    add(add_kind(what, facts.cfsr, facts.exception));
    add(Text().add("CFSR ").add_hex(facts.cfsr).add(" HFSR ").add_hex(facts.hfsr));
    if (facts.access_known) {
        add(Text().add("accessing ").add_hex(facts.access));
    }
}

void Teensy40Watchdog::take_fault() {
    const arm_fault_info_struct info = *fault_info();
    if (!valid(info)) {
        return;
    }
    const bool data = (info.cfsr & data_address_valid) != 0;
    const bool bus = (info.cfsr & bus_address_valid) != 0;
    const CrashFacts facts{info.ret,    info.ipsr & exception_mask,   info.cfsr, info.hfsr,
                           data || bus, data ? info.mmfar : info.bfar};
    cause_ = facts.exception == too_hot ? ResetCause::over_temperature : ResetCause::crash;
    crash_ = CrashLines();
    crash_.compose(facts);
}

void Teensy40Watchdog::begin() {
    const uint32_t flags = SRC_SRSR;
    const ResetSource &source = source_of(flags, SRC_GPR5);
    cause_ = source.cause;
    if (source.line != nullptr) {
        crash_.add(Text().add(source.line));
    }
    take_fault();
    CrashReport.clear(); // the reset flags too, which would stay over the next reset
    // But not the temperature sensor's: that one alone is cleared by writing 0.
    SRC_SRSR = flags & ~static_cast<uint32_t>(SRC_SRSR_TEMPSENSE_RST_B);
}

/// Restart the count first: the time elapsed under a longer timeout may exceed the shorter one.
void Teensy40Watchdog::configure(uint32_t time_out_ms) {
    const uint32_t counts = time_out_ms * counts_per_ms;
    CCM_CCGR5 |= CCM_CCGR5_WDOG3(CCM_CCGR_ON);
    WDOG3_CNT = feed_word;
    wait_for_crossing([counts] { return WDOG3_CNT < counts / 2; });
    {
        const InterruptLock lock; // what follows the unlocking must follow within 128 bus clocks
        WDOG3_CNT = unlock_word;
        for (int i = 0; i < unlock_polls && (WDOG3_CS & WDOG_CS_ULK) == 0; ++i) {}
        WDOG3_TOVAL = counts;
        WDOG3_WIN = 0;
        WDOG3_CS = static_cast<uint32_t>(WDOG_CS_FLG | WDOG_CS_CMD32EN | WDOG_CS_CLK(low_power_clock) | WDOG_CS_UPDATE |
                                         WDOG_CS_EN);
    }
    wait_for_crossing([] { return (WDOG3_CS & WDOG_CS_RCS) != 0; });
    started_ = true;
}

void Teensy40Watchdog::feed() {
    if (alive_.both_alive() && started_) {
        WDOG3_CNT = feed_word;
    }
}

void Teensy40Watchdog::reset() {
    SRC_GPR5 = requested_reset;
    system_reset();
}

} // namespace omni
