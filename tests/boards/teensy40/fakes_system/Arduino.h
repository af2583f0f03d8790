// SPDX-License-Identifier: MIT
// The few Teensyduino names that the board layer's system part uses, as variables and functions of a model of the chip.
// Test code moves the model through fake_teensy.h.
#pragma once

#include <cstddef>
#include <cstdint>
#include <cstring>

// Processor
extern volatile uint32_t F_CPU_ACTUAL;
struct FakeCycleCounter {
    operator uint32_t();
};
extern FakeCycleCounter ARM_DWT_CYCCNT;

struct arm_fault_info_struct {
    uint32_t len, ipsr, cfsr, hfsr, mmfar, bfar, ret, xpsr;
    float temp;
    uint32_t time, crc;
};

// Reset flags: a write of 1 clears, of the temperature sensor's a write of 0.
constexpr uint32_t SRC_SRSR_IPP_RESET_B = 1u << 0;
constexpr uint32_t SRC_SRSR_LOCKUP_SYSRESETREQ = 1u << 1;
constexpr uint32_t SRC_SRSR_CSU_RESET_B = 1u << 2;
constexpr uint32_t SRC_SRSR_IPP_USER_RESET_B = 1u << 3;
constexpr uint32_t SRC_SRSR_WDOG_RST_B = 1u << 4;
constexpr uint32_t SRC_SRSR_JTAG_RST_B = 1u << 5;
constexpr uint32_t SRC_SRSR_JTAG_SW_RST = 1u << 6;
constexpr uint32_t SRC_SRSR_WDOG3_RST_B = 1u << 7;
constexpr uint32_t SRC_SRSR_TEMPSENSE_RST_B = 1u << 8;
struct FakeResetFlags {
    uint32_t flags;
    void operator=(uint32_t written);
    operator uint32_t() const { return flags; }
};
extern FakeResetFlags SRC_SRSR;
extern volatile uint32_t SRC_GPR5;
enum IRQ_NUMBER_t { IRQ_TEMPERATURE_PANIC = 64 };

// Watchdog 3: what is written to the counter register is a command. The others take a value only while it is unlocked,
// and a new configuration holds once each of them was written.
struct FakeWatchdogCounter {
    void operator=(uint32_t command);
    operator uint32_t() const;
};
struct FakeWatchdogControl {
    void operator=(uint32_t value);
    operator uint32_t() const;
};
struct FakeWatchdogLimit {
    uint32_t value;
    bool written;
    void operator=(uint32_t counts);
};
extern FakeWatchdogCounter WDOG3_CNT;
extern FakeWatchdogControl WDOG3_CS;
extern FakeWatchdogLimit WDOG3_TOVAL, WDOG3_WIN;
extern volatile uint32_t CCM_CCGR5;
constexpr uint32_t CCM_CCGR_ON = 3;
constexpr uint32_t CCM_CCGR5_WDOG3(uint32_t n) {
    return n << 4;
}
constexpr uint32_t WDOG_CS_UPDATE = 1u << 5, WDOG_CS_EN = 1u << 7, WDOG_CS_RCS = 1u << 10, WDOG_CS_ULK = 1u << 11,
                   WDOG_CS_CMD32EN = 1u << 13, WDOG_CS_FLG = 1u << 14;
constexpr uint32_t WDOG_CS_CLK(uint32_t n) {
    return n << 8;
}

// Analog-digital converters
#define DMAMEM
extern volatile uint32_t HW_OCOTP_MAC0; ///< lower half of the MAC address that is burnt into the chip
extern volatile uint32_t ADC1_HC0, ADC1_HS, ADC1_R0, ADC2_HC0, ADC2_HS, ADC2_R0;
constexpr uint32_t ADC_HS_COCO0 = 1;
void analogReadResolution(unsigned bits);
int analogRead(uint8_t pin);

// Pins
constexpr uint8_t LOW = 0, HIGH = 1, OUTPUT = 1, INPUT = 0, INPUT_PULLUP = 2;
void pinMode(uint8_t pin, uint8_t mode);
void digitalWrite(uint8_t pin, uint8_t level);
uint8_t digitalRead(uint8_t pin);
struct FakeSetRegister {
    uint8_t pin;
    void operator=(uint32_t mask) volatile;
};
volatile FakeSetRegister *portSetRegister(uint8_t pin);
volatile uint32_t *portClearRegister(uint8_t pin);
volatile uint32_t *portConfigRegister(uint8_t pin);
void analogWriteResolution(unsigned bits);
void analogWriteFrequency(uint8_t pin, float frequency_Hz);
void analogWrite(uint8_t pin, int value);
constexpr uint32_t digitalPinToBitMask(uint8_t pin) {
    return 1u << pin;
}

// USB
struct FakeUsbSerial {
    uint8_t dtr();
    uint32_t baud();
};
extern FakeUsbSerial Serial;
extern volatile uint8_t usb_configuration;
extern volatile uint32_t USB1_PORTSC1;
constexpr uint32_t USB_PORTSC1_SUSP = 1u << 7;
int usb_serial_read(void *buffer, uint32_t size);
int usb_serial_write(const void *buffer, uint32_t size);
int usb_serial_write_buffer_free();
void usb_serial_flush_input();
void usb_serial_flush_output();
constexpr int IRQ_USB1 = 113;
void NVIC_DISABLE_IRQ(int number);
void NVIC_ENABLE_IRQ(int number);

// Serial1
struct FakeHardwareSerial {
    void addMemoryForWrite(void *memory, size_t length);
    void addMemoryForRead(void *memory, size_t length);
    void begin(uint32_t baud);
    int available();
    int read();
    int availableForWrite();
    size_t write(const uint8_t *data, size_t length);
};
extern FakeHardwareSerial Serial1;
extern volatile uint32_t LPUART6_STAT;
constexpr uint32_t LPUART_STAT_TC = 1u << 22; ///< the shift register is empty
