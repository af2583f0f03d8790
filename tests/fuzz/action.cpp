// SPDX-License-Identifier: MIT
#include "action.h"

#include <algorithm>
#include <cstring>

#include "generator.h"

namespace fuzz {
namespace {

constexpr size_t fewest = 2;   ///< the set-up and something to do
constexpr size_t longest = 64; ///< actions that mutations make by themselves
constexpr auto kinds = static_cast<size_t>(Kind::count);

Kind likely_kind(Generator &random) {
    // A robot that stands still shows no stop that fails: half of what is put in makes it move or stops it.
    static constexpr Kind often[] = {Kind::ticks, Kind::ticks, Kind::host_ticks, Kind::arm,
                                     Kind::drive, Kind::estop, Kind::disarm,     Kind::release};
    constexpr size_t count = sizeof often / sizeof often[0];
    return random.below(2) == 0 ? often[random.below(count)] : static_cast<Kind>(random.below(kinds));
}

Action new_action(Generator &random) {
    Action action{};
    action.kind = static_cast<uint8_t>(likely_kind(random));
    action.link = static_cast<uint8_t>(random.below(4) | (random.below(8) == 0 ? 0x80u : 0u));
    action.a = static_cast<uint8_t>(random.next());
    action.b = static_cast<uint8_t>(random.next());
    action.n = static_cast<uint16_t>(random.below(random.below(8) == 0 ? 65536 : 48));
    action.x = static_cast<int16_t>(random.next());
    return action;
}

/// Bit 3 of a set-up: its motors hang on pins, not on the chip (sequence.h).
constexpr uint8_t robot_with_pins = 8;

/// A robot that is armed and driving: most sequences that mean something begin like this.
void append_driving(Actions *actions, Generator &random) {
    const auto link = static_cast<uint8_t>(random.below(2));
    Action setup = new_action(random);
    if (random.below(4) != 0) {
        setup.a &= robot_with_pins;
    }
    const auto number = [](Kind kind) { return static_cast<uint8_t>(kind); };
    const uint8_t time = number((setup.a & 1) != 0 ? Kind::host_ticks : Kind::ticks);
    actions->push_back(setup);
    actions->push_back({time, 0, 0, 0, 12, 0});
    actions->push_back({number(Kind::arm), link, 0, 0, 0, 0});
    actions->push_back({number(Kind::drive), link, static_cast<uint8_t>(random.below(3)), 0, 0, 12000});
    actions->push_back({time, 0, 0, 3, static_cast<uint16_t>(random.below(40)), 0});
}

void change_field(Action *action, Generator &random) {
    const Action other = new_action(random);
    switch (random.below(6)) {
    case 0:
        action->kind = other.kind;
        break;
    case 1:
        action->link = other.link;
        break;
    case 2:
        action->a = other.a;
        break;
    case 3:
        action->b = other.b;
        break;
    case 4:
        action->n = other.n;
        break;
    default:
        action->x = other.x;
    }
}

void mutate_one(Actions *actions, Generator &random) {
    const size_t at = 1 + random.below(actions->size() - 1); // the set-up stays where it is
    const auto place = actions->begin() + static_cast<std::ptrdiff_t>(at);
    const bool room = actions->size() < longest;
    switch (random.below(8)) {
    case 0:
    case 1:
    case 2:
        if (room) {
            actions->insert(place, new_action(random));
            break;
        }
        [[fallthrough]];
    case 3:
        if (actions->size() > fewest) {
            actions->erase(place);
        }
        break;
    case 4:
        if (room) {
            const Action copy = *place;
            actions->insert(actions->begin() + static_cast<std::ptrdiff_t>(1 + random.below(actions->size())), copy);
        }
        break;
    case 5:
        std::swap(*place, (*actions)[1 + random.below(actions->size() - 1)]);
        break;
    case 6:
        place->link = static_cast<uint8_t>(place->link + 1 + random.below(3));
        break;
    default:
        change_field(&(*actions)[random.below(actions->size())], random);
    }
}

size_t store(const Actions &actions, uint8_t *out, size_t capacity) {
    const size_t count = std::min(actions.size(), capacity / sizeof(Action));
    if (count > 0) {
        std::memcpy(out, actions.data(), count * sizeof(Action));
    }
    return count * sizeof(Action);
}

} // namespace

Actions actions_of(const uint8_t *data, size_t size) {
    Actions actions(size / sizeof(Action));
    if (!actions.empty()) {
        std::memcpy(actions.data(), data, actions.size() * sizeof(Action));
    }
    return actions;
}

size_t mutate_actions(uint8_t *data, size_t size, size_t capacity, uint64_t seed) {
    Generator random(seed);
    Actions actions = actions_of(data, size);
    size_t changes = 1 + random.below(4);
    if (actions.size() < fewest) {
        actions.clear();
        append_driving(&actions, random);
        changes += random.below(24);
    }
    for (; changes > 0; --changes) {
        mutate_one(&actions, random);
    }
    return store(actions, data, capacity);
}

size_t cross_actions(const Actions &first, const Actions &second, uint8_t *out, size_t capacity, uint64_t seed) {
    Generator random(seed);
    Actions both = first;
    if (!first.empty() && second.size() > 1) {
        both.resize(1 + random.below(first.size()));
        const auto from = static_cast<std::ptrdiff_t>(1 + random.below(second.size() - 1));
        both.insert(both.end(), second.begin() + from, second.end());
    }
    return store(both, out, capacity);
}

} // namespace fuzz
