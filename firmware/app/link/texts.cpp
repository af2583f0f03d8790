// SPDX-License-Identifier: MIT
#include "app/link/texts.h"

#include <cstring>

#include "app/base/core.h"
#include "app/base/crc32.h"

namespace omni {
namespace {

constexpr uint64_t streamed_interval_us = 1'000'000;

mavlink_statustext_t status_text(uint8_t severity, const Text &text) {
    mavlink_statustext_t message{};
    message.severity = severity;
    std::memcpy(message.text, text.data(), text.length());
    return message;
}

} // namespace

void Texts::send(size_t link, TextGate &gate, uint8_t severity, const Text &text) {
    const bool passes = links_[link].connected() &&
                        gate.pass(clock_.now_us, crc32(reinterpret_cast<const uint8_t *>(text.data()), text.length()));
    if (passes && !links_[link].send(MAVLINK_MSG_ID_STATUSTEXT, status_text(severity, text), Priority::text)) {
        gate.count();
    }
}

void Texts::say(uint8_t severity, const Text &text) {
    for (size_t i = 0; i < links_.count(); ++i) {
        send_to(i, severity, text);
    }
}

void Texts::send_to(size_t link, uint8_t severity, const Text &text) {
    send(link, gates_[link].news, severity, text);
}

void Texts::refuse(uint8_t severity, const Text &text) {
    if (requester_ < links_.count()) {
        send(requester_, gates_[requester_].refusals, severity, text);
    } else {
        say(severity, text);
    }
}

void Texts::refuse_rate_limited(uint64_t (&reported_us)[Board::max_ports], const Text &text) {
    const size_t link = requester_ < links_.count() ? requester_ : 0;
    if (reported_us[link] != 0 && clock_.now_us >= reported_us[link] &&
        clock_.now_us - reported_us[link] < streamed_interval_us) {
        gates_[link].refusals.count();
        return;
    }
    reported_us[link] = clock_.now_us > 0 ? clock_.now_us : 1;
    refuse(MAV_SEVERITY_WARNING, text);
}

void Texts::report_suppressed(size_t link, TextGate &gate, const char *what) {
    const uint32_t number = gate.take_suppressed_count(clock_.now_us);
    const mavlink_statustext_t message = status_text(MAV_SEVERITY_NOTICE, Text().add(number).add(what));
    if (number > 0 && !links_[link].send(MAVLINK_MSG_ID_STATUSTEXT, message, Priority::text)) {
        gate.count(number);
    }
}

void Texts::report_suppressed() {
    for (size_t i = 0; i < links_.count(); ++i) {
        report_suppressed(i, gates_[i].news, " messages left out");
        report_suppressed(i, gates_[i].refusals, " more refusals left out");
    }
}

Text fault_text(const char *prefix, uint32_t faults) {
    Text text;
    text.add(prefix);
    const char *separator = "";
    for (uint32_t bit = 1; bit != 0; bit <<= 1) {
        if ((faults & bit) != 0) {
            text.add(separator).add(omni_fault_name(bit));
            separator = ", ";
        }
    }
    return text;
}

} // namespace omni
