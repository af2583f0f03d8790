// SPDX-License-Identifier: MIT
/// @file link.h  One MAVLink channel: parser, output buffer with admission by priority, byte budget.
#pragma once

#include <cstddef>
#include <cstdint>

#include "app/base/board.h"
#include "app/link/codec.h"
#include "app/link/signing.h"

namespace omni {

/// Who may still send when room or budget gets short, most important first.
enum class Priority : uint8_t {
    stop,      ///< answers to stops: in front of everything that waits; in a full buffer, in the place of others
    reply,     ///< answers and heartbeats: dropped only when the buffer is full
    text,      ///< STATUSTEXT: as long as half of the buffer is free
    telemetry, ///< within the budget
    bulk,      ///< parameter lists: within half of the budget of their own, so that neither starves the other
};

class Link {
public:
    static constexpr size_t buffer_size = 8192;

    /// Longest frame that a radio is sent unasked: an XBee cuts its stream into packets of about this many bytes.
    static constexpr size_t radio_frame = 100;

    /// @param number of the link, from 0. @param signing of a radio; nullptr where whoever is connected has the robot
    /// in hand.
    void attach(SerialPort *port, uint8_t number = 0, Signing *signing = nullptr) {
        port_ = port;
        number_ = number;
        signing_ = signing;
    }
    bool is_radio() const { return signing_ != nullptr; }
    /// Whether this frame may do anything; counted if not.
    bool admits(const Frame &frame) { return signing_ == nullptr || signing_->admits(frame); }
    /// Where bytes between frames go; silence counts as a frame.
    void set_text(TextSink *text) {
        text_ = text;
        parser_.set_text(text);
    }
    /// Speed of the port's line [bit/s], for ports that have one: from when the buffer is empty on.
    void set_baud(uint32_t baud) { baud_ = baud; }
    void set_system(uint8_t system) { system_ = system; }
    /// @param bytes_s what the link may carry, B/s; a line with a baud rate carries no more than half of that.
    void set_budget(float bytes_s) { budget_ = bytes_s; }
    /// Budgets are off in host-in-the-loop: its wire carries far more than telemetry anyway, and its clock may stand
    /// still. Except on a line with a baud rate.
    void set_unlimited(bool unlimited) { unlimited_ = unlimited && !port_->has_baud(); }
    /// Add what the time since the last call allows to send.
    void refill(uint64_t now_us);
    /// Read waiting bytes and look after a frame that stopped arriving half-way. @param idle_ns free-running time.
    void receive(uint64_t idle_ns);
    bool next(Frame *frame) { return parser_.next(frame); }
    /// True if a frame of this priority would be sent now.
    bool admits(Priority priority, size_t length) const;
    /// Send a message. @return false (and counted, for telemetry) if it was dropped.
    template <class Message>
    bool send(uint32_t id, const Message &message, Priority priority) {
        uint8_t payload[max_payload + 1] = {};
        static_assert(sizeof message <= sizeof payload, "not a MAVLink payload");
        std::memcpy(payload, &message, sizeof message);
        return send_payload(id, payload, priority);
    }
    /// Give the port what it takes.
    void flush();
    /// True once for each new connection.
    bool connected_anew();
    bool connected() const { return session_ != 0; }
    uint32_t rx_errors() const { return parser_.errors(); }
    uint32_t tx_dropped() const { return tx_dropped_; }
    /// Telemetry that became old before there was room for it.
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
    size_t begun_ = 0;  ///< bytes at the beginning of out_ that belong to a frame whose first bytes have gone
    size_t urgent_ = 0; ///< bytes behind those that answer stops
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
