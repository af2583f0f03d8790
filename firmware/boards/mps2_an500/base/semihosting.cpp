// SPDX-License-Identifier: MIT
#include "base/semihosting.h"

#include <cstring>

namespace an500 {
namespace {

enum class Service : uint32_t {
    open = 0x01,
    close = 0x02,
    write0 = 0x04,
    write = 0x05,
    read = 0x06,
    seek = 0x0A,
    flen = 0x0C,
    last_errno = 0x13,
    get_cmdline = 0x15,
    exit_extended = 0x20,
};

constexpr uintptr_t application_exit = 0x20026;
constexpr const char *console_name = ":tt";

/// Where text goes; -1: to the console.
int print_handle = -1;

intptr_t call(Service service, const void *argument) {
    register auto r0 asm("r0") = static_cast<uintptr_t>(service);
    register const void *r1 asm("r1") = argument;
    asm volatile("bkpt 0xAB" : "+r"(r0) : "r"(r1) : "memory");
    return static_cast<intptr_t>(r0);
}

uintptr_t word(const void *pointer) {
    return reinterpret_cast<uintptr_t>(pointer);
}

/// Transfers answer with the count of bytes that were not moved.
int transfer(Service service, int handle, const void *data, size_t length) {
    const uintptr_t block[] = {static_cast<uintptr_t>(handle), word(data), length};
    const intptr_t left = call(service, block);
    return left >= 0 && static_cast<size_t>(left) <= length ? static_cast<int>(length - static_cast<size_t>(left)) : -1;
}

} // namespace

int semihosting_open(const char *path, OpenMode mode) {
    const uintptr_t block[] = {word(path), static_cast<uintptr_t>(mode), std::strlen(path)};
    return call(Service::open, block);
}

bool semihosting_close(int handle) {
    const auto block = static_cast<uintptr_t>(handle);
    return call(Service::close, &block) == 0;
}

int semihosting_read(int handle, void *data, size_t length) {
    return transfer(Service::read, handle, data, length);
}

int semihosting_write(int handle, const void *data, size_t length) {
    return transfer(Service::write, handle, data, length);
}

bool semihosting_seek(int handle, size_t position) {
    const uintptr_t block[] = {static_cast<uintptr_t>(handle), position};
    return call(Service::seek, block) >= 0;
}

int semihosting_length(int handle) {
    const auto block = static_cast<uintptr_t>(handle);
    return call(Service::flen, &block);
}

int semihosting_errno() {
    return call(Service::last_errno, nullptr);
}

void semihosting_print(const char *text) {
    if (print_handle < 0) {
        call(Service::write0, text);
    } else {
        // QEMU writes there too, and does not keep to the end of a file that is opened for appending.
        semihosting_seek(print_handle, static_cast<size_t>(semihosting_length(print_handle)));
        semihosting_write(print_handle, text, std::strlen(text));
    }
}

bool semihosting_print_to(const char *path) {
    print_handle = semihosting_open(path, OpenMode::append);
    return print_handle >= 0;
}

int semihosting_open_console(bool for_reading) {
    const uintptr_t mode = for_reading ? 0 : 4;
    const uintptr_t block[] = {word(console_name), mode, std::strlen(console_name)};
    return call(Service::open, block);
}

bool semihosting_command_line(char *text, size_t capacity) {
    const uintptr_t block[] = {word(text), capacity};
    return call(Service::get_cmdline, block) == 0;
}

void semihosting_exit(int code) {
    const uintptr_t block[] = {application_exit, static_cast<uintptr_t>(code)};
    call(Service::exit_extended, block);
    for (;;) {}
}

} // namespace an500
