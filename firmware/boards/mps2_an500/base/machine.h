// SPDX-License-Identifier: MIT
/// @file machine.h  Registers of the Arm MPS2 board with the AN500 image (Cortex-M7, 25 MHz), as far as they are used.
///
/// Sources: Arm DAI 0500 (AN500), DDI 0479 (Cortex-M System Design Kit), ARMv7-M Architecture Reference Manual.
#pragma once

#include <cstddef>
#include <cstdint>

namespace an500 {

constexpr uint32_t clock_Hz = 25'000'000;
constexpr uint32_t ns_per_clock = 40;

using Register = volatile uint32_t;

inline Register &at(uintptr_t address) {
    return *reinterpret_cast<Register *>(address);
}

/// CMSDK APB UART.
struct Uart {
    Register data;
    Register state;
    Register control;
    Register interrupt; ///< pending; write 1 to clear
    Register divider;
};
constexpr uint32_t uart_tx_full = 1u << 0;
constexpr uint32_t uart_rx_full = 1u << 1;
constexpr uint32_t uart_tx_enable = 1u << 0;
constexpr uint32_t uart_rx_enable = 1u << 1;
constexpr uint32_t uart_tx_interrupt = 1u << 2;
constexpr uint32_t uart_rx_interrupt = 1u << 3;
constexpr uint32_t uart_tx_pending = 1u << 0;
constexpr uint32_t uart_rx_pending = 1u << 1;
constexpr size_t uart_count = 5;
constexpr uintptr_t uart_address[uart_count] = {0x40004000, 0x40005000, 0x40006000, 0x40007000, 0x40009000};
/// Number of the receive interrupt; the transmit interrupt is the next one.
constexpr uint32_t uart_interrupt[uart_count] = {0, 2, 4, 18, 20};
inline Uart &uart(size_t number) {
    return *reinterpret_cast<Uart *>(uart_address[number]);
}

/// CMSDK APB timer: counts down, period reload + 1.
struct Timer {
    Register control;
    Register value;
    Register reload;
    Register interrupt; ///< write 1 to clear
};
constexpr uint32_t timer_enable = 1u << 0;
constexpr uint32_t timer_interrupt_enable = 1u << 3;
constexpr uint32_t timer0_interrupt = 8;
inline Timer &timer0() {
    return *reinterpret_cast<Timer *>(0x40000000);
}

/// First half of the CMSDK dual timer, as a free-running 32-bit down counter.
struct FreeTimer {
    Register load;
    Register value;
    Register control;
};
constexpr uint32_t free_timer_32_bit = 1u << 1;
constexpr uint32_t free_timer_enable = 1u << 7;
inline FreeTimer &free_timer() {
    return *reinterpret_cast<FreeTimer *>(0x40002000);
}

/// CMSDK APB watchdog: non-maskable interrupt when the time is up, reset when it is up again.
struct WatchdogTimer {
    Register load;
    Register value;
    Register control;
    Register clear;
};
constexpr uint32_t watchdog_interrupt_enable = 1u << 0;
constexpr uint32_t watchdog_reset_enable = 1u << 1;
inline WatchdogTimer &watchdog_timer() {
    return *reinterpret_cast<WatchdogTimer *>(0x40008000);
}

inline void enable_interrupt(uint32_t number) {
    at(0xE000E100) = 1u << number;
}

inline void disable_interrupt(uint32_t number) {
    at(0xE000E180) = 1u << number;
}

/// @param priority 0 (most urgent) to 255.
inline void set_priority(uint32_t number, uint8_t priority) {
    *reinterpret_cast<volatile uint8_t *>(0xE000E400 + number) = priority;
}

/// Holds interrupts off while it lives.
class InterruptLock {
public:
    InterruptLock() { asm volatile("mrs %0, primask\n\tcpsid i" : "=r"(before_) : : "memory"); }
    ~InterruptLock() { asm volatile("msr primask, %0" : : "r"(before_) : "memory"); }
    InterruptLock(const InterruptLock &) = delete;
    InterruptLock &operator=(const InterruptLock &) = delete;

private:
    uint32_t before_;
};

/// Sleep until an interrupt is pending, masked or not.
inline void wait_for_interrupt() {
    asm volatile("dsb\n\twfi" : : : "memory");
}

[[noreturn]] inline void reset_system() {
    at(0xE000ED0C) = 0x05FA0004;
    asm volatile("dsb" : : : "memory");
    for (;;) {}
}

/// Start the free-running counter that clock_ticks() reads; it counts down at clock_Hz.
inline void start_free_timer() {
    free_timer().control = 0;
    free_timer().load = 0xFFFFFFFF;
    free_timer().control = free_timer_enable | free_timer_32_bit;
}

/// Modulo 2^32, at clock_Hz. With `qemu -icount shift=6` an instruction takes 64 ns: instructions = ticks * 40 / 64.
inline uint32_t clock_ticks() {
    return ~free_timer().value;
}

} // namespace an500
