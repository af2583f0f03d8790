// SPDX-License-Identifier: MIT
#include "app/codec.h"

#include <algorithm>
#include <iterator>

#include "app/mavlink_types.h"

namespace omni {
namespace {

constexpr uint8_t magic_v1 = 0xFE;
constexpr uint8_t magic_v2 = 0xFD;
constexpr size_t header_v1 = 6;
constexpr size_t header_v2 = 10;
constexpr size_t checksum_length = 2;
constexpr uint8_t flag_signed = 0x01;

constexpr mavlink_msg_entry_t entries[] = MAVLINK_MESSAGE_CRCS;

/// The table is sorted by id. @return nullptr if the dialect has no such message.
const mavlink_msg_entry_t *find_entry(uint32_t id) {
    const auto *last = std::end(entries);
    const auto *found = std::lower_bound(
        std::begin(entries), last, id, [](const mavlink_msg_entry_t &entry, uint32_t wanted) { return entry.msgid < wanted; });
    return found != last && found->msgid == id ? found : nullptr;
}

/// What a byte does to a CRC-16/MCRF4XX: table k after k more bytes. Bit arithmetic byte by byte takes four times the
/// instructions, which would be 30 % of all that a PC spends on a tick in lockstep.
struct CrcTables {
    uint16_t entry[4][256] = {};
};

constexpr uint16_t after_a_byte(uint16_t crc) {
    constexpr uint16_t polynomial = 0x8408;
    for (int bit = 0; bit < 8; ++bit) {
        crc = static_cast<uint16_t>((crc & 1) != 0 ? crc >> 1 ^ polynomial : crc >> 1);
    }
    return crc;
}

constexpr CrcTables make_crc_tables() {
    CrcTables tables;
    for (uint16_t byte = 0; byte < 256; ++byte) {
        uint16_t crc = byte;
        for (auto &table : tables.entry) {
            crc = after_a_byte(crc);
            table[byte] = crc;
        }
    }
    return tables;
}

constexpr CrcTables crc_tables = make_crc_tables();

/// CRC-16/MCRF4XX over everything behind the magic byte, then the message's own seed byte.
uint16_t checksum(const uint8_t *bytes, size_t length, uint8_t extra) {
    const auto &t = crc_tables.entry;
    const uint8_t *const end = bytes + length;
    unsigned crc = 0xFFFF;
    for (; end - bytes >= 4; bytes += 4) {
        const unsigned low = (crc ^ bytes[0]) & 0xFF;
        const unsigned high = (crc >> 8) ^ bytes[1];
        crc = static_cast<unsigned>(t[3][low] ^ t[2][high] ^ t[1][bytes[2]] ^ t[0][bytes[3]]);
    }
    for (; bytes != end; ++bytes) {
        crc = crc >> 8 ^ t[0][(crc ^ *bytes) & 0xFF];
    }
    return static_cast<uint16_t>(crc >> 8 ^ t[0][(crc ^ extra) & 0xFF]);
}

bool is_magic(uint8_t byte) {
    return byte == magic_v1 || byte == magic_v2;
}

/// Where things are in one frame.
struct Layout {
    size_t header;
    size_t payload;
    size_t total;
    uint32_t id;
    const uint8_t *source; ///< system, component
};

Layout layout_of(const uint8_t *bytes) {
    Layout layout{};
    layout.payload = bytes[1];
    if (bytes[0] == magic_v1) {
        layout.header = header_v1;
        layout.id = bytes[5];
        layout.source = bytes + 3;
        layout.total = header_v1 + layout.payload + checksum_length;
    } else {
        layout.header = header_v2;
        layout.id = static_cast<uint32_t>(bytes[7] | bytes[8] << 8 | bytes[9] << 16);
        layout.source = bytes + 5;
        layout.total = header_v2 + layout.payload + checksum_length + ((bytes[2] & flag_signed) != 0 ? signature_length : 0);
    }
    return layout;
}

void fill(Frame *frame, const Layout &layout, const uint8_t *bytes, const mavlink_msg_entry_t &entry) {
    frame->id = layout.id;
    frame->system = layout.source[0];
    frame->component = layout.source[1];
    frame->is_signed = layout.total > layout.header + layout.payload + checksum_length;
    frame->bytes = bytes;
    frame->length = layout.total;
    const size_t length = std::min<size_t>(layout.payload, entry.max_msg_len);
    std::memcpy(frame->payload, bytes + layout.header, length);
    std::memset(frame->payload + length, 0, max_payload - length);
    const bool targeted = (entry.flags & MAV_MSG_ENTRY_FLAG_HAVE_TARGET_SYSTEM) != 0;
    const bool component = (entry.flags & MAV_MSG_ENTRY_FLAG_HAVE_TARGET_COMPONENT) != 0;
    frame->target_system = targeted ? frame->payload[entry.target_system_ofs] : 0;
    frame->target_component = component ? frame->payload[entry.target_component_ofs] : 0;
}

} // namespace

size_t encode_frame(uint8_t *out, uint8_t sequence, uint8_t system, uint32_t id, const void *payload, bool is_signed) {
    const mavlink_msg_entry_t *entry = find_entry(id);
    if (entry == nullptr) {
        return 0;
    }
    size_t length = entry->max_msg_len;
    std::memcpy(out + header_v2, payload, length);
    while (length > 1 && out[header_v2 + length - 1] == 0) {
        --length;
    }
    const uint8_t header[header_v2] = {magic_v2,
                                       static_cast<uint8_t>(length),
                                       is_signed ? flag_signed : uint8_t{0},
                                       0,
                                       sequence,
                                       system,
                                       MAV_COMP_ID_AUTOPILOT1,
                                       static_cast<uint8_t>(id),
                                       static_cast<uint8_t>(id >> 8),
                                       static_cast<uint8_t>(id >> 16)};
    std::memcpy(out, header, sizeof header);
    const uint16_t crc = checksum(out + 1, header_v2 - 1 + length, entry->crc_extra);
    out[header_v2 + length] = static_cast<uint8_t>(crc);
    out[header_v2 + length + 1] = static_cast<uint8_t>(crc >> 8);
    return header_v2 + length + checksum_length;
}

size_t frame_length(const uint8_t *frame) {
    return layout_of(frame).total;
}

size_t longest_frame(uint32_t id) {
    const mavlink_msg_entry_t *entry = find_entry(id);
    return entry != nullptr ? header_v2 + entry->max_msg_len + checksum_length + signature_length : 0;
}

uint8_t *FrameParser::space(size_t *room) {
    if (begin_ > 0) {
        std::memmove(buffer_, buffer_ + begin_, end_ - begin_);
        end_ -= begin_;
        begin_ = 0;
    }
    *room = sizeof buffer_ - end_;
    return buffer_ + end_;
}

FrameParser::Match FrameParser::match(Frame *frame, size_t *length) const {
    const uint8_t *bytes = buffer_ + begin_;
    const size_t held = end_ - begin_;
    const size_t header = bytes[0] == magic_v1 ? header_v1 : header_v2;
    if (held < header) {
        return Match::incomplete;
    }
    const Layout layout = layout_of(bytes);
    *length = layout.total;
    if (bytes[0] == magic_v2 && (bytes[2] & ~flag_signed) != 0) {
        return Match::no; // an incompatible feature that this program does not know
    }
    if (held < layout.total) {
        return Match::incomplete;
    }
    const mavlink_msg_entry_t *entry = find_entry(layout.id);
    if (entry == nullptr) {
        // Its checksum cannot be verified; what follows tells whether it was a frame.
        return held == layout.total || is_magic(bytes[layout.total]) ? Match::foreign : Match::no;
    }
    const size_t covered = layout.header + layout.payload;
    const uint16_t crc = checksum(bytes + 1, covered - 1, entry->crc_extra);
    if (bytes[covered] != (crc & 0xFF) || bytes[covered + 1] != crc >> 8) {
        return Match::no;
    }
    fill(frame, layout, bytes, *entry);
    return Match::frame;
}

void FrameParser::skip_byte() {
    const bool text = text_ != nullptr && text_->on_byte(buffer_[begin_]);
    errors_ += text ? 0 : 1;
    begin_ += 1;
}

bool FrameParser::next(Frame *frame) {
    while (begin_ < end_) {
        size_t length = 1;
        const Match found = is_magic(buffer_[begin_]) ? match(frame, &length) : Match::no;
        switch (found) {
        case Match::incomplete:
            return false;
        case Match::frame:
            begin_ += length;
            if (text_ != nullptr) {
                text_->on_frame();
            }
            return true;
        case Match::foreign:
            begin_ += length;
            break;
        case Match::no:
            skip_byte();
            break;
        }
    }
    return false;
}

void FrameParser::give_up_frame() {
    if (begin_ < end_) {
        skip_byte();
    }
}

} // namespace omni
