/* SPDX-License-Identifier: MIT */
/**
 * @file machine.h
 * Inside the emulated i.MX RT1062: what its parts (processor, interrupt controller, peripherals) need of one another.
 *
 * Time is counted in nanoseconds since power-on. An instruction takes a fixed number of them
 * (rt1062_config_t.instruction_ns); between instructions nothing happens. Peripherals do something when a register is
 * accessed and when a deadline of theirs has come.
 *
 * Everything that changes lives in rt_state_t (no pointers in it) and in the four memories, so a snapshot is a copy.
 *
 * Sources, cited where used: [RM] i.MX RT1060 reference manual (IMXRT1060RM). [V7M] Armv7-M architecture reference
 * manual (DDI 0403). [core] the use that Teensyduino's core makes of a register.
 */
#ifndef EMULATED_TEENSY_MACHINE_H
#define EMULATED_TEENSY_MACHINE_H

#include "emulated_teensy/rt1062.h"
#include "state.h"
#include "unicorn_api.h"

#define RT_NEVER UINT64_MAX

enum {
    RT_ITCM_SIZE = 512 * 1024,
    RT_DTCM_SIZE = 512 * 1024,
    RT_OCRAM_SIZE = 512 * 1024, /* Teensyduino's RAM2 */
    RT_FLASH_SIZE = 2 * 1024 * 1024
};

#define RT_ITCM_BASE 0x00000000u
#define RT_DTCM_BASE 0x20000000u
#define RT_OCRAM_BASE 0x20200000u
#define RT_FLASH_BASE 0x60000000u

enum { RT_WINDOWS = 2, RT_CPU_MHz = 600 };

/* Exception numbers [V7M B1.5.2]; 16 + n: interrupt n. */
enum {
    RT_NMI = 2,
    RT_HARD_FAULT = 3,
    RT_MEM_FAULT = 4,
    RT_BUS_FAULT = 5,
    RT_USAGE_FAULT = 6,
    RT_SVCALL = 11,
    RT_PENDSV = 14,
    RT_SYSTICK = 15,
    RT_IRQ0 = 16
};

/* Addresses that Unicorn hands to bus.c. */
typedef struct rt_window_t {
    rt1062_t *m;
    uint32_t base;
} rt_window_t;

struct rt1062_t {
    rt_unicorn_t api;
    rt_uc_engine_t *engine;
    rt1062_config_t config;
    uint8_t *itcm; /* page-aligned */
    uint8_t *dtcm;
    uint8_t *ocram;
    uint8_t *flash;
    rt1062_circuit_t circuit; /* what the pins are wired to */
    bool wired;               /* there is a circuit */
    rt_state_t s;
    /* Below: nothing that a snapshot needs. */
    int64_t slice_ns;    /* time that the processor was given when it began to run */
    int64_t budget_ns;   /* and what is left of it */
    uint64_t look_up_ns; /* when that ends */
    uint64_t until_ns;   /* when the whole run ends */
    bool protection_dirty;
    bool flash_dirty;
    bool look_up;        /* leave Unicorn before the next basic block */
    bool masked_pending; /* an interrupt waits for PRIMASK, BASEPRI or FAULTMASK to change */
    uint32_t masks;      /* rt_masks() when that was found */
    bool stopping;       /* `stop` is the reason for which the run ends */
    bool in_part;        /* config.exact: a block is executed up to an instruction within it */
    uint32_t part_block; /* the block to do that with, 0: none */
    uint32_t part_size;
    uint32_t block_at;  /* basic block being executed */
    uint32_t access_pc; /* instruction of the register access under way, or last met */
    uint32_t interrupt; /* number of Unicorn's interrupt, RT_NO_INTERRUPT: none */
    rt1062_stop_t stop;
    char why[RT1062_TEXT];
    rt_window_t windows[RT_WINDOWS];
    rt_uc_hook_t hooks[RT_WINDOWS + 6];
    rt_uc_hook_t guards[RT_MPU_REGIONS]; /* on regions of the memory protection unit that are smaller than a page */
    uint32_t guard_count;
    uint32_t break_at[RT_BREAKS];
    uint32_t break_count;
    uint32_t pace_at; /* rt1062_pace() */
    int64_t pace_ns;
    uint32_t stack_end; /* rt1062_stack_end() */
    uint32_t stack_left;
    uint32_t stop_on;             /* a bit per rt1062_stop_t */
    rt_block_t blocks[RT_BLOCKS]; /* instructions per basic block, as it was met */
    rt1062_output_t output[RT1062_OUTPUT_COUNT];
    rt_i2c_trace_t i2c_trace;
};

/* A peripheral's registers: addresses base .. base + size - 1. */
typedef struct rt_device_t {
    const char *name;
    uint32_t base;
    uint32_t size;
    /* Aligned accesses of 1, 2 or 4 bytes; `offset` from base. @return false: there is no such register, or not of this
     * width. */
    bool (*read)(rt1062_t *m, uint32_t offset, uint32_t size, uint32_t *value);
    bool (*write)(rt1062_t *m, uint32_t offset, uint32_t size, uint32_t value);
    /* After any reset, the cold one included. m->s.reset_flags tells which (RT_RESET_...). NULL: nothing to do. */
    void (*reset)(rt1062_t *m);
} rt_device_t;

/* ---- bus.c */

/* The table of all devices, in no order, ended by a NULL name. */
extern const rt_device_t *const rt_devices[];
const rt_device_t *rt_device_at(uint32_t address);
bool rt_bus_attach(rt1062_t *m);
/* One access of 1, 2 or 4 bytes, as the processor makes it. */
uint32_t rt_bus_read(rt1062_t *m, uint32_t address, uint32_t size);
void rt_bus_write(rt1062_t *m, uint32_t address, uint32_t size, uint32_t value);

/* ---- time.c: deadlines */

/* Time now [ns since power-on]; during a register access: of the end of the basic block that makes it. */
uint64_t rt_now(const rt1062_t *m);
/* Call rt_event_handlers[event] at `at_ns`, or at once if that is past. One deadline per event: the last call counts.
 * RT_NEVER: not at all. */
void rt_schedule(rt1062_t *m, rt_event_t event, uint64_t at_ns);
/* Run the handlers that are due. */
void rt_events_run(rt1062_t *m);
uint64_t rt_next_event(const rt1062_t *m);
typedef void (*rt_event_handler_t)(rt1062_t *m);
extern const rt_event_handler_t rt_event_handlers[RT_EVENT_COUNT];

/* ---- exceptions.c */

/* A peripheral's interrupt line goes up or down. Level-sensitive. @param irq 0..159. */
void rt_irq_set(rt1062_t *m, uint32_t irq, bool high);
/* Make a system exception or interrupt pending. @param exception number as in IPSR: 2 NMI .. 15 SysTick, 16 + irq. */
void rt_exception_pend(rt1062_t *m, uint32_t exception);
/* Lines that are still high are pending again. */
void rt_lines_repend(rt1062_t *m);
/* The three mask registers in one word. */
uint32_t rt_masks(rt1062_t *m);
/* Enter what is due: a fault, else the pending exception of the highest priority that may interrupt. */
void rt_exceptions_take(rt1062_t *m);
/* The one of the highest priority that is pending and on, 0: none. */
uint32_t rt_exception_next(const rt1062_t *m);
/* Does one that is pending end a WFI? It does if PRIMASK alone keeps it from being taken [V7M B1.5.19]. */
bool rt_exceptions_wake(rt1062_t *m);
/* Leave the handler that branched to this EXC_RETURN value. */
void rt_exception_return(rt1062_t *m, uint32_t exc_return);
/* Set the fault status registers for a fault of this kind. */
void rt_fault_status(rt1062_t *m, uint32_t exception, uint32_t address);

/* ---- protection.c: what memory there is and who may do what with it */

/* May privileged code write to this address of memory? */
bool rt_may_write(const rt1062_t *m, uint32_t address);
/* The memory protection unit or the partition of the tightly coupled memory was changed: the run loop applies it before
 * it goes on. */
void rt_protection_changed(rt1062_t *m);
void rt_protection_apply(rt1062_t *m);
/* The flash chip began or ended its work: the same for flash memory alone. */
void rt_flash_protection_changed(rt1062_t *m);
/* IOMUXC_GPR14, 16, 17 were written: partition of the FlexRAM. @param banks two bits for each of 16 banks of 32 KB, as
 * in GPR17. */
void rt_flexram_configured(rt1062_t *m, uint32_t banks);

/* ---- fpu.c */

/* Is it a double-precision operation, which Unicorn's processor does not know? */
bool rt_fpu_is_double(uint32_t instruction);
/* Carry it out and go on to the next instruction. @return false: it is not modelled, and nothing has changed. */
bool rt_fpu_double(rt1062_t *m, uint32_t instruction);

/* ---- cpu.c */

#define XPSR_T (1u << 24)
#define XPSR_IT 0x0600FC00u

/*
 * To be called by each hook on memory. Before it calls one, Unicorn looks up what instruction it is at. It leaves its
 * IT state behind, as if the basic block ended there. But it goes on, and the next one would begin as part of an IT
 * block.
 */
void rt_leave_it_block(rt1062_t *m);

enum { RT_NO_INTERRUPT = 0xFFFF };

bool rt_cpu_open(rt1062_t *m, char *why, size_t why_size);
void rt_cpu_close(rt1062_t *m);
/* Registers as after reset. */
void rt_cpu_reset(rt1062_t *m, uint32_t stack, uint32_t entry);
/* Others than the program wrote to memory that may hold code: what is kept of it is forgotten. */
void rt_code_changed(rt1062_t *m, uint32_t address, uint32_t size);
/* Run until the run's end, an event, or an exception to be taken. */
void rt_cpu_slice(rt1062_t *m, uint64_t until_ns);
uint32_t rt_reg(rt1062_t *m, int number);
void rt_set_reg(rt1062_t *m, int number, uint32_t value);
/* Memory behind an address, without rights and side effects. @return NULL if it is not all memory. */
uint8_t *rt_memory(rt1062_t *m, uint32_t address, uint32_t size);
/*
 * Leave Unicorn before the next basic block: something changed that the run loop must look at. The rest of the present
 * block is still executed: a handful of instructions. So it is on the chip, where a write takes its time to reach a
 * peripheral.
 */
void rt_look_up(rt1062_t *m);
/* End the run for this reason. */
void rt_stop(rt1062_t *m, rt1062_stop_t stop);

/* ---- faults.c: what the processor or the model objects to */

/* The model can't go on: a register that is not modelled, a state that the chip leaves undefined. The run ends with
 * RT1062_STOP_REFUSED. */
#if defined(__GNUC__)
__attribute__((format(printf, 2, 3)))
#endif
void rt_refuse(rt1062_t *m, const char *format, ...);
/* The processor objects: note it among the findings and let exception `exception` (3 HardFault .. 6 UsageFault) be
 * taken at once. */
#if defined(__GNUC__)
__attribute__((format(printf, 4, 5)))
#endif
void rt_fault(rt1062_t *m, uint32_t exception, uint32_t address, const char *format, ...);
/* Something a robot must not do, which the chip lets pass: note it among the findings. */
#if defined(__GNUC__)
__attribute__((format(printf, 3, 4)))
#endif
void rt_finding(rt1062_t *m, rt1062_finding_kind_t kind, const char *format, ...);

/* ---- reset.c */

/* Ask for a reset once the instruction is over. @param flags RT_RESET_... as SRC_SRSR will show them. */
void rt_reset_request(rt1062_t *m, uint32_t flags);
/* Do it: devices, processor, boot. */
void rt_reset_now(rt1062_t *m, uint32_t flags);

/* ---- outputs: bytes for whoever runs the machine */

void rt_output(rt1062_t *m, rt1062_channel_t channel, const uint8_t *bytes, uint32_t count);

#endif
