// SPDX-License-Identifier: MIT
/// @file fuzz_app.cpp  The whole firmware on fakes. It gets frames of every message with mutated fields, damaged, cut
/// and joined ones, raw bytes, reconnections, interleaved links, ticks in between.
#include <algorithm>
#include <cstring>

#include "app/base/core.h"
#include "check.h"
#include "messages.h"
#include "robot.h"

namespace fuzz {
namespace {

constexpr float infinity = __builtin_inff();

class Play {
public:
    explicit Play(Script &script) : script_(script), robot_(setup_of(script), script) {
        manners_.may_arm = robot_.setup.may_arm;
        manners_.only_nonsense = robot_.setup.only_nonsense;
    }

    void run() {
        for (int tick = 0; tick < 8; ++tick) {
            pass_time(); // the chip's start-up
        }
        while (!script_.ended()) {
            act();
        }
        robot_.background();
    }

private:
    static Setup setup_of(Script &script) {
        Setup setup;
        const uint8_t bits = script.byte();
        setup.lockstep = (bits & 1) != 0;
        setup.only_nonsense = (bits & 6) == 6;
        setup.may_arm = setup.only_nonsense || (bits & 8) != 0;
        setup.robot = robots[(bits >> 4 & 1) | (bits >> 6 & 2)];
        setup.ports = static_cast<uint8_t>(1 + (bits >> 5) % omni::Board::max_ports);
        return setup;
    }

    void act() {
        static constexpr int frame_actions = 7;
        const size_t action = script_.below(16);
        if (action < frame_actions) {
            send_frame();
        } else if (action < 11) {
            const size_t ticks = 1 + script_.below(12);
            for (size_t i = 0; i < ticks; ++i) {
                pass_time();
            }
        } else if (action == 11) {
            raw_bytes();
        } else if (action == 12) {
            robot_.connect_anew(port(), script_.one_in(4));
        } else if (action == 13) {
            disturb();
        } else if (action == 14 && manners_.may_arm) {
            arm_and_drive();
        } else {
            robot_.background();
        }
    }

    void arm_and_drive() {
        const size_t link = port();
        robot_.send(link, command_long(MAV_CMD_COMPONENT_ARM_DISARM, 1.0f));
        if (manners_.only_nonsense) {
            return;
        }
        const float vx = static_cast<float>(script_.number<int8_t>()) * 0.002f;
        const int turning = static_cast<int>(script_.below(8));
        const size_t ticks = script_.below(200);
        for (size_t i = ticks; i > 0; --i) {
            if (i % 16 == 0 || i == ticks) {
                robot_.send(link, velocity_target(vx));
            }
            robot_.turn_wheels(turning);
            pass_time();
        }
    }

    size_t port() { return script_.below(robot_.setup.ports); }

    Bytes frame() {
        const mavlink_msg_entry_t &entry = pick_message(script_, manners_);
        uint8_t payload[256] = {};
        fill_payload(payload, entry, script_, manners_);
        Form form;
        const uint8_t bits = script_.byte();
        form.v1 = (bits & 7) == 7;
        form.is_signed = (bits & 0x18) == 0x18;
        form.incompatible = (bits & 0xE0) == 0xE0 ? 2 : 0;
        form.sequence = bits;
        form.system = script_.one_in(16) ? script_.byte() : uint8_t{255};
        Bytes bytes;
        append_frame(&bytes, entry, payload, form);
        return bytes;
    }

    void send_frame() {
        Bytes bytes = frame();
        const uint8_t how = manners_.only_nonsense ? uint8_t{0} : script_.byte();
        if (how % 16 == 15) { // damaged
            for (size_t i = 1 + script_.below(3); i > 0; --i) {
                bytes[script_.below(bytes.size())] ^= script_.byte();
            }
        } else if (how % 16 == 14) { // cut
            bytes.resize(script_.below(bytes.size()));
        } else if (how % 16 == 13) { // one within another
            const Bytes other = frame();
            bytes.insert(bytes.begin() + static_cast<std::ptrdiff_t>(script_.below(bytes.size())), other.begin(),
                         other.end());
        }
        robot_.send(port(), bytes);
        if (how % 2 == 0) {
            robot_.background();
        }
    }

    void raw_bytes() {
        if (manners_.only_nonsense) {
            return;
        }
        Bytes bytes(1 + script_.below(script_.one_in(8) ? 1000 : 40));
        script_.bytes(bytes.data(), bytes.size());
        robot_.send(port(), bytes);
    }

    void disturb() {
        const size_t what = script_.below(9);
        if (what == 0) {
            robot_.bus.fate = static_cast<omni::I2cStatus>(1 + script_.below(4));
        } else if (what == 1) {
            robot_.bus.fate = omni::I2cStatus::done;
        } else if (what == 2) {
            robot_.ports[port()].space = script_.below(4000);
        } else if (what == 3) {
            robot_.ports[port()].piece = 1 + script_.below(300);
        } else if (what == 4) {
            robot_.storage.writes_left = script_.below(3000);
        } else if (what == 5) {
            robot_.clock.ns += 300'000'000; // silence, as the links' watch sees it
        } else if (manners_.only_nonsense) {
            robot_.hil_battery_V = infinity;
        } else {
            disturb_world(what);
        }
    }

    void disturb_world(size_t what) {
        if (what == 6) {
            const int32_t by = script_.one_in(4) ? script_.number<int32_t>() : script_.number<int8_t>();
            int32_t &count = robot_.encoders.counts[script_.below(OMNI_MAX_WHEELS)];
            count = static_cast<int32_t>(static_cast<uint32_t>(count) + static_cast<uint32_t>(by));
        } else if (what == 7) {
            robot_.encoders.valid = script_.byte();
            robot_.hil_battery_V = script_.number<float>();
        } else {
            const uint64_t by = script_.one_in(4) ? script_.number<uint64_t>() : script_.number<uint16_t>();
            robot_.hil_us += by;
            robot_.clock.us += by % 1'000'000;
        }
    }

    void pass_time() {
        if (robot_.setup.lockstep) {
            robot_.send(0, robot_.hil_sensors());
        } else {
            robot_.tick();
        }
        robot_.background();
    }

    Script &script_;
    Robot robot_;
    Manners manners_;
};

} // namespace
} // namespace fuzz

extern "C" int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
    fuzz::Script script(data, size);
    ++fuzz::figures().executions;
    fuzz::Play(script).run();
    return 0;
}
