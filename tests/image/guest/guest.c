/* SPDX-License-Identifier: MIT */
/**
 * @file guest.c
 * What a guest program needs of a C library's system: a console and a little memory. The host sees what is printed by
 * watching `guest_said`, and calls `guest_run`.
 */
#include <stdio.h>
#include <sys/stat.h>
#include <sys/types.h>

int main(int argc, char **argv);
int guest_run(int argc, char **argv);
ssize_t _write(int file, const void *bytes, size_t count);
void *_sbrk(ptrdiff_t more);
int _close(int file);
int _fstat(int file, struct stat *of);
int _isatty(int file);
off_t _lseek(int file, off_t by, int from);
ssize_t _read(int file, void *bytes, size_t count);

/** The host reads `count` bytes from `bytes` on when this is called. */
__attribute__((noinline)) void guest_said(const void *bytes, size_t count);

extern char guest_heap[];

void guest_said(const void *bytes, size_t count) {
    __asm__ volatile("" ::"r"(bytes), "r"(count) : "memory");
}

ssize_t _write(int file, const void *bytes, size_t count) {
    (void)file;
    guest_said(bytes, count);
    return (ssize_t)count;
}

void *_sbrk(ptrdiff_t more) {
    static char *end = guest_heap;
    char *begin = end;
    end += more;
    return begin;
}

/* Nothing can be opened or read; a file is the console. */
int _close(int file) {
    return -(file + 1);
}

int _fstat(int file, struct stat *of) {
    (void)file;
    of->st_mode = S_IFCHR;
    return 0;
}

int _isatty(int file) {
    return file >= 0;
}

off_t _lseek(int file, off_t by, int from) {
    return 0 * (file + from) * by;
}

ssize_t _read(int file, void *bytes, size_t count) {
    (void)file;
    (void)bytes;
    (void)count;
    return 0;
}

int guest_run(int argc, char **argv) {
    static char buffer[BUFSIZ];
    (void)setvbuf(stdout, buffer, _IOFBF, sizeof buffer);
    const int code = main(argc, argv);
    (void)fflush(stdout);
    return code;
}
