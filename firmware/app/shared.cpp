// SPDX-License-Identifier: MIT
#include "app/shared.h"

#include "app/core.h"
#include "app/crc32.h"

namespace omni {

bool Shared::cable_connected() const {
    bool connected = false;
    bool any = false;
    for (size_t i = 0; i < board.port_count; ++i) {
        any = any || !links[i].is_radio();
        connected = connected || (!links[i].is_radio() && links[i].connected());
    }
    return connected || !any;
}

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

constexpr uint64_t streamed_interval_us = 1'000'000;

mavlink_statustext_t status_text(uint8_t severity, const Text &text) {
    mavlink_statustext_t message{};
    message.severity = severity;
    std::memcpy(message.text, text.data(), text.length());
    return message;
}

} // namespace

void Shared::send_text(size_t link, TextGate &gate, uint8_t severity, const Text &text) {
    const bool passes =
        links[link].connected() && gate.pass(now_us, crc32(reinterpret_cast<const uint8_t *>(text.data()), text.length()));
    if (passes && !links[link].send(MAVLINK_MSG_ID_STATUSTEXT, status_text(severity, text), Priority::text)) {
        gate.count();
    }
}

void Shared::say(uint8_t severity, const Text &text) {
    for (size_t i = 0; i < board.port_count; ++i) {
        say_on(i, severity, text);
    }
}

void Shared::say_on(size_t link, uint8_t severity, const Text &text) {
    send_text(link, texts_[link].news, severity, text);
}

void Shared::refuse(uint8_t severity, const Text &text) {
    if (asker < board.port_count) {
        send_text(asker, texts_[asker].refusals, severity, text);
    } else {
        say(severity, text);
    }
}

uint8_t Shared::refuse_armed(const char *what) {
    if (disarming()) {
        return MAV_RESULT_TEMPORARILY_REJECTED;
    }
    refuse(MAV_SEVERITY_WARNING, Text().add(what).add(": disarm first"));
    return MAV_RESULT_DENIED;
}

void Shared::refuse_streamed(uint64_t (&said_us)[Board::max_ports], const Text &text) {
    const size_t link = asker < board.port_count ? asker : 0;
    if (said_us[link] != 0 && now_us >= said_us[link] && now_us - said_us[link] < streamed_interval_us) {
        texts_[link].refusals.count();
        return;
    }
    said_us[link] = now_us > 0 ? now_us : 1;
    refuse(MAV_SEVERITY_WARNING, text);
}

void Shared::say_left_out(size_t link, TextGate &gate, const char *what) {
    const uint32_t number = gate.take_left_out(now_us);
    const mavlink_statustext_t message = status_text(MAV_SEVERITY_NOTICE, Text().add(number).add(what));
    if (number > 0 && !links[link].send(MAVLINK_MSG_ID_STATUSTEXT, message, Priority::text)) {
        gate.count(number);
    }
}

void Shared::say_left_out() {
    for (size_t i = 0; i < board.port_count; ++i) {
        say_left_out(i, texts_[i].news, " messages left out");
        say_left_out(i, texts_[i].refusals, " more refusals left out");
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
