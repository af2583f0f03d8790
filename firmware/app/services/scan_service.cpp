// SPDX-License-Identifier: MIT
#include "app/services/scan_service.h"

#include <algorithm>

namespace omni {

uint8_t ScanService::start(const Sender &sender) {
    if (robot_.armed()) {
        return robot_.refuse_armed("I2C scan refused");
    }
    if (hil_.hil_silent()) {
        texts_.refuse(MAV_SEVERITY_WARNING, Text().add("I2C scan refused: no sensor readings yet"));
        return MAV_RESULT_TEMPORARILY_REJECTED;
    }
    sender_ = sender;
    if (running_) {
        return MAV_RESULT_ACCEPTED; // retransmission: one result for both
    }
    Request request;
    request.kind = Request::Kind::i2c_scan;
    scans_before_ = robot_.latest().i2c_found.scans;
    running_ = control_.request(request);
    return running_ ? MAV_RESULT_ACCEPTED : MAV_RESULT_TEMPORARILY_REJECTED;
}

void ScanService::serve() {
    const I2cFound &found = robot_.latest().i2c_found;
    if (!running_ || found.scans == scans_before_) {
        return;
    }
    running_ = false;
    mavlink_omni_i2c_scan_t message{};
    message.time_boot_ms = clock_.now_ms();
    std::copy(found.addresses, found.addresses + sizeof found.addresses, message.found);
    message.stuck = found.stuck ? 1 : 0;
    links_.reply(sender_, MAVLINK_MSG_ID_OMNI_I2C_SCAN, message);
}

void ScanService::restart() {
    if (running_) {
        running_ = false;
        texts_.send_to(sender_.link, MAV_SEVERITY_WARNING, Text().add("I2C scan cancelled: HIL switched"));
    }
}

} // namespace omni
