// SPDX-License-Identifier: MIT
/// @file semihosting.h  The debugger's services (Arm "Semihosting for AArch32 and AArch64"), here QEMU's: files,
/// console, exit.
#pragma once

#include <cstddef>
#include <cstdint>

namespace an500 {

/// How SYS_OPEN opens, named as in C's fopen.
enum class OpenMode : uint32_t { read = 1, read_write = 3, read_write_new = 7, append = 9 };

/// @return a handle, or -1 (see semihosting_errno()).
int semihosting_open(const char *path, OpenMode mode);
bool semihosting_close(int handle);
/// @return bytes read, 0 at the end of the file, -1 on failure.
int semihosting_read(int handle, void *data, size_t length);
/// @return bytes written, -1 on failure.
int semihosting_write(int handle, const void *data, size_t length);
bool semihosting_seek(int handle, size_t position);
/// @return length of the file, -1 on failure.
int semihosting_length(int handle);
/// The host's errno of the last failure.
int semihosting_errno();
/// Write text to the console (QEMU: standard error), or to the file named before.
void semihosting_print(const char *text);
/// From now on print to the end of this file. @return false if it cannot be opened.
bool semihosting_print_to(const char *path);
/// Handle of the console, for bytes (QEMU: standard input or output). Reading waits for the first one. @return -1 on
/// failure.
int semihosting_open_console(bool for_reading);
/// Get the command line, words separated by blanks. @return false if it does not fit.
bool semihosting_command_line(char *text, size_t capacity);
/// End the emulator with this exit code.
[[noreturn]] void semihosting_exit(int code);

} // namespace an500
