// SPDX-License-Identifier: MIT
// An I2C master with its command FIFO, the two lines, a PCA9685 on them, and the interval timer. The master is LPI2C1;
// compiled with GYRO_PORT it is LPI2C3, with FLOW_PORT LPI2C4.
#include <cstring>
#include <vector>

#include "chip.h"
#include "core_pins.h"
#include "IntervalTimer.h"

extern "C" {
#include "hil_sim/pca9685.h"
}

IMXRT_LPI2C_t IMXRT_LPI2C1, IMXRT_LPI2C3, IMXRT_LPI2C4;

namespace fake {
namespace {

#ifdef GYRO_PORT
IMXRT_LPI2C_t &master = IMXRT_LPI2C3;
constexpr IRQ_NUMBER_t master_irq = IRQ_LPI2C3;
constexpr uint8_t sda_pin = 17;
constexpr uint8_t scl_pin = 16;
#elif defined(FLOW_PORT)
IMXRT_LPI2C_t &master = IMXRT_LPI2C4;
constexpr IRQ_NUMBER_t master_irq = IRQ_LPI2C4;
constexpr uint8_t sda_pin = 25;
constexpr uint8_t scl_pin = 24;
#else
IMXRT_LPI2C_t &master = IMXRT_LPI2C1;
constexpr IRQ_NUMBER_t master_irq = IRQ_LPI2C1;
constexpr uint8_t sda_pin = 18;
constexpr uint8_t scl_pin = 19;
#endif
constexpr uint64_t never = UINT64_MAX;
constexpr uint32_t cycles_per_us = 600;
constexpr size_t fifo_size = 4;

struct Fifo {
    uint32_t words[fifo_size];
    size_t count;

    bool push(uint32_t word) {
        if (count == fifo_size) {
            return false;
        }
        words[count++] = word;
        return true;
    }
    uint32_t pop() {
        const uint32_t first = words[0];
        std::memmove(words, words + 1, --count * sizeof words[0]);
        return first;
    }
};

struct Bus {
    Fifo commands;
    Fifo received;
    uint32_t flags;
    bool enabled;
    bool ours;        ///< between START and STOP
    bool reading;     ///< addressed for reading
    bool auto_stop;   ///< the master ends by itself after a NACK
    bool leaves_stop; ///< and would not, if its flag were cleared too early
    bool working;
    uint32_t command;
    uint32_t bytes_left; ///< of a RECEIVE
    uint64_t ready_at;
    uint64_t now;

    hil_pca9685_t chip;
    uint8_t address;
    uint8_t written[64];
    size_t written_count;
    int refused_byte;
    Line to_hold;
    Line held;
    int hold_after; ///< events until to_hold is held
    int clocks;     ///< until SDA is let go
    int bytes_seen;
    bool scl, sda;
    uint32_t gpio_clocks; ///< times a GPIO took SCL low
    std::vector<uint16_t> log;
    uint32_t mistake_count;

    void (*timer)();
    uint64_t timer_period;
    uint64_t timer_at;
    bool timer_refused;
    uint32_t rise_ns; ///< of the lines' edges, 30 % to 70 %
};

Bus bus;

bool line_held(Line line) {
    return bus.held == line;
}

void commit_write() {
    if (bus.written_count > 0) {
        hil_pca9685_write(&bus.chip, bus.address, bus.written, static_cast<uint32_t>(bus.written_count));
        bus.written_count = 0;
    }
}

void log_event(uint16_t what) {
    if (what == event_start || what == event_stop) {
        commit_write();
    }
    bus.log.push_back(what);
    if (bus.to_hold != Line::none && --bus.hold_after == 0) {
        bus.held = bus.to_hold;
        bus.to_hold = Line::none;
    }
}

/// One bit's length from the registers. An RC edge is seen as high 0.91 of its rise time after it began.
uint64_t bit_cycles() {
    const uint32_t ccr = master.MCCR0.value;
    const uint32_t scale = master.MCFGR1.value & 7u;
    const uint32_t rise_clocks = bus.rise_ns * 60 * 91 / 100'000;
    const uint32_t latency = (2 + (master.MCFGR2.value >> 16 & 0xFu) + rise_clocks) >> scale;
    return uint64_t{((ccr & 0x3Fu) + (ccr >> 8 & 0x3Fu) + 2 + latency) << scale} * 10; // 600 MHz / 60 MHz
}

void lose_arbitration() {
    bus.flags |= LPI2C_MSR_ALF;
    bus.ours = false;
    bus.working = false;
}

/// A master's byte. @return false if it lost the bus.
bool send(uint8_t data, bool acknowledged) {
    if (line_held(Line::sda)) {
        if (data != 0) {
            lose_arbitration();
            return false;
        }
        acknowledged = true; // a low SDA looks like one
    }
    const bool refused = bus.bytes_seen++ == bus.refused_byte;
    const bool ack = acknowledged && !refused;
    log_event(ack ? data : static_cast<uint16_t>(data | nack));
    if (!ack) {
        bus.flags |= LPI2C_MSR_NDF;
        bus.auto_stop = !bus.leaves_stop;
    }
    return ack;
}

void do_start(uint8_t first) {
    if (is_gpio(sda_pin) || is_gpio(scl_pin)) {
        ++bus.mistake_count;
    }
    if (line_held(Line::sda) && bus.ours) {
        lose_arbitration();
        return;
    }
    log_event(event_start);
    bus.ours = true;
    bus.reading = (first & 1u) != 0;
    bus.address = first >> 1;
    const bool known = hil_pca9685_write(&bus.chip, bus.address, nullptr, 0);
    send(first, known);
}

void do_stop() {
    if (!bus.ours) {
        return;
    }
    log_event(event_stop);
    bus.ours = false;
    bus.flags |= LPI2C_MSR_SDF | LPI2C_MSR_EPF;
}

void fifo_error() {
    if ((bus.flags & (LPI2C_MSR_NDF | LPI2C_MSR_ALF)) == 0) {
        ++bus.mistake_count;
    }
    bus.flags |= LPI2C_MSR_FEF;
}

void do_transmit(uint8_t data) {
    if (!bus.ours) {
        fifo_error();
        return;
    }
    if (bus.reading) {
        ++bus.mistake_count;
    }
    if (send(data, true) && bus.written_count < sizeof bus.written) {
        bus.written[bus.written_count++] = data;
    }
}

void do_receive() {
    if (!bus.ours) {
        fifo_error();
        bus.bytes_left = 0;
        return;
    }
    uint8_t data = 0;
    if (!bus.reading || !hil_pca9685_read(&bus.chip, bus.address, &data, 1)) {
        ++bus.mistake_count;
    }
    --bus.bytes_left;
    if (line_held(Line::sda)) {
        data = 0;
    }
    bus.received.push(data);
    log_event(static_cast<uint16_t>(data | by_slave | (bus.bytes_left == 0 ? +nack : 0)));
    if (line_held(Line::sda) && bus.bytes_left == 0) {
        lose_arbitration(); // the last byte's NACK cannot be sent
    }
}

bool can_begin() {
    if (!bus.enabled || bus.working) {
        return false;
    }
    if (bus.auto_stop) {
        return true;
    }
    const bool blocked = (bus.flags & (LPI2C_MSR_NDF | LPI2C_MSR_ALF | LPI2C_MSR_FEF)) != 0;
    return bus.bytes_left > 0 ? bus.received.count < fifo_size : bus.commands.count > 0 && !blocked;
}

/// A line that is held stops the clock, keeps a START from beginning and a STOP from ending.
bool hangs() {
    const uint32_t kind = bus.auto_stop ? LPI2C_MTDR_CMD_STOP : bus.command & 0x700u;
    const bool edge_needed = kind == LPI2C_MTDR_CMD_STOP || (kind == LPI2C_MTDR_CMD_START && !bus.ours);
    return line_held(Line::scl) || (line_held(Line::sda) && edge_needed);
}

void begin_command() {
    if (!bus.auto_stop && bus.bytes_left == 0) {
        bus.command = bus.commands.pop();
        if ((bus.command & 0x700u) == LPI2C_MTDR_CMD_RECEIVE) {
            bus.bytes_left = (bus.command & 0xFFu) + 1;
        }
    }
    const bool stop = bus.auto_stop || (bus.command & 0x700u) == LPI2C_MTDR_CMD_STOP;
    bus.working = true;
    bus.ready_at = bus.now + (stop ? 1 : 9) * bit_cycles();
}

void end_command() {
    if (hangs()) {
        bus.ready_at = never;
        return;
    }
    bus.working = false;
    if (bus.auto_stop) {
        bus.auto_stop = false;
        bus.bytes_left = 0;
        do_stop();
        return;
    }
    const uint8_t data = static_cast<uint8_t>(bus.command & 0xFFu);
    switch (bus.command & 0x700u) {
    case LPI2C_MTDR_CMD_START:
        do_start(data);
        break;
    case LPI2C_MTDR_CMD_TRANSMIT:
        do_transmit(data);
        break;
    case LPI2C_MTDR_CMD_RECEIVE:
        do_receive();
        break;
    case LPI2C_MTDR_CMD_STOP:
        do_stop();
        break;
    default:
        ++bus.mistake_count;
    }
}

uint32_t status(uint32_t) {
    uint32_t flags = bus.flags | (bus.ours ? LPI2C_MSR_MBF | LPI2C_MSR_BBF : 0u);
    flags |= bus.received.count > 0 ? LPI2C_MSR_RDF : 0u;
    return flags | (bus.commands.count <= (master.MFCR.value & 3u) ? LPI2C_MSR_TDF : 0u);
}

void clear_status(uint32_t written) {
    bus.flags &= ~written;
}

uint32_t fifo_status(uint32_t) {
    return static_cast<uint32_t>(bus.commands.count | bus.received.count << 16);
}

void queue_command(uint32_t word) {
    if (!bus.commands.push(word)) {
        ++bus.mistake_count;
    }
}

uint32_t take_received(uint32_t) {
    if (bus.received.count == 0) {
        ++bus.mistake_count;
        return 1u << 14;
    }
    return bus.received.pop();
}

void control(uint32_t value) {
    bus.enabled = (value & LPI2C_MCR_MEN) != 0;
    if ((value & (LPI2C_MCR_RTF | LPI2C_MCR_RST)) != 0) {
        bus.commands.count = 0;
    }
    if ((value & (LPI2C_MCR_RRF | LPI2C_MCR_RST)) != 0) {
        bus.received.count = 0;
    }
    if ((value & LPI2C_MCR_RST) != 0) {
        bus.flags = 0;
        bus.ours = bus.working = bus.auto_stop = false;
        bus.bytes_left = 0;
        master.MIER.value = master.MCCR0.value = master.MFCR.value = 0;
    }
}

void serve_interrupt() {
    for (int rounds = 0; (status(0) & master.MIER.value) != 0 && deliver(master_irq); ++rounds) {
        if (rounds > 20) {
            ++bus.mistake_count; // a request that is never satisfied
            master.MIER.value = 0;
        }
    }
}

} // namespace

void lines_changed() {
    const bool scl = bus_level(scl_pin);
    bus.gpio_clocks += bus.scl && !scl && is_gpio(scl_pin);
    if (bus.scl && !scl && line_held(Line::sda) && is_gpio(scl_pin) && --bus.clocks == 0) {
        bus.held = Line::none;
    }
    const bool sda = bus_level(sda_pin);
    if (scl && bus.scl && sda != bus.sda && is_gpio(sda_pin)) {
        log_event(sda ? event_stop : event_start);
    } else if (scl != bus.scl && sda != bus.sda && scl) {
        ++bus.mistake_count; // both at once
    }
    bus.scl = scl;
    bus.sda = sda;
}

bool bus_level(uint8_t pin) {
    if (pin == sda_pin) {
        return !line_held(Line::sda) && !gpio_pulls_low(sda_pin);
    }
    if (pin == scl_pin) {
        return !line_held(Line::scl) && !gpio_pulls_low(scl_pin);
    }
    return outside_level(pin);
}

void advance_us(uint32_t us) {
    const uint64_t end = bus.now + uint64_t{us} * cycles_per_us;
    for (;;) {
        serve_interrupt();
        if (can_begin()) {
            begin_command();
        }
        const uint64_t command_at = bus.working ? bus.ready_at : never;
        const uint64_t timer_at = bus.timer != nullptr ? bus.timer_at : never;
        const uint64_t next = command_at < timer_at ? command_at : timer_at;
        if (next > end) {
            break;
        }
        bus.now = next;
        cycles = static_cast<uint32_t>(next);
        if (next == timer_at) {
            bus.timer_at += bus.timer_period;
            bus.timer();
        } else {
            end_command();
        }
    }
    bus.now = end;
    cycles = static_cast<uint32_t>(end);
}

void refuse_byte(int n) {
    bus.refused_byte = n;
    bus.bytes_seen = 0;
}

void hold_line(Line line, int after_events, int clocks) {
    bus.to_hold = after_events > 0 ? line : Line::none;
    bus.held = after_events > 0 ? Line::none : line;
    bus.hold_after = after_events;
    bus.clocks = clocks;
    bus.scl = bus_level(scl_pin);
    bus.sda = bus_level(sda_pin);
}

void let_lines_go() {
    bus.held = bus.to_hold = Line::none;
    if (bus.working && bus.ready_at == never) {
        bus.ready_at = bus.now;
    }
    bus.scl = bus_level(scl_pin);
    bus.sda = bus_level(sda_pin);
}

void leave_stop(bool leave) {
    bus.leaves_stop = leave;
}

void set_rise_time(uint32_t ns) {
    bus.rise_ns = ns;
}

bool timer_allowed(bool allowed) {
    bus.timer_refused = !allowed;
    return allowed;
}

size_t event_count() {
    return bus.log.size();
}

uint16_t event(size_t index) {
    return bus.log[index];
}

void clear_events() {
    bus.log.clear();
}

uint32_t take_gpio_clocks() {
    const uint32_t clocks = bus.gpio_clocks;
    bus.gpio_clocks = 0;
    return clocks;
}

uint32_t mistakes() {
    return bus.mistake_count;
}

hil_pca9685_t &chip() {
    return bus.chip;
}

void reset_bus() {
    bus = {};
    bus.scl = bus.sda = true;
    bus.refused_byte = -1;
    bus.now = cycles;
    hil_pca9685_reset(&bus.chip, 0x40);
    master.MIER.value = 0;
    master.MSR.on_read = status;
    master.MSR.on_write = clear_status;
    master.MFSR.on_read = fifo_status;
    master.MTDR.on_write = queue_command;
    master.MRDR.on_read = take_received;
    master.MCR.on_write = control;
}

} // namespace fake

bool IntervalTimer::begin(void (*function)(), uint32_t period_us) {
    using namespace fake;
    if (bus.timer_refused || bus.timer != nullptr) {
        return false;
    }
    bus.timer = function;
    bus.timer_period = uint64_t{period_us} * cycles_per_us;
    bus.timer_at = bus.now + bus.timer_period;
    return true;
}

void IntervalTimer::end() {
    fake::bus.timer = nullptr;
}
