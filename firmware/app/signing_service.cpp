// SPDX-License-Identifier: MIT
#include "app/signing_service.h"

#include <algorithm>

namespace omni {
namespace {

/// The stored clock is at most this far behind while disarmed [10 us]: 50 s.
constexpr uint64_t store_interval = 5'000'000;
constexpr uint64_t latest_time = (uint64_t{1} << 48) - 1;
constexpr uint64_t text_interval_us = 10'000'000;

} // namespace

void SigningService::boot() {
    shared_.signing.boot();
}

void SigningService::say_key() {
    const Signing &signing = shared_.signing;
    if (signing.required()) {
        shared_.say(MAV_SEVERITY_NOTICE, Text().add("signing key ").add_hex(signing.fingerprint()).add(" set"));
    } else {
        shared_.say(MAV_SEVERITY_NOTICE, Text().add("signing key removed: the radio is open"));
    }
}

void SigningService::on_setup(const Frame &frame, const Sender &sender) {
    const auto message = frame.as<mavlink_setup_signing_t>();
    Signing &signing = shared_.signing;
    if (shared_.links[sender.link].is_radio()) {
        signing.count_refused_key();
        shared_.refuse(MAV_SEVERITY_WARNING, Text().add("signing key refused: set it over USB (link 1)"));
        return;
    }
    if (shared_.armed()) {
        shared_.refuse(MAV_SEVERITY_WARNING, Text().add("signing key refused: disarm first"));
        return;
    }
    const uint8_t *key = message.secret_key;
    const bool none = std::all_of(key, key + Signing::key_length, [](uint8_t byte) { return byte == 0; });
    const bool done = none ? signing.remove_key() : signing.set_key(key, std::min(message.initial_timestamp, latest_time));
    if (done) {
        say_key();
    } else {
        shared_.refuse(MAV_SEVERITY_ERROR, Text().add("the memory failed: signing key not changed"));
    }
}

/// Never while armed: writing may stop the processor for a while.
void SigningService::keep_time() {
    Signing &signing = shared_.signing;
    const bool armed = shared_.armed();
    const bool disarmed_now = was_armed_ && !armed;
    was_armed_ = armed;
    if (armed || !signing.required() || signing.not_stored() == 0) {
        return;
    }
    if (disarmed_now || shared_.reboot || signing.not_stored() >= (store_failed_ ? 2 * store_interval : store_interval)) {
        store_failed_ = !signing.store_time();
        if (store_failed_) {
            shared_.say(MAV_SEVERITY_ERROR, Text().add("the memory failed: signing time not stored"));
        }
    }
}

void SigningService::say_refused() {
    const SigningCounts &counts = shared_.signing.counts();
    const bool quiet = shared_.now_us >= said_us_ && shared_.now_us - said_us_ < text_interval_us && said_us_ != 0;
    if (counts.total() == said_refused_ || quiet) {
        return;
    }
    said_us_ = std::max<uint64_t>(shared_.now_us, 1);
    said_refused_ = counts.total();
    shared_.say(MAV_SEVERITY_WARNING, Text()
                                          .add("radio refused: ")
                                          .add(counts.not_signed)
                                          .add(" unsigned, ")
                                          .add(counts.wrong)
                                          .add(" wrong, ")
                                          .add(counts.replayed)
                                          .add(" old"));
}

void SigningService::serve() {
    shared_.signing.advance(shared_.now_us);
    keep_time();
    say_refused();
    if (!damage_said_ && shared_.signing.state() == Signing::State::damaged && shared_.links[0].connected()) {
        damage_said_ = true;
        shared_.say(MAV_SEVERITY_CRITICAL, Text().add("signing key unreadable, radio closed: set it again"));
    }
}

} // namespace omni
