// SPDX-License-Identifier: MIT
#include "app/services/signing_service.h"
#include "app/base/flash_code.h"

#include <algorithm>

namespace omni {
namespace {

/// Maximum lag of the stored clock while disarmed [10 us]: 50 s.
constexpr uint64_t store_interval = 5'000'000;
constexpr uint64_t retry_us = 60'000'000;
constexpr uint64_t text_interval_us = 10'000'000;

} // namespace

void SigningService::boot() {
    signing_.boot();
}

void SigningService::report_key() {
    if (signing_.required()) {
        texts_.say(MAV_SEVERITY_NOTICE, Text().add("signing key ").add_hex(signing_.fingerprint()).add(" set"));
    } else {
        texts_.say(MAV_SEVERITY_NOTICE, Text().add("signing key removed: the radio is open"));
    }
}

const char *SigningService::obstacle(const Sender &sender, uint64_t time) {
    if (links_[sender.link].is_radio()) {
        signing_.count_refused_key();
        return "set it over USB or a cable";
    }
    if (robot_.armed()) {
        return robot_.disarm_hint();
    }
    return time > Signing::max_time ? "its time is beyond 2103" : nullptr;
}

OMNI_COLD void SigningService::on_setup(const Frame &frame, const Sender &sender) {
    const auto message = frame.as<mavlink_setup_signing_t>();
    if (const char *why = obstacle(sender, message.initial_timestamp)) {
        texts_.refuse(MAV_SEVERITY_WARNING, Text().add("signing key refused: ").add(why));
        return;
    }
    const uint8_t *key = message.secret_key;
    const bool none = std::all_of(key, key + Signing::key_length, [](uint8_t byte) { return byte == 0; });
    const bool done = none ? signing_.remove_key() : signing_.set_key(key, message.initial_timestamp);
    if (done) {
        report_key();
    } else {
        texts_.refuse(MAV_SEVERITY_ERROR, Text().add("the memory failed: signing key not changed"));
    }
}

/// Never while armed: writing may halt the processor. The time stored ahead for a drive is replaced after it.
void SigningService::store_time_if_due() {
    const bool armed = robot_.armed();
    const bool disarmed_now = was_armed_ && !armed;
    was_armed_ = armed;
    const bool wait = tried_us_ != 0 && clock_.now_us >= tried_us_ && clock_.now_us - tried_us_ < retry_us;
    if (armed || !signing_.required() || wait) {
        return;
    }
    if (signing_.outdated(disarmed_now || robot_.reboot_requested() ? 0 : store_interval)) {
        tried_us_ = signing_.store_time() ? 0 : std::max<uint64_t>(clock_.now_us, 1);
        if (tried_us_ != 0) {
            texts_.say(MAV_SEVERITY_ERROR, Text().add("the memory failed: signing time not stored"));
        }
    }
}

OMNI_COLD void SigningService::report_refused() {
    const SigningCounts &counts = signing_.counts();
    const bool quiet =
        clock_.now_us >= last_text_us_ && clock_.now_us - last_text_us_ < text_interval_us && last_text_us_ != 0;
    const uint32_t others = counts.total() - counts.ahead;
    if ((others == said_others_ && counts.ahead == said_ahead_) || quiet) {
        return;
    }
    last_text_us_ = std::max<uint64_t>(clock_.now_us, 1);
    if (counts.ahead != said_ahead_) {
        texts_.say(MAV_SEVERITY_WARNING, Text().add("radio refused: clock far ahead; set the key again"));
    }
    if (others != said_others_) {
        texts_.say(MAV_SEVERITY_WARNING, Text()
                                             .add("radio refused: ")
                                             .add(counts.not_signed)
                                             .add(" unsigned, ")
                                             .add(counts.wrong)
                                             .add(" wrong, ")
                                             .add(counts.replayed)
                                             .add(" old"));
    }
    said_ahead_ = counts.ahead;
    said_others_ = others;
}

void SigningService::serve() {
    signing_.advance(clock_.now_us);
    store_time_if_due();
    report_refused();
    if (!damage_said_ && signing_.state() == Signing::State::damaged && links_.cable_connected()) {
        damage_said_ = true;
        texts_.say(MAV_SEVERITY_CRITICAL, Text().add("signing key unreadable, radio closed: set it again"));
    }
}

} // namespace omni
