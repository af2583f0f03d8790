// SPDX-License-Identifier: MIT
// The gyro's driver on a bus with the chip's model, in simulated time.
#include <algorithm>

#include "app/icm42688.h"
#include "gyro_bus.h"

using namespace omni;

namespace {

struct Gyro {
    GyroBus bus;
    Icm42688 driver{bus, GyroBus::address};
    uint64_t time_us = 1000;
};

} // namespace

extern "C" {

Gyro *gyro_new() {
    return new Gyro;
}

void gyro_delete(Gyro *gyro) {
    delete gyro;
}

void gyro_use_axis(Gyro *gyro, int axis) {
    gyro->driver.use_axis(static_cast<int8_t>(axis));
}

/// A tick, then `step_us` with these rates at the chip. @param read out: what the driver says, left as it is where
/// nothing is new. @return the driver's bits.
int gyro_tick(Gyro *gyro, uint32_t step_us, const double *rates, float *read) {
    const int valid = gyro->driver.read(gyro->time_us, read);
    gyro->time_us += step_us;
    hil_icm42688_sense(&gyro->bus.chip, gyro->time_us, rates);
    return valid;
}

int gyro_cause(Gyro *gyro) {
    return static_cast<int>(gyro->driver.trouble().cause);
}

int gyro_seen(Gyro *gyro) {
    return gyro->driver.trouble().seen;
}

uint32_t gyro_starts(Gyro *gyro) {
    return gyro->driver.starts();
}

uint32_t gyro_batches(Gyro *gyro) {
    return gyro->bus.batches;
}

uint32_t gyro_recoveries(Gyro *gyro) {
    return gyro->bus.recoveries;
}

void gyro_hold(Gyro *gyro, int held) {
    gyro->bus.held = held != 0;
}

hil_icm42688_faults_t *gyro_faults(Gyro *gyro) {
    return &gyro->bus.chip.faults;
}

/// As after a dip of the supply.
void gyro_power_cycle(Gyro *gyro) {
    hil_icm42688_reset(&gyro->bus.chip, GyroBus::address);
}

int gyro_register(Gyro *gyro, uint32_t bank, uint32_t reg) {
    return gyro->bus.chip.registers[bank][reg];
}

/// As a start that was broken off leaves it.
void gyro_set_register(Gyro *gyro, uint32_t bank, uint32_t reg, uint32_t value) {
    gyro->bus.chip.registers[bank][reg] = static_cast<uint8_t>(value);
}

uint32_t gyro_ignored_writes(Gyro *gyro) {
    return gyro->bus.chip.ignored_writes;
}
}
