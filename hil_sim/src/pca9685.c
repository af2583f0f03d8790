/* SPDX-License-Identifier: MIT */
#include "hil_sim/pca9685.h"

#include <string.h>

enum {
    MODE1 = 0x00,
    MODE2 = 0x01,
    SUBADR1 = 0x02,
    ALLCALLADR = 0x05,
    LED0_ON_L = 0x06,
    LED15_OFF_H = 0x45,
    ALL_LED_ON_L = 0xFA,
    ALL_LED_OFF_H = 0xFD,
    PRESCALE = 0xFE,
    TESTMODE = 0xFF,

    RESTART = 0x80,
    EXTCLK = 0x40,
    AUTO_INCREMENT = 0x20,
    SLEEP = 0x10,
    SUB1 = 0x08,
    ALLCALL = 0x01,
    MODE2_OCH = 0x08,
    MODE2_INVERT = 0x10,
    MODE2_OUTDRV = 0x04,
    MODE2_OUTNE = 0x03,
    OUTNE_HIGH = 0x01,
    MODE2_MASK = 0x1F,

    FULL = 0x10, /* in ON_H: always high; in OFF_H: always low */
    HIGH_BYTE_MASK = 0x1F,
    GENERAL_CALL = 0x00,
    SOFTWARE_RESET = 0x06,
    PRESCALE_MIN = 3,
    STEPS = 4096,
    CHANNEL_REGISTERS = 4
};

static const double OSCILLATOR_Hz = 25e6;

/* The outputs follow the registers. */
static void latch(hil_pca9685_t *chip) {
    memcpy(chip->outputs, chip->registers + LED0_ON_L, sizeof chip->outputs);
}

void hil_pca9685_reset(hil_pca9685_t *chip, uint8_t address) {
    const bool output_enable_high = chip->output_enable_high; /* a pin, not a register */
    memset(chip, 0, sizeof *chip);
    chip->output_enable_high = output_enable_high;
    chip->address = address;
    chip->registers[MODE1] = SLEEP | ALLCALL;
    chip->registers[MODE2] = 0x04;
    chip->registers[SUBADR1] = 0xE2;
    chip->registers[SUBADR1 + 1] = 0xE4;
    chip->registers[SUBADR1 + 2] = 0xE8;
    chip->registers[ALLCALLADR] = 0xE0;
    chip->registers[PRESCALE] = 0x1E;
    for (uint32_t reg = LED0_ON_L + 3; reg <= LED15_OFF_H; reg += CHANNEL_REGISTERS) {
        chip->registers[reg] = FULL;
    }
    latch(chip);
}

/* The sub-addresses and the all-call address live in registers, shifted left by the read/write bit. */
static bool addressed(const hil_pca9685_t *chip, uint8_t address) {
    if (address == chip->address) {
        return true;
    }
    const uint8_t mode1 = chip->registers[MODE1];
    for (uint32_t sub = 0; sub < 3; sub++) {
        if ((mode1 & (SUB1 >> sub)) != 0 && address == chip->registers[SUBADR1 + sub] >> 1) {
            return true;
        }
    }
    return (mode1 & ALLCALL) != 0 && address == chip->registers[ALLCALLADR] >> 1;
}

static bool is_led(uint8_t reg) {
    return reg >= LED0_ON_L && reg <= LED15_OFF_H;
}

static bool is_all_led(uint8_t reg) {
    return reg >= ALL_LED_ON_L && reg <= ALL_LED_OFF_H;
}

static void advance(hil_pca9685_t *chip) {
    if ((chip->registers[MODE1] & AUTO_INCREMENT) == 0) {
        return;
    }
    const bool last = chip->pointer == LED15_OFF_H || chip->pointer == PRESCALE;
    chip->pointer = last ? MODE1 : (uint8_t)(chip->pointer + 1);
}

static bool any_channel_running(const hil_pca9685_t *chip) {
    for (uint32_t reg = LED0_ON_L + 3; reg <= LED15_OFF_H; reg += CHANNEL_REGISTERS) {
        if ((chip->registers[reg] & FULL) == 0) {
            return true;
        }
    }
    return false;
}

static void write_mode1(hil_pca9685_t *chip, uint8_t value) {
    const uint8_t old = chip->registers[MODE1];
    uint8_t kept = (uint8_t)((value & ~(RESTART | EXTCLK)) | (old & (RESTART | EXTCLK)));
    if ((old & SLEEP) != 0 && (value & (SLEEP | EXTCLK)) == (SLEEP | EXTCLK)) {
        kept |= EXTCLK; /* sticky: only a reset clears it */
    }
    if ((old & SLEEP) == 0 && (value & SLEEP) != 0 && any_channel_running(chip)) {
        kept |= RESTART;
    }
    if ((old & SLEEP) == 0 && (value & RESTART) != 0) {
        kept &= (uint8_t)~RESTART;
    }
    chip->registers[MODE1] = kept;
}

static void write_all_led(hil_pca9685_t *chip, uint8_t reg, uint8_t value) {
    for (uint32_t led = LED0_ON_L + (uint32_t)(reg - ALL_LED_ON_L); led <= LED15_OFF_H; led += CHANNEL_REGISTERS) {
        chip->registers[led] = value;
    }
}

static uint8_t led_value(uint8_t reg_in_channel, uint8_t value) {
    return (reg_in_channel & 1) != 0 ? value & HIGH_BYTE_MASK : value;
}

static void write_prescale(hil_pca9685_t *chip, uint8_t value) {
    if ((chip->registers[MODE1] & SLEEP) == 0) {
        chip->ignored_writes++;
        return;
    }
    chip->registers[PRESCALE] = value < PRESCALE_MIN ? PRESCALE_MIN : value;
}

static void write_register(hil_pca9685_t *chip, uint8_t value) {
    const uint8_t reg = chip->pointer;
    if (reg == MODE1) {
        write_mode1(chip, value);
    } else if (reg == MODE2) {
        chip->registers[MODE2] = value & MODE2_MASK;
    } else if (reg <= ALLCALLADR) {
        chip->registers[reg] = value & 0xFE;
    } else if (is_led(reg)) {
        chip->registers[reg] = led_value((uint8_t)((reg - LED0_ON_L) % CHANNEL_REGISTERS), value);
    } else if (is_all_led(reg)) {
        write_all_led(chip, reg, led_value((uint8_t)(reg - ALL_LED_ON_L), value));
    } else if (reg == PRESCALE) {
        write_prescale(chip, value);
    } else {
        chip->ignored_writes++; /* reserved, or TestMode */
    }
}

/* Touching the PWM registers forgets the interrupted state. Any of them does if outputs change on STOP, all four of a
 * channel if they change on ACK. */
static bool forgets_restart(const hil_pca9685_t *chip, uint32_t led_writes) {
    const bool on_ack = (chip->registers[MODE2] & MODE2_OCH) != 0;
    return led_writes >= (on_ack ? (uint32_t)CHANNEL_REGISTERS : 1u);
}

/* A write is over: a STOP or a repeated START. */
static void end_write(hil_pca9685_t *chip) {
    if (chip->talk == HIL_PCA9685_WRITTEN && forgets_restart(chip, chip->led_writes)) {
        chip->registers[MODE1] &= (uint8_t)~RESTART;
    }
    chip->talk = HIL_PCA9685_SILENT;
    chip->led_writes = 0;
}

bool hil_pca9685_start(hil_pca9685_t *chip, uint8_t address, bool read) {
    end_write(chip);
    if (read) {
        chip->talk = address == chip->address ? HIL_PCA9685_READ : HIL_PCA9685_SILENT;
    } else if (address == GENERAL_CALL) {
        chip->talk = HIL_PCA9685_CALLED;
    } else {
        chip->talk = addressed(chip, address) ? HIL_PCA9685_ADDRESSED : HIL_PCA9685_SILENT;
    }
    return chip->talk != HIL_PCA9685_SILENT;
}

static void put_data(hil_pca9685_t *chip, uint8_t byte) {
    const uint8_t reg = chip->pointer;
    const bool led = is_led(reg) || is_all_led(reg);
    chip->led_writes += led;
    write_register(chip, byte);
    const bool last = is_led(reg) ? (reg - LED0_ON_L) % CHANNEL_REGISTERS == 3 : reg == ALL_LED_OFF_H;
    if (led && last && (chip->registers[MODE2] & MODE2_OCH) != 0) {
        latch(chip);
    }
    advance(chip);
}

bool hil_pca9685_put(hil_pca9685_t *chip, uint8_t byte) {
    switch (chip->talk) {
    case HIL_PCA9685_CALLED:
        chip->talk = byte == SOFTWARE_RESET ? HIL_PCA9685_TOLD_TO_RESET : HIL_PCA9685_SILENT;
        break;
    case HIL_PCA9685_ADDRESSED:
        chip->pointer = byte;
        chip->talk = HIL_PCA9685_WRITTEN;
        break;
    case HIL_PCA9685_WRITTEN:
        put_data(chip, byte);
        break;
    default:
        chip->talk = HIL_PCA9685_SILENT;
        break;
    }
    return chip->talk != HIL_PCA9685_SILENT;
}

uint8_t hil_pca9685_get(hil_pca9685_t *chip) {
    if (chip->talk != HIL_PCA9685_READ) {
        return 0xFF;
    }
    const uint8_t byte = chip->registers[chip->pointer]; /* ALL_LED, reserved and TestMode hold 0 */
    advance(chip);
    return byte;
}

void hil_pca9685_stop(hil_pca9685_t *chip) {
    const bool reset = chip->talk == HIL_PCA9685_TOLD_TO_RESET;
    end_write(chip);
    if (reset) {
        hil_pca9685_reset(chip, chip->address);
    }
    latch(chip);
}

bool hil_pca9685_write(hil_pca9685_t *chip, uint8_t address, const uint8_t *data, uint32_t length) {
    bool acknowledged = hil_pca9685_start(chip, address, false);
    for (uint32_t i = 0; i < length && acknowledged; i++) {
        acknowledged = hil_pca9685_put(chip, data[i]);
    }
    hil_pca9685_stop(chip);
    return acknowledged;
}

bool hil_pca9685_read(hil_pca9685_t *chip, uint8_t address, uint8_t *data, uint32_t length) {
    const bool acknowledged = hil_pca9685_start(chip, address, true);
    for (uint32_t i = 0; i < length && acknowledged; i++) {
        data[i] = hil_pca9685_get(chip);
    }
    hil_pca9685_stop(chip);
    return acknowledged;
}

static uint32_t twelve_bits(const uint8_t *low_high) {
    return (uint32_t)low_high[0] | (uint32_t)(low_high[1] & 0x0F) << 8;
}

static double programmed_duty(const uint8_t *led) {
    if ((led[3] & FULL) != 0) {
        return 0.0;
    }
    if ((led[1] & FULL) != 0) {
        return 1.0;
    }
    return (double)((twelve_bits(led + 2) - twelve_bits(led)) % STEPS) / (double)STEPS;
}

static const uint8_t *channel_registers(const hil_pca9685_t *chip, uint32_t channel) {
    return chip->outputs + (size_t)CHANNEL_REGISTERS * channel;
}

/* Level of an output while OE is high. */
static double disabled_level(const hil_pca9685_t *chip) {
    const uint8_t mode2 = chip->registers[MODE2];
    return (mode2 & MODE2_OUTNE) == OUTNE_HIGH && (mode2 & MODE2_OUTDRV) != 0 ? 1.0 : 0.0;
}

double hil_pca9685_duty(const hil_pca9685_t *chip, uint32_t channel) {
    const bool stopped = (chip->registers[MODE1] & (SLEEP | RESTART | EXTCLK)) != 0;
    if (channel >= HIL_PCA9685_CHANNELS) {
        return 0.0;
    }
    if (chip->output_enable_high) {
        return disabled_level(chip);
    }
    if (stopped) {
        return 0.0;
    }
    const double duty = programmed_duty(channel_registers(chip, channel));
    return (chip->registers[MODE2] & MODE2_INVERT) != 0 ? 1.0 - duty : duty;
}

double hil_pca9685_phase(const hil_pca9685_t *chip, uint32_t channel) {
    if (channel >= HIL_PCA9685_CHANNELS) {
        return 0.0;
    }
    const uint8_t *led = channel_registers(chip, channel);
    const bool inverted = (chip->registers[MODE2] & MODE2_INVERT) != 0;
    return (double)twelve_bits(inverted ? led + 2 : led) / (double)STEPS;
}

double hil_pca9685_frequency_Hz(const hil_pca9685_t *chip) {
    return OSCILLATOR_Hz / ((double)STEPS * (chip->registers[PRESCALE] + 1.0));
}
