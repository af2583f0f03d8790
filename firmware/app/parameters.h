// SPDX-License-Identifier: MIT
/// @file parameters.h  The working parameter set and MAVLink's parameter protocol. Every parameter travels as REAL32.
///
/// SYS_ID changes by a PARAM_SET of it alone, and at a restart, if another one is stored. What replaces many values at
/// once leaves it: loading, going back to the robot's own values, the end of a trial.
#pragma once

#include <cstdint>

#include "app/param_store.h"
#include "app/robot_state.h"

namespace omni {

/// A change of configuration that other modules follow (link budgets, rates, system id).
class ParameterListener {
public:
    virtual void parameters_changed() = 0;

protected:
    ~ParameterListener() = default;
};

class Parameters {
public:
    Parameters(const Board &board, Links &links, Texts &texts, RobotState &robot, ControlLoop &control,
               ParameterListener &listener)
        : board_(board), links_(links), texts_(texts), robot_(robot), control_(control), listener_(listener),
          store_(*board.storage) {}

    /// Robot's own values, then what is stored. A stored value that does not fit is left out: the robot's own is used,
    /// and that is said once a link is there. If its own make no robot, it comes up with fallback_values() and does not
    /// arm until a stored set that fits has been loaded.
    void boot();

    void on_request_list(const Sender &sender);
    /// Whoever asked on this link has gone.
    void stop_list(size_t link);
    void on_request_read(const Frame &frame, const Sender &sender);
    void on_set(const Frame &frame, const Sender &sender);
    /// MAV_CMD_PREFLIGHT_STORAGE. @param action 0 load, 1 store, 2 back to the robot's own values (in use, not stored).
    /// @return MAV_RESULT
    uint8_t storage_command(float action);
    /// Use these values again, which were in use before, and tell the links what changes. @return whether they fit
    bool take_back(const omni_real_t *values);
    /// Send what is left of the lists that were asked for, as far as the links take it.
    void serve();

    const omni_real_t *values() const { return values_; }
    /// Configuration of the working set, for the background's own use.
    const omni_robot_config_t &config() const { return config_; }

private:
    void say_boot_problems();
    bool adopt(const omni_real_t *values, int32_t *bad_index, omni_result_t *why);
    bool adopt_or_say(const omni_real_t *wanted);
    void keep_system(omni_real_t *values) const;
    bool fits(const omni_real_t *values, int32_t *bad_index);
    void leave_out_what_clashes(omni_real_t *values);
    StoreResult adopt_stored();
    void say_misfits();
    uint8_t load();
    uint8_t save();
    void refuse(int32_t index, float value, omni_result_t why, int32_t blamed);
    bool send_value(size_t link, int32_t index, Priority priority);
    int32_t index_of(const char *name, int32_t index) const;

    const Board &board_;
    Links &links_;
    Texts &texts_;
    RobotState &robot_;
    ControlLoop &control_;
    ParameterListener &listener_;
    ParamStore store_;
    omni_real_t values_[OMNI_PARAM_COUNT] = {};
    omni_robot_config_t config_{};
    uint16_t sequence_ = 0;
    int32_t list_next_[Board::max_ports] = {OMNI_PARAM_COUNT, OMNI_PARAM_COUNT, OMNI_PARAM_COUNT, OMNI_PARAM_COUNT};
    Misfits misfits_{}; ///< what was left out of the stored set that was loaded last
    StoreResult boot_result_ = StoreResult::empty;
    bool boot_damaged_ = false; ///< a stored set cannot be read
    bool boot_said_ = false;
};

} // namespace omni
