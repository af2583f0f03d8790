// SPDX-License-Identifier: MIT
// Pins, GPIO ports and the interrupt controller.
#include "boards/teensy40/processor.h"
#include "chip.h"
#include "core_pins.h"

namespace fake {
namespace {

constexpr size_t pin_count = 40;
constexpr size_t port_size = 36;
enum Offset { dr = 0, gdir = 1, psr = 2, imr = 5, isr = 6, edge_sel = 7, dr_clear = 34 };

Register ports[4][port_size];
Register muxes[pin_count];
Register pads[pin_count];
bool levels[pin_count];
bool held = false;
uint32_t locks; ///< InterruptLocks that there are
uint32_t pin_interrupts;
void (*vectors[200])();
bool enabled[200];
uint8_t priorities[200];

// Port (0: GPIO6) and bit of each pin of a Teensy 4.0.
constexpr uint8_t where[pin_count][2] = {{0, 3},  {0, 2},  {3, 4},  {3, 5},  {3, 6},  {3, 8},  {1, 10}, {1, 17},
                                         {1, 16}, {1, 11}, {1, 0},  {1, 2},  {1, 1},  {1, 3},  {0, 18}, {0, 19},
                                         {0, 23}, {0, 22}, {0, 17}, {0, 16}, {0, 26}, {0, 27}, {0, 24}, {0, 25},
                                         {0, 12}, {0, 13}, {0, 30}, {0, 31}, {2, 18}, {3, 31}, {2, 23}, {2, 22},
                                         {1, 12}, {3, 7},  {2, 15}, {2, 14}, {2, 13}, {2, 12}, {2, 17}, {2, 16}};

constexpr Pin pin(size_t number) {
    return {ports[where[number][0]], 1u << where[number][1], &muxes[number], &pads[number]};
}

template <size_t port>
uint32_t read_pads(uint32_t) {
    uint32_t bits = 0;
    for (size_t i = 0; i < pin_count; ++i) {
        // A pad that is not in GPIO mode reads as noise: nobody may rely on it.
        const bool high =
            is_gpio(static_cast<uint8_t>(i)) ? bus_level(static_cast<uint8_t>(i)) : (cycles >> i % 7 & 1u) != 0;
        if (where[i][0] == port && high) {
            bits |= pins[i].mask;
        }
    }
    return bits;
}

template <size_t port>
void clear_flags(uint32_t written) {
    ports[port][isr].value &= ~written;
}

template <size_t port>
void direct(uint32_t written) {
    ports[port][gdir].value = written;
    lines_changed();
}

template <size_t port>
void clear_outputs(uint32_t written) {
    ports[port][dr].value &= ~written;
}

template <size_t port>
void hook() {
    ports[port][psr].on_read = read_pads<port>;
    ports[port][isr].on_write = clear_flags<port>;
    ports[port][gdir].on_write = direct<port>;
    ports[port][dr_clear].on_write = clear_outputs<port>;
}

bool pin_interrupt_pending() {
    for (auto &port : ports) {
        if ((port[isr].value & port[imr].value) != 0) {
            return true;
        }
    }
    return false;
}

void deliver_pins() {
    while (pin_interrupt_pending() && deliver(IRQ_GPIO6789)) {
        ++pin_interrupts;
    }
}

} // namespace

#define TEN(n)                                                                                                         \
    pin(n), pin(n + 1), pin(n + 2), pin(n + 3), pin(n + 4), pin(n + 5), pin(n + 6), pin(n + 7), pin(n + 8), pin(n + 9)
const Pin pins[40] = {TEN(0), TEN(10), TEN(20), TEN(30)};
Register ccm_ccgr2, ccm_ccgr4, ccm_cscdr2, daisy[26], sda_daisy, scl_daisy, sda3_daisy, scl3_daisy, sda4_daisy,
    scl4_daisy, ccm_ccgr6;
uint32_t cycles = 0;

void attach(int irq, void (*function)()) {
    vectors[irq] = function;
}

void enable(int irq) {
    enabled[irq] = true;
}

void set_priority(int irq, uint8_t priority) {
    priorities[irq] = priority;
}

uint8_t priority_of(int irq) {
    return priorities[irq];
}

bool deliver(int irq) {
    if (held || locks > 0 || !enabled[irq] || vectors[irq] == nullptr) {
        return false;
    }
    vectors[irq]();
    return true;
}

bool is_gpio(uint8_t number) {
    return (muxes[number].value & 0xFu) == 5u;
}

bool gpio_pulls_low(uint8_t number) {
    const Register *port = pins[number].port;
    return is_gpio(number) && (port[gdir].value & pins[number].mask) != 0 && (port[dr].value & pins[number].mask) == 0;
}

bool outside_level(uint8_t number) {
    return levels[number];
}

void set_level(uint8_t number, bool high) {
    if (levels[number] == high) {
        return;
    }
    levels[number] = high;
    Register *port = pins[number].port;
    if (is_gpio(number) && (port[edge_sel].value & pins[number].mask) != 0) {
        port[isr].value |= pins[number].mask;
    }
    if (!is_gpio(number)) {
        crossbar_edge(number, high);
    }
    deliver_pins();
}

void hold_interrupts(bool hold) {
    held = hold;
    deliver_pins();
}

uint32_t take_pin_interrupts() {
    const uint32_t count = pin_interrupts;
    pin_interrupts = 0;
    return count;
}

void reset() {
    pin_interrupts = 0;
    for (auto &port : ports) {
        for (Register &each : port) {
            each.value = 0;
        }
    }
    for (size_t i = 0; i < pin_count; ++i) {
        muxes[i].value = 5;
        pads[i].value = 0;
        levels[i] = true;
    }
    for (size_t i = 0; i < 200; ++i) {
        vectors[i] = nullptr;
        enabled[i] = false;
    }
    held = false;
    hook<0>();
    hook<1>();
    hook<2>();
    hook<3>();
    reset_decoders();
    reset_bus();
}

} // namespace fake

omni::InterruptLock::InterruptLock() {
    ++fake::locks;
}

omni::InterruptLock::~InterruptLock() {
    --fake::locks;
    fake::deliver_pins();
}
