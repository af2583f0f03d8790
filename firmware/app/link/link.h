// SPDX-License-Identifier: MIT
/// @file link.h  One MAVLink channel: parser, output buffer with admission by priority, byte budget.
#pragma once

#include <cstddef>
#include <cstdint>

#include "app/base/board.h"
#include "app/link/codec.h"
#include "app/link/signing.h"

namespace omni {

/// Transmit priority when buffer space or budget is short, highest first.
enum class Priority : uint8_t {
    stop,      ///< acknowledgements of stops: sent before everything pending; displace others in a full buffer
    reply,     ///< answers and heartbeats: dropped only when the buffer is full
    text,      ///< STATUSTEXT: while half of the buffer is free
    telemetry, ///< within the budget
    bulk,      ///< parameter lists and logs: within a separate half of the budget, so that neither starves the other
};

class Link {
public:
    static constexpr size_t buffer_size = 8192;

    /// Longest unrequested frame on a radio: about the packet size of an XBee.
    static constexpr size_t radio_frame = 100;

    /// @param number of the link, from 0. @param signing for radios; nullptr for wired links, whose user
    /// has physical access.
    void attach(SerialPort *port, uint8_t number = 0, Signing *signing = nullptr) {
        port_ = port;
        number_ = number;
        signing_ = signing;
    }
    bool is_radio() const { return signing_ != nullptr; }
    /// Is this frame accepted by signing? Rejected ones are counted.
    bool admits(const Frame &frame) { return signing_ == nullptr || signing_->admits(frame); }
    /// Set the receiver of the bytes between frames; a silence is reported as a frame.
    void set_text(TextSink *text) {
        text_ = text;
        parser_.set_text(text);
    }
    /// Baud rate [bit/s], for ports that have one; applied when the transmit buffer is empty.
    void set_baud(uint32_t baud) { baud_ = baud; }
    void set_system(uint8_t system) { system_ = system; }
    /// @param bytes_s budget [B/s]; limited to half of the baud rate.
    void set_budget(float bytes_s) { budget_ = bytes_s; }
    /// Disable the budget in hardware-in-the-loop, whose simulated time may stand still. No effect on a link with a
    /// baud rate.
    void set_unlimited(bool unlimited) { unlimited_ = unlimited && !port_->has_baud(); }
    /// Refill the token buckets by the time since the last call.
    void refill(uint64_t now_us);
    /// Read received bytes; discard an incomplete frame after a timeout. @param idle_ns free-running time.
    void receive(uint64_t idle_ns);
    bool next(Frame *frame) { return parser_.next(frame); }
    /// Would a frame of this priority be accepted now?
    bool admits(Priority priority, size_t length) const;
    /// Send a message. @return false (and counted, for telemetry) if it was dropped.
    template <class Message>
    bool send(uint32_t id, const Message &message, Priority priority) {
        uint8_t payload[max_payload + 1] = {};
        static_assert(sizeof message <= sizeof payload, "not a MAVLink payload");
        std::memcpy(payload, &message, sizeof message);
        return send_payload(id, payload, priority);
    }
    /// Write pending bytes to the port.
    void flush();
    /// Check for a new connection; true once for each.
    bool connected_anew();
    bool connected() const { return session_ != 0; }
    uint32_t rx_errors() const { return parser_.errors(); }
    uint32_t tx_dropped() const { return tx_dropped_; }
    /// Count telemetry that was skipped for lack of room.
    void count_dropped(uint32_t frames) { tx_dropped_ += frames; }

private:
    float budget() const;
    void make_room(size_t length);
    void put(const uint8_t *frame, size_t length, Priority priority);
    void sent(size_t count);
    void flush_frames();
    bool send_payload(uint32_t id, const uint8_t *payload, Priority priority);

    SerialPort *port_ = nullptr;
    FrameParser parser_;
    Signing *signing_ = nullptr;
    TextSink *text_ = nullptr;
    uint8_t number_ = 0;
    uint32_t baud_ = 0;
    uint32_t applied_baud_ = 0;
    uint8_t out_[buffer_size] = {};
    size_t pending_ = 0;
    size_t begun_ = 0;  ///< remaining bytes of a frame that is partly sent, at the start of out_
    size_t urgent_ = 0; ///< bytes of acknowledgements of stops, after those
    uint8_t system_ = 1;
    uint8_t sequence_ = 0;
    bool unlimited_ = false;
    bool new_session_ = false;
    uint32_t session_ = 0;
    float budget_ = 0.0f;
    float tokens_ = 0.0f;
    float bulk_tokens_ = 0.0f;
    float line_tokens_ = 0.0f;
    uint64_t refilled_us_ = 0;
    uint64_t heard_ns_ = 0;
    uint32_t tx_dropped_ = 0;
};

} // namespace omni
