// SPDX-License-Identifier: MIT
/// @file chip.h  A model of the Teensy 4.0's pins, quadrature decoders, I2C master and interrupts, for the tests.
#pragma once

#include <cstddef>
#include <cstdint>

namespace fake {

/// Everything back to reset.
void reset();

// ---- pins (pins.cpp)
/// Set the level that the world outside gives a pin. An edge may interrupt, if interrupts are let in.
void set_level(uint8_t pin, bool high);
/// Hold interrupts off (as an erase of flash does), or let the pending ones in.
void hold_interrupts(bool held);
/// Interrupts by pins since the last call.
uint32_t take_pin_interrupts();
uint8_t priority_of(int irq);
/// A pin's own drive: true while a GPIO pulls it low.
bool gpio_pulls_low(uint8_t pin);
/// In GPIO mode.
bool is_gpio(uint8_t pin);
/// Level from outside alone.
bool outside_level(uint8_t pin);
bool deliver(int irq);

// ---- quadrature decoders (decoders.cpp)
void reset_decoders();
/// A pin that is routed to the crossbar changed.
void crossbar_edge(uint8_t pin, bool high);
/// Let a decoder's counter begin elsewhere.
void set_decoder(uint8_t unit, uint32_t position);
/// The decoder saw both phases change at once.
void report_both_changed(uint8_t unit);

// ---- I2C (i2c_bus.cpp)
/// What happened on the wire. Bytes: the value, | nack if not acknowledged, | read if sent by the chip.
enum Event : uint16_t { event_start = 0x1000, event_stop = 0x2000, nack = 0x100, by_slave = 0x200 };
enum class Line : uint8_t { none, sda, scl };

void reset_bus();
/// Let time pass: the master works, its interrupts and the timer come.
void advance_us(uint32_t us);
/// Refuse the n-th byte (0: first, addresses count) of what follows; -1: none.
void refuse_byte(int n);
/// After so many more wire events, hold a line low. SDA is let go after `clocks` clocks, SCL never.
void hold_line(Line line, int after_events, int clocks);
void let_lines_go();
/// After a NACK the master waits for a STOP command instead of sending one by itself.
void leave_stop(bool leave);
bool timer_allowed(bool allowed);
/// How slow the lines' edges are: pull-ups and capacitance. 0 after a reset.
void set_rise_time(uint32_t ns);
size_t event_count();
uint16_t event(size_t index);
void clear_events();
/// Misuse of the master: FIFO overflow, commands out of order, both lines moved at once. 0 is right.
uint32_t mistakes();
/// Clocks made by GPIO since the last call.
uint32_t take_gpio_clocks();
void lines_changed();
bool bus_level(uint8_t pin);

} // namespace fake
