/* SPDX-License-Identifier: MIT */
#include "unicorn_api.h"

#include <dlfcn.h>
#include <stdio.h>
#include <string.h>

typedef struct symbol_t {
    const char *name;
    size_t offset; /* of the function pointer in rt_unicorn_t */
} symbol_t;

#define FUNCTION(member, name)                                                                                         \
    { name, offsetof(rt_unicorn_t, member) }
static const symbol_t symbols[] = {
    FUNCTION(version, "uc_version"),      FUNCTION(open, "uc_open"),           FUNCTION(close, "uc_close"),
    FUNCTION(control, "uc_ctl"),          FUNCTION(error_text, "uc_strerror"), FUNCTION(map_memory, "uc_mem_map_ptr"),
    FUNCTION(map_io, "uc_mmio_map"),      FUNCTION(protect, "uc_mem_protect"), FUNCTION(hook_add, "uc_hook_add"),
    FUNCTION(hook_delete, "uc_hook_del"), FUNCTION(reg_read, "uc_reg_read"),   FUNCTION(reg_write, "uc_reg_write"),
    FUNCTION(start, "uc_emu_start"),      FUNCTION(stop, "uc_emu_stop"),
};
#undef FUNCTION

static bool find_symbols(rt_unicorn_t *api, char *why, size_t why_size) {
    for (size_t i = 0; i < sizeof symbols / sizeof symbols[0]; i++) {
        void *found = dlsym(api->library, symbols[i].name);
        if (found == NULL) {
            snprintf(why, why_size, "the Unicorn library has no function %s", symbols[i].name);
            return false;
        }
        /* Function and object pointers have the same shape on POSIX; ISO C knows no cast between them. */
        memcpy((char *)api + symbols[i].offset, &found, sizeof found);
    }
    return true;
}

bool rt_unicorn_open(rt_unicorn_t *api, const char *path, char *why, size_t why_size) {
    memset(api, 0, sizeof *api);
    api->library = dlopen(path, RTLD_NOW | RTLD_LOCAL);
    if (api->library == NULL) {
        snprintf(why, why_size, "cannot open the Unicorn library: %s", dlerror());
        return false;
    }
    if (!find_symbols(api, why, why_size)) {
        rt_unicorn_close(api);
        return false;
    }
    unsigned major = 0;
    unsigned minor = 0;
    api->version(&major, &minor);
    if (major != RT_UC_MAJOR) {
        snprintf(why, why_size, "Unicorn %u.%u is installed, version %d is needed", major, minor, RT_UC_MAJOR);
        rt_unicorn_close(api);
        return false;
    }
    return true;
}

void rt_unicorn_close(rt_unicorn_t *api) {
    if (api->library != NULL) {
        dlclose(api->library);
        api->library = NULL;
    }
}
