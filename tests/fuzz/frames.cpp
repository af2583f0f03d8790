// SPDX-License-Identifier: MIT
#include "frames.h"

#include <algorithm>
#include <cstring>
#include <iterator>

namespace fuzz {
namespace {

constexpr mavlink_msg_entry_t entries[] = MAVLINK_MESSAGE_CRCS;

struct Standard {
    uint32_t id;
    uint8_t seed;
    size_t length;
};
constexpr Standard standard[] = OMNI_FAMILIAR_MESSAGES;
constexpr uint8_t magic_v1 = 0xFE;
constexpr uint8_t magic_v2 = 0xFD;
constexpr uint8_t flag_signed = 1;
constexpr size_t header_v2 = 10;
constexpr size_t signature_length = 13;

/// CRC-16/MCRF4XX (reflected 0x1021, initial value 0xFFFF) of every byte: bit by bit it was a quarter of a run's time.
struct CrcTable {
    uint16_t of[256] = {};
    constexpr CrcTable() {
        for (unsigned byte = 0; byte < 256; ++byte) {
            unsigned crc = byte;
            for (int bit = 0; bit < 8; ++bit) {
                crc = (crc & 1u) != 0 ? crc >> 1 ^ 0x8408u : crc >> 1;
            }
            of[byte] = static_cast<uint16_t>(crc);
        }
    }
};

constexpr CrcTable crc_table;

uint16_t crc_of(const uint8_t *bytes, size_t length, uint8_t extra) {
    unsigned crc = 0xFFFF;
    for (size_t i = 0; i < length; ++i) {
        crc = crc >> 8 ^ crc_table.of[(crc ^ bytes[i]) & 0xFF];
    }
    return static_cast<uint16_t>(crc >> 8 ^ crc_table.of[(crc ^ extra) & 0xFF]);
}

} // namespace

const mavlink_msg_entry_t *entry_of(uint32_t id) {
    for (const mavlink_msg_entry_t &entry : entries) {
        if (entry.msgid == id) {
            return &entry;
        }
    }
    return nullptr;
}

const mavlink_msg_entry_t &entry_number(size_t n) {
    return entries[n % entry_count()];
}

size_t entry_count() {
    return std::size(entries);
}

void append_frame(Bytes *out, const mavlink_msg_entry_t &entry, const uint8_t *payload, const Form &form) {
    const bool v1 = form.v1 && entry.msgid < 256;
    size_t length = v1 ? entry.min_msg_len : entry.max_msg_len;
    while (!v1 && form.trim && length > 1 && payload[length - 1] == 0) {
        --length;
    }
    const size_t begin = out->size();
    const auto size = static_cast<uint8_t>(length);
    const auto flags = static_cast<uint8_t>(form.incompatible | (form.is_signed ? flag_signed : 0));
    const Bytes header =
        v1 ? Bytes{magic_v1, size, form.sequence, form.system, form.component, static_cast<uint8_t>(entry.msgid)}
           : Bytes{magic_v2,
                   size,
                   flags,
                   0,
                   form.sequence,
                   form.system,
                   form.component,
                   static_cast<uint8_t>(entry.msgid),
                   static_cast<uint8_t>(entry.msgid >> 8),
                   static_cast<uint8_t>(entry.msgid >> 16)};
    out->insert(out->end(), header.begin(), header.end());
    out->insert(out->end(), payload, payload + length);
    const uint16_t crc = crc_of(out->data() + begin + 1, out->size() - begin - 1, entry.crc_extra);
    out->push_back(static_cast<uint8_t>(crc));
    out->push_back(static_cast<uint8_t>(crc >> 8));
    if (!v1 && form.is_signed) {
        out->insert(out->end(), signature_length, form.sequence);
    }
}

void sign(Bytes *frame, const uint8_t *key, uint64_t time, uint8_t link_id) {
    uint8_t *at = frame->data() + frame->size() - signature_length;
    at[0] = link_id;
    std::memcpy(at + 1, &time, 6);
    mavlink_sha256_ctx context;
    mavlink_sha256_init(&context);
    mavlink_sha256_update(&context, key, 32);
    mavlink_sha256_update(&context, frame->data(), static_cast<uint32_t>(frame->size() - 6));
    mavlink_sha256_final_48(&context, at + 7);
}

bool is_signed(const Found &frame) {
    return frame.length == header_v2 + frame.payload_length + 2 + signature_length;
}

uint64_t signing_time(const Found &frame, const uint8_t *key) {
    const uint8_t *begin = frame.payload - header_v2;
    const Bytes sent(begin, begin + frame.length);
    const uint8_t *signature = sent.data() + sent.size() - signature_length;
    uint64_t time = 0;
    std::memcpy(&time, signature + 1, 6);
    Bytes right = sent;
    sign(&right, key, time, signature[0]);
    return right == sent ? time : 0;
}

Found frame_at(const uint8_t *stream, size_t size, size_t begin) {
    Found found;
    found.begin = begin;
    const uint8_t *bytes = stream + begin;
    const size_t left = size - begin;
    if (left == 0 || (bytes[0] != magic_v1 && bytes[0] != magic_v2)) {
        return found;
    }
    const bool v1 = bytes[0] == magic_v1;
    const size_t header = v1 ? 6 : header_v2;
    if (left < header) {
        found.kind = Found::Kind::incomplete;
        found.length = left + 1;
        return found;
    }
    if (!v1 && (bytes[2] & ~flag_signed) != 0) {
        return found;
    }
    found.payload_length = bytes[1];
    found.payload = bytes + header;
    found.id = v1 ? bytes[5] : static_cast<uint32_t>(bytes[7] | bytes[8] << 8 | bytes[9] << 16);
    found.system = v1 ? bytes[3] : bytes[5];
    found.component = v1 ? bytes[4] : bytes[6];
    found.length = header + found.payload_length + 2 + (!v1 && (bytes[2] & flag_signed) != 0 ? signature_length : 0);
    const mavlink_msg_entry_t *entry = entry_of(found.id);
    const Standard *other = std::find_if(std::begin(standard), std::end(standard),
                                         [&found](const Standard &message) { return message.id == found.id; });
    const bool known = entry != nullptr || other != std::end(standard);
    if (!known || (v1 && found.payload_length != (entry != nullptr ? entry->min_msg_len : other->length))) {
        return found;
    }
    if (left < found.length) {
        found.kind = Found::Kind::incomplete;
        return found;
    }
    const size_t covered = header + found.payload_length;
    const unsigned sent = bytes[covered] | static_cast<unsigned>(bytes[covered + 1]) << 8;
    const bool right = sent == crc_of(bytes + 1, covered - 1, entry != nullptr ? entry->crc_extra : other->seed);
    const Found::Kind whole = entry != nullptr ? Found::Kind::valid : Found::Kind::foreign;
    found.kind = right ? whole : Found::Kind::damaged;
    return found;
}

bool asks_to_arm(const uint8_t *stream, size_t size) {
    for (size_t i = 0; i < size; ++i) {
        const Found found = frame_at(stream, size, i);
        if (found.kind != Found::Kind::valid) {
            continue;
        }
        if (found.id == MAVLINK_MSG_ID_COMMAND_LONG) {
            const auto message = as<mavlink_command_long_t>(found);
            if (message.command == MAV_CMD_COMPONENT_ARM_DISARM && message.param1 == 1.0f) {
                return true;
            }
        } else if (found.id == MAVLINK_MSG_ID_COMMAND_INT) {
            const auto message = as<mavlink_command_int_t>(found);
            if (message.command == MAV_CMD_COMPONENT_ARM_DISARM && message.param1 == 1.0f) {
                return true;
            }
        }
    }
    return false;
}

} // namespace fuzz
