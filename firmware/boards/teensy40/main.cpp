// SPDX-License-Identifier: MIT
/// @file main.cpp  The firmware on a Teensy 4.0: puts the parts together, ticks by a timer interrupt, serves the links
/// in loop().
#include <Arduino.h>
#include <IntervalTimer.h>

#include "app/app.h"
#include "app/base/core.h"
#include "boards/teensy40/battery.h"
#include "boards/teensy40/clock.h"
#include "boards/teensy40/encoders.h"
#include "boards/teensy40/flow.h"
#include "boards/teensy40/gyro.h"
#include "boards/teensy40/i2c.h"
#include "boards/teensy40/memory.h"
#include "boards/teensy40/motor_pins.h"
#include "boards/teensy40/motor_stop.h"
#include "boards/teensy40/pins.h"
#include "boards/teensy40/ports.h"
#include "boards/teensy40/priorities.h"
#include "boards/teensy40/processor.h"
#include "boards/teensy40/storage.h"
#include "boards/teensy40/watchdog.h"
#include "omni/wiring_gen.h"

namespace omni {
namespace {

/// In RAM2: ITCM and DTCM are for what the tick needs at once.
alignas(8) DMAMEM uint8_t burst_memory[default_burst_bytes];

constexpr bool battery_wired = wiring::battery_pin >= 0;
/// omni flash finds this in a .hex file by its text (host/omniwheel/flashing/hex_file.py) before it uploads it.
/// Volatile: it is read where it is, in flash memory, so the linker keeps it.
struct ImageLabel {
    char words[20];
    uint32_t wiring_id;
};
__attribute__((section(".progmem"))) const volatile ImageLabel image_label = {"omniwheel wiring id", wiring::id};
constexpr uint32_t radio_baud = 9600; ///< until the stored LINK2_BAUD is known
/// Time to send queued messages before a reboot.
constexpr uint64_t reboot_flush_us = 100'000;
/// A few attempts at 100 kHz, each with the bus freed before. A chip that is silent for longer is the driver's to try.
constexpr uint64_t motor_stop_us = 10'000;

class Teensy40 {
public:
    Board begin();
    void start(App &app, void (*on_timer)());
    void tick();
    void loop();
    float battery_V() const { return battery_.volts(); }

private:
    void stop_motors();
    [[noreturn]] void reboot();

    Teensy40Clock clock_;
    Teensy40OutputEnable output_enable_;
    Teensy40StopButton stop_button_;
    Teensy40Light light_;
    Teensy40Watchdog watchdog_;
    Teensy40Flash flash_{watchdog_, &i2c_};
    FlashLog storage_{flash_};
    UsbPort usb_;
    RadioPort radio_;
    Teensy40Encoders encoders_;
    Teensy40I2c i2c_;
    RobotGyro gyro_;
    RobotFlow flow_;
    Teensy40MotorPins motor_pins_;
    MotorStop motor_stop_;
    Battery battery_{battery_wired ? static_cast<uint8_t>(wiring::battery_pin) : uint8_t{0}, wiring::battery_divider};
    IntervalTimer timer_;
    App *app_ = nullptr;
};

Teensy40 &machine() {
    static Teensy40 instance;
    return instance;
}

void on_timer() {
    machine().tick();
}

float battery_V() {
    return machine().battery_V();
}

/// As in the USB descriptor (Teensyduino's usb_desc.c): the fused number, small ones times ten.
uint64_t serial_number() {
    const uint32_t burnt = HW_OCOTP_MAC0 & 0xFFFFFF;
    return burnt < 10'000'000 ? burnt * 10 : burnt;
}

/// The loop sees the I2C interrupt no more than the tick does: half-way. Without a chip begin() has stopped them
/// already.
void Teensy40::stop_motors() {
    if (Teensy40MotorPins::wired()) {
        return;
    }
    const uint64_t begin_us = clock_.now_us();
    bool stopped = false;
    while (!stopped && clock_.now_us() - begin_us < motor_stop_us) {
        const InterruptLock lock;
        stopped = motor_stop_.step(i2c_);
    }
}

/// Motors first: erasing flash memory may take seconds. Slow steps run before the watchdog is started.
Board Teensy40::begin() {
    output_enable_.begin();
    motor_pins_.begin();
    paint_stack();
    i2c_.begin();
    stop_motors();
    light_.begin();
    light_.set(true);
    watchdog_.begin();
    storage_.begin();
    radio_.begin(radio_baud);
    encoders_.begin();
    stop_button_.begin();
    if (battery_wired) {
        battery_.begin();
    }
    Board board;
    board.clock = &clock_;
    board.encoders = &encoders_;
    board.i2c = &i2c_;
    board.output_enable = &output_enable_;
    board.motor_pins = Teensy40MotorPins::wired() ? &motor_pins_ : nullptr;
    board.stop_button = Teensy40StopButton::wired() ? &stop_button_ : nullptr;
    board.gyro_chip = gyro_.begin();
    board.flow_chip = flow_.begin();
    board.light = &light_;
    board.ports[0] = &usb_;
    board.ports[1] = &radio_;
    board.port_count = 2;
    board.storage = &storage_;
    board.watchdog = &watchdog_;
    board.serial_number = serial_number();
    board.wiring_id = image_label.wiring_id;
    board.robot_values = omni_builtin_robots[0].values;
    board.battery_V = battery_wired ? omni::battery_V : nullptr;
    board.memory_free = memory_free;
    board.use_teensy40();
    board.burst_memory = burst_memory;
    board.burst_bytes = sizeof burst_memory;
    return board;
}

void Teensy40::start(App &app, void (*callback)()) {
    app_ = &app;
    flash_.watched();
    watchdog_.start();
    timer_.priority(priority_tick);
    timer_.begin(callback, static_cast<uint32_t>(OMNI_TICK_US));
}

void Teensy40::tick() {
    watchdog_.tick();
    if (usb_.upload_asked()) {
        output_enable_.set(false);
        Teensy40MotorPins::drive_low();
        motor_stop_.step(i2c_);
        return;
    }
    app_->tick();
    if (battery_wired) {
        battery_.sample();
    }
}

void Teensy40::loop() {
    app_->background();
    if (app_->reboot_wanted()) {
        reboot();
    }
}

void Teensy40::reboot() {
    const uint64_t begin_us = clock_.now_us();
    while (clock_.now_us() - begin_us < reboot_flush_us) {
        app_->background();
    }
    timer_.end();
    output_enable_.set(false);
    Teensy40MotorPins::drive_low();
    watchdog_.reset();
}

} // namespace
} // namespace omni

void setup() {
    using namespace omni;
    const Board board = machine().begin();
    static App app(board, false);
    machine().start(app, on_timer);
}

void loop() {
    omni::machine().loop();
}
