// SPDX-License-Identifier: MIT
/// @file signing.h  MAVLink 2 message signing: who may command the robot through the air.
///
/// With a key set, a frame from a radio counts only if its signature is right and its time stamp is new. New means
/// later than the last one of its stream (system, component, link id). In a new stream it means no older than a minute
/// before our clock, and later than the last one of every stream that had to make room. A new stream is always
/// admitted: it takes the place of the one that has been silent for longest. A frame that is more than half a year
/// ahead of our clock does not count in any stream. So one wrong calendar cannot shut out the right ones. See
/// docs/reference/protocol.md for the table, and https://mavlink.io/en/guide/message_signing.html for the format.
///
/// **Where the clock comes from.** A key that is set over a cable brings the time, exactly: it may go back. After that
/// it counts on, and follows every frame that was taken. The memory holds the time while disarmed, and from arming on a
/// time far ahead instead. So a robot that lost its power while armed takes no recording of that drive. Its own frames
/// then tell the stations the time that it wants: every MAVLink signer follows a clock that is ahead of its own.
#pragma once

#include <cstddef>
#include <cstdint>

#include "app/base/board.h"
#include "app/link/codec.h"
#include "app/storage/record_store.h"

namespace omni {

/// Frames refused since boot, by reason.
struct SigningCounts {
    uint32_t not_signed = 0;
    uint32_t wrong = 0;    ///< signature of another key, or of other bytes
    uint32_t replayed = 0; ///< time stamp not newer than the stream's last, or too old for a new stream
    uint32_t ahead = 0;    ///< time stamp too far ahead of our clock
    uint32_t keys = 0;     ///< keys that came over a radio; not frames
    uint32_t total() const { return not_signed + wrong + replayed + ahead; }
};

class Signing {
public:
    static constexpr size_t key_length = 32;
    /// A year before the 48 bits of a time stamp end (March 2104): our own would stand still there [10 us].
    static constexpr uint64_t latest_time = (uint64_t{1} << 48) - uint64_t{100'000} * 86'400 * 365;
    /// What the memory is ahead of the clock while armed: longer than any drive on one battery [10 us].
    static constexpr uint64_t longest_drive = uint64_t{100'000} * 3600 * 12;
    /// A robot clock that goes on by more at once has become another clock. Erasing flash memory, the longest pause,
    /// takes 0.4 s.
    static constexpr uint64_t longest_step_us = 10'000'000;
    /// A frame further ahead of a clock that was ever set is refused [10 us]. Half a year is longer than most robots
    /// lie on a shelf.
    static constexpr uint64_t most_ahead = uint64_t{100'000} * 86'400 * 183;
    enum class State : uint8_t {
        off,     ///< no key: radios are open
        on,      ///< a key is set
        damaged, ///< there was a key and it cannot be read: nothing passes until one is set or removed over USB
    };

    explicit Signing(Storage &storage);

    /// Take key and clock from the memory.
    void boot();
    State state() const { return state_; }
    /// Whether radios are closed to frames that are not signed.
    bool required() const { return state_ != State::off; }
    /// First bytes of the key's SHA-256, to compare keys by; 0 without a key.
    uint32_t fingerprint() const { return fingerprint_; }
    bool is_key(const uint8_t *key) const;
    /// Use and store a key. @param time our clock is set to it, forward or back; streams ahead of it are forgotten; 0:
    /// the sender has no clock, ours stays. At most latest_time [10 us since 2015]. @return false if the memory failed;
    /// the old key and time stay.
    bool set_key(const uint8_t *key, uint64_t time);
    bool remove_key();

    /// Judge a frame from a radio, and count it if it is refused. An unsigned HEARTBEAT or RADIO_STATUS is refused and
    /// not counted: other stations and the modems themselves send them. An early frame leaves no trace: it will come
    /// again, behind older ones.
    bool admits(const Frame &frame);
    /// Sign a frame that was encoded with `is_signed`. @param frame room for signature_length more. @return its new
    /// length.
    size_t sign(uint8_t *frame, size_t length, uint8_t link_id);

    /// Let the clock go on. The robot clock becomes another one when host-in-the-loop begins or ends. So a time that
    /// went back only starts a new count, and a jump counts as `longest_step_us`. @param now_us robot clock.
    void advance(uint64_t now_us);
    /// The clock [10 us since 2015].
    uint64_t time() const { return time_; }
    /// Whether the memory holds a time that is this far behind, or one that is ahead of the clock.
    bool outdated(uint64_t behind) const { return stored_time_ > time_ || time_ - stored_time_ > behind; }
    bool store_time() { return store(time_); }
    /// Before motors may move. @return false if the memory failed.
    bool store_for_drive() {
        return !required() || stored_time_ > time_ + longest_drive / 2 || store(time_ + longest_drive);
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
    /// What becomes of a frame.
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
    uint64_t replaced_ = 0; ///< latest time stamp of the streams that made room: a new one must be later
    uint64_t time_ = 0;
    uint64_t stored_time_ = 0;
    uint64_t last_sent_ = 0;
    uint64_t advanced_us_ = 0;
    uint64_t rest_us_ = 0;
    SigningCounts counts_;
};

} // namespace omni
