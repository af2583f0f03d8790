// SPDX-License-Identifier: MIT
/// @file frames.h  MAVLink frames for the fuzzers, made and recognised without the firmware's own codec.
#pragma once

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <vector>

#include "app/link/mavlink_types.h"
#include "script.h"

namespace fuzz {

using Bytes = std::vector<uint8_t>;

/// How a frame is put on the wire.
struct Form {
    bool v1 = false;
    bool is_signed = false; ///< flag and 13 bytes of signature
    uint8_t incompatible = 0;
    uint8_t sequence = 0;
    uint8_t system = 255;
    uint8_t component = 190;
    bool trim = true;
};

/// Entry of a message in the dialect, or nullptr.
const mavlink_msg_entry_t *entry_of(uint32_t id);
/// The n-th message of the dialect, n modulo their number.
const mavlink_msg_entry_t &entry_number(size_t n);
size_t entry_count();

/// Append a frame with a correct checksum. @param payload max_msg_len bytes of the entry.
void append_frame(Bytes *out, const mavlink_msg_entry_t &entry, const uint8_t *payload, const Form &form);

/// A frame of this message, its struct as mavgen has it.
template <class Message>
Bytes frame_of(uint32_t id, const Message &message, const Form &form = {}) {
    uint8_t payload[256] = {};
    static_assert(sizeof message < sizeof payload, "not a MAVLink payload");
    std::memcpy(payload, &message, sizeof message);
    Bytes frame;
    append_frame(&frame, *entry_of(id), payload, form);
    return frame;
}

/// Put a right signature into the place that `is_signed` left, as https://mavlink.io/en/guide/message_signing.html has
/// it, with MAVLink's own SHA-256. @param key 32 bytes. @param time [10 us since 2015], above that of the frame before.
void sign(Bytes *frame, const uint8_t *key, uint64_t time, uint8_t link_id = 1);

/// A frame that stands somewhere in a stream.
struct Found {
    size_t begin = 0;
    size_t length = 0; ///< as its header says; the checksum was not looked at if it is not whole
    uint32_t id = 0;
    uint8_t system = 0;
    uint8_t component = 0;
    const uint8_t *payload = nullptr;
    size_t payload_length = 0;
    enum class Kind { none, incomplete, foreign, damaged, valid } kind = Kind::none;
};

/// Whether a valid frame carries a signature.
bool is_signed(const Found &frame);
/// Time stamp of a signed frame [10 us since 2015], 0 if its signature is not of this key.
uint64_t signing_time(const Found &frame, const uint8_t *key);

/// The payload of a valid frame as mavgen's struct.
template <class Message>
Message as(const Found &frame) {
    uint8_t whole[256] = {};
    std::memcpy(whole, frame.payload, frame.payload_length);
    Message message{};
    std::memcpy(&message, whole, sizeof message);
    return message;
}

/// What stands at this place of a stream. Nothing: no start byte, an unknown flag or message, no length of it. Or a
/// frame and in which state it is. `foreign` is a whole one of a standard message that the robot does not speak.
Found frame_at(const uint8_t *stream, size_t size, size_t begin);

/// Whether these bytes hold, anywhere, a whole valid frame that asks to arm. A superset of what any parser may see.
bool asks_to_arm(const uint8_t *stream, size_t size);

} // namespace fuzz
