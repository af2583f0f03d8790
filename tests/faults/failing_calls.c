// SPDX-License-Identifier: MIT
/// @file failing_calls.c  A file system whose calls fail on command: loaded with LD_PRELOAD over libc's.
///
/// Calls that change something at or below the folder $FAIL_UNDER are counted: open for writing, write, pwrite, fsync,
/// rename, link, mkdir, ftruncate. The call number $FAIL_AT (from 1) fails with errno $FAIL_WITH; with $FAIL_STAYS=1 so
/// do all later ones. With $FAIL_SHORT=1 the first write to fail takes half of its bytes. The next that writes fails.
/// Programs that load this set the same by fail_arm(). Removing a file and reading never fail, and a full disk lets
/// files be cut off.
#define _GNU_SOURCE
#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <limits.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <sys/types.h>
#include <sys/uio.h>
#include <unistd.h>

static char under[PATH_MAX];
static long at, calls;
static int with, stays, halves;
static char last[64];

void fail_arm(const char *folder, long number, int error, int stay, int half) {
    snprintf(under, sizeof under, "%s", folder);
    at = number;
    with = error;
    stays = stay;
    halves = half;
    calls = 0;
    last[0] = '\0';
}

long fail_calls(void) {
    return calls;
}

/// Name of the call that failed first, "" if none did.
const char *fail_last(void) {
    return last;
}

__attribute__((constructor)) static void from_environment(void) {
    const char *folder = getenv("FAIL_UNDER");
    const char *number = getenv("FAIL_AT");
    const char *error = getenv("FAIL_WITH");
    if (folder != NULL && number != NULL && error != NULL) {
        fail_arm(folder, atol(number), atoi(error), getenv("FAIL_STAYS") != NULL, getenv("FAIL_SHORT") != NULL);
    }
}

static int ours(const char *path) {
    const size_t length = strlen(under);
    return length > 0 && strncmp(path, under, length) == 0 && (path[length] == '/' || path[length] == '\0');
}

static int ours_fd(int fd) {
    char name[64];
    char path[PATH_MAX];
    if (under[0] == '\0') {
        return 0;
    }
    snprintf(name, sizeof name, "/proc/self/fd/%d", fd);
    const ssize_t length = readlink(name, path, sizeof path - 1);
    if (length <= 0) {
        return 0;
    }
    path[length] = '\0';
    return ours(path);
}

static int ours_path(int folder, const char *path) {
    char whole[PATH_MAX];
    if (under[0] == '\0' || path == NULL) {
        return 0;
    }
    if (path[0] == '/') {
        return ours(path);
    }
    if (folder != AT_FDCWD) {
        return ours_fd(folder);
    }
    const char *here = getcwd(whole, sizeof whole);
    return here != NULL && ours(here);
}

/// Count a call. @return true if it is to fail; errno is set.
static int fails(const char *name) {
    ++calls;
    if (calls != at && !(stays && at > 0 && calls > at)) {
        return 0;
    }
    if (last[0] == '\0') {
        snprintf(last, sizeof last, "%s", name);
    }
    errno = with;
    return 1;
}

#define REAL(type, name, ...)                                                                                          \
    static type (*real)(__VA_ARGS__);                                                                                  \
    if (real == NULL) {                                                                                                \
        real = (type(*)(__VA_ARGS__))dlsym(RTLD_NEXT, name);                                                           \
    }

static int opens(int folder, const char *path, int flags, mode_t mode) {
    REAL(int, "openat", int, const char *, int, ...)
    const int writes = (flags & (O_WRONLY | O_RDWR | O_CREAT | O_TRUNC)) != 0;
    if (writes && ours_path(folder, path) && fails("open")) {
        return -1;
    }
    return real(folder, path, flags, mode);
}

#define OPEN(name)                                                                                                     \
    int name(const char *path, int flags, ...) {                                                                       \
        va_list more;                                                                                                  \
        va_start(more, flags);                                                                                         \
        const mode_t mode = (flags & (O_CREAT | O_TMPFILE)) != 0 ? (mode_t)va_arg(more, int) : 0;                      \
        va_end(more);                                                                                                  \
        return opens(AT_FDCWD, path, flags, mode);                                                                     \
    }
OPEN(open)
OPEN(open64)

/// @return how many bytes of a write may go out: all, half of them, or -1 if it fails.
static ssize_t allowed(const char *name, int fd, size_t size) {
    if (!ours_fd(fd)) {
        return (ssize_t)size;
    }
    if (!fails(name)) {
        return (ssize_t)size;
    }
    if (halves && size > 1) {
        halves = 0;
        at = calls + 1; // the rest, which the program will try next, does not fit
        return (ssize_t)(size / 2);
    }
    return -1;
}

ssize_t write(int fd, const void *data, size_t size) {
    REAL(ssize_t, "write", int, const void *, size_t)
    const ssize_t take = allowed("write", fd, size);
    return take < 0 ? -1 : real(fd, data, (size_t)take);
}

ssize_t pwrite(int fd, const void *data, size_t size, off_t offset) {
    REAL(ssize_t, "pwrite", int, const void *, size_t, off_t)
    const ssize_t take = allowed("pwrite", fd, size);
    return take < 0 ? -1 : real(fd, data, (size_t)take, offset);
}

ssize_t pwrite64(int fd, const void *data, size_t size, off64_t offset) {
    REAL(ssize_t, "pwrite64", int, const void *, size_t, off64_t)
    const ssize_t take = allowed("pwrite", fd, size);
    return take < 0 ? -1 : real(fd, data, (size_t)take, offset);
}

ssize_t writev(int fd, const struct iovec *parts, int count) {
    REAL(ssize_t, "writev", int, const struct iovec *, int)
    return allowed("writev", fd, 1) < 0 ? -1 : real(fd, parts, count);
}

#define OF_FD(name, arguments, names, types)                                                                           \
    int name arguments {                                                                                               \
        REAL(int, #name, types)                                                                                        \
        return ours_fd(fd) && fails(#name) ? -1 : real names;                                                          \
    }
#define TYPES(...) __VA_ARGS__
OF_FD(fsync, (int fd), (fd), TYPES(int))
OF_FD(fdatasync, (int fd), (fd), TYPES(int))
/// Cutting a file off works on a full disk.
#define CUTS(name, offset)                                                                                             \
    int name(int fd, offset length) {                                                                                  \
        REAL(int, #name, int, offset)                                                                                  \
        return with == EIO && ours_fd(fd) && fails(#name) ? -1 : real(fd, length);                                     \
    }
CUTS(ftruncate, off_t)
CUTS(ftruncate64, off64_t)

int rename(const char *from, const char *to) {
    REAL(int, "rename", const char *, const char *)
    return ours_path(AT_FDCWD, to) && fails("rename") ? -1 : real(from, to);
}

int link(const char *from, const char *to) {
    REAL(int, "link", const char *, const char *)
    return ours_path(AT_FDCWD, to) && fails("link") ? -1 : real(from, to);
}

int mkdir(const char *path, mode_t mode) {
    REAL(int, "mkdir", const char *, mode_t)
    return ours_path(AT_FDCWD, path) && fails("mkdir") ? -1 : real(path, mode);
}
