// SPDX-License-Identifier: MIT
// The driver of a sensor of motion over the floor on a bus with the sensor's model, in simulated time.
#include <algorithm>

#include "app/drivers/otos.h"
#include "app/drivers/pinpoint.h"
#include "app/drivers/register_flow.h"

extern "C" {
#include "hil_sim/flow_chip.h"
}

using namespace omni;

namespace {

/// As shared/generate writes them: a swingarm pod (13.25 steps per mm), x wheel 84 mm left, y wheel 168 mm behind. The
/// y wheel counts the other way.
constexpr uint8_t settings[] = {5, 14, 0,  0, 0x54, 0x41, //
                                5, 15, 0,  0, 0xA8, 0x42, //
                                5, 16, 0,  0, 0x28, 0xC3, //
                                5, 4,  32, 0, 0,    0,    //
                                5, 4,  4,  0, 0,    0,    //
                                0};
constexpr PoseCounter chips[HIL_FLOW_KINDS] = {otos::chip, pinpoint::with(settings)};
constexpr uint8_t addresses[HIL_FLOW_KINDS] = {otos::address, pinpoint::address};

/// A transfer is done by the next tick, unless a line is held low.
class FlowBus final : public I2cBus {
public:
    bool submit(const I2cTransaction *batch, size_t count) override {
        ++batches;
        if (busy_) {
            return false;
        }
        std::fill(read_, read_ + sizeof read_, uint8_t{0});
        busy_ = true;
        acknowledged_ = !held && lose == 0;
        lose -= lose > 0 ? 1 : 0;
        for (size_t i = 0; i < count && acknowledged_; ++i) {
            acknowledged_ = carry(batch[i]);
        }
        hil_flow_chip_stop(&chip);
        return true;
    }
    I2cStatus poll(uint8_t *read) override {
        if (!busy_) {
            return I2cStatus::idle;
        }
        if (held) {
            return I2cStatus::busy;
        }
        busy_ = false;
        std::copy(read_, read_ + sizeof read_, read);
        return acknowledged_ ? I2cStatus::done : I2cStatus::nack;
    }
    void recover() override {
        ++recoveries;
        busy_ = false;
    }

    hil_flow_chip_t chip{};
    bool held = false;
    int lose = 0; ///< transfers that nobody acknowledges
    uint32_t batches = 0;
    uint32_t recoveries = 0;

private:
    bool carry(const I2cTransaction &transaction) {
        bool good = hil_flow_chip_start(&chip, transaction.address, false);
        for (size_t i = 0; i < transaction.write_length && good; ++i) {
            good = hil_flow_chip_put(&chip, transaction.write[i]);
        }
        if (transaction.read_length > 0 && good) {
            good = hil_flow_chip_start(&chip, transaction.address, true);
            for (size_t i = 0; i < transaction.read_length && good; ++i) {
                read_[i] = hil_flow_chip_get(&chip);
            }
        }
        return good;
    }

    bool busy_ = false;
    bool acknowledged_ = true;
    uint8_t read_[I2cTransaction::max_read] = {};
};

struct Flow {
    explicit Flow(uint8_t kind) : driver(bus, addresses[kind], chips[kind]) {
        hil_flow_chip_reset(&bus.chip, kind, addresses[kind]);
    }
    FlowBus bus;
    RegisterFlow driver;
    uint64_t time_us = 1000;
    bool rests = true;
};

} // namespace

extern "C" {

Flow *flow_new(int kind) {
    return new Flow(static_cast<uint8_t>(kind));
}

void flow_delete(Flow *flow) {
    delete flow;
}

void flow_use(Flow *flow, int wanted) {
    flow->driver.use(wanted != 0);
}

/// A tick, then a millisecond in which the sensor moves. @param read out: as it is where nothing is new. @return bits.
int flow_tick(Flow *flow, const double *moved, float *read) {
    const int valid = flow->driver.read(flow->time_us, read, flow->rests);
    flow->time_us += 1000;
    hil_flow_chip_move(&flow->bus.chip, flow->time_us, moved);
    return valid;
}

int flow_cause(Flow *flow) {
    return static_cast<int>(flow->driver.trouble().cause);
}

int flow_seen(Flow *flow) {
    return flow->driver.trouble().seen;
}

uint32_t flow_starts(Flow *flow) {
    return flow->driver.starts();
}

uint32_t flow_batches(Flow *flow) {
    return flow->bus.batches;
}

uint32_t flow_recoveries(Flow *flow) {
    return flow->bus.recoveries;
}

uint32_t flow_calibrations(Flow *flow) {
    return flow->bus.chip.calibrations;
}

uint32_t flow_ignored_writes(Flow *flow) {
    return flow->bus.chip.ignored_writes;
}

void flow_rest(Flow *flow, int rests) {
    flow->rests = rests != 0;
}

/// Milliseconds that a Pinpoint's calibration takes.
void flow_slow_calibration(Flow *flow, int ms) {
    flow->bus.chip.calibration_us = static_cast<uint32_t>(ms) * 1000;
}

void flow_hold(Flow *flow, int held) {
    flow->bus.held = held != 0;
}

void flow_lose(Flow *flow, int transfers) {
    flow->bus.lose = transfers;
}

/// As after a dip of the supply.
void flow_power_cycle(Flow *flow) {
    hil_flow_chip_reset(&flow->bus.chip, flow->bus.chip.kind, flow->bus.chip.address);
}

double flow_pose(Flow *flow, int axis) {
    return flow->bus.chip.pose[axis];
}

void flow_put(Flow *flow, double x, double y, double heading) {
    flow->bus.chip.pose[0] = x;
    flow->bus.chip.pose[1] = y;
    flow->bus.chip.pose[2] = heading;
}

hil_flow_faults_t *flow_faults(Flow *flow) {
    return &flow->bus.chip.faults;
}

void flow_wheels(Flow *flow, double steps, double x_wheel, double y_wheel, int x_reversed, int y_reversed) {
    flow->bus.chip.wheels = {steps, x_wheel, y_wheel, {x_reversed != 0, y_reversed != 0}};
}
}
