// SPDX-License-Identifier: MIT
#include "app/link/codec.h"

#include <algorithm>
#include <iterator>

#include "app/link/mavlink_types.h"
#include "app/link/stops.h"

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
    const auto *found =
        std::lower_bound(std::begin(entries), last, id,
                         [](const mavlink_msg_entry_t &entry, uint32_t wanted) { return entry.msgid < wanted; });
    return found != last && found->msgid == id ? found : nullptr;
}

/// Standard message, whether used by this firmware or not.
struct Familiar {
    uint16_t id;
    uint8_t seed;
    uint8_t length; ///< without extensions: MAVLink 1 always sends this many bytes
};

constexpr Familiar familiar[] = OMNI_FAMILIAR_MESSAGES;

const Familiar *find_familiar(uint32_t id) {
    const auto *last = std::end(familiar);
    const auto *found = std::lower_bound(std::begin(familiar), last, id,
                                         [](const Familiar &message, uint32_t wanted) { return message.id < wanted; });
    return found != last && found->id == id ? found : nullptr;
}

/// Lookup tables of CRC-16/MCRF4XX: table k for a byte followed by k more bytes. Bitwise computation would take four
/// times the instructions: 30 % of a PC's time per tick in lockstep.
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
uint16_t frame_checksum(const uint8_t *bytes, size_t length, uint8_t extra) {
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

/// Layout of one frame.
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
        layout.total =
            header_v2 + layout.payload + checksum_length + ((bytes[2] & flag_signed) != 0 ? signature_length : 0);
    }
    return layout;
}

/// Properties needed to validate a frame of one message.
struct Kind {
    const mavlink_msg_entry_t *spoken; ///< nullptr: not used by this firmware
    bool known;
    uint8_t seed;
    uint8_t least; ///< payload without extensions
};

Kind kind_of(uint32_t id) {
    const mavlink_msg_entry_t *spoken = find_entry(id);
    if (spoken != nullptr) {
        return {spoken, true, spoken->crc_extra, spoken->min_msg_len};
    }
    const Familiar *other = find_familiar(id);
    return other != nullptr ? Kind{nullptr, true, other->seed, other->length} : Kind{};
}

/// Is this a valid start of a frame?
bool is_plausible(const uint8_t *bytes, const Layout &layout, const Kind &kind) {
    if (bytes[0] == magic_v1) {
        return kind.known && layout.payload == kind.least;
    }
    return kind.known && (bytes[2] & ~flag_signed) == 0; // unknown incompatibility flags
}

bool checksum_right(const uint8_t *bytes, size_t covered, uint8_t seed) {
    const uint16_t crc = frame_checksum(bytes + 1, covered - 1, seed);
    return bytes[covered] == (crc & 0xFF) && bytes[covered + 1] == crc >> 8;
}

void fill_frame(Frame *frame, const Layout &layout, const uint8_t *bytes, const mavlink_msg_entry_t &entry) {
    frame->id = layout.id;
    frame->system = layout.source[0];
    frame->component = layout.source[1];
    frame->is_signed = layout.total > layout.header + layout.payload + checksum_length;
    frame->early = false;
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
    const uint16_t crc = frame_checksum(out + 1, header_v2 - 1 + length, entry->crc_extra);
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
        stops_scanned_ -= std::min(stops_scanned_, begin_);
        begin_ = 0;
    }
    *room = sizeof buffer_ - end_;
    return buffer_ + end_;
}

FrameParser::Match FrameParser::match(size_t at, Frame *frame, size_t *length) const {
    const uint8_t *bytes = buffer_ + at;
    const size_t held = end_ - at;
    if (held < (bytes[0] == magic_v1 ? header_v1 : header_v2)) {
        return Match::incomplete;
    }
    const Layout layout = layout_of(bytes);
    const Kind kind = kind_of(layout.id);
    *length = layout.total;
    if (!is_plausible(bytes, layout, kind)) {
        return Match::no;
    }
    if (held < layout.total) {
        return Match::incomplete;
    }
    if (!checksum_right(bytes, layout.header + layout.payload, kind.seed)) {
        return Match::no;
    }
    if (kind.spoken == nullptr) {
        return Match::foreign;
    }
    fill_frame(frame, layout, bytes, *kind.spoken);
    return Match::frame;
}

/// Find a stop within the incomplete frame at begin_ that has been completed since the last call.
bool FrameParser::find_stop(Frame *frame) {
    const size_t first = stops_scanned_ > longest_stop ? stops_scanned_ - longest_stop : 0;
    for (size_t at = std::max(begin_ + 1, first); at < end_; ++at) {
        size_t length = 0;
        if (is_magic(buffer_[at]) && match(at, frame, &length) == Match::frame && at + length > stops_scanned_ &&
            is_stop(*frame)) {
            stops_scanned_ = at + length;
            frame->early = true;
            return true;
        }
    }
    stops_scanned_ = end_;
    return false;
}

void FrameParser::skip_byte() {
    const bool text = text_ != nullptr && text_->on_byte(buffer_[begin_]);
    errors_ += text ? 0 : 1;
    begin_ += 1;
}

bool FrameParser::next(Frame *frame) {
    while (begin_ < end_) {
        size_t length = 1;
        const Match found = is_magic(buffer_[begin_]) ? match(begin_, frame, &length) : Match::no;
        switch (found) {
        case Match::incomplete:
            return find_stop(frame);
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
