// SPDX-License-Identifier: MIT
/// @file codec.h  MAVLink framing: bytes to frames and back. Checksum seeds and lengths come from the generated
/// dialect.
#pragma once

#include "app/link/mavlink_frame.h"

namespace omni {

/// Write one MAVLink 2 frame. @param out at least max_frame bytes. @param is_signed set the signed flag; the signature
/// itself is not written. @return length without signature, 0 if the dialect has no such message.
size_t encode_frame(uint8_t *out, uint8_t sequence, uint8_t system, uint32_t id, const void *payload, bool is_signed);
/// Length of a MAVLink 2 frame, signature included, from its header.
size_t frame_length(const uint8_t *frame);
/// Bytes of the longest signed frame of this message, 0 if the dialect has no such message.
size_t longest_frame(uint32_t id);

/// Receives the bytes between frames, in stream order.
class TextSink {
public:
    /// Process a byte. @return true if it may belong to a line of text; false: noise.
    virtual bool on_byte(uint8_t byte) = 0;
    /// A complete frame was received between the bytes.
    virtual void on_frame() = 0;

protected:
    ~TextSink() = default;
};

/// Frame parser for MAVLink 1 and 2. After an invalid frame it resynchronises at the next byte, so that no complete
/// frame is lost. Signatures are not verified here.
///
/// **Start of a frame.** Start byte, known flags, a known message id (standard or ours), in MAVLink 1 also its exact
/// length. Anything else is noise. Frames of unknown messages are recognised by their checksum, too, so that a payload
/// is never interpreted as a frame.
///
/// **Frames within an incomplete frame.** A false start claims up to 280 bytes and cannot be distinguished from a frame
/// that is still arriving. Frames within it are returned after its checksum has failed, or after a silence. A stop is
/// returned as soon as its last byte is received (`early`), and again in stream order, so that an arm command before it
/// does not take effect after it. A payload that contains a valid stop frame stops the robot, which is fail-safe.
///
/// **Run time.** Each byte starts at most one match (280 bytes of checksum); within an incomplete frame up to
/// longest_stop positions are matched once more. No recursion; 584 bytes of buffer.
class FrameParser {
public:
    /// Buffer for received bytes. @param room out: its size, at least 1 after next() has returned false.
    uint8_t *space(size_t *room);
    void received(size_t count) { end_ += count; }
    /// Get the next complete frame. @return false if more bytes are needed.
    bool next(Frame *frame);
    /// True while a frame is incomplete.
    bool waiting() const { return end_ > begin_; }
    /// Discard the start of an incomplete frame after a silence.
    void give_up_frame();
    /// Clear the buffer (new connection).
    void reset() { begin_ = end_ = stops_scanned_ = 0; }
    /// @param text receiver of the bytes between frames; nullptr: none.
    void set_text(TextSink *text) { text_ = text; }
    /// Discarded bytes and checksum errors since boot.
    uint32_t errors() const { return errors_; }

private:
    enum class Match { incomplete, no, frame, foreign };
    Match match(size_t at, Frame *frame, size_t *length) const;
    bool find_stop(Frame *frame);
    void skip_byte();

    uint8_t buffer_[2 * max_frame] = {};
    size_t begin_ = 0;
    size_t end_ = 0;
    size_t stops_scanned_ = 0; ///< stops within an incomplete frame up to this position have been returned
    uint32_t errors_ = 0;
    TextSink *text_ = nullptr;
};

} // namespace omni
