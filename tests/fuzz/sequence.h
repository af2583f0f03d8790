// SPDX-License-Identifier: MIT
/// @file sequence.h  Plays a list of actions (action.h) on the firmware and asks the oracle of stops after every tick.
///
/// An action: `link` says where, modulo the links there are. With its top bit the frame waits, and goes out joined with
/// the next one of that link. `a` and `b` choose variants, `n` and `x` are amounts. The first action's `a` sets the run
/// up: bit 0 lockstep, bit 1 no output-enable pin, bits 2 and 3 the robot. Its `b` says how many links beyond two.
#pragma once

#include "action.h"
#include "robot.h"
#include "stop_oracle.h"

namespace fuzz {

class Sequence final : private Listener {
public:
    explicit Sequence(const Action &setup);
    void run(const Actions &actions);

private:
    /// What a frame asks for that the oracle must know.
    enum class Event : uint8_t { nothing, arm, release, disarm, estop };
    static constexpr size_t radio = 1;
    static constexpr size_t max_ports = omni::Board::max_ports;
    static Setup setup_of(const Action &setup);

    void heard(size_t port, const Found &frame) override;
    void host_ticked() override { oracle_.host_ticked(robot_.world_moves()); }

    void act(const Action &action);
    void ticks(const Action &action);
    void host_ticks(const Action &action);
    void arm(const Action &action);
    void disarm(const Action &action);
    void estop(const Action &action);
    void release(const Action &action);
    void drive(const Action &action);
    void fixes(const Action &action);
    void heartbeat(const Action &action);
    void enter_hil(const Action &action) { command(action, MAV_CMD_OMNI_HIL, 1.0f, 0.0f); }
    void leave_hil(const Action &action) { command(action, MAV_CMD_OMNI_HIL, 0.0f, 0.0f); }
    void reboot(const Action &action) { command(action, MAV_CMD_PREFLIGHT_REBOOT_SHUTDOWN, 1.0f, 0.0f); }
    void power_cut(const Action &action);
    void parameter(const Action &action);
    void trajectory(const Action &action);
    void message(const Action &action);
    void noise(const Action &action);
    void half(const Action &action);
    void connect(const Action &action);
    /// A link that takes nothing, until it does again: what waited on it comes late and says nothing of now.
    void clog(size_t link, bool clogged);
    bool is_clogged(size_t link) const { return (clogged_ >> link & 1) != 0; }
    void bus(const Action &action);
    void clock_jump(const Action &action);
    void silence(const Action &action);
    void storage(const Action &action);
    void key(const Action &action);
    void scan(const Action &action);
    void list(const Action &action);

    size_t link_of(const Action &action) const { return (action.link & 0x7F) % robot_.setup.ports; }
    /// How frames look on this link at the moment.
    Form form_on(size_t link) const;
    /// A command with a receipt of its own; what it means is worked out from it. A stop among them is promised its
    /// effect.
    void command(const Action &action, uint16_t number, float first, float second);
    /// A stop that the robot may take for a recording. It has started anew, and the station has not heard it say its
    /// time since.
    bool may_be_a_recording(size_t link) const { return signs_ && link == radio && !knows_the_time_; }
    void sign_on(size_t link, Bytes *frame);
    void started_anew();
    void send(const Action &action, Bytes frame, Event event = Event::nothing);
    void put(size_t link, Bytes bytes);
    void tick_once(int turning);
    void background();
    void allow_what_waits();
    void deliver();

    Script nothing_; ///< the robot's own chances: a memory that is erased, a start by power
    Robot robot_;
    StopOracle oracle_;
    Bytes joined_[max_ports];                     ///< waits to go out with the next frame
    std::vector<Event> joined_events_[max_ports]; ///< of what waits
    std::vector<Event> events_[max_ports];        ///< of frames that the robot has not read to the end
    bool dirty_[max_ports] = {};                  ///< an unfinished frame came before: all but stops may be found later
    bool signs_ = false;
    bool knows_the_time_ = true; ///< the station on the radio, of the robot's signing clock
    bool storage_works_ = true;
    unsigned clogged_ = 0; ///< a bit per link
    unsigned good_bus_ticks_ = 0;
    uint64_t boots_ = 0;
    uint64_t signing_time_ = 0;
    float receipts_ = 0.0f;
};

} // namespace fuzz
