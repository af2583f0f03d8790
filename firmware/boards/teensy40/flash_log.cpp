// SPDX-License-Identifier: MIT
#include "boards/teensy40/flash_log.h"

#include <algorithm>
#include <cstring>

#include "app/base/crc32.h"

namespace omni {
namespace {

constexpr uint32_t magic = 0x314C464F; // "OFL1"
constexpr size_t piece = 64;

template <class T>
uint32_t crc_before(const T &item, size_t length) {
    uint8_t bytes[sizeof item];
    std::memcpy(bytes, &item, sizeof bytes);
    return crc32(bytes, length);
}

constexpr size_t padded(size_t length) {
    return (length + 3) / 4 * 4;
}

} // namespace

struct FlashLog::Header {
    uint32_t magic;
    uint32_t sequence;
    uint32_t image_crc;
    uint32_t header_crc;
};

struct FlashLog::Record {
    uint16_t offset;
    uint16_t length;
    uint32_t crc; ///< over offset, length and data
};

uint32_t FlashLog::crc_of(size_t sector, size_t offset, size_t length, uint32_t crc) {
    uint8_t bytes[piece];
    for (size_t done = 0; done < length; done += piece) {
        const size_t count = std::min(piece, length - done);
        flash_.read(sector, offset + done, bytes, count);
        crc = crc32(bytes, count, crc);
    }
    return crc;
}

bool FlashLog::valid_bank(size_t sector, uint32_t *sequence) {
    Header header;
    uint8_t bytes[sizeof header];
    flash_.read(sector, 0, bytes, sizeof bytes);
    std::memcpy(&header, bytes, sizeof header);
    *sequence = header.sequence;
    return header.magic == magic && header.header_crc == crc_before(header, offsetof(Header, header_crc)) &&
           header.image_crc == crc_of(sector, image_at, capacity, 0);
}

bool FlashLog::blank(size_t sector, size_t from) {
    uint8_t bytes[piece];
    for (size_t at = from; at < Flash::sector_size; at += piece) {
        const size_t count = std::min(piece, Flash::sector_size - at);
        flash_.read(sector, at, bytes, count);
        if (std::any_of(bytes, bytes + count, [](uint8_t byte) { return byte != 0xFF; })) {
            return false;
        }
    }
    return true;
}

void FlashLog::find_banks(size_t *newest, size_t *second) {
    *newest = none;
    *second = none;
    uint32_t best = 0;
    uint32_t next = 0;
    for (size_t sector = 0; sector < flash_.sectors(); ++sector) {
        uint32_t sequence = 0;
        if (!valid_bank(sector, &sequence)) {
            continue;
        }
        if (*newest == none || static_cast<int32_t>(sequence - best) > 0) {
            *second = *newest;
            next = best;
            *newest = sector;
            best = sequence;
        } else if (*second == none || static_cast<int32_t>(sequence - next) > 0) {
            *second = sector;
            next = sequence;
        }
    }
    sequence_ = best;
}

/// @param end of the record, if there is a valid one at `at`.
bool FlashLog::take_record(size_t at, size_t *end) {
    if (at + record_header > Flash::sector_size) {
        return false;
    }
    Record record;
    uint8_t bytes[sizeof record];
    flash_.read(bank_, at, bytes, sizeof bytes);
    std::memcpy(&record, bytes, sizeof record);
    const size_t data_at = at + record_header;
    if (record.length > Flash::sector_size - data_at || size_t{record.offset} + record.length > capacity) {
        return false;
    }
    if (record.crc != crc_of(bank_, data_at, record.length, crc32(bytes, offsetof(Record, crc)))) {
        return false;
    }
    flash_.read(bank_, data_at, image_ + record.offset, record.length);
    *end = data_at + padded(record.length);
    return true;
}

void FlashLog::replay() {
    flash_.read(bank_, image_at, image_, capacity);
    end_ = log_at;
    while (take_record(end_, &end_)) {}
    if (!blank(bank_, end_)) {
        end_ = Flash::sector_size; // a write that was cut short: nothing may follow it
        doubtful_ = true;
    }
}

void FlashLog::begin() {
    size_t second = none;
    doubtful_ = false;
    find_banks(&bank_, &second);
    if (bank_ == none) {
        std::memset(image_, 0xFF, sizeof image_);
        for (size_t sector = 0; sector < flash_.sectors(); ++sector) {
            doubtful_ = doubtful_ || !blank(sector, 0);
        }
        return; // nothing is erased either: a supply that is too low to read may recover
    }
    replay();
    for (size_t sector = 0; sector < flash_.sectors(); ++sector) {
        if (sector != bank_ && sector != second && !blank(sector, 0)) {
            flash_.erase(sector);
        }
    }
}

bool FlashLog::read(size_t offset, uint8_t *data, size_t length) {
    if (offset > capacity || length > capacity - offset) {
        return false;
    }
    std::memcpy(data, image_ + offset, length);
    return true;
}

/// Program and verify.
bool FlashLog::programmed(size_t sector, size_t offset, const uint8_t *data, size_t length) {
    flash_.program(sector, offset, data, length);
    uint8_t bytes[piece];
    for (size_t done = 0; done < length; done += piece) {
        const size_t count = std::min(piece, length - done);
        flash_.read(sector, offset + done, bytes, count);
        if (std::memcmp(bytes, data + done, count) != 0) {
            return false;
        }
    }
    return true;
}

/// Append a record of these bytes of the image.
bool FlashLog::append(size_t offset, size_t length) {
    const size_t needed = record_header + padded(length);
    if (bank_ == none || end_ + needed > closing_at) {
        return false;
    }
    Record record{static_cast<uint16_t>(offset), static_cast<uint16_t>(length), 0};
    uint8_t bytes[sizeof record];
    std::memcpy(bytes, &record, sizeof bytes);
    record.crc = crc32(image_ + offset, length, crc32(bytes, offsetof(Record, crc)));
    std::memcpy(bytes, &record, sizeof bytes);
    const size_t at = end_;
    end_ = Flash::sector_size; // until it has worked
    if (!programmed(bank_, at, bytes, sizeof bytes) ||
        !programmed(bank_, at + record_header, image_ + offset, length)) {
        return false;
    }
    end_ = at + needed;
    return true;
}

/// Make this sector the bank with the image as it is now.
bool FlashLog::fill_bank(size_t sector) {
    if (!blank(sector, 0)) {
        ++late_erases_;
        flash_.erase(sector);
    }
    Header header{magic, sequence_ + 1, crc32(image_, capacity), 0};
    header.header_crc = crc_before(header, offsetof(Header, header_crc));
    uint8_t bytes[sizeof header];
    std::memcpy(bytes, &header, sizeof bytes);
    return programmed(sector, image_at, image_, capacity) && programmed(sector, 0, bytes, sizeof bytes);
}

/// Leave a trace of the write that begins the next bank: without it, a power cut before that bank has its header would
/// look as if nothing had been written.
void FlashLog::close_bank() {
    const uint8_t mark[Flash::sector_size - closing_at] = {};
    programmed(bank_, closing_at, mark, sizeof mark); // worn cells cost the trace only
    end_ = Flash::sector_size;
}

bool FlashLog::begin_bank() {
    if (bank_ != none) {
        close_bank();
    }
    const size_t count = flash_.sectors();
    for (size_t step = 1; step <= count; ++step) {
        const size_t sector = bank_ == none ? step - 1 : (bank_ + step) % count;
        if (sector != bank_ && fill_bank(sector)) {
            bank_ = sector;
            doubtful_ = false;
            ++sequence_;
            end_ = log_at;
            return true;
        }
    }
    return false;
}

bool FlashLog::write(size_t offset, const uint8_t *data, size_t length) {
    if (offset > capacity || length > capacity - offset) {
        return false;
    }
    while (length > 0 && data[length - 1] == image_[offset + length - 1]) {
        --length;
    }
    while (length > 0 && *data == image_[offset]) {
        ++offset;
        ++data;
        --length;
    }
    if (length == 0 && !doubtful_) {
        return true;
    }
    uint8_t before[capacity];
    std::memcpy(before, image_, capacity);
    std::memcpy(image_ + offset, data, length);
    if (append(offset, length) || begin_bank()) {
        return true;
    }
    std::memcpy(image_, before, capacity);
    return false;
}

} // namespace omni
