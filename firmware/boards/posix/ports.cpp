// SPDX-License-Identifier: MIT
#include "boards/posix/ports.h"

#include <fcntl.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdio>
#include <cstdlib>
#include <cstring>

namespace omni {

bool split_address(const char *address, char *host, size_t host_size, const char **port) {
    const char *colon = std::strrchr(address, ':');
    const size_t length = colon != nullptr ? static_cast<size_t>(colon - address) : 0;
    char *end = nullptr;
    const long number = colon != nullptr ? std::strtol(colon + 1, &end, 10) : -1;
    if (length == 0 || length >= host_size || end == colon + 1 || *end != '\0' || number < 0 || number > 65535) {
        std::fprintf(stderr, "omni-firmware: link address '%s': HOST:PORT is needed, port 0..65535\n", address);
        return false;
    }
    std::memcpy(host, address, length);
    host[length] = '\0';
    *port = colon + 1;
    return true;
}

void PosixPort::connected(int fd) {
    fd_ = fd;
    fcntl(fd_, F_SETFL, fcntl(fd_, F_GETFL) | O_NONBLOCK);
    fcntl(fd_, F_SETFD, FD_CLOEXEC);
    pending_ = 0;
    session_ = ++sessions_;
}

size_t PosixPort::read(uint8_t *data, size_t capacity) {
    if (fd_ < 0) {
        return 0;
    }
    const ssize_t count = ::read(fd_, data, capacity);
    if (count > 0) {
        received_ += static_cast<uint64_t>(count);
        return static_cast<size_t>(count);
    }
    if (count == 0 || (errno != EAGAIN && errno != EWOULDBLOCK && errno != EINTR)) {
        disconnected();
    }
    return 0;
}

void PosixPort::push() {
    if (fd_ < 0 || pending_ == 0) {
        return;
    }
    const ssize_t count = ::write(fd_, out_, pending_);
    if (count > 0) {
        pending_ -= static_cast<size_t>(count);
        std::memmove(out_, out_ + count, pending_);
    } else if (count < 0 && errno != EAGAIN && errno != EWOULDBLOCK && errno != EINTR) {
        pending_ = 0;
        disconnected();
    }
}

bool PosixPort::write(const uint8_t *data, size_t length) {
    if (length > write_space()) {
        return false;
    }
    std::memcpy(out_ + pending_, data, length);
    pending_ += length;
    push();
    return true;
}

short PosixPort::wanted_events() const {
    return static_cast<short>(POLLIN | (pending_ > 0 ? POLLOUT : 0));
}

} // namespace omni
