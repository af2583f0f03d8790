// SPDX-License-Identifier: MIT
#include "app/link/signing.h"

#include <algorithm>
#include <cstring>

#include "app/base/flash_code.h"
#include "app/link/mavlink_types.h"

namespace omni {
namespace {

constexpr size_t time_length = 6;
constexpr size_t digest_length = 6;
constexpr size_t at_time = 1; ///< in the signature, behind the link id
constexpr size_t at_digest = at_time + time_length;
constexpr size_t at_key = 4; ///< in the stored record
constexpr uint64_t us_per_unit = 10;
constexpr uint64_t time_stamp_limit = (uint64_t{1} << 48) - 1;
/// A new stream may start this far behind our clock: one minute.
constexpr uint64_t new_stream_slack = 6'000'000;

/// Offset of a record in the memory; a memory that is too small makes every access fail.
size_t at_tail(Storage &storage, size_t offset) {
    const size_t size = storage.size();
    return size >= storage_tail ? size - storage_tail + offset : size;
}

/// First 48 bits of SHA-256 over the key and `length` bytes.
void digest_frame(const uint8_t *key, const uint8_t *bytes, size_t length, uint8_t *out) {
    mavlink_sha256_ctx context;
    mavlink_sha256_init(&context);
    mavlink_sha256_update(&context, key, Signing::key_length);
    mavlink_sha256_update(&context, bytes, static_cast<uint32_t>(length));
    mavlink_sha256_final_48(&context, out);
}

uint64_t time_of(const uint8_t *signature) {
    uint64_t time = 0;
    std::memcpy(&time, signature + at_time, time_length);
    return time;
}

/// Constant-time comparison.
bool are_equal(const uint8_t *a, const uint8_t *b, size_t length) {
    uint8_t difference = 0;
    for (size_t i = 0; i < length; ++i) {
        difference = static_cast<uint8_t>(difference | (a[i] ^ b[i]));
    }
    return difference == 0;
}

} // namespace

Signing::Signing(Storage &storage)
    : key_store_(storage, at_tail(storage, 0), key_content),
      time_store_(storage, at_tail(storage, key_record), signing_time_size) {}

OMNI_COLD void Signing::boot() {
    uint8_t record[key_content] = {};
    const RecordStore::Result found = key_store_.load(record);
    if (found == RecordStore::Result::damaged) {
        forget_key(State::damaged);
    } else if (found == RecordStore::Result::ok && record[0] == 1) {
        use_key(record + at_key);
    }
    uint64_t time = 0;
    if (time_store_.load(reinterpret_cast<uint8_t *>(&time)) == RecordStore::Result::ok) {
        stored_time_ = time;
        set_on(std::min(time, max_time));
    }
}

bool Signing::is_key(const uint8_t *key) const {
    return state_ == State::on && are_equal(key, key_, key_length);
}

void Signing::use_key(const uint8_t *key) {
    std::memcpy(key_, key, key_length);
    uint8_t hash[digest_length];
    digest_frame(key_, key_, 0, hash);
    fingerprint_ = static_cast<uint32_t>(hash[0]) << 24 | static_cast<uint32_t>(hash[1]) << 16 |
                   static_cast<uint32_t>(hash[2]) << 8 | hash[3];
    forget_streams();
    state_ = State::on;
}

void Signing::forget_key(State state) {
    std::memset(key_, 0, sizeof key_);
    fingerprint_ = 0;
    forget_streams();
    state_ = state;
}

void Signing::forget_streams() {
    std::fill(streams_, streams_ + max_streams, Stream{});
    replaced_ = 0;
}

/// @param key nullptr: none.
bool Signing::store_key(const uint8_t *key) {
    uint8_t record[key_content] = {};
    if (key != nullptr) {
        record[0] = 1;
        std::memcpy(record + at_key, key, key_length);
    }
    return key_store_.save(record);
}

/// Set the clock from a cable. Streams ahead of it are dropped, as they could never be accepted again.
void Signing::set_time(uint64_t time) {
    if (time == 0) {
        return;
    }
    time_ = std::min(time, max_time);
    replaced_ = std::min(replaced_, time_);
    last_sent_ = time_; // otherwise our frames would be ahead of stations with a correct clock
    for (Stream &stream : streams_) {
        stream.used = stream.used && stream.last <= time_;
    }
}

OMNI_COLD bool Signing::set_key(const uint8_t *key, uint64_t time) {
    const bool same = is_key(key);
    if (!same && !store_key(key)) {
        return false;
    }
    if (!same) {
        use_key(key);
    }
    set_time(time);
    if (!same || outdated(new_stream_slack)) { // a repeated request causes no wear
        store_time();                          // tried again if it fails
    }
    return true;
}

bool Signing::remove_key() {
    if (state_ != State::off && !store_key(nullptr)) {
        return false;
    }
    forget_key(State::off);
    return true;
}

Signing::Stream *Signing::find(const Frame &frame, uint8_t link_id) {
    for (Stream &stream : streams_) {
        if (stream.is_of(frame, link_id)) {
            return &stream;
        }
    }
    return nullptr;
}

/// A free entry, or the stream with the oldest last frame.
OMNI_COLD Signing::Stream *Signing::vacant() {
    Stream *oldest = streams_;
    for (Stream &stream : streams_) {
        if (!stream.used) {
            return &stream;
        }
        oldest = stream.last < oldest->last ? &stream : oldest;
    }
    return oldest;
}

/// Stream of an authentic frame. @return nullptr if it may be a replay.
Signing::Stream *Signing::stream_of(const Frame &frame) {
    const uint8_t *signature = frame.bytes + frame.length - signature_length;
    const uint64_t time = time_of(signature);
    Stream *stream = find(frame, signature[0]);
    if (stream != nullptr) {
        return time > stream->last ? stream : nullptr;
    }
    return time + new_stream_slack >= time_ && time > replaced_ ? vacant() : nullptr;
}

Signing::Verdict Signing::judge(const Frame &frame) {
    if (!frame.is_signed) {
        const bool from_the_air = frame.id == MAVLINK_MSG_ID_HEARTBEAT || frame.id == MAVLINK_MSG_ID_RADIO_STATUS;
        return from_the_air ? Verdict::from_the_air : Verdict::not_signed;
    }
    const uint8_t *signature = frame.bytes + frame.length - signature_length;
    uint8_t expected[digest_length];
    digest_frame(key_, frame.bytes, frame.length - digest_length, expected);
    if (state_ == State::damaged || !are_equal(expected, signature + at_digest, digest_length)) {
        return Verdict::wrong;
    }
    if (time_ != 0 && time_of(signature) > time_ + max_clock_lead) {
        return Verdict::ahead;
    }
    Stream *stream = stream_of(frame);
    if (stream == nullptr) {
        return Verdict::replayed;
    }
    if (!frame.early) {
        const uint64_t time = time_of(signature);
        if (stream->used && !stream->is_of(frame, signature[0])) {
            replaced_ = std::max(replaced_, stream->last); // no recording of it may start a new stream
        }
        *stream = {true, frame.system, frame.component, signature[0], time};
        set_on(std::min(time + 1, max_time)); // a peer that follows our clock already has this time
    }
    return Verdict::taken;
}

bool Signing::admits(const Frame &frame) {
    if (!required()) {
        return true;
    }
    const Verdict verdict = judge(frame);
    const uint32_t one = frame.early ? 0 : 1;
    counts_.not_signed += verdict == Verdict::not_signed ? one : 0;
    counts_.wrong += verdict == Verdict::wrong ? one : 0;
    counts_.replayed += verdict == Verdict::replayed ? one : 0;
    counts_.ahead += verdict == Verdict::ahead ? one : 0;
    return verdict == Verdict::taken;
}

size_t Signing::sign(uint8_t *frame, size_t length, uint8_t link_id) {
    last_sent_ = std::min(std::max(last_sent_ + 1, time_), time_stamp_limit);
    frame[length] = link_id;
    std::memcpy(frame + length + at_time, &last_sent_, time_length);
    digest_frame(key_, frame, length + at_digest, frame + length + at_digest);
    return length + signature_length;
}

void Signing::advance(uint64_t now_us) {
    rest_us_ += now_us > advanced_us_ ? std::min(now_us - advanced_us_, max_clock_step_us) : 0;
    advanced_us_ = now_us;
    time_ = std::min(time_ + rest_us_ / us_per_unit, time_stamp_limit);
    rest_us_ %= us_per_unit;
}

bool Signing::store(uint64_t time) {
    if (!time_store_.save(reinterpret_cast<const uint8_t *>(&time))) {
        return false;
    }
    stored_time_ = time;
    return true;
}

} // namespace omni
