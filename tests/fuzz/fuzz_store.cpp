// SPDX-License-Identifier: MIT
/// @file fuzz_store.cpp  The parameter memory with any content, also with checksums that are right. Nothing is read or
/// written outside of it. Foreign and damaged sets change nothing. A set that was stored comes back. A robot that boots
/// from it rests.
#include <cstring>

#include "app/base/core.h"
#include "app/base/crc32.h"
#include "app/storage/param_store.h"
#include "app/storage/storage_layout.h"
#include "check.h"
#include "messages.h"
#include "robot.h"

namespace fuzz {
namespace {

void put32(uint8_t *at, uint32_t value) {
    std::memcpy(at, &value, sizeof value);
}

size_t room(const FakeStorage &storage) {
    return storage.used > omni::storage_tail
               ? std::min(storage.used - omni::storage_tail, size_t{omni::ParamStore::max_size})
               : 0;
}

/// A set as the firmware writes it, with entries of the script's choice.
void forge(FakeStorage *storage, Script &script) {
    const size_t size = room(*storage);
    if (size < 16) {
        return;
    }
    uint8_t *at = storage->bytes;
    const size_t count = script.below((size - 16) / 6 + 1);
    put32(at, script.one_in(16) ? script.number<uint32_t>() : 0x34504D4Fu);
    put32(at + 4, script.one_in(8) ? script.number<uint32_t>() : omni_param_schema_crc);
    put32(at + 8, script.one_in(16) ? script.number<uint32_t>() : static_cast<uint32_t>(count));
    for (size_t i = 0; i < count; ++i) {
        uint8_t *entry = at + 12 + 6 * i;
        const auto index = static_cast<uint16_t>(parameter_for(script.number<uint16_t>()));
        const uint16_t key = script.one_in(16) ? script.number<uint16_t>() : omni_param_table[index].storage_key;
        const float value = script.one_in(2) ? script.number<float>() : omni_param_table[index].maximum;
        std::memcpy(entry, &key, sizeof key);
        std::memcpy(entry + 2, &value, sizeof value);
    }
    put32(at + 12 + 6 * count, script.one_in(16) ? script.number<uint32_t>() : omni::crc32(at, 12 + 6 * count));
}

void fill(FakeStorage *storage, Script &script) {
    static constexpr size_t sizes[] = {1080, 2048, 0, 1, 192, 231, 232, 256};
    storage->used = sizes[script.below(std::size(sizes)) * (script.one_in(4) ? 1 : 0)];
    std::memset(storage->bytes, 0xFF, sizeof storage->bytes);
    if (script.one_in(4)) {
        script.bytes(storage->bytes, storage->used);
    }
    if (!script.one_in(4)) {
        forge(storage, script);
    }
}

void store_alone(FakeStorage *storage, Script &script) {
    omni::ParamStore store(*storage);
    omni_real_t robot[OMNI_PARAM_COUNT];
    omni_params_defaults(robot);
    omni_real_t values[OMNI_PARAM_COUNT];
    std::memcpy(values, robot, sizeof values);
    if (store.load(values) != omni::StoreResult::ok) {
        check(std::memcmp(values, robot, sizeof values) == 0, "what cannot be used changes nothing");
    }
    for (int32_t i = 0; i < OMNI_PARAM_COUNT; ++i) {
        check(omni_param_check(i, values[i], false) == OMNI_OK, "no value outside of its range is used", i);
    }
    omni_real_t changed[OMNI_PARAM_COUNT];
    std::memcpy(changed, robot, sizeof changed);
    for (size_t i = script.below(20); i > 0; --i) {
        const size_t index = parameter_for(script.number<uint16_t>());
        changed[index] = omni_param_table[index].maximum;
    }
    storage->writes_left = script.one_in(4) ? script.below(400) : SIZE_MAX;
    const bool whole = storage->writes_left == SIZE_MAX;
    const omni::StoreResult saved = store.save(changed, robot);
    omni_real_t back[OMNI_PARAM_COUNT];
    std::memcpy(back, robot, sizeof back);
    const omni::StoreResult loaded = store.load(back);
    if (saved == omni::StoreResult::ok) {
        check(loaded == omni::StoreResult::ok && std::memcmp(back, changed, sizeof back) == 0,
              "what is stored comes back");
    } else {
        check(!whole || saved == omni::StoreResult::full || storage->used < 80 + omni::storage_tail,
              "a memory that works takes the set", static_cast<long>(saved));
    }
}

void robot_that_boots(Script &script) {
    Setup setup;
    setup.ports = 1;
    Script nothing(nullptr, 0);
    Robot robot(setup, nothing);
    fill(&robot.storage, script);
    robot.boot();
    for (int tick = 0; tick < 20; ++tick) {
        robot.tick();
        robot.background();
    }
    figures().bytes += robot.storage.used;
}

} // namespace
} // namespace fuzz

extern "C" int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
    fuzz::Script script(data, size);
    ++fuzz::figures().executions;
    if (script.below(4) == 0) {
        fuzz::robot_that_boots(script);
    } else {
        static fuzz::FakeStorage storage;
        storage = fuzz::FakeStorage{};
        fuzz::fill(&storage, script);
        fuzz::figures().bytes += storage.used;
        fuzz::store_alone(&storage, script);
    }
    return 0;
}
