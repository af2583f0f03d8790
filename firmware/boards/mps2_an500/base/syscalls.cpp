// SPDX-License-Identifier: MIT
/// @file syscalls.cpp  System calls of newlib's stdio: console and files by semihosting, memory for its buffers.
///
/// stdio is for start and end of a program (options, reports, tests); the firmware's own code uses neither it nor a
/// heap.
#include <sys/stat.h>
#include <sys/types.h>

#include <cerrno>
#include <cstddef>

#include <fcntl.h>

#include "base/semihosting.h"

extern "C" {

extern char an500_heap_begin[];
extern char an500_heap_end[];

int _close(int file);
int _fstat(int file, struct stat *status);
int _isatty(int file);
off_t _lseek(int file, off_t offset, int whence);
int _open(const char *path, int flags, int mode);
int _read(int file, void *data, size_t length);
int _write(int file, const void *data, size_t length);
void *_sbrk(ptrdiff_t increment);
[[noreturn]] void _exit(int code);
int _kill(int process, int number);
int _getpid();
void _fini();
}

namespace {

/// newlib's 0 to 2 are the console.
constexpr int first_file = 3;

bool is_console(int file) {
    return file < first_file;
}

int failed() {
    errno = an500::semihosting_errno();
    return -1;
}

} // namespace

extern "C" {

int _open(const char *path, int flags, int) {
    const an500::OpenMode mode =
        (flags & O_ACCMODE) == O_RDONLY ? an500::OpenMode::read : an500::OpenMode::read_write_new;
    const int handle = an500::semihosting_open(path, mode);
    return handle < 0 ? failed() : handle + first_file;
}

int _close(int file) {
    return is_console(file) || an500::semihosting_close(file - first_file) ? 0 : failed();
}

int _read(int file, void *data, size_t length) {
    const int count = is_console(file) ? 0 : an500::semihosting_read(file - first_file, data, length);
    return count < 0 ? failed() : count;
}

int _write(int file, const void *data, size_t length) {
    if (!is_console(file)) {
        const int count = an500::semihosting_write(file - first_file, data, length);
        return count < 0 ? failed() : count;
    }
    const char *bytes = static_cast<const char *>(data);
    char piece[128];
    for (size_t at = 0; at < length;) {
        size_t filled = 0;
        while (filled < sizeof piece - 1 && at < length) {
            piece[filled++] = bytes[at++];
        }
        piece[filled] = '\0';
        an500::semihosting_print(piece);
    }
    return static_cast<int>(length);
}

off_t _lseek(int, off_t, int) {
    errno = ESPIPE; // files are read from their beginning
    return -1;
}

int _fstat(int file, struct stat *status) {
    *status = {};
    status->st_mode = is_console(file) ? S_IFCHR : S_IFREG;
    return 0;
}

int _isatty(int file) {
    return is_console(file) ? 1 : 0;
}

void *_sbrk(ptrdiff_t increment) {
    static char *end = an500_heap_begin;
    if (an500_heap_end - end < increment) {
        errno = ENOMEM;
        return reinterpret_cast<void *>(-1);
    }
    char *const before = end;
    end += increment;
    return before;
}

void _exit(int code) {
    an500::semihosting_exit(code);
}

int _kill(int, int) {
    an500::semihosting_exit(1);
}

int _getpid() {
    return 1;
}

/// Nothing to destroy at the end.
void _fini() {}
}
