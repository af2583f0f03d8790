// SPDX-License-Identifier: MIT
#include "app/services/parameter_trial.h"

#include <cstring>

#include "app/base/flash_code.h"

namespace omni {
namespace {

/// The hub's component (host/omniwheel/hub): it ends the trial of a disconnected client.
constexpr uint8_t hub_component = MAV_COMP_ID_UART_BRIDGE;

} // namespace

OMNI_COLD uint8_t ParameterTrial::refuse(const char *why) {
    texts_.refuse(MAV_SEVERITY_WARNING, Text().add("trial refused: ").add(why));
    return MAV_RESULT_DENIED;
}

OMNI_COLD bool ParameterTrial::is_own(const Sender &sender) const {
    return sender == station_ || (sender.link == station_.link && sender.component == hub_component);
}

OMNI_COLD uint8_t ParameterTrial::begin(const Sender &sender) {
    if (robot_.armed()) {
        return robot_.refuse_armed("trial refused");
    }
    if (on_) {
        return refuse(is_own(sender) ? "end the one that goes on" : "another station tries parameters");
    }
    if (!heartbeats_.stations.alive(sender, clock_.now_us)) {
        return refuse("no heartbeats of this station");
    }
    std::memcpy(before_, parameters_.values(), sizeof before_);
    station_ = sender;
    session_ = board_.ports[sender.link]->session();
    on_ = true;
    return MAV_RESULT_ACCEPTED;
}

OMNI_COLD uint8_t ParameterTrial::command(float action, const Sender &sender) {
    const bool own = on_ && is_own(sender);
    const bool goes_on = own && !over_;
    if (action == 1.0f) {
        return begin(sender);
    }
    if (action == 2.0f && own) {
        over_ = true;
        serve();
        return MAV_RESULT_ACCEPTED;
    }
    if (action == 0.0f && goes_on) {
        on_ = false;
        return MAV_RESULT_ACCEPTED;
    }
    if (action == 0.0f || action == 2.0f) {
        return refuse("there is none of this station");
    }
    return action == 3.0f && goes_on ? MAV_RESULT_ACCEPTED : MAV_RESULT_DENIED;
}

void ParameterTrial::serve() {
    if (on_ &&
        (!heartbeats_.stations.alive(station_, clock_.now_us) || board_.ports[station_.link]->session() != session_)) {
        over_ = true;
    }
    const bool may_drive = robot_.armed() && robot_.state() != OMNI_STATE_FAILSAFE;
    if (!over_ || may_drive) {
        return;
    }
    on_ = over_ = false;
    if (parameters_.restore(before_)) {
        texts_.say(MAV_SEVERITY_NOTICE, Text().add("trial ended: parameters are as before"));
    }
}

} // namespace omni
