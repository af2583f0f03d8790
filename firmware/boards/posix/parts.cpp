// SPDX-License-Identifier: MIT
#include "boards/posix/parts.h"

#include <fcntl.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <ctime>

namespace omni {
namespace {

bool refused(const char *path, const char *why) {
    std::fprintf(stderr, "omni-firmware: --storage %s: %s\n", path, why);
    return false;
}

} // namespace

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
    if (fd_ < 0 || realpath(path, path_) == nullptr) { // writes replace the file itself, not a link to it
        return refused(path, std::strerror(errno));
    }
    if (std::snprintf(part_, sizeof part_, "%s.part", path_) >= static_cast<int>(sizeof part_)) {
        return refused(path, std::strerror(ENAMETOOLONG));
    }
    if (!lock(fd_)) {
        return refused(path, "another firmware uses it; end that one, or give each a file of its own");
    }
    // A file shorter than the memory is one that was never written to its end: the rest counts as erased.
    return pread(fd_, bytes_, sizeof bytes_, 0) >= 0 || refused(path, std::strerror(errno));
}

bool FileStorage::lock(int fd) const {
    if (flock(fd, LOCK_EX | LOCK_NB) != 0) {
        return errno != EWOULDBLOCK; // there are file systems without locks
    }
    // The previous owner may just have replaced the file.
    struct stat locked {};
    struct stat present {};
    return fstat(fd, &locked) == 0 && stat(path_, &present) == 0 && locked.st_ino == present.st_ino;
}

bool FileStorage::put(const uint8_t *content, int *fd) const {
    *fd = ::open(part_, O_RDWR | O_CREAT | O_TRUNC | O_CLOEXEC, 0644);
    if (*fd < 0) {
        return false;
    }
    size_t done = 0;
    while (done < sizeof bytes_) {
        const ssize_t count = pwrite(*fd, content + done, sizeof bytes_ - done, static_cast<off_t>(done));
        if (count <= 0 && errno != EINTR) {
            return false;
        }
        done += count > 0 ? static_cast<size_t>(count) : 0;
    }
    struct stat before {};
    if (fstat(fd_, &before) == 0) {
        [[maybe_unused]] const int kept = fchmod(*fd, before.st_mode & 07777);
    }
    flock(*fd, LOCK_EX | LOCK_NB); // before others can open it under its name
    return fsync(*fd) == 0 && rename(part_, path_) == 0;
}

bool FileStorage::replace(const uint8_t *content) {
    int fd = -1;
    if (!put(content, &fd)) {
        std::fprintf(stderr, "omni-firmware: cannot write %s: %s\n", path_, std::strerror(errno));
        if (fd >= 0) {
            ::close(fd);
            unlink(part_);
        }
        return false;
    }
    ::close(fd_);
    fd_ = fd;
    sync_folder();
    return true;
}

void FileStorage::sync_folder() const {
    char folder[sizeof path_];
    std::snprintf(folder, sizeof folder, "%s", path_);
    char *slash = std::strrchr(folder, '/');
    slash[slash == folder ? 1 : 0] = '\0';
    const int fd = ::open(folder, O_RDONLY | O_DIRECTORY | O_CLOEXEC);
    // The file is whole and in place: what a failure here can cost is the new set, if the power goes right now.
    if (fd < 0 || fsync(fd) != 0) {
        std::fprintf(stderr, "omni-firmware: cannot bring %s to the disk: %s\n", folder, std::strerror(errno));
    }
    if (fd >= 0) {
        ::close(fd);
    }
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
    uint8_t content[sizeof bytes_];
    std::memcpy(content, bytes_, sizeof content);
    std::memcpy(content + offset, data, length);
    if (fd_ >= 0 && !replace(content)) {
        return false;
    }
    std::memcpy(bytes_ + offset, data, length);
    return true;
}

} // namespace omni
