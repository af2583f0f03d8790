// SPDX-License-Identifier: MIT
// The gyro's driver on a bus with the chip's model, in simulated time.
#include <algorithm>

#include "app/drivers/bmi270.h"
#include "app/drivers/icm42688.h"
#include "app/drivers/ism330dhcx.h"
#include "app/drivers/lsm6dso.h"
#include "app/drivers/register_gyro.h"
#include "gyro_bus.h"

using namespace omni;

namespace {

constexpr const GyroRegisters *registers_of[HIL_GYRO_KINDS] = {&icm42688::registers, &lsm6dso::registers,
                                                               &ism330dhcx::registers, &bmi270::registers};

/// Stands for Bosch's: nobody looks at what it says.
struct Configuration {
    uint8_t bytes[HIL_GYRO_UPLOAD];
    Configuration() {
        uint32_t state = 1;
        for (uint8_t &byte : bytes) {
            state = state * 1664525u + 1013904223u;
            byte = static_cast<uint8_t>(state >> 24);
        }
    }
} const configuration;

struct Gyro {
    explicit Gyro(uint8_t kind)
        : bus(kind),
          driver(bus, bus.chip.address, *registers_of[kind], configuration.bytes, sizeof configuration.bytes) {}
    GyroBus bus;
    RegisterGyro driver;
    uint64_t time_us = 1000;
};

} // namespace

extern "C" {

Gyro *gyro_new(int kind) {
    return new Gyro(static_cast<uint8_t>(kind));
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
    hil_gyro_chip_sense(&gyro->bus.chip, gyro->time_us, rates);
    return valid;
}

int gyro_cause(Gyro *gyro) {
    return static_cast<int>(gyro->driver.trouble().cause);
}

int gyro_seen(Gyro *gyro) {
    return gyro->driver.trouble().seen;
}

int gyro_wanted(Gyro *gyro) {
    return gyro->driver.trouble().wanted;
}

uint32_t gyro_starts(Gyro *gyro) {
    return gyro->driver.starts();
}

uint32_t gyro_batches(Gyro *gyro) {
    return gyro->bus.batches;
}

uint32_t gyro_longest_batch(Gyro *gyro) {
    return gyro->bus.longest_bytes;
}

uint32_t gyro_recoveries(Gyro *gyro) {
    return gyro->bus.recoveries;
}

void gyro_hold(Gyro *gyro, int held) {
    gyro->bus.held = held != 0;
}

hil_gyro_faults_t *gyro_faults(Gyro *gyro) {
    return &gyro->bus.chip.faults;
}

/// As after a dip of the supply.
void gyro_power_cycle(Gyro *gyro) {
    hil_gyro_chip_reset(&gyro->bus.chip, gyro->bus.chip.kind, gyro->bus.chip.address);
}

int gyro_register(Gyro *gyro, uint32_t bank, uint32_t reg) {
    return gyro->bus.chip.registers[bank][reg];
}

/// As a start that was broken off leaves it, or a bit that flips.
void gyro_set_register(Gyro *gyro, uint32_t bank, uint32_t reg, uint32_t value) {
    gyro->bus.chip.registers[bank][reg] = static_cast<uint8_t>(value);
}

uint32_t gyro_ignored_writes(Gyro *gyro) {
    return gyro->bus.chip.ignored_writes;
}

/// Bytes of the configuration file that the chip has as they should be.
uint32_t gyro_uploaded(Gyro *gyro) {
    uint32_t right = 0;
    for (size_t i = 0; i < sizeof configuration.bytes; ++i) {
        right += gyro->bus.chip.upload[i] == configuration.bytes[i] ? 1 : 0;
    }
    return right;
}

// The chip alone, as whoever plays the bus sees it.

/// One transaction: register, then bytes written or read. @param data in or out. @return acknowledged.
int gyro_talk(Gyro *gyro, uint32_t reg, uint8_t *data, uint32_t count, int reads) {
    hil_gyro_chip_t *chip = &gyro->bus.chip;
    bool good = hil_gyro_chip_start(chip, chip->address, false) && hil_gyro_chip_put(chip, static_cast<uint8_t>(reg));
    good = good && (reads == 0 || hil_gyro_chip_start(chip, chip->address, true));
    for (uint32_t i = 0; i < count && good; ++i) {
        if (reads != 0) {
            data[i] = hil_gyro_chip_get(chip);
        } else {
            good = hil_gyro_chip_put(chip, data[i]);
        }
    }
    hil_gyro_chip_stop(chip);
    return good;
}

void gyro_sense(Gyro *gyro, uint32_t step_us, const double *rates) {
    gyro->time_us += step_us;
    hil_gyro_chip_sense(&gyro->bus.chip, gyro->time_us, rates);
}

/// A reading of which the first `before` bytes come before the world changes, the others after it.
void gyro_read_across(Gyro *gyro, uint32_t reg, uint32_t before, const double *rates, uint8_t *data) {
    hil_gyro_chip_t *chip = &gyro->bus.chip;
    hil_gyro_chip_start(chip, chip->address, false);
    hil_gyro_chip_put(chip, static_cast<uint8_t>(reg));
    hil_gyro_chip_start(chip, chip->address, true);
    for (uint32_t i = 0; i < 6; ++i) {
        if (i == before) {
            gyro_sense(gyro, 2000, rates);
        }
        data[i] = hil_gyro_chip_get(chip);
    }
    hil_gyro_chip_stop(chip);
}
}
