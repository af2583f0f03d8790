// SPDX-License-Identifier: MIT
#include "sequence.h"

#include <algorithm>
#include <cstring>

#include "app/base/core.h"
#include "app/base/crc32.h"
#include "check.h"
#include "messages.h"

namespace fuzz {
namespace {

/// A bus that works again after a fault needs so many ticks until the chip has surely been told.
constexpr unsigned bus_recovery_ticks = 50;

constexpr uint8_t signing_key[32] = {0x4B, 0x45, 0x59};

} // namespace

Setup Sequence::setup_of(const Action &setup) {
    Setup how;
    how.lockstep = (setup.a & 1) != 0;
    how.may_arm = true;
    how.robot = robots[setup.a >> 2 & 3];
    how.ports = static_cast<uint8_t>(2 + setup.b % 3);
    return how;
}

Sequence::Sequence(const Action &setup) : nothing_(nullptr, 0), robot_(setup_of(setup), nothing_) {
    robot_.listener = this;
    robot_.pin.is_wired = (setup.a & 2) == 0;
    boots_ = robot_.boots;
}

void Sequence::run(const Actions &actions) {
    for (size_t i = 1; i < actions.size(); ++i) {
        act(actions[i]);
    }
    for (size_t link = 0; link < robot_.setup.ports; ++link) {
        clog(link, false);
    }
    // Whatever was stopped stays so while nobody says anything.
    for (int tick = 0; tick < 8; ++tick) {
        tick_once(0);
    }
}

void Sequence::act(const Action &action) {
    static constexpr void (Sequence::*doers[])(const Action &) = {
        &Sequence::ticks,      &Sequence::host_ticks, &Sequence::arm,       &Sequence::disarm,    &Sequence::estop,
        &Sequence::release,    &Sequence::drive,      &Sequence::fixes,     &Sequence::heartbeat, &Sequence::enter_hil,
        &Sequence::leave_hil,  &Sequence::reboot,     &Sequence::power_cut, &Sequence::parameter, &Sequence::trajectory,
        &Sequence::message,    &Sequence::noise,      &Sequence::half,      &Sequence::connect,   &Sequence::bus,
        &Sequence::clock_jump, &Sequence::silence,    &Sequence::storage,   &Sequence::key,       &Sequence::scan,
        &Sequence::list,
    };
    static_assert(sizeof doers / sizeof doers[0] == static_cast<size_t>(Kind::count), "one for each kind");
    (this->*doers[static_cast<size_t>(action.what())])(action);
}

// ---- time

void Sequence::tick_once(int turning) {
    robot_.turn_wheels(turning);
    signing_time_ += OMNI_TICK_US / 10;
    allow_what_waits();
    if (robot_.setup.lockstep) {
        clog(0, false);
        put(0, robot_.hil_sensors());
    } else {
        robot_.tick();
        good_bus_ticks_ = robot_.bus.fate == omni::I2cStatus::done ? good_bus_ticks_ + 1 : 0;
        const bool promised = robot_.pin.is_wired || good_bus_ticks_ > bus_recovery_ticks;
        oracle_.bench_ticked(promised && robot_.bench_moves());
    }
    background();
    if (good_bus_ticks_ > bus_recovery_ticks || robot_.setup.lockstep) {
        oracle_.pass(clogged_); // a bus that hangs delays entering host-in-the-loop, and with it whatever comes after
    }
}

void Sequence::ticks(const Action &action) {
    robot_.hosted = false;
    for (int i = 0; i <= action.n % 64; ++i) {
        tick_once(action.b % 8);
    }
}

void Sequence::host_ticks(const Action &action) {
    robot_.hosted = true;
    for (int i = 0; i <= action.n % 64; ++i) {
        if (!robot_.setup.lockstep) {
            const size_t link = link_of(action);
            clog(link, false);
            Bytes sensors = robot_.hil_sensors(form_on(link));
            sign_on(link, &sensors);
            put(link, sensors);
        }
        tick_once(action.b % 8);
    }
}

void Sequence::background() {
    allow_what_waits();
    robot_.background();
    deliver();
    if (robot_.boots != boots_) {
        started_anew();
        oracle_.rebooted(storage_works_);
    }
}

/// A robot that was armed takes up half a day ahead of its clock, so that it takes no recording of that drive. Until
/// its next frame over the radio a station cannot know that, and what it has signed before is as good as a recording.
void Sequence::started_anew() {
    boots_ = robot_.boots;
    knows_the_time_ = false;
    if (signs_) {
        joined_[radio].clear();
        joined_events_[radio].clear();
        robot_.ports[radio].in.clear();
        events_[radio].clear();
    }
}

/// A station's clock follows the robot's, as that of every MAVLink signer does.
void Sequence::heard(size_t port, const Found &frame) {
    if (port == radio) {
        const uint64_t time = is_signed(frame) ? signing_time(frame, signing_key) : 0;
        signing_time_ = std::max(signing_time_, time);
        knows_the_time_ =
            !is_signed(frame) || time != 0; // a robot that cannot read its key hears nobody, nor can it be heard
    }
    if (!is_clogged(port) || frame.id != MAVLINK_MSG_ID_HEARTBEAT) {
        oracle_.heard(port, frame);
    }
}

/// The robot may read an arming or a release at any moment from when it was sent.
void Sequence::allow_what_waits() {
    for (const auto &events : events_) {
        for (const Event event : events) {
            if (event == Event::release) {
                oracle_.release();
            } else if (event == Event::arm) {
                oracle_.arm();
            }
        }
    }
}

void Sequence::deliver() {
    for (size_t link = 0; link < robot_.setup.ports; ++link) {
        if (!robot_.ports[link].in.empty()) {
            continue;
        }
        for (const Event event : events_[link]) {
            if (event == Event::release) {
                oracle_.release();
            } else if (event == Event::arm) {
                oracle_.arm();
            } else if (event != Event::nothing) {
                figures().stops += 1;
                figures().stops_in_motion += robot_.bench_moves() || robot_.world_moves() ? 1 : 0;
                oracle_.stop(event == Event::estop);
            }
        }
        events_[link].clear();
    }
}

// ---- frames

Form Sequence::form_on(size_t link) const {
    Form form;
    form.is_signed = signs_ && link == radio;
    return form;
}

void Sequence::put(size_t link, Bytes bytes) {
    if (robot_.ports[link].connection == 0) {
        return;
    }
    Bytes &joined = joined_[link];
    joined.insert(joined.end(), bytes.begin(), bytes.end());
    robot_.send(link, joined);
    joined.clear();
    events_[link].insert(events_[link].end(), joined_events_[link].begin(), joined_events_[link].end());
    joined_events_[link].clear();
}

void Sequence::sign_on(size_t link, Bytes *frame) {
    if (signs_ && link == radio) {
        sign(frame, signing_key, ++signing_time_);
    }
}

void Sequence::send(const Action &action, Bytes frame, Event event) {
    const size_t link = link_of(action);
    if (robot_.ports[link].connection == 0) {
        return;
    }
    sign_on(link, &frame);
    joined_events_[link].push_back(event);
    if ((action.link & 0x80) != 0) {
        joined_[link].insert(joined_[link].end(), frame.begin(), frame.end());
        return;
    }
    put(link, frame);
    background();
}

void Sequence::command(const Action &action, uint16_t number, float first, float second) {
    const size_t link = link_of(action);
    Event event = Event::nothing;
    if (number == MAV_CMD_COMPONENT_ARM_DISARM) {
        event = first == 1.0f ? Event::arm : first == 0.0f ? Event::disarm : Event::nothing;
    } else if (number == MAV_CMD_OMNI_ESTOP) {
        event = first == 0.0f ? Event::release : Event::estop;
    } else if (number == MAV_CMD_DO_FLIGHTTERMINATION && first > 0.5f) {
        event = Event::estop;
    }
    if (dirty_[link] && (event == Event::arm || event == Event::release)) {
        return; // nobody can say when the robot would find it
    }
    mavlink_command_long_t message{};
    message.command = number;
    message.param1 = first;
    message.param2 = second;
    message.param5 = ++receipts_;
    const bool as_int = (action.a & 0x40) != 0;
    mavlink_command_int_t whole{};
    whole.command = number;
    whole.param1 = first;
    whole.param2 = second;
    whole.x = static_cast<int32_t>(receipts_);
    const Bytes frame = as_int ? frame_of(MAVLINK_MSG_ID_COMMAND_INT, whole, form_on(link))
                               : frame_of(MAVLINK_MSG_ID_COMMAND_LONG, message, form_on(link));
    const bool stops = event == Event::disarm || event == Event::estop;
    if (stops && may_be_a_recording(link)) {
        send(action, frame);
        return;
    }
    if (stops && robot_.ports[link].connection != 0 && (action.link & 0x80) == 0) {
        uint8_t bytes[28];
        std::memcpy(bytes, as_int ? static_cast<const void *>(&whole) : &message, sizeof bytes);
        oracle_.expect_ack(link, static_cast<int32_t>(omni::crc32(bytes, sizeof bytes)));
    }
    send(action, frame, event);
}

void Sequence::arm(const Action &action) {
    command(action, MAV_CMD_COMPONENT_ARM_DISARM, 1.0f, 0.0f);
}

void Sequence::disarm(const Action &action) {
    command(action, MAV_CMD_COMPONENT_ARM_DISARM, 0.0f, (action.a & 1) != 0 ? 21196.0f : 0.0f);
}

void Sequence::estop(const Action &action) {
    if (action.a % 3 == 0) {
        command(action, MAV_CMD_DO_FLIGHTTERMINATION, 1.0f, 0.0f);
    } else {
        const float other =
            action.x == 0 ? __builtin_nanf("") : static_cast<float>(action.x); // what is no release stops
        command(action, MAV_CMD_OMNI_ESTOP, action.a % 3 == 1 ? 1.0f : other, 0.0f);
    }
}

void Sequence::release(const Action &action) {
    command(action, MAV_CMD_OMNI_ESTOP, 0.0f, 0.0f);
}

void Sequence::connect(const Action &action) {
    const size_t link = link_of(action);
    if (action.a % 8 == 5) {
        clog(link, !is_clogged(link));
        return;
    }
    robot_.connect_anew(link, action.a % 4 == 3);
    joined_[link].clear();
    joined_events_[link].clear();
    events_[link].clear();
    dirty_[link] = false;
    oracle_.forget_acks(link);
    background();
}

void Sequence::clog(size_t link, bool clogged) {
    static constexpr size_t plenty = 1 << 16;
    if (clogged == is_clogged(link)) {
        return;
    }
    robot_.ports[link].space = clogged ? 0 : plenty;
    if (!clogged) {
        background(); // what waited comes now
    }
    clogged_ ^= 1u << link;
}

void Sequence::power_cut(const Action &) {
    robot_.bus.chip.power_up(); // the motor pins are low after every reset
    robot_.watchdog.cause = omni::ResetCause::power_on;
    robot_.boot();
    started_anew();
    for (auto &events : events_) {
        events.clear();
    }
    oracle_.rebooted(storage_works_ && oracle_.settled());
}

} // namespace fuzz
