// SPDX-License-Identifier: MIT
#include "boards/posix/parts.h"

#include <fcntl.h>
#include <unistd.h>

#include <cerrno>
#include <cstdio>
#include <cstring>
#include <ctime>

namespace omni {

uint64_t PosixClock::stopwatch_ns() {
    timespec now{};
    clock_gettime(CLOCK_MONOTONIC, &now);
    return static_cast<uint64_t>(now.tv_sec) * 1'000'000'000u + static_cast<uint64_t>(now.tv_nsec);
}

bool FileStorage::open(const char *path) {
    std::memset(bytes_, 0xFF, sizeof bytes_);
    if (path == nullptr) {
        return true;
    }
    fd_ = ::open(path, O_RDWR | O_CREAT | O_CLOEXEC, 0644);
    // A file shorter than the memory is one that was never written to its end: the rest counts as erased.
    if (fd_ < 0 || pread(fd_, bytes_, sizeof bytes_, 0) < 0) {
        std::fprintf(stderr, "omni-firmware: --storage %s: %s\n", path, std::strerror(errno));
        return false;
    }
    return true;
}

void FileStorage::close_file() {
    if (fd_ >= 0) {
        ::close(fd_);
        fd_ = -1;
    }
}

bool FileStorage::read(size_t offset, uint8_t *data, size_t length) {
    if (offset > sizeof bytes_ || length > sizeof bytes_ - offset) {
        return false;
    }
    std::memcpy(data, bytes_ + offset, length);
    return true;
}

bool FileStorage::write(size_t offset, const uint8_t *data, size_t length) {
    if (offset > sizeof bytes_ || length > sizeof bytes_ - offset) {
        return false;
    }
    std::memcpy(bytes_ + offset, data, length);
    if (fd_ < 0) {
        return true;
    }
    // From the beginning, so that a young file has no hole of zeros in front.
    const ssize_t count = pwrite(fd_, bytes_, sizeof bytes_, 0);
    return count == static_cast<ssize_t>(sizeof bytes_) && fsync(fd_) == 0;
}

} // namespace omni
