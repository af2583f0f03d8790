// SPDX-License-Identifier: MIT
/// @file parameters.h  Active parameter set and MAVLink's parameter protocol. All parameters are sent as REAL32.
///
/// SYS_ID is changed only by its own PARAM_SET, and by a restart if another one is stored. Operations on many values
/// (load, reset to the robot file's values, end of a trial) keep it.
#pragma once

#include <cstdint>

#include "app/services/robot_state.h"
#include "app/storage/param_store.h"

namespace omni {

/// Listener for parameter changes (link budgets, rates, system id).
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

    /// Load the robot file's values, then the stored ones. An invalid stored value is replaced by the robot file's and
    /// reported once a link is connected. If the robot file's values are invalid, fallback_parameters() are used and
    /// arming is refused until a valid stored set has been loaded.
    void boot();

    void on_request_list(const Sender &sender);
    /// Cancel the parameter list on this link after a disconnect.
    void stop_list(size_t link);
    void on_request_read(const Frame &frame, const Sender &sender);
    void on_set(const Frame &frame, const Sender &sender);
    /// MAV_CMD_PREFLIGHT_STORAGE. @param action 0: load, 1: store, 2: reset to the robot file's values (not stored).
    /// @return MAV_RESULT
    uint8_t storage_command(float action);
    /// Restore earlier values and send the changed ones to the links. @return false if they are not valid together
    bool restore(const omni_real_t *values);
    /// Send the remaining parameters of requested lists, as far as the links accept them.
    void serve();

    const omni_real_t *values() const { return values_; }
    /// Configuration derived from the active set, for the background.
    const omni_robot_config_t &config() const { return config_; }

private:
    void report_boot_problems();
    bool adopt(const omni_real_t *values, int32_t *bad_index, omni_result_t *why);
    bool adopt_or_report(const omni_real_t *wanted);
    void keep_system_id(omni_real_t *values) const;
    bool fits(const omni_real_t *values, int32_t *bad_index);
    void remove_inconsistent_values(omni_real_t *values);
    StoreResult adopt_stored();
    void report_rejected_params();
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
    RejectedParams rejected_params_{}; ///< values rejected in the last load
    StoreResult boot_result_ = StoreResult::empty;
    bool boot_reported_ = false;
};

} // namespace omni
