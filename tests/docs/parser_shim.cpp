// SPDX-License-Identifier: MIT
// extern "C" access to what a link does with bytes: the firmware's parser, and its judgement of signatures.
#include <cstring>

#include "app/link/codec.h"
#include "app/link/signing.h"

namespace {

struct Memory final : omni::Storage {
    uint8_t bytes[2048];
    Memory() { std::memset(bytes, 0xFF, sizeof bytes); }
    size_t size() override { return sizeof bytes; }
    bool read(size_t offset, uint8_t *data, size_t length) override {
        std::memcpy(data, bytes + offset, length);
        return true;
    }
    bool write(size_t offset, const uint8_t *data, size_t length) override {
        std::memcpy(bytes + offset, data, length);
        return true;
    }
};

struct Receiver {
    Memory memory;
    omni::Signing signing{memory};
    omni::FrameParser parser;
};

} // namespace

extern "C" {

/// @param key nullptr: none, everything passes. @param time of the signing clock.
Receiver *receiver_new(const uint8_t *key, uint64_t time) {
    auto *receiver = new Receiver;
    if (key != nullptr) {
        receiver->signing.set_key(key, time);
    }
    return receiver;
}

void receiver_delete(Receiver *receiver) {
    delete receiver;
}

/// @param found ids of the frames that were taken, in order; refused ones as -1. @return how many; stops that come
/// early are left out.
size_t receiver_feed(Receiver *receiver, const uint8_t *bytes, size_t length, int32_t *found, uint8_t *payloads) {
    size_t count = 0;
    for (size_t i = 0; i < length; ++i) {
        size_t room = 0;
        *receiver->parser.space(&room) = bytes[i];
        receiver->parser.received(1);
        omni::Frame frame;
        while (receiver->parser.next(&frame)) {
            if (frame.early) {
                continue;
            }
            const bool admitted = !receiver->signing.required() || receiver->signing.admits(frame);
            found[count] = admitted ? static_cast<int32_t>(frame.id) : -1;
            std::memcpy(payloads + count * omni::max_payload, frame.payload, omni::max_payload);
            ++count;
        }
    }
    return count;
}

uint32_t receiver_errors(const Receiver *receiver) {
    return receiver->parser.errors();
}

/// A frame that the firmware itself encodes and, with a key, signs. @return its length.
size_t receiver_encode(Receiver *receiver, uint32_t id, const uint8_t *payload, uint8_t *out) {
    const bool sign = receiver->signing.required();
    const size_t length = omni::encode_frame(out, 0, 1, id, payload, sign);
    return sign ? receiver->signing.sign(out, length, 0) : length;
}
}
