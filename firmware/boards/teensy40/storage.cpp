// SPDX-License-Identifier: MIT
#include "boards/teensy40/storage.h"

#include <Arduino.h>

#include <algorithm>
#include <cstring>

#include "boards/teensy40/processor.h"

// Part of Teensyduino's eeprom.c, which declares them in no header.
extern "C" void eepromemu_flash_write(void *address, const void *data, uint32_t length);
extern "C" void eepromemu_flash_erase_sector(void *address);

namespace omni {
namespace {

constexpr uint32_t base = 0x601F0000; ///< Teensy 4.0: the last 64 KB but one sector of the 2 MB chip
/// The chip programs within pages of 256 bytes; less at once keeps interrupts off for less.
constexpr size_t program_unit = 32;
/// What the core copies into the flash controller's registers at a time. They are Device memory. There its copy of 3
/// bytes, or of 7 from an aligned address, stores a halfword at an odd address. The processor faults. Copies of 8 bytes
/// store words only.
constexpr size_t copy_unit = 8;
static_assert(program_unit % copy_unit == 0);
/// Before an erase: longer than any batch of the I2C bus takes, or is given.
constexpr uint32_t bus_timeout_ms = 20;
/// Before each 32 bytes: an update at 400 kHz ends within this. A slower bus hardly notices 0.4 ms without interrupts,
/// and 66 such waits in a row must not trip the watchdog.
constexpr uint32_t bus_timeout_short_ms = 1;

const uint8_t *memory_of(size_t sector, size_t offset) {
    return flash_memory(base + static_cast<uint32_t>(sector * Flash::sector_size + offset));
}

} // namespace

void Teensy40Flash::read(size_t sector, size_t offset, uint8_t *data, size_t length) {
    std::memcpy(data, memory_of(sector, offset), length);
}

/// Whole copy units around the bytes; what is beside them is programmed to ones, which changes nothing in NOR flash. So
/// units of ones alone are left out. So the first stop in an empty memory is stored without first writing 2 KB.
void Teensy40Flash::program(size_t sector, size_t offset, const uint8_t *data, size_t length) {
    while (length > 0) {
        const size_t before = offset % copy_unit;
        const size_t begin = offset - before;
        const size_t count = std::min(length, program_unit - offset % program_unit);
        const size_t whole = (before + count + copy_unit - 1) / copy_unit * copy_unit;
        alignas(copy_unit) uint8_t bytes[program_unit];
        std::memset(bytes, 0xFF, sizeof bytes);
        std::memcpy(bytes + before, data, count);
        if (std::any_of(bytes, bytes + whole, [](uint8_t byte) { return byte != 0xFF; })) {
            wait_for_bus(bus_timeout_short_ms);
            // The address is a number for the flash controller; nothing is written through the pointer.
            eepromemu_flash_write(const_cast<uint8_t *>(memory_of(sector, begin)), bytes, static_cast<uint32_t>(whole));
        }
        offset += count;
        data += count;
        length -= count;
    }
}

void Teensy40Flash::wait_for_bus(uint32_t patience_ms) {
    const uint32_t begin = ARM_DWT_CYCCNT;
    while (bus_ != nullptr && bus_->on_wire() && ARM_DWT_CYCCNT - begin < F_CPU_ACTUAL / 1000 * patience_ms) {}
}

void Teensy40Flash::erase(size_t sector) {
    wait_for_bus(bus_timeout_ms);
    if (watched_) {
        watchdog_.expect_erase(true);
    }
    eepromemu_flash_erase_sector(const_cast<uint8_t *>(memory_of(sector, 0)));
    if (watched_) {
        watchdog_.expect_erase(false);
    }
}

} // namespace omni
