// SPDX-License-Identifier: MIT
#include "app/shared.h"

#include "app/core.h"

namespace omni {

void Shared::heartbeat(size_t link) {
    stations.hear(link, now_us);
    if (stations.counts(link)) {
        control.set_heartbeat(stations.heard_us(link));
    }
}

void Shared::commanded(size_t link) {
    if (armed() && stations.commander() != link && stations.alive(link, now_us)) {
        stations.take_command(link);
        control.set_heartbeat(stations.heard_us(link));
    }
}

void Shared::count_report() {
    stopping = static_cast<uint8_t>(stopping - (stopping > 0 ? 1 : 0));
    if (arming > 0 && --arming == 0 && latest.outputs.state == OMNI_STATE_DISARMED) {
        say(MAV_SEVERITY_WARNING, fault_text("not armed: ", latest.arming_faults)); // a fault that came with the command
    }
    if (!armed()) {
        stations.release();
    }
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
