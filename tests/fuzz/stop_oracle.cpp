// SPDX-License-Identifier: MIT
#include "stop_oracle.h"

#include <algorithm>

#include "app/base/core.h"
#include "check.h"

namespace fuzz {

void StopOracle::arm() {
    may_move_ = may_move_ || !latched_;
}

void StopOracle::stop(bool latching) {
    may_move_ = false;
    latched_ = latched_ || latching;
    bench_ticks_ = host_ticks_ = 0;
}

void StopOracle::forget_acks(size_t link) {
    acks_.erase(std::remove_if(acks_.begin(), acks_.end(), [link](const Ack &ack) { return ack.link == link; }),
                acks_.end());
}

void StopOracle::rebooted(bool latch_kept) {
    may_move_ = false;
    latched_ = latched_ && latch_kept;
    bench_ticks_ = host_ticks_ = 0;
    acks_.clear();
}

void StopOracle::check_rest(unsigned ticks, bool moves) const {
    const bool rests = may_move_ || ticks < ticks_to_rest || !moves;
    check(rests,
          latched_ ? "an emergency stop is zero volts within two ticks, until it is released"
                   : "who is disarmed gets zero volts within two ticks, until somebody arms",
          static_cast<long>(ticks));
}

void StopOracle::bench_ticked(bool moves) {
    ++bench_ticks_;
    check_rest(bench_ticks_, moves);
}

void StopOracle::host_ticked(bool moves) {
    ++host_ticks_;
    check_rest(host_ticks_, moves);
}

void StopOracle::heard(size_t link, const Found &frame) {
    if (frame.id == MAVLINK_MSG_ID_HEARTBEAT) {
        const auto message = as<mavlink_heartbeat_t>(frame);
        const unsigned ticks = (message.base_mode & MAV_MODE_FLAG_HIL_ENABLED) != 0 ? host_ticks_ : bench_ticks_;
        const bool armed = (message.base_mode & MAV_MODE_FLAG_SAFETY_ARMED) != 0;
        const bool settled = ticks > ticks_to_rest;
        check(!settled || may_move_ || !armed, "who was stopped does not say that it is armed");
        const bool left = message.system_status != MAV_STATE_EMERGENCY && message.system_status != MAV_STATE_BOOT;
        check(!settled || !latched_ || !left, "an emergency stop stays until it is released", message.system_status);
    } else if (frame.id == MAVLINK_MSG_ID_COMMAND_ACK) {
        const auto message = as<mavlink_command_ack_t>(frame);
        const auto ack = std::find_if(acks_.begin(), acks_.end(), [&](const Ack &one) {
            return one.link == link && one.receipt == message.result_param2;
        });
        if (ack != acks_.end()) {
            check(message.result == MAV_RESULT_ACCEPTED, "no stop is refused (result)", message.result);
            acks_.erase(ack);
        }
    }
}

void StopOracle::pass(unsigned deaf) {
    for (Ack &ack : acks_) {
        ack.passes -= (deaf >> ack.link & 1) != 0 ? 0 : 1;
        check(ack.passes >= 0, "every stop is acknowledged (link)", static_cast<long>(ack.link));
    }
}

} // namespace fuzz
