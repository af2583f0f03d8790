// SPDX-License-Identifier: MIT
#include "boards/teensy40/motor_stop.h"

#include "app/drivers/pca9685.h"

namespace omni {

bool MotorStop::step(I2cBus &bus) {
    uint8_t read[I2cTransaction::max_read] = {};
    const I2cStatus status = bus.poll(read);
    if (status == I2cStatus::busy) {
        return false;
    }
    if (status == I2cStatus::stuck) {
        bus.recover();
    }
    const bool acknowledged = sent_ && status == I2cStatus::done;
    sent_ = !acknowledged && Pca9685::submit_all_off(bus);
    return acknowledged;
}

} // namespace omni
