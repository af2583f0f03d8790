// SPDX-License-Identifier: MIT
/// @file codec.h  MAVLink framing: bytes to frames and back. Checksums and lengths come from the generated dialect.
#pragma once

#include "app/link/mavlink_frame.h"

namespace omni {

/// Write one MAVLink 2 frame. @param out at least max_frame bytes. @param is_signed say that a signature follows; it is
/// not written. @return length without signature, 0 if the dialect has no such message.
size_t encode_frame(uint8_t *out, uint8_t sequence, uint8_t system, uint32_t id, const void *payload, bool is_signed);
/// Length of a MAVLink 2 frame, signature included, from its header.
size_t frame_length(const uint8_t *frame);
/// Bytes of the longest signed frame of this message, 0 if the dialect has no such message.
size_t longest_frame(uint32_t id);

/// Gets the bytes that belong to no frame, in the order of the stream.
class TextSink {
public:
    /// @return true if the byte may belong to a line of text; false: noise.
    virtual bool on_byte(uint8_t byte) = 0;
    /// A whole frame came in between.
    virtual void on_frame() = 0;

protected:
    ~TextSink() = default;
};

/// Finds frames in a byte stream. After a damaged or false frame it looks again from the next byte on, so nothing that
/// arrived whole is lost. Reads MAVLink 1 too; a signature is passed on, not checked.
///
/// **What counts as a beginning.** A start byte, flags that we know, the number of a standard message or one of ours,
/// in MAVLink 1 also its exact length. All else is noise at once and claims nothing. Frames of messages that we do not
/// speak are told from noise by their checksum, too. What stands inside a whole one is its payload and is never obeyed.
///
/// **What stands inside an unfinished frame.** Half a frame claims up to 280 bytes, and nobody can tell it from a frame
/// that is still coming. Whole frames inside are taken once its checksum has failed, or after silence. A stop does not
/// wait for that: it is handed over as soon as its last byte is there (`early`). It comes once more in its turn, so
/// that an arm command in front of it does not have the last word. A payload that looks like a stop, with a right
/// checksum, stops the robot; that is the safe reading.
///
/// **Work per byte.** Each byte is the beginning of at most one match (280 bytes of checksum). Within an unfinished
/// frame at most longest_stop places before it are looked at once more. No recursion; 584 bytes of buffer.
class FrameParser {
public:
    /// Where new bytes go. @param room out: how many fit, at least 1 after next() has returned false.
    uint8_t *space(size_t *room);
    void received(size_t count) { end_ += count; }
    /// Take the next whole frame. @return false when more bytes are needed.
    bool next(Frame *frame);
    /// True while the beginning of a frame is held.
    bool waiting() const { return end_ > begin_; }
    /// The line went silent within a frame: its beginning was false.
    void give_up_frame();
    /// Forget everything (new connection).
    void reset() { begin_ = end_ = looked_ = 0; }
    /// @param text where the bytes between frames go; nullptr: nowhere.
    void set_text(TextSink *text) { text_ = text; }
    /// Bytes thrown away and frames with a wrong checksum, since boot.
    uint32_t errors() const { return errors_; }

private:
    enum class Match { incomplete, no, frame, foreign };
    Match match(size_t at, Frame *frame, size_t *length) const;
    bool find_stop(Frame *frame);
    void skip_byte();

    uint8_t buffer_[2 * max_frame] = {};
    size_t begin_ = 0;
    size_t end_ = 0;
    size_t looked_ = 0; ///< stops inside an unfinished frame have been handed over if they end up to here
    uint32_t errors_ = 0;
    TextSink *text_ = nullptr;
};

} // namespace omni
