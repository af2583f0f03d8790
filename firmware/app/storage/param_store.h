// SPDX-License-Identifier: MIT
/// @file param_store.h  Parameters in non-volatile memory. Storage writes are atomic: a power cut leaves the old or the
/// new set.
///
/// A set holds the values that differ from the robot file's: header (magic, schema CRC, count), storage key and value
/// of each, CRC-32 over all. Bytes: docs/reference/storage.md.
///
/// The storage key is a hash of the parameter's name, so a set survives firmware updates: each value is checked against
/// the current range, and unknown or invalid ones are skipped and reported. A parameter that was never changed follows
/// the new firmware's default.
#pragma once

#include <cstddef>
#include <cstdint>

#include "app/base/board.h"
#include "app/base/core.h"

namespace omni {

enum class StoreResult : uint8_t {
    ok,
    empty,   ///< nothing is stored
    damaged, ///< what is stored cannot be read
    full,    ///< more values than the memory holds
    failed,  ///< write error
};

/// Values of a stored set that were rejected.
struct RejectedParams {
    static constexpr size_t max_listed = 6;
    struct {
        int32_t index;
        omni_real_t value;
    } first[max_listed];  ///< the first values out of range
    uint32_t refused = 0; ///< number of values out of range
    uint32_t unknown = 0; ///< number of unknown parameters
    /// @param index -1: unknown
    void add(int32_t index, omni_real_t value) {
        if (index < 0) {
            ++unknown;
            return;
        }
        if (refused < max_listed) {
            first[refused] = {index, value};
        }
        ++refused;
    }
};

class ParamStore {
public:
    /// Maximum size of a set [bytes].
    static constexpr size_t max_size = 12 + 6 * OMNI_PARAM_COUNT + 4;

    explicit ParamStore(Storage &storage) : storage_(storage) {}

    /// Overwrite `values` (robot file's values on entry) with the stored ones. Unchanged unless `ok`. Values are within
    /// their ranges; the caller must check the combination.
    StoreResult load(omni_real_t *values);
    /// Values rejected by the last load.
    const RejectedParams &rejected_params() const { return rejected_params_; }
    /// Store the differences of `values` from `robot_values`, and verify by reading back.
    StoreResult save(const omni_real_t *values, const omni_real_t *robot_values);

private:
    size_t room() const;
    StoreResult read();
    size_t compose(const omni_real_t *values, const omni_real_t *robot_values);

    Storage &storage_;
    RejectedParams rejected_params_{};
    uint8_t buffer_[max_size] = {};
};

} // namespace omni
