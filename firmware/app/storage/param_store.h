// SPDX-License-Identifier: MIT
/// @file param_store.h  Parameters in non-volatile memory, in two slots (two_slots.h).
///
/// A slot holds what differs from the robot's own values. First comes a header: magic, schema CRC, sequence, count.
/// Storage key and value of each follow, then CRC-32 over all of it. The valid slot with the newer sequence counts.
///
/// The storage key comes from the parameter's name. So a set outlives an update of the firmware: each value is found by
/// its name and checked against this firmware's range. What has no place any more is left out and reported, the rest is
/// used. A parameter that was never changed follows the new firmware's default.
#pragma once

#include <cstddef>
#include <cstdint>

#include "app/base/core.h"
#include "app/storage/two_slots.h"

namespace omni {

enum class StoreResult : uint8_t {
    ok,
    empty,   ///< nothing valid is stored
    foreign, ///< an old firmware's set, by index, of a table whose order is not known any more
    full,    ///< more parameters differ than a slot holds
    failed,  ///< the memory did not take it
};

/// What was left out of a stored set.
struct Misfits {
    static constexpr size_t kept = 6;
    struct {
        int32_t index;
        omni_real_t value;
    } first[kept];        ///< values that this firmware refuses, as many as fit here
    uint32_t refused = 0; ///< how many there are
    uint32_t unknown = 0; ///< values of parameters that this firmware does not have
    /// @param index -1: unknown
    void add(int32_t index, omni_real_t value) {
        if (index < 0) {
            ++unknown;
            return;
        }
        if (refused < kept) {
            first[refused] = {index, value};
        }
        ++refused;
    }
};

class ParamStore : public TwoSlots<ParamStore> {
public:
    /// Largest slot in use, bytes; larger memories are not filled.
    static constexpr size_t max_slot = 16 + 6 * OMNI_PARAM_COUNT + 4;

    explicit ParamStore(Storage &storage) : TwoSlots(storage) {}

    /// Put the stored values over `values`, which holds the robot's own on entry. Unchanged unless `ok`. Each value
    /// that is used is within its range; whether they fit together is for the caller to find out.
    StoreResult load(omni_real_t *values);
    /// What the last load left out.
    const Misfits &misfits() const { return misfits_; }
    /// Store what differs between `values` and `robot_values`, and read it back.
    StoreResult save(const omni_real_t *values, const omni_real_t *robot_values);

private:
    friend class TwoSlots<ParamStore>;
    size_t slot_size() const;
    bool has_room() const;
    static size_t place() { return 0; }
    Slot judge() const;
    size_t compose(const omni_real_t *values, const omni_real_t *robot_values, uint32_t sequence);

    Misfits misfits_{};
    uint8_t buffer_[max_slot] = {};
};

} // namespace omni
