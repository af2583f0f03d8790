// SPDX-License-Identifier: MIT
// A model of the flash sectors. Programming clears bits, erasing sets them, and wear is counted. Power may fail in the
// middle of any 16-bit word that is programmed and of any erase, leaving bits half-way. In front of them are the flash
// controller's transmit registers. They are Device memory, where the processor faults at an access that is not aligned
// to its own width.
#include "boards/teensy40/processor.h"

extern "C" void fake_journal_add(char letter);
extern "C" void fake_watchdog_elapse_ms(uint32_t ms);
extern "C" bool fake_i2c_waits_for_interrupts();

namespace {

constexpr uint32_t base = 0x601F0000, sector_size = 4096, sectors = 15;
constexpr uint32_t page = 256;
constexpr uint32_t erase_ms = 400; ///< longest, by the chip's datasheet

struct {
    uint8_t bytes[sectors * sector_size];
    uint32_t erases[sectors];
    uint32_t steps;  ///< words programmed and sectors erased
    uint32_t cut_at; ///< power fails in this step
    bool power;
    uint32_t random;
    uint32_t longest; ///< bytes programmed at once
    bool page_crossed, set_a_bit, faulted;
    uint32_t held_up;   ///< times that interrupts were off while the I2C bus needed them
    bool worn[sectors]; ///< erasing does nothing any more
} flash;

uint8_t random_byte() {
    flash.random = flash.random * 1664525u + 1013904223u;
    return static_cast<uint8_t>(flash.random >> 24);
}

/// @return 0: no power, 1: power fails now, 2: all is well.
int step() {
    if (!flash.power) {
        return 0;
    }
    flash.power = flash.steps++ != flash.cut_at;
    return flash.power ? 2 : 1;
}

constexpr uint32_t fifo_bytes = 8; ///< the core fills FLEXSPI_TFDR0 and 1 at a time

/// One store of this width [bytes]: ARMv7-M, A3.2.1: unaligned accesses to Device memory fault, whatever UNALIGN_TRP
/// says.
void store(uint32_t offset, uint32_t width) {
    flash.faulted = flash.faulted || offset % width != 0;
}

/// The stores of the Teensy core's memcpy (memcpy-armv7m.S) of at most 8 bytes to an address that 8 divides.
void copy_to_fifo(const uint8_t *source, uint32_t length) {
    const bool aligned = reinterpret_cast<uintptr_t>(source) % 4 == 0;
    uint32_t at = 0;
    if (!aligned && length < 8 && length >= 4) {
        for (; at < length; ++at) {
            store(at, 1);
        }
        return;
    }
    for (; length - at >= 4; at += 4) {
        store(at, 4);
    }
    if ((length & 1) != 0) {
        store(at++, 1);
    }
    if ((length & 2) != 0) {
        store(at, 2);
    }
}

} // namespace

namespace omni {

const uint8_t *flash_memory(uint32_t address) {
    return flash.bytes + (address - base);
}

} // namespace omni

extern "C" {

void eepromemu_flash_write(void *address, const void *data, uint32_t length) {
    const auto at = static_cast<uint32_t>(static_cast<uint8_t *>(address) - flash.bytes);
    const auto *bytes = static_cast<const uint8_t *>(data);
    flash.longest = length > flash.longest ? length : flash.longest;
    flash.page_crossed = flash.page_crossed || length == 0 || at / page != (at + length - 1) / page;
    for (uint32_t i = 0; i < length; i += fifo_bytes) {
        copy_to_fifo(bytes + i, length - i < fifo_bytes ? length - i : fifo_bytes);
    }
    flash.held_up += fake_i2c_waits_for_interrupts() ? 1 : 0;
    flash.power = flash.power && !flash.faulted; // the processor is lost: nothing more is programmed
    int outcome = 2;
    for (uint32_t i = 0; i < length; ++i) {
        outcome = i % 2 == 0 ? step() : outcome;
        uint8_t &cell = flash.bytes[at + i];
        flash.set_a_bit =
            flash.set_a_bit || (bytes[i] != 0xFF && (bytes[i] & ~cell) != 0); // all ones: nothing is asked for
        if (outcome == 2) {
            cell = static_cast<uint8_t>(cell & bytes[i]);
        } else if (outcome == 1) {
            cell = static_cast<uint8_t>(cell & (bytes[i] | random_byte()));
        }
    }
}

void eepromemu_flash_erase_sector(void *address) {
    const auto sector = static_cast<uint32_t>(static_cast<uint8_t *>(address) - flash.bytes) / sector_size;
    const int outcome = step();
    fake_journal_add('E');
    fake_watchdog_elapse_ms(erase_ms);
    flash.erases[sector] += outcome != 0 ? 1 : 0;
    for (uint32_t i = sector * sector_size; outcome != 0 && !flash.worn[sector] && i < (sector + 1) * sector_size;
         ++i) {
        flash.bytes[i] = outcome == 2 ? uint8_t{0xFF} : static_cast<uint8_t>(flash.bytes[i] | random_byte());
    }
}

void flash_reset(uint8_t fill) {
    flash = {};
    std::memset(flash.bytes, fill, sizeof flash.bytes);
    flash.power = true;
    flash.cut_at = UINT32_MAX;
    flash.random = 1;
}
/// Power fails after so many more steps; the torn bits come from the seed.
void flash_cut_after(uint32_t steps, uint32_t seed) {
    flash.cut_at = flash.steps + steps;
    flash.random = seed;
}
bool flash_power_on() {
    const bool failed = !flash.power;
    flash.power = true;
    flash.cut_at = UINT32_MAX;
    return failed;
}
uint32_t flash_steps() {
    return flash.steps;
}
uint32_t flash_erases(uint32_t sector) {
    return flash.erases[sector];
}
void flash_wear_out(uint32_t sector) {
    flash.worn[sector] = true;
}
uint32_t flash_longest() {
    return flash.longest;
}
/// The code asked for something that the chip cannot do.
bool flash_misused() {
    return flash.page_crossed || flash.set_a_bit || flash.faulted;
}
/// The processor ran into a fault while it programmed.
bool flash_faulted() {
    return flash.faulted;
}
uint32_t flash_held_up_bus() {
    return flash.held_up;
}
uint8_t *flash_bytes() {
    return flash.bytes;
}
}
