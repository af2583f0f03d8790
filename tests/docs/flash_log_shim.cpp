// SPDX-License-Identifier: MIT
/// @file flash_log_shim.cpp  The flash log on two sectors of ordinary memory.
#include <cstring>

#include "boards/teensy40/flash_log.h"

namespace {

struct MemoryFlash final : omni::Flash {
    uint8_t *bytes;
    explicit MemoryFlash(uint8_t *memory) : bytes(memory) {}
    size_t sectors() override { return 2; }
    uint8_t *at(size_t sector, size_t offset) { return bytes + sector * sector_size + offset; }
    void read(size_t sector, size_t offset, uint8_t *data, size_t length) override {
        std::memcpy(data, at(sector, offset), length);
    }
    void program(size_t sector, size_t offset, const uint8_t *data, size_t length) override {
        for (size_t i = 0; i < length; ++i) {
            at(sector, offset)[i] = static_cast<uint8_t>(at(sector, offset)[i] & data[i]);
        }
    }
    void erase(size_t sector) override { std::memset(at(sector, 0), 0xFF, sector_size); }
};

} // namespace

extern "C" {

/// Put data into the log in `memory`, two sectors. @return 1 if it is there.
int log_write(uint8_t *memory, uint32_t offset, const uint8_t *data, uint32_t length) {
    MemoryFlash flash(memory);
    omni::FlashLog log(flash);
    log.begin();
    return log.write(offset, data, length) ? 1 : 0;
}

/// Read all 2048 bytes of the log in `memory`. @return 1 if it is in no doubt.
int log_read(uint8_t *memory, uint8_t *data) {
    MemoryFlash flash(memory);
    omni::FlashLog log(flash);
    log.begin();
    return log.read(0, data, omni::FlashLog::capacity) && !log.may_hold_unreadable_data() ? 1 : 0;
}
}
