// SPDX-License-Identifier: MIT
/// @file param_store.h  Parameters in non-volatile memory: two slots, written in turn, so that a power cut at any byte leaves the
/// old or the new set, never a mix.
///
/// A slot holds what differs from the robot's own values (1080 bytes of EEPROM must do): header (magic, schema CRC, sequence,
/// count), then index and value of each, then CRC-32 over all of it. The valid slot with the newer sequence counts.
#pragma once

#include <cstddef>
#include <cstdint>

#include "app/board.h"
#include "app/core.h"

namespace omni {

enum class StoreResult : uint8_t {
    ok,
    empty,   ///< nothing valid is stored
    foreign, ///< stored by a firmware with another parameter table
    full,    ///< more parameters differ than a slot holds
    failed,  ///< the memory did not take it
};

class ParamStore {
public:
    /// Largest slot in use, bytes; larger memories are not filled.
    static constexpr size_t max_slot = 16 + 6 * OMNI_PARAM_COUNT + 4;

    explicit ParamStore(Storage &storage) : storage_(storage) {}

    /// Put the stored values over `values`, which holds the robot's own on entry. Unchanged unless `ok`.
    StoreResult load(omni_real_t *values);
    /// A slot holds something that is neither a set nor erased memory, as a power cut while storing leaves it.
    bool damaged();
    /// Store what differs between `values` and `robot_values`, and read it back.
    StoreResult save(const omni_real_t *values, const omni_real_t *robot_values);

private:
    struct Slot {
        bool valid = false;
        bool erased = false;
        uint32_t sequence = 0;
    };
    size_t slot_size();
    Slot inspect(size_t number);
    int newest();
    size_t compose(const omni_real_t *values, const omni_real_t *robot_values, uint32_t sequence);

    Storage &storage_;
    uint8_t buffer_[max_slot] = {};
};

} // namespace omni
