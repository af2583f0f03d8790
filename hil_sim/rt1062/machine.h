/* SPDX-License-Identifier: MIT */
/**
 * @file machine.h
 * Inside the emulated i.MX RT1062: what its parts (processor, interrupt controller, peripherals) need of one another.
 *
 * Time is counted in nanoseconds since power-on. An instruction takes a fixed number of them (rt1062_config_t.instruction_ns); between
 * instructions nothing happens. Peripherals do something when a register is accessed and when a deadline of theirs has come.
 *
 * Everything that changes lives in rt_state_t (no pointers in it) and in the four memories, so a snapshot is a copy.
 *
 * Sources, cited where used: [RM] i.MX RT1060 reference manual (IMXRT1060RM); [V7M] Armv7-M architecture reference manual (DDI 0403);
 * [core] the use that Teensyduino's core makes of a register.
 */
#ifndef HIL_SIM_RT1062_MACHINE_H
#define HIL_SIM_RT1062_MACHINE_H

#include "hil_sim/rt1062.h"
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

struct rt1062_t {
    rt_unicorn_t api;
    rt_uc_engine_t *engine;
    rt1062_config_t config;
    uint8_t *itcm; /* page-aligned */
    uint8_t *dtcm;
    uint8_t *ocram;
    uint8_t *flash;
    hil_world_t *world; /* what the pins are wired to; NULL: nothing */
    rt_state_t s;
    /* Below: nothing that a snapshot needs. */
    int64_t budget_ns;   /* time that the processor may still run before it must look up */
    uint64_t look_up_ns; /* when the budget ends */
    bool running;        /* inside Unicorn */
    uint32_t access_pc;  /* instruction of the register access under way */
    rt1062_stop_t stop;
    char why[RT1062_TEXT];
    rt_uc_hook_t hooks[8];
    rt_block_t blocks[RT_BLOCKS]; /* instructions per basic block, as it was met */
    rt1062_output_t output[RT1062_OUTPUT_COUNT];
};

/* A peripheral's registers: addresses base .. base + size - 1. */
typedef struct rt_device_t {
    const char *name;
    uint32_t base;
    uint32_t size;
    /* Aligned accesses of 1, 2 or 4 bytes; `offset` from base. @return false: there is no such register, or not of this width. */
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

/* ---- time.c: deadlines */

/* Time now [ns since power-on]; during a register access: of the end of the basic block that makes it. */
uint64_t rt_now(const rt1062_t *m);
/* Call rt_event_handlers[event] at `at_ns`, or at once if that is past. One deadline per event: the last call counts. RT_NEVER: not at all. */
void rt_schedule(rt1062_t *m, rt_event_t event, uint64_t at_ns);
/* Run the handlers that are due. */
void rt_events_run(rt1062_t *m);
uint64_t rt_next_event(const rt1062_t *m);
typedef void (*rt_event_handler_t)(rt1062_t *m);
extern const rt_event_handler_t rt_event_handlers[RT_EVENT_COUNT];

/* ---- scs.c: interrupts and the system control space */

/* A peripheral's interrupt line goes up or down. Level-sensitive. @param irq 0..159. */
void rt_irq_set(rt1062_t *m, uint32_t irq, bool high);
/* Make a system exception or interrupt pending. @param exception number as in IPSR: 2 NMI .. 15 SysTick, 16 + irq. */
void rt_exception_pend(rt1062_t *m, uint32_t exception);
/* @return the exception to enter now, 0: none. Looks at masks and priorities. */
uint32_t rt_exception_due(rt1062_t *m);
void rt_exception_begin(rt1062_t *m, uint32_t exception);
void rt_exception_end(rt1062_t *m, uint32_t exception);
uint32_t rt_vector(rt1062_t *m, uint32_t exception);

/* ---- cpu.c */

bool rt_cpu_open(rt1062_t *m);
void rt_cpu_close(rt1062_t *m);
/* Registers as after reset: stack and program counter come from the vector table that the boot image names. */
void rt_cpu_reset(rt1062_t *m, uint32_t stack, uint32_t entry);
uint32_t rt_reg(rt1062_t *m, int number);
void rt_set_reg(rt1062_t *m, int number, uint32_t value);
/* Memory as the processor sees it, without side effects. @return false if it is not all memory. */
uint8_t *rt_memory(rt1062_t *m, uint32_t address, uint32_t size);
/* Leave Unicorn before the next basic block: something changed that the run loop must look at. */
void rt_look_up(rt1062_t *m);

/* ---- faults.c: what the processor or the model objects to */

/* The model can't go on: a register that is not modelled, a state that the chip leaves undefined. The run ends with RT1062_STOP_REFUSED. */
#if defined(__GNUC__)
__attribute__((format(printf, 2, 3)))
#endif
void rt_refuse(rt1062_t *m, const char *format, ...);
/* The processor objects: note it among the findings and let exception `exception` (3 HardFault .. 6 UsageFault) be taken at once. */
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
