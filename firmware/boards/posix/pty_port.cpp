// SPDX-License-Identifier: MIT
#include <fcntl.h>
#include <sys/stat.h>
#include <termios.h>
#include <unistd.h>

#include <cerrno>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <initializer_list>

#include "boards/posix/ports.h"

namespace omni {
namespace {

/// Put a link to the terminal at `path`; only another link may be replaced.
bool link_to(const char *target, const char *path) {
    struct stat present {};
    if (lstat(path, &present) == 0 && S_ISLNK(present.st_mode)) {
        unlink(path);
    }
    if (symlink(target, path) != 0) {
        std::fprintf(stderr, "omni-firmware: cannot link %s to the terminal: %s\n", path, std::strerror(errno));
        return false;
    }
    return true;
}

void make_raw(int fd) {
    termios settings{};
    tcgetattr(fd, &settings);
    settings.c_iflag &= ~static_cast<tcflag_t>(IGNBRK | BRKINT | PARMRK | ISTRIP | INLCR | IGNCR | ICRNL | IXON);
    settings.c_oflag &= ~static_cast<tcflag_t>(OPOST);
    settings.c_lflag &= ~static_cast<tcflag_t>(ECHO | ECHONL | ICANON | ISIG | IEXTEN);
    settings.c_cflag = (settings.c_cflag & ~static_cast<tcflag_t>(CSIZE | PARENB)) | CS8;
    tcsetattr(fd, TCSANOW, &settings);
}

} // namespace

bool PtyPort::open(const char *address) {
    const int master = posix_openpt(O_RDWR | O_NOCTTY);
    const bool usable = master >= 0 && grantpt(master) == 0 && unlockpt(master) == 0;
    const char *name = usable ? ptsname(master) : nullptr;
    // Held open here, so that a client may come and go without the terminal hanging up.
    other_side_ = name != nullptr ? ::open(name, O_RDWR | O_NOCTTY) : -1;
    if (other_side_ < 0) {
        std::fprintf(stderr, "omni-firmware: cannot open a pseudo-terminal: %s\n", std::strerror(errno));
        return false;
    }
    make_raw(other_side_);
    if (std::strlen(address) >= sizeof symlink_) {
        std::fprintf(stderr, "omni-firmware: link name too long: %s\n", address);
        return false;
    }
    std::snprintf(url_, sizeof url_, "%s", *address != '\0' ? address : name);
    if (*address != '\0') {
        if (!link_to(name, address)) {
            return false;
        }
        std::snprintf(symlink_, sizeof symlink_, "%s", address);
    }
    connected(master);
    return true;
}

void PtyPort::close_port() {
    if (symlink_[0] != '\0') {
        unlink(symlink_);
    }
    for (int *fd : {&fd_, &other_side_}) {
        if (*fd >= 0) {
            ::close(*fd);
            *fd = -1;
        }
    }
}

size_t PtyPort::wait_for(pollfd *fds) {
    fds[0] = {fd_, wanted_events(), 0};
    return 1;
}

} // namespace omni
