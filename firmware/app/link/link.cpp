// SPDX-License-Identifier: MIT
#include "app/link/link.h"

#include <algorithm>

namespace omni {
namespace {

/// Timeout within a frame: longer than any pause within a frame at 9600 baud.
constexpr uint64_t idle_limit_ns = 200'000'000;
/// Bucket size: budget over this time, or one frame of each message of a slow profile's telemetry.
constexpr float burst_s = 0.1f;
constexpr float least_burst = 400.0f;
/// Buffered bytes above which telemetry waits, to limit its latency.
constexpr size_t telemetry_backlog = 2048;
/// Link id in the signature of acknowledgements of stops: a separate stream, as they overtake frames signed before,
/// which would be rejected as too old in one stream.
constexpr unsigned stop_stream = 0x80;

/// Buffer space that bulk data leave for telemetry.
constexpr size_t bulk_backlog = 1024;

/// Bytes per bit of a serial line: ten bits per byte, half of the capacity.
constexpr float bytes_per_baud = 0.05f;

/// Maximum output rate as a multiple of the budget, one packet at a time: a modem behind a fast line overflows by
/// faster bursts.
constexpr float line_share = 1.5f;

float burst_of(float bytes_s) {
    return std::max(bytes_s * burst_s, least_burst);
}

} // namespace

float Link::budget() const {
    const bool limited = port_->has_baud() && applied_baud_ != 0;
    return limited ? std::min(budget_, bytes_per_baud * static_cast<float>(applied_baud_)) : budget_;
}

void Link::refill(uint64_t now_us) {
    // The clock went back (entering or leaving hardware-in-the-loop): restart the token buckets.
    const float seconds = now_us >= refilled_us_ ? static_cast<float>(now_us - refilled_us_) * 1e-6f : burst_s;
    refilled_us_ = now_us;
    const float bytes_s = budget();
    tokens_ = std::min(tokens_ + bytes_s * seconds, burst_of(bytes_s));
    bulk_tokens_ = std::min(bulk_tokens_ + 0.5f * bytes_s * seconds, burst_of(0.5f * bytes_s));
    line_tokens_ = std::min(line_tokens_ + line_share * bytes_s * seconds, static_cast<float>(radio_frame));
}

void Link::receive(uint64_t idle_ns) {
    const uint32_t session = port_->session();
    if (session != session_) {
        session_ = session;
        new_session_ = session != 0;
        parser_.reset();
        pending_ = begun_ = urgent_ = 0;
        tokens_ = burst_of(budget());
        bulk_tokens_ = burst_of(0.5f * budget());
    }
    if (port_->has_baud() && pending_ == 0 && baud_ != applied_baud_) {
        port_->set_baud(baud_);
        applied_baud_ = baud_;
    }
    size_t room = 0;
    uint8_t *space = parser_.space(&room);
    const size_t count = room > 0 ? port_->read(space, room) : 0;
    const bool silent = idle_ns - heard_ns_ > idle_limit_ns;
    if (silent && text_ != nullptr) {
        text_->on_frame();
    }
    if (count > 0) {
        heard_ns_ = idle_ns;
        parser_.received(count);
    } else if (silent && parser_.waiting()) {
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
    case Priority::stop:
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

/// Make room for the acknowledgement of a stop: drop frames from the end, except other acknowledgements of stops.
void Link::make_room(size_t length) {
    while (pending_ + length > buffer_size && pending_ > begun_ + urgent_) {
        size_t last = begun_ + urgent_;
        for (size_t end = last; end < pending_; end += frame_length(out_ + end)) {
            last = end;
        }
        pending_ = last;
        ++tx_dropped_;
    }
}

void Link::put(const uint8_t *frame, size_t length, Priority priority) {
    const size_t at = priority == Priority::stop ? begun_ + urgent_ : pending_;
    std::memmove(out_ + at + length, out_ + at, pending_ - at);
    std::memcpy(out_ + at, frame, length);
    pending_ += length;
    urgent_ += priority == Priority::stop ? length : 0;
}

/// Remove sent bytes from the buffer.
void Link::sent(size_t count) {
    size_t end = begun_; // end of the frame that contains the last byte
    while (end < count) {
        end += frame_length(out_ + end);
    }
    const size_t urgent_end = begun_ + urgent_;
    begun_ = end - count;
    urgent_ = urgent_end > end ? urgent_end - end : 0;
    pending_ -= count;
    std::memmove(out_, out_ + count, pending_);
}

bool Link::send_payload(uint32_t id, const uint8_t *payload, Priority priority) {
    if (session_ == 0) {
        return false;
    }
    uint8_t frame[max_frame];
    const bool is_signed = signing_ != nullptr && signing_->required();
    size_t length = encode_frame(frame, sequence_, system_, id, payload, is_signed);
    if (is_signed && length != 0) {
        const unsigned stream = number_ | (priority == Priority::stop ? stop_stream : 0u);
        length = signing_->sign(frame, length, static_cast<uint8_t>(stream));
    }
    if (priority == Priority::stop) {
        make_room(length);
    }
    if (length == 0 || !admits(priority, length)) {
        tx_dropped_ += priority == Priority::bulk ? 0 : 1;
        return false;
    }
    put(frame, length, priority);
    ++sequence_;
    if (!unlimited_) { // otherwise the link would be silent afterwards until its budget has recovered
        tokens_ -= static_cast<float>(length);
        bulk_tokens_ -= priority == Priority::bulk ? static_cast<float>(length) : 0.0f;
    }
    return true;
}

/// Write complete frames only: a modem sends data without a pause as one packet.
void Link::flush_frames() {
    size_t done = 0;
    while (done < pending_) {
        const size_t length = frame_length(out_ + done);
        const bool due = done < urgent_ || line_tokens_ >= static_cast<float>(std::min(length, radio_frame));
        if (!due || length > port_->write_space() || !port_->write(out_ + done, length)) {
            break;
        }
        line_tokens_ -= static_cast<float>(length);
        done += length;
    }
    sent(done);
}

void Link::flush() {
    if (port_->session() != session_) {
        return; // pending data are of a closed connection: receive() clears them
    }
    if (port_->has_baud()) {
        flush_frames();
        return;
    }
    const size_t count = std::min(pending_, port_->write_space());
    if (count > 0 && port_->write(out_, count)) {
        sent(count);
    }
}

} // namespace omni
