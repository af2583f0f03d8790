/* SPDX-License-Identifier: MIT */
/*
 * Preloaded into programs that are compiled with -finstrument-functions. It appends each function's first call to the
 * file $OMNI_REACH/calls, as the binary's path and the function's place in it. What has been called is forgotten
 * whenever the number in $OMNI_REACH/test changes. So every test gets a list of its own, also from processes that go
 * on.
 */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <fcntl.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <unistd.h>

#define QUIET __attribute__((no_instrument_function))

enum { PLACES = 1 << 16 };

static const volatile uint32_t *test;
static uint32_t known_test;
static const void *known[PLACES];
static int calls = -1;

QUIET static void give_up(const char *why) {
    perror(why);
    abort();
}

__attribute__((constructor)) QUIET static void start(void) {
    const char *folder = getenv("OMNI_REACH");
    char path[4096];
    if (folder == NULL) {
        return;
    }
    snprintf(path, sizeof path, "%s/test", folder);
    const int file = open(path, O_RDONLY | O_CLOEXEC);
    test = mmap(NULL, sizeof *test, PROT_READ, MAP_SHARED, file, 0);
    snprintf(path, sizeof path, "%s/calls", folder);
    calls = open(path, O_WRONLY | O_APPEND | O_CLOEXEC);
    if (test == MAP_FAILED || calls < 0) {
        give_up(path);
    }
}

QUIET void __cyg_profile_func_enter(void *function, void *from);
QUIET void __cyg_profile_func_exit(void *function, void *from);

QUIET void __cyg_profile_func_enter(void *function, void *from) {
    (void)from;
    if (calls < 0) {
        return;
    }
    if (*test != known_test) {
        known_test = *test;
        memset(known, 0, sizeof known);
    }
    size_t place = ((uintptr_t)function >> 1) * 2654435761u % PLACES;
    while (known[place] != NULL && known[place] != function) {
        place = (place + 1) % PLACES;
    }
    Dl_info info;
    if (known[place] == function || dladdr(function, &info) == 0) {
        return;
    }
    known[place] = function;
    char line[4200];
    const int length = snprintf(line, sizeof line, "%lx %s\n",
                                (unsigned long)((char *)function - (char *)info.dli_fbase), info.dli_fname);
    if (write(calls, line, (size_t)length) != length) {
        give_up("calls");
    }
}

QUIET void __cyg_profile_func_exit(void *function, void *from) {
    (void)function;
    (void)from;
}
