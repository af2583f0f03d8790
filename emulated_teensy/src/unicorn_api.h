/* SPDX-License-Identifier: MIT */
/**
 * @file unicorn_api.h
 * The few functions of the Unicorn processor emulator (version 2) that the machine calls. The library comes from PyPI's
 * package `unicorn` and is opened at run time. So nothing of it is needed to build or use the rest.
 */
#ifndef EMULATED_TEENSY_UNICORN_API_H
#define EMULATED_TEENSY_UNICORN_API_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

typedef struct rt_uc_engine_t rt_uc_engine_t; /* Unicorn's uc_engine */
typedef size_t rt_uc_hook_t;
typedef void (*rt_callback_t)(void); /* any function that Unicorn calls back */

/* Numbers of Unicorn's own headers (unicorn.h, arm.h of version 2). rt_unicorn_open() refuses any other major version.
 */
enum {
    RT_UC_MAJOR = 2,
    RT_UC_ARCH_ARM = 1,
    RT_UC_MODE_M = (1 << 4) | (1 << 5), /* Thumb, M profile */
    RT_UC_CPU_CORTEX_M7 = 10,
    RT_UC_PROT_NONE = 0,
    RT_UC_PROT_READ = 1,
    RT_UC_PROT_WRITE = 2,
    RT_UC_PROT_EXEC = 4,
    RT_UC_PROT_ALL = 7,
    RT_UC_HOOK_INTR = 1 << 0,
    RT_UC_HOOK_BLOCK = 1 << 3,
    RT_UC_HOOK_INVALID_MEMORY =
        (1 << 4) | (1 << 5) | (1 << 6) | (1 << 7) | (1 << 8) | (1 << 9), /* unmapped and protected */
    RT_UC_HOOK_MEM_READ = 1 << 10,
    RT_UC_HOOK_MEM_WRITE = 1 << 11,
    RT_UC_HOOK_INSN_INVALID = 1 << 14,
    RT_UC_MEM_READ = 16,
    RT_UC_MEM_WRITE = 17,
    RT_UC_MEM_FETCH = 18,
    RT_UC_MEM_FETCH_PROT = 24,
    RT_UC_CTL_CPU_MODEL = 7 | (1 << 26) | (1 << 30),    /* one argument, written */
    RT_UC_CTL_REMOVE_CACHE = 9 | (2 << 26) | (1 << 30), /* two arguments, written */
    RT_UC_CTL_FLUSH_CACHE = 10 | (1 << 30),
    RT_UC_ERR_OK = 0
};

/* Register numbers of Unicorn's arm.h. */
enum {
    RT_REG_FPSCR = 6,
    RT_REG_LR = 10,
    RT_REG_PC = 11,
    RT_REG_SP = 12,
    RT_REG_D0 = 14, /* D0..D15: RT_REG_D0 + n */
    RT_REG_R0 = 66, /* R0..R12: RT_REG_R0 + n */
    RT_REG_S0 = 79, /* S0..S31: RT_REG_S0 + n */
    RT_REG_IPSR = 114,
    RT_REG_MSP = 115,
    RT_REG_PSP = 116,
    RT_REG_CONTROL = 117,
    RT_REG_XPSR = 120,
    RT_REG_PRIMASK = 123,
    RT_REG_BASEPRI = 124,
    RT_REG_FAULTMASK = 126
};

typedef struct rt_unicorn_t {
    void *library;
    unsigned (*version)(unsigned *major, unsigned *minor);
    int (*open)(int architecture, int mode, rt_uc_engine_t **engine);
    int (*close)(rt_uc_engine_t *engine);
    int (*control)(rt_uc_engine_t *engine, int what, ...);
    const char *(*error_text)(int error);
    int (*map_memory)(rt_uc_engine_t *engine, uint64_t address, size_t size, uint32_t permissions, void *memory);
    int (*map_io)(rt_uc_engine_t *engine, uint64_t address, size_t size, rt_callback_t read, void *read_user,
                  rt_callback_t write, void *write_user);
    int (*protect)(rt_uc_engine_t *engine, uint64_t address, size_t size, uint32_t permissions);
    int (*hook_add)(rt_uc_engine_t *engine, rt_uc_hook_t *hook, int type, rt_callback_t callback, void *user,
                    uint64_t begin, uint64_t end, ...);
    int (*hook_delete)(rt_uc_engine_t *engine, rt_uc_hook_t hook);
    int (*reg_read)(rt_uc_engine_t *engine, int number, void *value);
    int (*reg_write)(rt_uc_engine_t *engine, int number, const void *value);
    int (*start)(rt_uc_engine_t *engine, uint64_t begin, uint64_t until, uint64_t timeout_us, size_t count);
    int (*stop)(rt_uc_engine_t *engine);
} rt_unicorn_t;

/** Open the library at `path`. @return false with `why` filled in: not there, a function missing, another major
 * version. */
bool rt_unicorn_open(rt_unicorn_t *api, const char *path, char *why, size_t why_size);

void rt_unicorn_close(rt_unicorn_t *api);

#endif
