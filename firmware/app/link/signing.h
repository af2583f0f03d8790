// SPDX-License-Identifier: MIT
/// @file signing.h  MAVLink 2 message signing for radio links.
///
/// With a key set, a frame from a radio is accepted only with a valid signature and a new time stamp: later than the
/// last one of its stream (system, component, link id). The first of a new stream must not be older than our clock
/// minus one minute, nor than any stream that was replaced. A new stream replaces the one that has been silent for
/// longest. A frame more than half a year ahead of our clock is rejected, so that one sender with a wrong date cannot
/// lock out the others. Table: docs/reference/protocol.md; format: https://mavlink.io/en/guide/message_signing.html.
///
/// **Clock.** Setting a key over a cable sets the time, forward or back. Then it advances with the robot's clock and
/// follows every accepted frame. Non-volatile memory holds the time while disarmed, and from arming on a time far
/// ahead, so that after a power loss while armed a recording of that drive is rejected (replay protection). The robot's
/// own frames then advance the stations' clocks: every MAVLink signer follows a clock ahead of its own.
#pragma once

#include <cstddef>
#include <cstdint>

#include "app/base/board.h"
#include "app/link/codec.h"
#include "app/storage/record_store.h"

namespace omni {

/// Rejected frames since boot, by reason.
struct SigningCounts {
    uint32_t not_signed = 0;
    uint32_t wrong = 0;    ///< invalid signature
    uint32_t replayed = 0; ///< time stamp not later than the stream's last, or too old for a new stream
    uint32_t ahead = 0;    ///< time stamp too far ahead of our clock
    uint32_t keys = 0;     ///< SETUP_SIGNING received over a radio; not frames
    uint32_t total() const { return not_signed + wrong + replayed + ahead; }
};

class Signing {
public:
    static constexpr size_t key_length = 32;
    /// Limit of the clock: a year before the 48-bit time stamp overflows (March 2104) [10 us].
    static constexpr uint64_t max_time = (uint64_t{1} << 48) - uint64_t{100'000} * 86'400 * 365;
    /// Lead of the stored time over the clock while armed: longer than any drive on one battery [10 us].
    static constexpr uint64_t max_drive_duration = uint64_t{100'000} * 3600 * 12;
    /// A larger step of the robot clock is a change of the clock, not elapsed time. The longest pause, erasing flash,
    /// takes 0.4 s.
    static constexpr uint64_t max_clock_step_us = 10'000'000;
    /// A frame further ahead of a clock that was set once is rejected [10 us]. Half a year covers the time a robot is
    /// stored without power.
    static constexpr uint64_t max_clock_lead = uint64_t{100'000} * 86'400 * 183;
    enum class State : uint8_t {
        off,     ///< no key: all frames are accepted
        on,      ///< a key is set
        damaged, ///< a stored key cannot be read: no frame is accepted until a key is set or removed over USB
    };

    explicit Signing(Storage &storage);

    /// Load key and clock from non-volatile memory.
    void boot();
    State state() const { return state_; }
    /// Must frames from radios be signed?
    bool required() const { return state_ != State::off; }
    /// First bytes of the key's SHA-256; 0 without a key.
    uint32_t fingerprint() const { return fingerprint_; }
    bool is_key(const uint8_t *key) const;
    /// Use and store a key. @param time sets the clock, forward or back; streams ahead of it are dropped; 0: keep the
    /// clock. At most max_time [10 us since 2015]. @return false if the memory failed; key and time are then unchanged.
    bool set_key(const uint8_t *key, uint64_t time);
    bool remove_key();

    /// Verify a frame from a radio; count it if rejected. Unsigned HEARTBEAT and RADIO_STATUS, which other stations and
    /// modems send, are rejected without being counted. An early frame does not update the stream: it will be received
    /// again in order.
    bool admits(const Frame &frame);
    /// Sign a frame that was encoded with `is_signed`. @param frame buffer with room for signature_length more bytes.
    /// @return new length.
    size_t sign(uint8_t *frame, size_t length, uint8_t link_id);

    /// Advance the clock. The robot clock changes when hardware-in-the-loop starts or ends: a step back adds nothing, a
    /// jump adds at most `max_clock_step_us`. @param now_us robot clock.
    void advance(uint64_t now_us);
    /// The clock [10 us since 2015].
    uint64_t time() const { return time_; }
    /// Is the stored time more than `behind` older than the clock, or ahead of it?
    bool outdated(uint64_t behind) const { return stored_time_ > time_ || time_ - stored_time_ > behind; }
    bool store_time() { return store(time_); }
    /// Store a time ahead of the clock before arming. @return false if the memory failed.
    bool store_for_drive() {
        return !required() || stored_time_ > time_ + max_drive_duration / 2 || store(time_ + max_drive_duration);
    }
    void count_refused_key() { ++counts_.keys; }
    const SigningCounts &counts() const { return counts_; }

private:
    struct Stream {
        bool used = false;
        uint8_t system = 0;
        uint8_t component = 0;
        uint8_t link_id = 0;
        uint64_t last = 0;

        bool is_of(const Frame &frame, uint8_t id) const {
            return used && system == frame.system && component == frame.component && link_id == id;
        }
    };
    static constexpr size_t max_streams = 16;

    bool store_key(const uint8_t *key);
    bool store(uint64_t time);
    void set_on(uint64_t time) { time_ = time > time_ ? time : time_; }
    void set_time(uint64_t time);
    void use_key(const uint8_t *key);
    void forget_key(State state);
    void forget_streams();
    /// Result of the verification.
    enum class Verdict : uint8_t { taken, from_the_air, not_signed, wrong, replayed, ahead };
    Verdict judge(const Frame &frame);
    Stream *stream_of(const Frame &frame);
    Stream *find(const Frame &frame, uint8_t link_id);
    Stream *vacant();

    RecordStore key_store_;
    RecordStore time_store_;
    State state_ = State::off;
    uint8_t key_[key_length] = {};
    uint32_t fingerprint_ = 0;
    Stream streams_[max_streams];
    uint64_t replaced_ = 0; ///< latest time stamp of replaced streams: a new stream must be later
    uint64_t time_ = 0;
    uint64_t stored_time_ = 0;
    uint64_t last_sent_ = 0;
    uint64_t advanced_us_ = 0;
    uint64_t rest_us_ = 0;
    SigningCounts counts_;
};

} // namespace omni
