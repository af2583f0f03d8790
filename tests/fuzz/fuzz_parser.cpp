// SPDX-License-Identifier: MIT
/// @file fuzz_parser.cpp  The frame parser beside two others: MAVLink's own C parser on clean streams, and a search of
/// every byte on damaged ones. Nothing but valid frames is found, no whole valid frame is lost unless it is the payload
/// of another one. A stop is handed over with its last byte, whatever came before it.
#include <algorithm>
#include <cstring>

#include "app/link/codec.h"
#include "app/link/stops.h"
#include "check.h"
#include "frames.h"
#include "script.h"

namespace fuzz {
namespace {

struct Seen {
    uint32_t id;
    uint8_t system;
    uint8_t component;
    uint8_t payload[omni::max_payload];
};

bool operator==(const Seen &a, const Seen &b) {
    return a.id == b.id && a.system == b.system && a.component == b.component &&
           std::memcmp(a.payload, b.payload, sizeof a.payload) == 0;
}

using Stream = std::vector<Seen>;

/// A stop, and how many bytes had been fed when it came out.
struct Stop {
    Seen seen;
    size_t fed;
};

struct Parsed {
    Stream frames; ///< without those that came early
    std::vector<Stop> stops;
    size_t largest = 0; ///< bytes fed at once
};

void process_frames(omni::FrameParser &parser, size_t fed, Parsed *parsed) {
    omni::Frame frame;
    while (parser.next(&frame)) {
        Seen one{frame.id, frame.system, frame.component, {}};
        std::memcpy(one.payload, frame.payload, sizeof one.payload);
        const bool stop = omni::is_stop(frame);
        check(stop || !frame.early, "only stops come early");
        if (stop) {
            parsed->stops.push_back({one, fed});
        }
        if (!frame.early) {
            parsed->frames.push_back(one);
        }
    }
}

/// @param script how the stream is cut. What is left at the end is given up, as after silence.
Parsed with_our_parser(const Bytes &stream, Script &script) {
    static omni::FrameParser parser;
    parser.reset();
    Parsed parsed;
    size_t at = 0;
    parsed.largest = 1 + script.below(400);
    while (at < stream.size()) {
        size_t room = 0;
        uint8_t *space = parser.space(&room);
        check(room > 0, "there is always room for another byte");
        const size_t count = std::min({room, parsed.largest, stream.size() - at});
        std::memcpy(space, stream.data() + at, count);
        parser.received(count);
        at += count;
        process_frames(parser, at, &parsed);
    }
    while (parser.waiting()) {
        parser.give_up_frame();
        process_frames(parser, at, &parsed);
    }
    return parsed;
}

Stream with_mavlinks_parser(const Bytes &stream) {
    Stream seen;
    mavlink_reset_channel_status(MAVLINK_COMM_0);
    mavlink_message_t message{};
    mavlink_status_t status{};
    for (const uint8_t byte : stream) {
        if (mavlink_parse_char(MAVLINK_COMM_0, byte, &message, &status) == MAVLINK_FRAMING_OK) {
            Seen one{message.msgid, message.sysid, message.compid, {}};
            std::memcpy(one.payload, _MAV_PAYLOAD(&message), std::min<size_t>(message.len, sizeof one.payload));
            seen.push_back(one);
        }
    }
    return seen;
}

/// An emergency stop, now and then.
void make_stop(uint8_t *payload) {
    mavlink_command_long_t message{};
    message.command = MAV_CMD_OMNI_ESTOP;
    message.param1 = 1.0f;
    std::memcpy(payload, &message, sizeof message);
}

Bytes random_frame(Script &script) {
    const bool stop = script.below(6) == 0;
    const mavlink_msg_entry_t &entry = stop ? *entry_of(MAVLINK_MSG_ID_COMMAND_LONG) : entry_number(script.byte());
    uint8_t payload[256] = {};
    if (stop) {
        make_stop(payload);
    } else {
        script.bytes(payload, script.below(size_t{entry.max_msg_len} + 1));
    }
    const uint8_t bits = script.byte();
    Form form;
    form.v1 = (bits & 3) == 3;
    form.is_signed = (bits & 12) == 12;
    form.trim = (bits & 16) == 0;
    form.sequence = bits;
    form.system = script.byte();
    form.component = script.byte();
    Bytes bytes;
    append_frame(&bytes, entry, payload, form);
    return bytes;
}

void clean(Script &script) {
    Bytes stream;
    while (!script.ended()) {
        const Bytes frame = random_frame(script);
        stream.insert(stream.end(), frame.begin(), frame.end());
    }
    Script cuts(stream.data(), std::min<size_t>(stream.size(), 8));
    const Stream ours = with_our_parser(stream, cuts).frames;
    check(ours == with_mavlinks_parser(stream), "both parsers find the same frames", static_cast<long>(ours.size()));
    figures().frames += ours.size();
    figures().bytes += stream.size();
}

Bytes damaged_stream(Script &script) {
    Bytes stream;
    while (!script.ended()) {
        Bytes piece = random_frame(script);
        const size_t how = script.below(8);
        if (how == 1) {
            piece.resize(script.below(piece.size()));
        } else if (how == 2) {
            piece[script.below(piece.size())] ^= static_cast<uint8_t>(1 + script.below(255));
        } else if (how == 3) {
            piece.resize(1 + script.below(60));
            script.bytes(piece.data(), piece.size());
        } else if (how == 4) {
            const Bytes inner = random_frame(script);
            piece.insert(piece.begin() + static_cast<std::ptrdiff_t>(script.below(piece.size())), inner.begin(),
                         inner.end());
        }
        stream.insert(stream.end(), piece.begin(), piece.end());
    }
    return stream;
}

/// A whole frame that starts before `begin` and reaches beyond it: what stands there may be its payload.
bool hidden(const std::vector<Found> &claims, size_t begin) {
    return std::any_of(claims.begin(), claims.end(), [begin](const Found &claim) {
        const bool whole = claim.kind == Found::Kind::valid || claim.kind == Found::Kind::foreign;
        return whole && claim.begin < begin && claim.begin + claim.length > begin;
    });
}

bool is_stop(const Seen &seen) {
    omni::Frame frame;
    frame.id = seen.id;
    std::memcpy(frame.payload, seen.payload, sizeof frame.payload);
    return omni::is_stop(frame);
}

/// Whether this stop came out with the bytes that completed it.
bool came_at_once(const Parsed &parsed, const Seen &stop, size_t complete) {
    return std::any_of(parsed.stops.begin(), parsed.stops.end(), [&](const Stop &one) {
        return one.seen == stop && one.fed >= complete && one.fed < complete + parsed.largest;
    });
}

Seen seen_of(const Found &found) {
    Seen seen{found.id, found.system, found.component, {}};
    const size_t most = entry_of(found.id)->max_msg_len;
    std::memcpy(seen.payload, found.payload, std::min(found.payload_length, most));
    return seen;
}

/// A stop that is not the payload of a whole frame comes with its last byte.
void check_stops(const Bytes &stream, const Parsed &parsed) {
    std::vector<Found> claims;
    for (size_t i = 0; i < stream.size(); ++i) {
        const Found found = frame_at(stream.data(), stream.size(), i);
        if (found.kind == Found::Kind::valid && !hidden(claims, i) && is_stop(seen_of(found))) {
            check(came_at_once(parsed, seen_of(found), i + found.length), "a stop comes with its last byte",
                  static_cast<long>(i));
        }
        if (found.kind != Found::Kind::none) {
            claims.push_back(found);
        }
    }
}

/// What a parser finds that looks at every byte again but those of a whole frame: frames that stand side by side.
Stream frames_in(const Bytes &stream) {
    Stream frames;
    size_t at = 0;
    while (at < stream.size()) {
        const Found found = frame_at(stream.data(), stream.size(), at);
        if (found.kind == Found::Kind::valid) {
            frames.push_back(seen_of(found));
        }
        at += found.kind == Found::Kind::valid || found.kind == Found::Kind::foreign ? found.length : 1;
    }
    return frames;
}

void damaged(Script &script) {
    const Bytes stream = damaged_stream(script);
    Script cuts(stream.data(), std::min<size_t>(stream.size(), 8));
    const Parsed parsed = with_our_parser(stream, cuts);
    const Stream &ours = parsed.frames;
    check_stops(stream, parsed);
    const Stream expected = frames_in(stream);
    const size_t shorter = std::min(ours.size(), expected.size());
    const auto same =
        std::mismatch(ours.begin(), ours.begin() + static_cast<std::ptrdiff_t>(shorter), expected.begin());
    const auto first = static_cast<size_t>(same.first - ours.begin());
    check(first == shorter && ours.size() >= expected.size(), "no whole valid frame is lost", static_cast<long>(first));
    check(ours.size() == expected.size(), "nothing is found that is not there", static_cast<long>(first));
    figures().frames += ours.size();
    figures().bytes += stream.size();
}

} // namespace
} // namespace fuzz

extern "C" int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
    fuzz::Script script(data, size);
    ++fuzz::figures().executions;
    if (script.below(2) == 0) {
        fuzz::clean(script);
    } else {
        fuzz::damaged(script);
    }
    return 0;
}
