// SPDX-License-Identifier: MIT
#include "boards/teensy40/encoders.h"

#include "boards/teensy40/priorities.h"
#include "boards/teensy40/processor.h"

/// Teensyduino's own (pwm.c), declared in no header of it.
extern "C" void xbar_connect(unsigned int input, unsigned int output);

namespace omni {
namespace {

constexpr uint32_t pad_input =
    IOMUXC_PAD_HYS | IOMUXC_PAD_PKE | IOMUXC_PAD_PUE | IOMUXC_PAD_PUS(1); ///< 47 kohm pull-up
constexpr uint32_t mux_gpio = 5;
/// Six equal samples, 25 periods of the 150 MHz bus clock apart: pulses below 1 us are noise.
constexpr uint16_t filter_1_us = (3 << 8) | 25;
constexpr uint16_t both_changed = 1 << 11; ///< CTRL2.SABIRQ, cleared by writing 1

/// Registers of a GPIO port, counted from DR.
enum GpioRegister : uint8_t { gpio_direction = 1, gpio_pad = 2, gpio_mask = 5, gpio_status = 6, gpio_both_edges = 7 };

Teensy40Encoders *owner = nullptr;

void on_pins_changed() {
    owner->pins_changed();
}

IMXRT_ENC_t &decoder(uint8_t unit) {
    switch (unit) {
    case 0:
        return IMXRT_ENC1;
    case 1:
        return IMXRT_ENC2;
    case 2:
        return IMXRT_ENC3;
    default:
        return IMXRT_ENC4;
    }
}

unsigned int phase_a_output(uint8_t unit) {
    constexpr unsigned int next_unit = XBARA1_OUT_ENC2_PHASEA_INPUT - XBARA1_OUT_ENC1_PHASEA_INPUT;
    return XBARA1_OUT_ENC1_PHASEA_INPUT + unit * next_unit;
}

/// Inputs 10 and 16 come from one pad each and need no choice.
void select_pad(const XbarPin &pin) {
    switch (pin.input) {
    case 6:
        IOMUXC_XBAR1_IN06_SELECT_INPUT = pin.daisy;
        break;
    case 7:
        IOMUXC_XBAR1_IN07_SELECT_INPUT = pin.daisy;
        break;
    case 8:
        IOMUXC_XBAR1_IN08_SELECT_INPUT = pin.daisy;
        break;
    case 9:
        IOMUXC_XBAR1_IN09_SELECT_INPUT = pin.daisy;
        break;
    case 14:
        IOMUXC_XBAR1_IN14_SELECT_INPUT = pin.daisy;
        break;
    case 15:
        IOMUXC_XBAR1_IN15_SELECT_INPUT = pin.daisy;
        break;
    case 17:
        IOMUXC_XBAR1_IN17_SELECT_INPUT = pin.daisy;
        break;
    case 22:
        IOMUXC_XBAR1_IN22_SELECT_INPUT = pin.daisy;
        break;
    case 23:
        IOMUXC_XBAR1_IN23_SELECT_INPUT = pin.daisy;
        break;
    default:
        break;
    }
}

void route(uint8_t number, unsigned int xbar_output) {
    const XbarPin &pin = *find_xbar_pin(number);
    *portControlRegister(number) = pad_input;
    *portConfigRegister(number) = pin.mux;
    select_pad(pin);
    xbar_connect(pin.input, xbar_output);
}

/// UPOS latches the lower half, so the two belong together.
int32_t position(IMXRT_ENC_t &unit) {
    const uint32_t upper = unit.UPOS;
    const uint32_t lower = unit.LPOSH;
    return static_cast<int32_t>(upper << 16 | lower);
}

} // namespace

void Teensy40Encoders::begin_hardware(const EncoderChannel &channel) {
    route(channel.pin_a, phase_a_output(channel.unit));
    route(channel.pin_b, phase_a_output(channel.unit) + 1);
    IMXRT_ENC_t &unit = decoder(channel.unit);
    unit.CTRL = 0; // quadrature, no index, no home, no watchdog
    unit.FILT = filter_1_us;
    unit.CTRL2 = both_changed; // no modulus: wraps at 32 bits
    unit.UPOS = 0;
    unit.LPOS = 0;
}

void Teensy40Encoders::begin_interrupt(uint8_t wheel) {
    Watched &watched = watched_[watched_count_];
    watched.wheel = wheel;
    watched.edges = 0;
    watched.silent = false;
    const uint8_t pins[] = {plan_.wheel[wheel].pin_a, plan_.wheel[wheel].pin_b};
    for (size_t i = 0; i < 2; ++i) {
        const Gpio port = portOutputRegister(pins[i]);
        const uint32_t mask = digitalPinToBitMask(pins[i]);
        watched.port[i] = port;
        watched.mask[i] = mask;
        *portControlRegister(pins[i]) = pad_input;
        *portConfigRegister(pins[i]) = mux_gpio;
        port[gpio_direction] = port[gpio_direction] & ~mask;
        port[gpio_both_edges] = port[gpio_both_edges] | mask;
        port[gpio_status] = mask;
        port[gpio_mask] = port[gpio_mask] | mask;
    }
    watched.counter.begin(levels(watched));
    ++watched_count_;
}

// Teensyduino's attachInterrupt calls one argument-less function per pin; here A and B are sampled together and once.
void Teensy40Encoders::begin() {
    CCM_CCGR2 = CCM_CCGR2 | CCM_CCGR2_XBAR1(CCM_CCGR_ON);
    CCM_CCGR4 = CCM_CCGR4 | CCM_CCGR4_ENC1(CCM_CCGR_ON) | CCM_CCGR4_ENC2(CCM_CCGR_ON) | CCM_CCGR4_ENC3(CCM_CCGR_ON) |
                CCM_CCGR4_ENC4(CCM_CCGR_ON);
    owner = this;
    watched_count_ = 0;
    for (uint8_t i = 0; i < plan_.wheels; ++i) {
        if (plan_.wheel[i].unit == EncoderChannel::by_interrupt) {
            begin_interrupt(i);
        } else {
            begin_hardware(plan_.wheel[i]);
        }
    }
    if (watched_count_ > 0) {
        attachInterruptVector(IRQ_GPIO6789, on_pins_changed);
        NVIC_SET_PRIORITY(IRQ_GPIO6789, priority_encoder_edges);
        NVIC_ENABLE_IRQ(IRQ_GPIO6789);
    }
}

uint8_t Teensy40Encoders::levels(const Watched &watched) {
    const uint32_t a_port = watched.port[0][gpio_pad];
    const uint32_t b_port = watched.port[1] == watched.port[0] ? a_port : uint32_t{watched.port[1][gpio_pad]};
    const uint8_t a = (a_port & watched.mask[0]) != 0 ? 2 : 0;
    return (b_port & watched.mask[1]) != 0 ? a | 1 : a;
}

/// The read back makes sure that the port has taken it before an interrupt ends.
void Teensy40Encoders::mask(const Watched &watched, bool masked) {
    for (size_t i = 0; i < 2; ++i) {
        const Gpio port = watched.port[i];
        const uint32_t others = port[gpio_mask] & ~watched.mask[i];
        port[gpio_mask] = masked ? others : others | watched.mask[i];
        static_cast<void>(uint32_t{port[gpio_mask]});
    }
}

// Flags are cleared before the levels are read: an edge in between interrupts again and finds nothing new. The read of
// the same port also makes sure that the flag is down before this interrupt ends.
void Teensy40Encoders::pins_changed() {
    for (uint8_t i = 0; i < watched_count_; ++i) {
        Watched &watched = watched_[i];
        const uint32_t changed =
            (watched.port[0][gpio_status] & watched.mask[0]) | (watched.port[1][gpio_status] & watched.mask[1]);
        if (changed == 0 || watched.silent) {
            continue;
        }
        if (watched.edges >= edge_limit) {
            watched.silent = true;
            mask(watched, true);
            continue;
        }
        watched.edges = static_cast<uint16_t>(watched.edges + 1);
        watched.port[0][gpio_status] = watched.mask[0];
        watched.port[1][gpio_status] = watched.mask[1];
        watched.counter.update(levels(watched));
    }
}

/// Flags come up while a pin is masked, too: they are old.
void Teensy40Encoders::listen_again(Watched &watched) {
    const InterruptLock lock; // other encoders' interrupts write the same mask registers
    watched.port[0][gpio_status] = watched.mask[0];
    watched.port[1][gpio_status] = watched.mask[1];
    watched.counter.resume(levels(watched));
    watched.silent = false;
    mask(watched, false);
}

uint8_t Teensy40Encoders::read(int32_t *counts) {
    uint32_t trusted = (1u << plan_.wheels) - 1u;
    for (uint8_t i = 0; i < watched_count_; ++i) {
        Watched &watched = watched_[i];
        counts[watched.wheel] = watched.counter.count();
        if (watched.silent) {
            trusted &= ~(1u << watched.wheel);
            listen_again(watched);
        }
        watched.edges = 0;
    }
    for (uint8_t i = 0; i < plan_.wheels; ++i) {
        if (plan_.wheel[i].unit == EncoderChannel::by_interrupt) {
            continue;
        }
        IMXRT_ENC_t &unit = decoder(plan_.wheel[i].unit);
        counts[i] = position(unit);
        if ((unit.CTRL2 & both_changed) != 0) {
            unit.CTRL2 = both_changed;
            ++hardware_errors_[i];
        }
    }
    return static_cast<uint8_t>(trusted);
}

void Teensy40Encoders::errors(uint32_t *errors) {
    for (uint8_t i = 0; i < plan_.wheels; ++i) {
        errors[i] = hardware_errors_[i];
    }
    for (uint8_t i = 0; i < watched_count_; ++i) {
        errors[watched_[i].wheel] = watched_[i].counter.errors();
    }
}

} // namespace omni
