// SPDX-License-Identifier: MIT
/// @file main.cpp  The firmware on the emulated Cortex-M7: ticks by a timer interrupt, or by the host in lockstep.
#include <atomic>
#include <cstdio>
#include <optional>

#include "app/app.h"
#include "boards/common/no_hardware.h"
#include "boards/mps2_an500/base/fault.h"
#include "boards/mps2_an500/base/machine.h"
#include "boards/mps2_an500/base/semihosting.h"
#include "boards/mps2_an500/console_port.h"
#include "boards/mps2_an500/options.h"
#include "boards/mps2_an500/parts.h"
#include "boards/mps2_an500/pins.h"
#include "boards/mps2_an500/reset_record.h"
#include "boards/mps2_an500/uart_port.h"

namespace omni {
namespace {

constexpr uint32_t tick_us = OMNI_TICK_US;
constexpr uint8_t tick_priority = 0x80;
constexpr uint8_t inject_priority = 0x20;
constexpr size_t inject_uart = 4;
/// Maximum number of missed ticks that are caught up; beyond that time jumps, which the core reports.
constexpr uint64_t catch_up_us = 60'000'000;
/// So many at a time, so that the links are served in between.
constexpr int catch_up_ticks = 20;
/// Timeout of an incomplete frame.
constexpr uint32_t idle_us = 250'000;
/// Time to send queued messages before a reboot.
constexpr uint64_t reboot_flush_us = 200'000;

alignas(8) uint8_t burst_memory[default_burst_bytes];

class Machine {
public:
    bool open(int argc, char **argv, int *exit_code);
    [[noreturn]] void run();
    void on_timer();
    void on_watchdog() { record_reset_cause(ResetCause::watchdog); }
    void on_inject();
    bool crash_resets() const { return options_.crash_resets; }

    UartPort uarts[Board::max_ports];
    std::atomic<bool> woken{false};

private:
    bool open_pins();
    static float supply_V();
    void open_inject();
    void start_timer(uint32_t period_us);
    void catch_up();
    bool bytes_wait() const;
    void sleep();
    void reboot();

    Options options_;
    TimerClock clock_;
    HostStorage storage_;
    TimerWatchdog watchdog_;
    ConsolePort console_;
    Pins pins_;
    NoEncoders encoders_;
    NoMotorsBus bus_;
    NoOutputEnable output_enable_;
    Board board_;
    std::optional<App> app_;
    uint64_t ticked_us_ = 0;
};

Machine machine;

float Machine::supply_V() {
    return machine.pins_.battery_V();
}

bool Machine::open(int argc, char **argv, int *exit_code) {
    if (!parse_options(argc, argv, &options_, exit_code)) {
        return false;
    }
    *exit_code = 2;
    if (!storage_.open(options_.storage)) {
        return false;
    }
    const size_t uart_count = options_.link_count - (options_.console_link ? 1 : 0);
    for (size_t i = 0; i < uart_count; ++i) {
        uarts[i].open(i);
        board_.ports[i] = &uarts[i];
    }
    if (options_.console_link) {
        if (!console_.open(uart_count == 1)) {
            return false;
        }
        board_.ports[uart_count] = &console_;
    }
    board_.port_count = options_.link_count;
    board_.clock = &clock_;
    board_.encoders = &encoders_;
    board_.i2c = &bus_;
    board_.output_enable = &output_enable_;
    board_.storage = &storage_;
    board_.watchdog = &watchdog_;
    board_.robot_values = options_.values;
    board_.burst_memory = burst_memory;
    board_.burst_bytes = sizeof burst_memory;
    return !options_.pins || open_pins();
}

/// The host's world in place of the stand-ins, and its serial line in front of the others.
bool Machine::open_pins() {
    for (size_t i = board_.port_count++; i > 0; --i) {
        board_.ports[i] = board_.ports[i - 1];
    }
    board_.ports[0] = &pins_.wire;
    board_.encoders = &pins_;
    board_.output_enable = &pins_;
    board_.stop_button = &pins_;
    board_.i2c = &pins_.bus;
    board_.battery_V = supply_V;
    board_.use_mps2_an500();
    pins_.start(clock_);
    return pins_.connect();
}

void Machine::open_inject() {
    an500::uart(inject_uart).control = an500::uart_rx_enable | an500::uart_rx_interrupt;
    an500::set_priority(an500::uart_interrupt[inject_uart], inject_priority);
    an500::enable_interrupt(an500::uart_interrupt[inject_uart]);
}

/// Higher priority than all of the firmware's interrupts, so that nothing else runs.
void Machine::on_inject() {
    an500::uart(inject_uart).interrupt = an500::uart_rx_pending;
    if (an500::uart(inject_uart).data == 'c') {
        an500::at(0) = 0; // memory protection forbids it
    }
    for (;;) {}
}

void Machine::start_timer(uint32_t period_us) {
    an500::set_priority(an500::timer0_interrupt, tick_priority);
    an500::enable_interrupt(an500::timer0_interrupt);
    an500::timer0().reload = period_us * (an500::clock_Hz / 1'000'000) - 1;
    an500::timer0().value = an500::timer0().reload;
    an500::timer0().control = an500::timer_enable | an500::timer_interrupt_enable;
}

void Machine::catch_up() {
    const uint64_t now_us = clock_.elapsed_us();
    if (now_us > ticked_us_ + catch_up_us) {
        ticked_us_ = now_us - tick_us;
    }
    for (int i = 0; i < catch_up_ticks && ticked_us_ + tick_us <= now_us; ++i) {
        ticked_us_ += tick_us;
        clock_.set(ticked_us_);
        app_->tick();
    }
}

void Machine::on_timer() {
    an500::timer0().interrupt = 1;
    woken = true;
    if (options_.lockstep) {
        return;
    }
    if (options_.catch_up) {
        catch_up();
    } else {
        app_->tick();
    }
}

bool Machine::bytes_wait() const {
    for (const UartPort &uart : uarts) {
        if (uart.waiting()) {
            return true;
        }
    }
    return console_.waiting() || pins_.wire.waiting();
}

/// Sleep until the next interrupt, unless one has occurred since the last background pass began.
void Machine::sleep() {
    if (options_.pins) {
        return; // with -icount sleep=off, QEMU's time jumps over two periods of a timer that ends a sleep
    }
    if (options_.console_link) {
        if (!console_.has_sent() && !bytes_wait()) {
            watchdog_.pause();
            console_.wait();
            watchdog_.resume();
        }
        return;
    }
    const an500::InterruptLock lock;
    if (!woken && !bytes_wait()) {
        an500::wait_for_interrupt();
    }
}

void Machine::reboot() {
    const uint64_t begin_us = clock_.elapsed_us();
    for (const UartPort &uart : uarts) {
        while (!uart.drained() && clock_.elapsed_us() - begin_us < reboot_flush_us) {
            app_->background();
        }
    }
    watchdog_.reset();
}

void Machine::run() {
    clock_.start(options_.catch_up);
    watchdog_.start(options_.watchdog_ms, options_.reset_cause);
    app_.emplace(board_, options_.lockstep);
    if (options_.inject) {
        open_inject();
    }
    start_timer(options_.lockstep ? idle_us : tick_us);
    an500::semihosting_print("{\"ready\":true}\n");
    for (;;) {
        woken = false;
        app_->background();
        if (app_->reboot_wanted()) {
            reboot();
        }
        sleep();
    }
}

} // namespace
} // namespace omni

extern "C" {

void timer0_handler() {
    omni::machine.on_timer();
}

void nmi_handler() {
    omni::machine.on_watchdog();
    an500::reset_system();
}

void uart4_rx_handler() {
    omni::machine.on_inject();
}

#define OMNI_UART_HANDLERS(number)                                                                                     \
    void uart##number##_rx_handler() {                                                                                 \
        omni::machine.uarts[number].on_receive();                                                                      \
        omni::machine.woken = true;                                                                                    \
    }                                                                                                                  \
    void uart##number##_tx_handler() {                                                                                 \
        omni::machine.uarts[number].on_transmit();                                                                     \
        omni::machine.woken = true;                                                                                    \
    }
OMNI_UART_HANDLERS(0)
OMNI_UART_HANDLERS(1)
OMNI_UART_HANDLERS(2)
OMNI_UART_HANDLERS(3)
}

void an500_say(const char *line) {
    an500::semihosting_print("omni-firmware: ");
    an500::semihosting_print(line);
    an500::semihosting_print("\n");
}

extern "C" void an500_fault(const an500::Fault &fault) {
    an500::describe_fault(fault, an500_say);
    if (!omni::machine.crash_resets()) {
        an500::semihosting_exit(an500::fault_exit_code);
    }
    omni::record_crash(fault);
    an500::reset_system();
}

int main(int argc, char **argv) {
    int exit_code = 0;
    if (omni::machine.open(argc, argv, &exit_code)) {
        omni::machine.run();
    }
    return exit_code;
}
