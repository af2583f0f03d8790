// SPDX-License-Identifier: MIT
/// @file flash_log.h  Non-volatile bytes as a log in flash memory: each write is atomic, at whatever moment power
/// fails.
///
/// Teensyduino's EEPROM emulation cannot promise that. It spreads neighbouring bytes over its sectors, and holds a
/// sector's bytes in RAM while it erases it. So one power cut can take all that is stored. Here the memory is a ring of
/// sectors, each a bank of its own:
///
///     0     header: magic, sequence, CRC-32 of the image, CRC-32 of the header; written last
///     16    image of all bytes when the bank was begun
///     2064  records: offset, length, CRC-32 of both and the data, data padded to 4 bytes
///     4092  closing mark, zero: written before the next bank is begun
///
/// A write appends a record of what changes. When the bank is full, it is closed and the next sector becomes the bank;
/// the old one stays until it is erased at some later start. The bank with the highest sequence counts. Anything but
/// ones behind its last valid record shows that a write was cut short. A sector is erased in advance at start, when the
/// ticks do not run yet. While they run it happens only if the ring was used up since.
#pragma once

#include <cstddef>
#include <cstdint>

#include "app/base/board.h"

namespace omni {

/// A few sectors of NOR flash: programming clears bits, erasing sets all bits of a sector.
class Flash {
public:
    static constexpr size_t sector_size = 4096;

    virtual size_t sectors() = 0;
    virtual void read(size_t sector, size_t offset, uint8_t *data, size_t length) = 0;
    virtual void program(size_t sector, size_t offset, const uint8_t *data, size_t length) = 0;
    virtual void erase(size_t sector) = 0;

protected:
    ~Flash() = default;
};

class FlashLog final : public Storage {
public:
    static constexpr size_t capacity = 2048;

    explicit FlashLog(Flash &flash) : flash_(flash) {}

    /// Find the latest content and erase sectors in advance. Takes seconds when many are in use.
    void begin();
    size_t size() override { return capacity; }
    bool read(size_t offset, uint8_t *data, size_t length) override;
    bool write(size_t offset, const uint8_t *data, size_t length) override;
    /// The last write was cut short. Or no bank is valid, yet the sectors are not blank: a supply too low to read, or
    /// another program's content. Ends with the next write.
    bool may_hold_unreadable_data() override { return doubtful_; }
    /// Erases since begin(): each disables interrupts for up to 400 ms.
    uint32_t late_erases() const { return late_erases_; }

private:
    struct Header;
    struct Record;
    static constexpr size_t none = SIZE_MAX;
    static constexpr size_t image_at = 16;
    static constexpr size_t log_at = image_at + capacity;
    static constexpr size_t record_header = 8;
    static constexpr size_t closing_at = Flash::sector_size - 4;

    bool valid_bank(size_t sector, uint32_t *sequence);
    bool blank(size_t sector, size_t from);
    void find_banks(size_t *newest, size_t *second);
    void replay();
    bool take_record(size_t at, size_t *end);
    bool append(size_t offset, size_t length);
    void close_bank();
    bool begin_bank();
    bool fill_bank(size_t sector);
    bool programmed(size_t sector, size_t offset, const uint8_t *data, size_t length);
    uint32_t crc_of(size_t sector, size_t offset, size_t length, uint32_t crc);

    Flash &flash_;
    size_t bank_ = none;
    uint32_t sequence_ = 0;
    size_t end_ = 0; ///< of the records, in the bank
    uint32_t late_erases_ = 0;
    bool doubtful_ = false;
    uint8_t image_[capacity] = {};
};

} // namespace omni
