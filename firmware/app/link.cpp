// SPDX-License-Identifier: MIT
#include "app/link.h"

#include <algorithm>

namespace omni {
namespace {

/// A frame whose rest does not come within this time was none: longer than any pause within a frame at 9600 baud.
constexpr uint64_t idle_limit_ns = 200'000'000;
/// The largest burst is what the budget gives in this time, or one frame.
constexpr float burst_s = 0.1f;
/// Telemetry waits while this much is buffered: what waits is old by the time it arrives.
constexpr size_t telemetry_backlog = 2048;
/// Lists leave room for telemetry in front of the port.
constexpr size_t bulk_backlog = 1024;

float burst_of(float bytes_s) {
    return std::max(bytes_s * burst_s, static_cast<float>(max_frame));
}

} // namespace

void Link::refill(uint64_t now_us) {
    // A clock that went back (entering or leaving host-in-the-loop) starts a new account.
    const float seconds = now_us >= refilled_us_ ? static_cast<float>(now_us - refilled_us_) * 1e-6f : burst_s;
    refilled_us_ = now_us;
    tokens_ = std::min(tokens_ + budget_ * seconds, burst_of(budget_));
    bulk_tokens_ = std::min(bulk_tokens_ + 0.5f * budget_ * seconds, burst_of(0.5f * budget_));
}

void Link::receive(uint64_t idle_ns) {
    const uint32_t session = port_->session();
    if (session != session_) {
        session_ = session;
        new_session_ = session != 0;
        parser_.reset();
        pending_ = 0;
        tokens_ = burst_of(budget_);
        bulk_tokens_ = burst_of(0.5f * budget_);
    }
    size_t room = 0;
    uint8_t *space = parser_.space(&room);
    const size_t count = room > 0 ? port_->read(space, room) : 0;
    if (count > 0 || !parser_.waiting()) {
        heard_ns_ = idle_ns;
        parser_.received(count);
    } else if (idle_ns - heard_ns_ > idle_limit_ns) {
        parser_.give_up_frame();
    }
}

bool Link::connected_anew() {
    const bool anew = new_session_;
    new_session_ = false;
    return anew;
}

bool Link::admits(Priority priority, size_t length) const {
    const auto bytes = static_cast<float>(length);
    switch (priority) {
    case Priority::reply:
        return pending_ + length <= buffer_size;
    case Priority::text:
        return pending_ + length <= buffer_size / 2;
    case Priority::telemetry:
        return pending_ + length <= telemetry_backlog && (unlimited_ || tokens_ >= bytes);
    case Priority::bulk:
        return pending_ + length <= bulk_backlog && (unlimited_ || bulk_tokens_ >= bytes);
    }
    return false;
}

bool Link::send_payload(uint32_t id, const uint8_t *payload, Priority priority) {
    if (session_ == 0) {
        return false;
    }
    uint8_t frame[max_frame];
    const size_t length = encode_frame(frame, sequence_, system_, id, payload);
    if (length == 0 || !admits(priority, length)) {
        tx_dropped_ += priority == Priority::bulk ? 0 : 1;
        return false;
    }
    std::memcpy(out_ + pending_, frame, length);
    pending_ += length;
    ++sequence_;
    tokens_ -= static_cast<float>(length);
    if (priority == Priority::bulk) {
        bulk_tokens_ -= static_cast<float>(length);
    }
    return true;
}

void Link::flush() {
    if (port_->session() != session_) {
        return; // what waits was meant for somebody who has gone: receive() clears it
    }
    const size_t count = std::min(pending_, port_->write_space());
    if (count > 0 && port_->write(out_, count)) {
        pending_ -= count;
        std::memmove(out_, out_ + count, pending_);
    }
}

} // namespace omni
