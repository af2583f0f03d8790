// SPDX-License-Identifier: MIT
// extern "C" access to the board layer's system part, and the application that main.cpp drives in the tests.
#include <algorithm>
#include <new>

#include "app/app.h"
#include "app/base/core.h"
#include "app/storage/param_store.h"
#include "boards/teensy40/battery.h"
#include "boards/teensy40/clock.h"
#include "boards/teensy40/ports.h"
#include "boards/teensy40/storage.h"
#include "boards/teensy40/watchdog.h"

extern "C" void fake_journal_add(char letter);
void setup();
void loop();

namespace {

omni::Board app_board;
bool app_wants_reboot;
bool app_ticks_feed; ///< background() feeds the watchdog, as the real one does

/// An object made anew on demand.
template <class T>
class Renewed {
public:
    template <class... Arguments>
    T &renew(Arguments &&...arguments) {
        return *(object_ = new (bytes_) T(arguments...));
    }
    T &operator*() { return *object_; }

private:
    T *object_ = nullptr;
    alignas(T) unsigned char bytes_[sizeof(T)];
};

Renewed<omni::CycleTime> time_;
Renewed<omni::UsbPort> usb;
Renewed<omni::RadioPort> radio;
Renewed<omni::Teensy40Watchdog> watchdog;
Renewed<omni::Battery> battery;
Renewed<omni::Teensy40Flash> flash;
Renewed<omni::FlashLog> storage;

} // namespace

namespace omni {

App::App(const Board &board, bool) {
    app_board = board;
    fake_journal_add('A');
}
void App::tick() {
    app_board.clock->now_us();
    fake_journal_add('1');
}
void App::background() {
    if (app_ticks_feed) {
        app_board.watchdog->feed();
    }
}
bool App::reboot_wanted() const {
    return app_wants_reboot;
}

} // namespace omni

extern "C" {

void time_begin(uint32_t cycles_per_us, uint32_t cycles) {
    time_.renew(cycles_per_us, cycles);
}
uint64_t time_us(uint32_t cycles) {
    (*time_).advance(cycles);
    return (*time_).us();
}
uint64_t time_ns(uint32_t cycles) {
    (*time_).advance(cycles);
    return (*time_).ns();
}

void port_begin(uint32_t baud) {
    usb.renew();
    radio.renew().begin(baud);
}
uint32_t usb_session() {
    return (*usb).session();
}
size_t usb_read(uint8_t *data, size_t capacity) {
    return (*usb).read(data, capacity);
}
size_t usb_space() {
    return (*usb).write_space();
}
bool usb_write(const uint8_t *data, size_t length) {
    return (*usb).write(data, length);
}
size_t radio_read(uint8_t *data, size_t capacity) {
    return (*radio).read(data, capacity);
}
size_t radio_space() {
    return (*radio).write_space();
}
bool radio_write(const uint8_t *data, size_t length) {
    return (*radio).write(data, length);
}
void radio_set_baud(uint32_t baud) {
    (*radio).set_baud(baud);
}

void watchdog_begin() {
    watchdog.renew().begin();
}
void watchdog_start() {
    (*watchdog).start();
}
void watchdog_expect_erase(bool begins) {
    (*watchdog).expect_erase(begins);
}
void watchdog_tick() {
    (*watchdog).tick();
}
void watchdog_feed() {
    (*watchdog).feed();
}
int watchdog_cause() {
    return static_cast<int>((*watchdog).reset_cause());
}
const char *watchdog_line(size_t number) {
    return (*watchdog).crash_line(number);
}
void watchdog_reset() {
    (*watchdog).reset();
}

void battery_begin(uint8_t pin, float divider) {
    battery.renew(pin, divider).begin();
}
float battery_sample() {
    (*battery).sample();
    return (*battery).volts();
}

/// Power on: what is known comes from the flash memory.
void storage_begin(bool running) {
    flash.renew(*watchdog);
    storage.renew(*flash).begin();
    if (running) {
        (*flash).watched();
    }
}
bool storage_write(size_t offset, const uint8_t *data, size_t length) {
    return (*storage).write(offset, data, length);
}
bool storage_read(size_t offset, uint8_t *data, size_t length) {
    return (*storage).read(offset, data, length);
}
size_t storage_size() {
    return (*storage).size();
}
bool storage_doubtful() {
    return (*storage).may_hold_unreadable_data();
}
uint32_t storage_late_erases() {
    return (*storage).late_erases();
}
/// Without the log: the driver alone.
void flash_program(size_t sector, size_t offset, const uint8_t *data, size_t length) {
    (*flash).program(sector, offset, data, length);
}
size_t param_count() {
    return OMNI_PARAM_COUNT;
}
/// @return omni::StoreResult
int param_save(const float *values, const float *robot_values) {
    omni::ParamStore store(*storage);
    return static_cast<int>(store.save(values, robot_values));
}
int param_load(float *values) {
    omni::ParamStore store(*storage);
    return static_cast<int>(store.load(values));
}

void main_setup() {
    app_wants_reboot = false;
    app_ticks_feed = true;
    setup();
}
void main_loop() {
    loop();
}
void app_background_hangs() {
    app_ticks_feed = false;
}
void app_asks_for_reboot() {
    app_wants_reboot = true;
}
uint64_t board_now_us() {
    return app_board.clock->now_us();
}
/// Fill the application's memory with this byte.
bool board_storage_fill(uint8_t value) {
    uint8_t bytes[omni::FlashLog::capacity];
    std::fill(bytes, bytes + sizeof bytes, value);
    return app_board.storage->write(0, bytes, sizeof bytes);
}
size_t board_ports() {
    return app_board.port_count;
}
uint64_t board_serial_number() {
    return app_board.serial_number;
}
float board_battery_V() {
    return app_board.battery_V();
}
void board_output_enable(bool on) {
    app_board.output_enable->set(on);
}
void board_output_enable_release() {
    app_board.output_enable->release();
}
bool board_output_enable_wired() {
    return app_board.output_enable->wired();
}
bool board_stop_button_open() {
    return app_board.stop_button->open();
}
void board_light(bool on) {
    app_board.light->set(on);
}
}
