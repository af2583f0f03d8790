// SPDX-License-Identifier: MIT
#include "boards/teensy40/watchdog.h"

#include <Arduino.h>
#include <CrashReport.h>

#include <cstring>

#include "boards/teensy40/processor.h"

namespace omni {
namespace {

// RTWDOG chapter of the i.MX RT1060 reference manual.
constexpr uint32_t unlock_word = 0xD928C520;
constexpr uint32_t feed_word = 0xB480A602;
constexpr uint32_t counts_per_ms =
    32; ///< of the 32.768 kHz low-power oscillator, which does not depend on the processor's clock
constexpr uint32_t low_power_clock = 1;
constexpr int unlock_patience = 1000;

/// Kept in SRC_GPR5 over a reset that was asked for; a lock-up leaves the same reset flag.
constexpr uint32_t asked_for = 0x4F4D4E49;

constexpr uint32_t data_address_valid = 0x80;  ///< CFSR.MMARVALID
constexpr uint32_t bus_address_valid = 0x8000; ///< CFSR.BFARVALID

/// What kind of fault, by the configurable fault status register (ARMv7-M B3.2.15).
const char *fault_kind(uint32_t cfsr) {
    if ((cfsr & 0xFF) != 0) {
        return "forbidden memory";
    }
    if ((cfsr & 0xFF00) != 0) {
        return "bus error";
    }
    return (cfsr & 0xFFFF0000) != 0 ? "bad instruction" : "unexpected interrupt";
}

/// CRC-32 of the fault handler's words as Teensyduino computes it: no final inversion.
uint32_t fault_crc(const arm_fault_info_struct &info) {
    uint32_t words[sizeof info / 4];
    std::memcpy(words, &info, sizeof words);
    uint32_t crc = 0xFFFFFFFF;
    for (size_t i = 0; i + 1 < sizeof words / 4; ++i) {
        crc ^= words[i];
        for (int bit = 0; bit < 32; ++bit) {
            crc = (crc >> 1) ^ ((crc & 1) != 0 ? 0xEDB88320u : 0u);
        }
    }
    return crc;
}

bool valid(const arm_fault_info_struct &info) {
    return info.len == sizeof info / 4 && info.crc == fault_crc(info);
}

ResetCause cause_of(uint32_t flags, uint32_t mark) {
    if ((flags & (SRC_SRSR_WDOG3_RST_B | SRC_SRSR_WDOG_RST_B)) != 0) {
        return ResetCause::watchdog;
    }
    if ((flags & SRC_SRSR_LOCKUP_SYSRESETREQ) != 0) {
        return mark == asked_for ? ResetCause::software : ResetCause::crash;
    }
    return ResetCause::power_on;
}

} // namespace

bool AliveGate::both_alive() {
    const uint32_t ticks = ticks_.load(std::memory_order_relaxed);
    const bool alive = ticks != seen_;
    seen_ = ticks;
    return alive;
}

void CrashLines::compose(uint32_t address, uint32_t cfsr, uint32_t hfsr, bool access_known, uint32_t access) {
    lines_[0] = Text().add("crash at ").add_hex(address).add(": ").add(fault_kind(cfsr));
    lines_[1] = Text().add("CFSR ").add_hex(cfsr).add(" HFSR ").add_hex(hfsr);
    count_ = 2;
    if (access_known) {
        lines_[2] = Text().add("accessing ").add_hex(access);
        count_ = 3;
    }
}

void Teensy40Watchdog::begin() {
    cause_ = cause_of(SRC_SRSR, SRC_GPR5);
    const arm_fault_info_struct info = *fault_info();
    if (valid(info)) {
        cause_ = ResetCause::crash;
        const bool data = (info.cfsr & data_address_valid) != 0;
        const bool bus = (info.cfsr & bus_address_valid) != 0;
        crash_.compose(info.ret, info.cfsr, info.hfsr, data || bus, data ? info.mmfar : info.bfar);
    }
    CrashReport.clear(); // the reset flags too, which would stay over the next reset
}

void Teensy40Watchdog::configure(uint32_t time_out_ms) {
    CCM_CCGR5 |= CCM_CCGR5_WDOG3(CCM_CCGR_ON);
    const InterruptLock lock; // what follows the unlocking must follow at once
    WDOG3_CNT = unlock_word;
    for (int i = 0; i < unlock_patience && (WDOG3_CS & WDOG_CS_ULK) == 0; ++i) {}
    WDOG3_TOVAL = time_out_ms * counts_per_ms;
    WDOG3_WIN = 0;
    WDOG3_CS =
        static_cast<uint32_t>(WDOG_CS_FLG | WDOG_CS_CMD32EN | WDOG_CS_CLK(low_power_clock) | WDOG_CS_UPDATE | WDOG_CS_EN);
    started_ = true;
}

void Teensy40Watchdog::feed() {
    if (alive_.both_alive() && started_) {
        WDOG3_CNT = feed_word;
    }
}

void Teensy40Watchdog::reset() {
    SRC_GPR5 = asked_for;
    system_reset();
}

} // namespace omni
