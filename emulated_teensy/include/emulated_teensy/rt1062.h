/* SPDX-License-Identifier: MIT */
/**
 * @file rt1062.h
 * A machine that runs the image which is flashed: an i.MX RT1062 as on a Teensy 4.0, as far as the firmware uses it.
 *
 * The processor is Unicorn's Cortex-M7 (PyPI's `unicorn`, opened at run time); interrupts, clocks, timers, flash
 * memory, watchdog, pins and links are modelled here. A register that is not modelled is an error when it is touched,
 * never a zero.
 *
 * Not modelled: caches and write buffers, cycle times (an instruction takes a fixed time), analog behaviour, electrical
 * limits. See rt1062_not_modelled().
 *
 * One machine per thread at a time. The functions return when the robot's time or an event is reached; none looks at
 * the wall clock.
 */
#ifndef EMULATED_TEENSY_RT1062_H
#define EMULATED_TEENSY_RT1062_H

#include <stdbool.h>
#include <stdint.h>

enum {
    RT1062_TEXT = 256,
    RT1062_OUTPUT_COUNT = 2,
    RT1062_OUTPUT_SIZE = 65536,
    RT1062_FINDINGS = 64,
    RT1062_EDGES = 8192,
    RT1062_NO_PIN = 255,
    RT1062_ENCODERS = 4,
    RT1062_PWM_PINS = 2 * RT1062_ENCODERS,
    RT1062_I2C_BUSES = 3,     /**< Teensy's Wire, Wire1, Wire2 */
    RT1062_DUTY_STEPS = 4096, /**< of a duty of 1 */
    RT1062_STEP_us = 1000     /**< a circuit is stepped so often */
};

typedef struct rt1062_t rt1062_t;

/** Byte streams between the machine and the outside. */
typedef enum rt1062_channel_t {
    RT1062_USB = 0,  /**< the USB serial port */
    RT1062_UART = 1, /**< LPUART6: Serial1, the radio */
} rt1062_channel_t;

/** Why a run ended. */
typedef enum rt1062_stop_t {
    RT1062_STOP_TIME = 0, /**< the asked time is reached */
    RT1062_STOP_BREAK,    /**< the processor is at a break point */
    RT1062_STOP_OUTPUT,   /**< a channel has bytes, and the caller wanted to know */
    RT1062_STOP_RESET,    /**< the chip was reset, by watchdog or program, and the caller wanted to know; it has booted
                             again */
    RT1062_STOP_POWER,    /**< the power was cut as asked */
    RT1062_STOP_UPLOAD,   /**< the program jumped to the uploader (bkpt #251) */
    RT1062_STOP_REFUSED   /**< the model can't go on; rt1062_why() */
} rt1062_stop_t;

/** What was seen that a robot's program must not do, or that only happens in trouble. */
typedef enum rt1062_finding_kind_t {
    RT1062_FINDING_FAULT = 0,    /**< the processor took a fault exception */
    RT1062_FINDING_DEVICE_WIDTH, /**< unaligned access to Device memory, or by LDRD, LDM and others that want words: a
                                    fault, too */
    RT1062_FINDING_FLASH,    /**< flash memory was asked for what it can't do: setting bits, crossing a page, a command
                                while busy */
    RT1062_FINDING_WATCHDOG, /**< watchdog registers written outside their windows */
    RT1062_FINDING_STORM,    /**< an interrupt returned many times in a row without its cause being taken away */
    RT1062_FINDING_PINS,     /**< two drivers on a pin, a peripheral whose pad is not connected to it */
    RT1062_FINDING_CLOCK,    /**< a peripheral used while its clock is off */
    RT1062_FINDING_STACK,    /**< an exception's frame below the stack's end: over the program's variables */
    RT1062_FINDING_KIND_COUNT
} rt1062_finding_kind_t;

typedef struct rt1062_finding_t {
    uint32_t kind; /**< rt1062_finding_kind_t */
    uint32_t pc;
    uint32_t address;
    uint32_t count; /**< times the same was found at the same pc */
    uint64_t time_ns;
    char text[160];
} rt1062_finding_t;

/** A change at the I2C lines: the levels from then on. */
typedef struct rt1062_edge_t {
    uint64_t time_ps;
    int8_t scl;
    int8_t sda;
} rt1062_edge_t;

typedef struct rt1062_config_t {
    uint32_t instruction_ns; /**< time of an instruction; on the chip about 1. 10: as many instructions per second as a
                                PC can emulate */
    bool exact;  /**< interrupts may come between any two instructions, not only between basic blocks; slower */
    bool strict; /**< see every access before it happens. Faults at their instruction are unaligned ones to Device
                 memory, and those to forbidden regions smaller than a page. Half as fast */
    bool words; /**< fault on LDRD, LDM, VLDR and others that want words, where the address is no multiple of four; less
                   than half as fast again. Without it such an access goes through */
    uint64_t seed; /**< of everything that is drawn at random: erase times, bits of a write cut off, RAM at power-on */
    uint8_t encoder_pin[RT1062_ENCODERS][2]; /**< Teensy pin numbers of A and B, RT1062_NO_PIN: none */
    uint8_t pwm_pin[RT1062_PWM_PINS];        /**< pins whose duty the circuit gets; RT1062_NO_PIN: none. Each is pulled
                                                down */
    uint8_t output_enable_pin;               /**< active low, pulled up; RT1062_NO_PIN: not wired */
    uint8_t stop_button_pin;                 /**< of a contact to ground that is normally closed; RT1062_NO_PIN: none */
    uint8_t battery_pin;                     /**< RT1062_NO_PIN: not measured */
    double battery_divider;                  /**< V of the battery per V at the pin */
} rt1062_config_t;

/** The circuit around the chip. A machine calls these while it runs, in its own thread; each gets `context`. */
typedef struct rt1062_circuit_t {
    void *context;
    uint32_t encoders;       /**< that are connected, at most RT1062_ENCODERS */
    uint32_t i2c_buses;      /**< a bit per bus that has pull-up resistors and may have chips */
    double pwm_frequency_Hz; /**< that is expected at the PWM pins; another one is a finding */
    uint32_t state_size;     /**< bytes that save() writes, a part of a machine's snapshot */
    /** The circuit is connected, at power-on and by rt1062_attach(). @return NULL, or why the run cannot begin. */
    const char *(*power_on)(void *context);
    /** Time has passed: RT1062_STEP_us. @return NULL, or why the circuit cannot go on: the run ends. */
    const char *(*step)(void *context, uint64_t now_us);
    /** @param counts out: quadrature counts of each encoder. Their edges come evenly over the next step. */
    void (*encoder_counts)(void *context, int32_t *counts);
    /** @param steps duty of each PWM pin, 0 to RT1062_DUTY_STEPS. */
    void (*duties)(void *context, const uint16_t *steps);
    void (*output_enable)(void *context, bool enabled);
    bool (*stop_button_open)(void *context);
    double (*battery_V)(void *context);
    /** Which lines of a bus something holds low. */
    void (*i2c_stuck)(void *context, uint32_t bus, bool *scl, bool *sda);
    /** START or repeated START and an address byte. @param address 7 bit. @return true: acknowledged. */
    bool (*i2c_start)(void *context, uint32_t bus, uint64_t now_us, uint8_t address, bool read);
    /** A byte from the master. @return true: acknowledged. */
    bool (*i2c_put)(void *context, uint32_t bus, uint8_t byte);
    /** A byte for the master. */
    uint8_t (*i2c_get)(void *context, uint32_t bus);
    void (*i2c_stop)(void *context, uint32_t bus);
    void (*save)(const void *context, void *state);
    void (*restore)(void *context, const void *state);
} rt1062_circuit_t;

/**
 * Make a machine; flash memory is erased, the power is off.
 * @param unicorn_library path of Unicorn's shared library. @param why out, at most why_size bytes. @return NULL on
 * failure.
 */
rt1062_t *rt1062_new(const char *unicorn_library, const rt1062_config_t *config, char *why, uint32_t why_size);
void rt1062_free(rt1062_t *m);

/** The chip's flash memory, 2 MB, to read and write at will. */
uint8_t *rt1062_flash(rt1062_t *m);
/** Wire the pins to a circuit, which is stepped with the chip's time from then on. NULL: nothing is connected.
 *  @param circuit is copied; its context must live as long as the machine. */
void rt1062_attach(rt1062_t *m, const rt1062_circuit_t *circuit);
/** Power on. RAM is noise. @return false: the boot ROM would not start this image; rt1062_why(). */
bool rt1062_power_on(rt1062_t *m);
/** The power is on: switched on, and not cut since. */
bool rt1062_powered(const rt1062_t *m);
/** Run until `until_ns` after power-on, or something else that stops. */
rt1062_stop_t rt1062_run(rt1062_t *m, uint64_t until_ns);
uint64_t rt1062_time_ns(const rt1062_t *m);
uint64_t rt1062_instructions(const rt1062_t *m);
/** Why the last run ended; a sentence. */
const char *rt1062_why(const rt1062_t *m);

/** Which stops the caller wants, a bit per rt1062_stop_t; RT1062_STOP_TIME, POWER, UPLOAD and REFUSED always stop. */
void rt1062_stop_on(rt1062_t *m, uint32_t stops);
/** Stop before the instruction at this address (a function's first, say), the first of a basic block; up to 8. 0:
 * forget them all. */
bool rt1062_break(rt1062_t *m, uint32_t address);

/**
 * Each time the program begins the basic block at this address, let time go on by `pause_ns` more, but not past the
 * next event. A main loop that only waits then costs fewer instructions. 0, 0: no longer.
 */
void rt1062_pace(rt1062_t *m, uint32_t address, uint32_t pause_ns);

/** Tell where the stack's room ends, from power-on on: what lies below is the program's variables. 0: nobody knows. */
void rt1062_stack_end(rt1062_t *m, uint32_t address);
/** Least bytes that have been left between that end and an exception's frame; UINT32_MAX: nobody knows. 0: it was
 * below. */
uint32_t rt1062_stack_left(const rt1062_t *m);

uint32_t rt1062_register(rt1062_t *m, uint32_t number); /**< r0..r15, 16: xPSR */
/** Copy memory (not registers). @return false: not all of it is memory. */
bool rt1062_read(rt1062_t *m, uint32_t address, uint8_t *bytes, uint32_t count);
bool rt1062_write(rt1062_t *m, uint32_t address, const uint8_t *bytes, uint32_t count);
/**
 * Call a function of the image in its present state, from the background: four integer arguments at most. Interrupts go
 * on.
 * @return RT1062_STOP_TIME and *result, or why it ended before it returned. `limit_ns`: time it may take.
 */
rt1062_stop_t rt1062_call(rt1062_t *m, uint32_t function, const uint32_t arguments[4], uint64_t limit_ns,
                          uint32_t *result);

/** One access to a register as the processor makes it, 1, 2 or 4 bytes. A register that is not modelled reads 0, with
 * rt1062_why(). */
uint32_t rt1062_bus_read(rt1062_t *m, uint32_t address, uint32_t size);
/** @return false: it is not modelled. */
bool rt1062_bus_write(rt1062_t *m, uint32_t address, uint32_t size, uint32_t value);

uint32_t rt1062_findings(const rt1062_t *m);
const rt1062_finding_t *rt1062_finding(const rt1062_t *m, uint32_t number);
void rt1062_forget_findings(rt1062_t *m);
/** What is not modelled: sentences, ended by NULL. */
const char *const *rt1062_not_modelled(void);

/** A copy of the whole machine and the state of its circuit; not of bytes and edges that wait to be fetched.
 *  @return NULL: no memory. */
typedef struct rt1062_snapshot_t rt1062_snapshot_t;
rt1062_snapshot_t *rt1062_snapshot(rt1062_t *m);
void rt1062_restore(rt1062_t *m, const rt1062_snapshot_t *snapshot);
void rt1062_snapshot_free(rt1062_snapshot_t *snapshot);

/** Bytes to the robot; they take the link's time. @return bytes taken. */
uint32_t rt1062_send(rt1062_t *m, rt1062_channel_t channel, const uint8_t *bytes, uint32_t count);
/** Bytes from the robot since the last call. @return bytes put into `bytes`. */
uint32_t rt1062_receive(rt1062_t *m, rt1062_channel_t channel, uint8_t *bytes, uint32_t room);

/**
 * The USB host: cable in or out (out at power-on). Whoever has the port open loses it when the cable is pulled or the
 * chip is reset: open it again. Then rt1062_send() takes nothing from RT1062_USB while the port is not ready and open.
 * A full output makes the host stop reading.
 */
void rt1062_usb_cable(rt1062_t *m, bool connected);
/** The next bus reset is one of a host that knows 12 Mbit/s only. */
void rt1062_usb_full_speed(rt1062_t *m, bool full_speed);
/** The port is opened (DTR) or closed; line coding (134 baud asks for the uploader). Before the port is ready: as soon
 * as it is. */
void rt1062_usb_open(rt1062_t *m, bool open, uint32_t baud);
/** Whoever has the port open stops reading, and what the computer keeps for it is full: it takes nothing more. */
void rt1062_usb_deaf(rt1062_t *m, bool deaf);
/** The device is configured by the host and can carry bytes. */
bool rt1062_usb_ready(const rt1062_t *m);

/** Level of a Teensy pin as a voltmeter would see it: 0, 1, or -1 if nothing drives or pulls it. */
int32_t rt1062_pin(rt1062_t *m, uint32_t teensy_pin);
/** Drive a Teensy pin from outside: 0, 1, or -1 to let go. */
void rt1062_drive_pin(rt1062_t *m, uint32_t teensy_pin, int32_t level);

/**
 * The wire at an encoder's pin is loose: instead of the disc's levels come edges at random times. So many per second on
 * average; 0: it is mended. One wire at a time. @return false: no such pin, no circuit, or more than 1e9.
 */
bool rt1062_noise(rt1062_t *m, uint32_t teensy_pin, uint32_t edges_per_s);
/** Reset the chip from outside. @param flags bits of SRC_SRSR: 2 program or lock-up, 0x80 watchdog, 0x100
 * over-temperature. */
void rt1062_reset(rt1062_t *m, uint32_t flags);
/** Set the chip's temperature [degC]; 40 at power-on. */
void rt1062_set_temperature(rt1062_t *m, double degC);
/**
 * Edges at the I2C lines since the last call, at most RT1062_EDGES; later ones are lost. An edge comes at the time it
 * has on the wire.
 * @return edges put into `edges`.
 */
uint32_t rt1062_i2c_edges(rt1062_t *m, rt1062_edge_t *edges, uint32_t room);

/** Cut the power after this many more flash commands that change memory: a page program, an erase. It goes when `share`
 * (0..1) of that one is done. */
void rt1062_cut_power_at(rt1062_t *m, uint32_t flash_commands, double share);

#endif
