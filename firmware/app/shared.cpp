// SPDX-License-Identifier: MIT
#include "app/shared.h"

#include "app/core.h"

namespace omni {

bool Shared::heartbeat() {
    Request request;
    request.kind = Request::Kind::heartbeat;
    request.time_us = now_us > 0 ? now_us : 1; // 0 means none yet
    return control.request(request);
}

namespace {

mavlink_statustext_t status_text(uint8_t severity, const Text &text) {
    mavlink_statustext_t message{};
    message.severity = severity;
    std::memcpy(message.text, text.data(), text.length());
    return message;
}

} // namespace

void Shared::say(uint8_t severity, const Text &text) {
    send_all(MAVLINK_MSG_ID_STATUSTEXT, status_text(severity, text), Priority::text);
}

void Shared::say_on(size_t link, uint8_t severity, const Text &text) {
    links[link].send(MAVLINK_MSG_ID_STATUSTEXT, status_text(severity, text), Priority::text);
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
