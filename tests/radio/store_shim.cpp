// SPDX-License-Identifier: MIT
/// @file store_shim.cpp  The firmware's stores on plain memory, and on the flash log with a power cut at a chosen byte.
#include <algorithm>
#include <cstring>

#include "app/storage/param_store.h"
#include "app/storage/record_store.h"
#include "app/tick/stop_latch.h"
#include "boards/teensy40/flash_log.h"

using namespace omni;

namespace {

struct MemoryStorage final : Storage {
    uint8_t *bytes;
    size_t length;
    size_t size() override { return length; }
    bool read(size_t offset, uint8_t *data, size_t count) override {
        if (offset > length || count > length - offset) {
            return false;
        }
        std::memcpy(data, bytes + offset, count);
        return true;
    }
    bool write(size_t offset, const uint8_t *data, size_t count) override {
        std::memcpy(bytes + offset, data, count);
        return true;
    }
    MemoryStorage(uint8_t *memory, size_t memory_size) : bytes(memory), length(memory_size) {}
};

/// Programming stops at a byte; that byte or word has some of its bits programmed, chosen by `torn`.
struct CutFlash final : Flash {
    uint8_t *bytes;
    size_t left; ///< bytes until the power fails
    size_t word;
    uint32_t torn;
    size_t sectors() override { return 3; }
    uint8_t *at(size_t sector, size_t offset) { return bytes + sector * sector_size + offset; }
    void read(size_t sector, size_t offset, uint8_t *data, size_t count) override {
        std::memcpy(data, at(sector, offset), count);
    }
    void program(size_t sector, size_t offset, const uint8_t *data, size_t count) override {
        for (size_t i = 0; i < count; ++i) {
            if (left == 0) {
                tear(at(sector, offset + i), data + i, std::min(word, count - i));
                return;
            }
            *at(sector, offset + i) &= data[i];
            --left;
        }
    }
    void erase(size_t sector) override {
        if (left > 0) {
            std::memset(at(sector, 0), 0xFF, sector_size);
        }
    }
    void tear(uint8_t *cells, const uint8_t *data, size_t count) {
        for (size_t i = 0; i < count; ++i) {
            cells[i] &= static_cast<uint8_t>(data[i] | ~(torn >> 8 * i));
        }
        torn = 0; // nothing more is programmed, whatever follows
    }
    CutFlash(uint8_t *memory, size_t cut, size_t word_size, uint32_t torn_bits)
        : bytes(memory), left(cut), word(word_size), torn(torn_bits) {}
};

/// The flash log as a start finds it.
struct CutLog {
    CutFlash flash;
    FlashLog log{flash};
    explicit CutLog(uint8_t *memory, size_t cut = SIZE_MAX, size_t word = 1, uint32_t torn = 0)
        : flash(memory, cut, word, torn) {
        log.begin();
    }
};

} // namespace

extern "C" {

int param_count() {
    return OMNI_PARAM_COUNT;
}

int param_load(uint8_t *image, uint32_t size, float *values) {
    MemoryStorage storage(image, size);
    ParamStore store(storage);
    return static_cast<int>(store.load(values));
}

int param_save(uint8_t *image, uint32_t size, const float *values, const float *own) {
    MemoryStorage storage(image, size);
    ParamStore store(storage);
    return static_cast<int>(store.save(values, own));
}

int record_load(uint8_t *image, uint32_t size, uint32_t offset, uint32_t content, uint8_t *data) {
    MemoryStorage storage(image, size);
    RecordStore store(storage, offset, content);
    return static_cast<int>(store.load(data));
}

int record_save(uint8_t *image, uint32_t size, uint32_t offset, uint32_t content, const uint8_t *data) {
    MemoryStorage storage(image, size);
    RecordStore store(storage, offset, content);
    return store.save(data) ? 1 : 0;
}

int flash_param_load(uint8_t *sectors, float *values) {
    CutLog cut(sectors);
    ParamStore store(cut.log);
    return static_cast<int>(store.load(values));
}

int flash_param_save(uint8_t *sectors, const float *values, const float *own, uint32_t cut, uint32_t word,
                     uint32_t torn) {
    CutLog cut_log(sectors, cut, word, torn);
    ParamStore store(cut_log.log);
    return static_cast<int>(store.save(values, own));
}

int flash_record_load(uint8_t *sectors, uint32_t offset, uint32_t content, uint8_t *data) {
    CutLog cut(sectors);
    RecordStore store(cut.log, offset, content);
    return static_cast<int>(store.load(data));
}

int flash_record_save(uint8_t *sectors, uint32_t offset, uint32_t content, const uint8_t *data, uint32_t cut,
                      uint32_t word, uint32_t torn) {
    CutLog cut_log(sectors, cut, word, torn);
    RecordStore store(cut_log.log, offset, content);
    return store.save(data) ? 1 : 0;
}

/// @return StopLatch::AtBoot
int flash_latch_boot(uint8_t *sectors) {
    CutLog cut(sectors);
    StopLatch latch(cut.log);
    return static_cast<int>(latch.boot());
}

/// Start with a pass of the background in the state that it came up in, then store a stop or a release.
void flash_latch_save(uint8_t *sectors, int stopped, uint32_t cut, uint32_t word, uint32_t torn) {
    CutLog cut_log(sectors, cut, word, torn);
    StopLatch latch(cut_log.log);
    if (latch.boot() != StopLatch::AtBoot::released) {
        latch.serve(true, false, false, 0);
    }
    latch.serve(stopped != 0, true, true, 0);
}
}
