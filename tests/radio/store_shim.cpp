// SPDX-License-Identifier: MIT
/// @file store_shim.cpp  The firmware's stores on a memory whose power fails at a chosen byte.
#include <algorithm>
#include <cstring>

#include "app/storage/param_store.h"
#include "app/storage/record_store.h"

using namespace omni;

namespace {

/// Writes stop at a byte; that word keeps some bits of the old and some of the new content, chosen by `torn`.
struct CutStorage final : Storage {
    uint8_t *bytes;
    size_t length;
    size_t left; ///< bytes until the power fails
    size_t word;
    uint32_t torn;
    size_t size() override { return length; }
    bool read(size_t offset, uint8_t *data, size_t count) override {
        if (offset > length || count > length - offset) {
            return false;
        }
        std::memcpy(data, bytes + offset, count);
        return true;
    }
    bool write(size_t offset, const uint8_t *data, size_t count) override {
        for (size_t i = 0; i < count; ++i) {
            if (left == 0) {
                tear(offset + i, data + i, std::min(word, count - i));
                return true;
            }
            bytes[offset + i] = data[i];
            --left;
        }
        return true;
    }
    void tear(size_t offset, const uint8_t *data, size_t count) {
        for (size_t i = 0; i < count; ++i) {
            const auto mask = static_cast<uint8_t>(torn >> 8 * i);
            bytes[offset + i] = static_cast<uint8_t>((bytes[offset + i] & ~mask) | (data[i] & mask));
        }
        torn = 0; // nothing more is written, whatever follows
        left = 0;
        word = 0;
    }
    CutStorage(uint8_t *memory, size_t memory_size, size_t cut, size_t word_size, uint32_t torn_bits)
        : bytes(memory), length(memory_size), left(cut), word(word_size), torn(torn_bits) {}
};

} // namespace

extern "C" {

int param_count() {
    return OMNI_PARAM_COUNT;
}

int param_load(uint8_t *image, uint32_t size, float *values) {
    CutStorage storage(image, size, size, 1, 0);
    ParamStore store(storage);
    return static_cast<int>(store.load(values));
}

int param_save(uint8_t *image, uint32_t size, const float *values, const float *own, uint32_t cut, uint32_t word,
               uint32_t torn) {
    CutStorage storage(image, size, cut, word, torn);
    ParamStore store(storage);
    return static_cast<int>(store.save(values, own));
}

int record_load(uint8_t *image, uint32_t size, uint32_t offset, uint32_t content, uint8_t *data) {
    CutStorage storage(image, size, size, 1, 0);
    RecordStore store(storage, offset, content);
    return static_cast<int>(store.load(data));
}

int record_save(uint8_t *image, uint32_t size, uint32_t offset, uint32_t content, const uint8_t *data, uint32_t cut,
                uint32_t word, uint32_t torn) {
    CutStorage storage(image, size, cut, word, torn);
    RecordStore store(storage, offset, content);
    return store.save(data) ? 1 : 0;
}
}
