// SPDX-License-Identifier: MIT
#include "boards/posix/parts.h"

#include <fcntl.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <ctime>

#include "app/pca9685.h"

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

uint8_t NoEncoders::read(int32_t *counts) {
    std::fill(counts, counts + OMNI_MAX_WHEELS, 0);
    return (1u << OMNI_MAX_WHEELS) - 1;
}

void NoEncoders::errors(uint32_t *errors) {
    std::fill(errors, errors + OMNI_MAX_WHEELS, 0u);
}

bool NoMotorsBus::submit(const I2cTransaction *batch, size_t count) {
    for (size_t i = 0; i < count; ++i) {
        const I2cTransaction &transaction = batch[i];
        acknowledged_ = transaction.address == Pca9685::address;
        if (!acknowledged_) {
            break;
        }
        if (transaction.write_length == 0) {
            continue;
        }
        uint8_t pointer = transaction.write[0];
        for (size_t at = 1; at < transaction.write_length; ++at) {
            registers_[pointer++] = transaction.write[at];
        }
        read_ = registers_[pointer];
    }
    submitted_ = true;
    return true;
}

I2cStatus NoMotorsBus::poll(uint8_t *read) {
    read[0] = read_;
    const bool done = submitted_;
    submitted_ = false;
    const I2cStatus outcome = acknowledged_ ? I2cStatus::done : I2cStatus::nack;
    return done ? outcome : I2cStatus::idle;
}

} // namespace omni
