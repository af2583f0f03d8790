// SPDX-License-Identifier: MIT
/// @file mavlink_frame.h  Received MAVLink frame, and size limits.
#pragma once

#include <cstddef>
#include <cstdint>
#include <cstring>

namespace omni {

constexpr size_t max_payload = 255;
constexpr size_t signature_length = 13;
constexpr size_t max_frame = 12 + max_payload + signature_length;

/// One received message, checksum verified.
struct Frame {
    uint32_t id = 0;
    uint8_t system = 0;
    uint8_t component = 0;
    uint8_t target_system = 0;      ///< 0: broadcast
    uint8_t target_component = 0;   ///< 0: all components
    bool is_signed = false;         ///< has a signature (not verified here)
    bool early = false;             ///< a stop returned ahead of the stream order, see FrameParser
    const uint8_t *bytes = nullptr; ///< as received, signature included; valid until the parser gets new bytes
    size_t length = 0;
    uint8_t payload[max_payload] = {}; ///< zero behind the bytes received (MAVLink 2 trims zeros)

    /// Payload as the generated struct of the message.
    template <class Message>
    Message as() const {
        static_assert(sizeof(Message) <= max_payload + 1, "not a MAVLink payload");
        Message message{};
        std::memcpy(&message, payload, sizeof message < max_payload ? sizeof message : max_payload);
        return message;
    }
};

} // namespace omni
