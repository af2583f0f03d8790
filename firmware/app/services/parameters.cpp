// SPDX-License-Identifier: MIT
#include "app/services/parameters.h"

#include <cmath>
#include <cstring>

#include "app/base/flash_code.h"

namespace omni {
namespace {

Text parameter_text(int32_t index) {
    Text text;
    text.add(omni_param_table[index].name);
    return text;
}

constexpr const char *inconsistent = "stored parameters do not fit: not used";
constexpr const char *damaged = "stored parameters are damaged: not used";

/// Equality that also holds for two NaNs: a value of the robot file may be NaN.
bool values_differ(omni_real_t a, omni_real_t b) {
    return a != b && !(std::isnan(a) && std::isnan(b));
}

/// Frame length of a PARAM_VALUE.
constexpr size_t param_value_frame = 37;

} // namespace

/// Make `values` the working set if a configuration can be built from them; nothing changes otherwise.
bool Parameters::adopt(const omni_real_t *values, int32_t *bad_index, omni_result_t *why) {
    RobotSetup &setup = control_.setups.scratch();
    *why = make_robot_setup(setup, values, bad_index);
    if (*why != OMNI_OK) {
        return false;
    }
    setup.config.sequence = ++sequence_;
    config_ = setup.config;
    std::memmove(values_, values, sizeof values_);
    control_.setups.publish();
    listener_.parameters_changed();
    return true;
}

bool Parameters::fits(const omni_real_t *values, int32_t *bad_index) {
    return make_robot_setup(control_.setups.scratch(), values, bad_index) == OMNI_OK;
}

/// Values within their ranges may be inconsistent. Remove the stored values that are reported as invalid. If the
/// reported one is of the robot file, or none is reported, add the stored values one by one as long as they are
/// consistent.
OMNI_COLD void Parameters::remove_inconsistent_values(omni_real_t *values) {
    const omni_real_t *own = board_.robot_values;
    int32_t bad = -1;
    bool whole = fits(values, &bad);
    while (!whole && bad >= 0 && values_differ(values[bad], own[bad])) {
        rejected_params_.add(bad, values[bad]);
        values[bad] = own[bad];
        whole = fits(values, &bad);
    }
    if (whole) {
        return;
    }
    omni_real_t stored[OMNI_PARAM_COUNT];
    std::memcpy(stored, values, sizeof stored);
    std::memcpy(values, own, sizeof stored);
    for (int32_t i = 0; i < OMNI_PARAM_COUNT; ++i) {
        values[i] = stored[i];
        if (values_differ(stored[i], own[i]) && !fits(values, &bad)) {
            rejected_params_.add(i, stored[i]);
            values[i] = own[i];
        }
    }
}

/// Apply the stored values.
/// @return ok, or why none of them is used; `failed`: the robot file's values are inconsistent.
StoreResult Parameters::adopt_stored() {
    omni_real_t values[OMNI_PARAM_COUNT];
    std::memcpy(values, board_.robot_values, sizeof values);
    const StoreResult result = store_.load(values);
    rejected_params_ = store_.rejected_params();
    if (result != StoreResult::ok) {
        return result;
    }
    remove_inconsistent_values(values);
    keep_system_id(values);
    int32_t bad = -1;
    omni_result_t why = OMNI_OK;
    if (!adopt(values, &bad, &why)) {
        return StoreResult::failed;
    }
    robot_.set_unusable_value(nullptr);
    return StoreResult::ok;
}

OMNI_COLD void Parameters::boot() {
    int32_t bad = -1;
    omni_result_t why = OMNI_OK;
    boot_result_ = adopt_stored();
    if (boot_result_ == StoreResult::ok || adopt(board_.robot_values, &bad, &why)) {
        return;
    }
    // The board's values are checked at build time. If they are invalid anyway, the links work, but arming is refused.
    robot_.set_unusable_value(bad >= 0 ? omni_param_table[bad].name : "WHEELS, W*_ANGLE");
    omni_real_t values[OMNI_PARAM_COUNT];
    fallback_parameters(values);
    adopt(values, &bad, &why);
}

bool Parameters::send_value(size_t link, int32_t index, Priority priority) {
    mavlink_param_value_t message{};
    const char *name = omni_param_table[index].name;
    std::memcpy(message.param_id, name, strnlen(name, sizeof message.param_id));
    message.param_value = values_[index];
    message.param_type = MAV_PARAM_TYPE_REAL32;
    message.param_count = OMNI_PARAM_COUNT;
    message.param_index = static_cast<uint16_t>(index);
    return links_[link].send(MAVLINK_MSG_ID_PARAM_VALUE, message, priority);
}

int32_t Parameters::index_of(const char *name, int32_t index) const {
    if (index >= 0) {
        return index < OMNI_PARAM_COUNT ? index : -1;
    }
    return omni_param_find(name);
}

void Parameters::on_request_list(const Sender &sender) {
    list_next_[sender.link] = 0;
}

void Parameters::stop_list(size_t link) {
    list_next_[link] = OMNI_PARAM_COUNT;
}

void Parameters::on_request_read(const Frame &frame, const Sender &sender) {
    const auto message = frame.as<mavlink_param_request_read_t>();
    const int32_t index = index_of(message.param_id, message.param_index);
    if (index >= 0) {
        send_value(sender.link, index, Priority::reply);
        return;
    }
    char name[OMNI_PARAM_NAME_LEN + 1] = {};
    std::memcpy(name, message.param_id, OMNI_PARAM_NAME_LEN);
    texts_.refuse(MAV_SEVERITY_WARNING, Text().add("parameter ").add(name[0] != 0 ? name : "index").add(": unknown"));
}

void Parameters::refuse(int32_t index, float value, omni_result_t why, int32_t blamed) {
    Text text = parameter_text(index);
    const omni_param_info_t &info = omni_param_table[index];
    text.add(" ").add(value).add(" refused: ");
    if (why == OMNI_ERR_LOCKED) {
        text.add(robot_.disarm_hint());
    } else if (why == OMNI_ERR_NOT_FINITE) {
        text.add("not a number");
    } else if (blamed == index && (value < info.minimum || value > info.maximum)) {
        text.add(info.minimum)
            .add("..")
            .add(info.maximum)
            .add(index == OMNI_PARAM_SYS_ID ? " (255: ground station)" : "");
    } else if (blamed == index && info.kind == OMNI_PARAM_INT &&
               value != static_cast<float>(static_cast<int32_t>(value))) {
        text.add("whole numbers only");
    } else if (blamed >= 0 && blamed != index) {
        text.add("clashes with ").add(omni_param_table[blamed].name);
    } else {
        text.add("does not fit the others");
    }
    texts_.refuse(MAV_SEVERITY_WARNING, text);
}

OMNI_COLD void Parameters::on_set(const Frame &frame, const Sender &sender) {
    const auto message = frame.as<mavlink_param_set_t>();
    const int32_t index = omni_param_find(message.param_id);
    if (index < 0) {
        char name[OMNI_PARAM_NAME_LEN + 1] = {};
        std::memcpy(name, message.param_id, OMNI_PARAM_NAME_LEN);
        texts_.refuse(MAV_SEVERITY_WARNING, Text().add("parameter ").add(name).add(": unknown"));
        return;
    }
    const float value = message.param_value;
    omni_result_t why = omni_param_check(index, value, robot_.armed());
    int32_t blamed = index;
    if (message.param_type != MAV_PARAM_TYPE_REAL32) {
        texts_.refuse(MAV_SEVERITY_WARNING, parameter_text(index).add(" refused: send it as REAL32"));
    } else if (why != OMNI_OK) {
        refuse(index, value, why, blamed);
    } else {
        omni_real_t values[OMNI_PARAM_COUNT];
        std::memcpy(values, values_, sizeof values);
        values[index] = value;
        if (!adopt(values, &blamed, &why)) {
            refuse(index, value, why, blamed);
        }
    }
    for (size_t link = 0; link < links_.count(); ++link) {
        send_value(link, index, link == sender.link ? Priority::reply : Priority::telemetry);
    }
}

/// Keep SYS_ID: another robot on the link may have the stored one or the robot file's, and both would be driven.
void Parameters::keep_system_id(omni_real_t *values) const {
    const omni_real_t now = values_[OMNI_PARAM_SYS_ID];
    values[OMNI_PARAM_SYS_ID] = now > 0.0f ? now : values[OMNI_PARAM_SYS_ID]; // before boot there is none
}

OMNI_COLD bool Parameters::adopt_or_report(const omni_real_t *wanted) {
    omni_real_t values[OMNI_PARAM_COUNT];
    std::memcpy(values, wanted, sizeof values);
    keep_system_id(values);
    int32_t bad = -1;
    omni_result_t why = OMNI_OK;
    if (adopt(values, &bad, &why)) {
        return true;
    }
    texts_.refuse(MAV_SEVERITY_ERROR,
                  Text().add("refused because of ").add(bad >= 0 ? omni_param_table[bad].name : "their sum"));
    return false;
}

OMNI_COLD bool Parameters::restore(const omni_real_t *values) {
    omni_real_t left[OMNI_PARAM_COUNT];
    std::memcpy(left, values_, sizeof left);
    if (!adopt_or_report(values)) {
        return false;
    }
    for (int32_t index = 0; index < OMNI_PARAM_COUNT; ++index) {
        for (size_t link = 0; values_differ(values_[index], left[index]) && link < links_.count(); ++link) {
            send_value(link, index, Priority::telemetry);
        }
    }
    return true;
}

void Parameters::report_rejected_params() {
    const uint32_t max_listed = RejectedParams::max_listed;
    for (uint32_t i = 0; i < rejected_params_.refused && i < max_listed; ++i) {
        const auto &unusable_value = rejected_params_.first[i];
        texts_.say(MAV_SEVERITY_WARNING, Text()
                                             .add("stored ")
                                             .add(omni_param_table[unusable_value.index].name)
                                             .add(" ")
                                             .add(unusable_value.value)
                                             .add(" left out"));
    }
    if (rejected_params_.refused > max_listed) {
        texts_.say(MAV_SEVERITY_WARNING,
                   Text().add(rejected_params_.refused - max_listed).add(" more stored values left out"));
    }
    if (rejected_params_.unknown > 0) {
        texts_.say(MAV_SEVERITY_WARNING,
                   Text().add(rejected_params_.unknown).add(" stored values left out: unknown here"));
    }
}

OMNI_COLD uint8_t Parameters::load() {
    const StoreResult result = adopt_stored();
    if (result == StoreResult::ok) {
        report_rejected_params();
        return MAV_RESULT_ACCEPTED;
    }
    if (result == StoreResult::damaged) {
        texts_.refuse(MAV_SEVERITY_ERROR, Text().add(damaged));
        return MAV_RESULT_FAILED;
    }
    if (result == StoreResult::empty) {
        texts_.refuse(MAV_SEVERITY_NOTICE, Text().add("nothing stored: the robot's own values are used"));
        return adopt_or_report(board_.robot_values) ? MAV_RESULT_ACCEPTED : MAV_RESULT_FAILED;
    }
    texts_.refuse(MAV_SEVERITY_ERROR, Text().add(inconsistent));
    return MAV_RESULT_FAILED;
}

uint8_t Parameters::save() {
    const StoreResult result = store_.save(values_, board_.robot_values);
    if (result == StoreResult::ok) {
        texts_.say(MAV_SEVERITY_INFO, Text().add("parameters stored"));
        return MAV_RESULT_ACCEPTED;
    }
    texts_.refuse(MAV_SEVERITY_ERROR,
                  Text().add(result == StoreResult::full ? "too many parameters differ: nothing stored"
                                                         : "the memory failed: nothing stored"));
    return MAV_RESULT_FAILED;
}

uint8_t Parameters::storage_command(float action) {
    if (robot_.armed()) {
        return robot_.refuse_armed("parameter storage refused");
    }
    if (action == 0.0f) {
        return load();
    }
    if (action == 1.0f) {
        return save();
    }
    if (action == 2.0f) {
        return adopt_or_report(board_.robot_values) ? MAV_RESULT_ACCEPTED : MAV_RESULT_FAILED;
    }
    return MAV_RESULT_UNSUPPORTED;
}

void Parameters::report_boot_problems() {
    if (robot_.unusable_value() != nullptr) {
        texts_.say(MAV_SEVERITY_CRITICAL, Text().add("own values do not fit: ").add(robot_.unusable_value()));
    }
    if (boot_result_ == StoreResult::failed) {
        texts_.say(MAV_SEVERITY_ERROR, Text().add(inconsistent));
    } else {
        report_rejected_params();
    }
    if (boot_result_ == StoreResult::damaged) {
        texts_.say(MAV_SEVERITY_ERROR, Text().add(damaged));
    }
}

void Parameters::serve() {
    for (size_t link = 0; link < links_.count(); ++link) {
        int32_t &next = list_next_[link];
        while (next < OMNI_PARAM_COUNT && links_[link].admits(Priority::bulk, param_value_frame) &&
               send_value(link, next, Priority::bulk)) {
            ++next;
        }
    }
    if (!boot_reported_ && links_.cable_connected()) {
        boot_reported_ = true;
        report_boot_problems();
    }
}

} // namespace omni
