// SPDX-License-Identifier: MIT
#include <netdb.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <sys/socket.h>
#include <unistd.h>

#include <cerrno>
#include <cstdio>
#include <cstring>

#include "boards/posix/ports.h"

namespace omni {
namespace {

/// Resolve and create a socket. @return its descriptor, or -1 after saying why.
int make_socket(const char *host, const char *port, int type, sockaddr_storage *address, socklen_t *length) {
    addrinfo hints{};
    hints.ai_family = AF_UNSPEC;
    hints.ai_socktype = type;
    addrinfo *found = nullptr;
    const int error = getaddrinfo(host, port, &hints, &found);
    if (error != 0) {
        std::fprintf(stderr, "omni-firmware: host '%s': %s\n", host, gai_strerror(error));
        return -1;
    }
    const int fd = socket(found->ai_family, type, 0);
    std::memcpy(address, found->ai_addr, found->ai_addrlen);
    *length = found->ai_addrlen;
    freeaddrinfo(found);
    if (fd < 0) {
        std::fprintf(stderr, "omni-firmware: socket: %s\n", std::strerror(errno));
    }
    return fd;
}

int fail(int fd, const char *what, const char *address) {
    std::fprintf(stderr, "omni-firmware: %s %s: %s\n", what, address, std::strerror(errno));
    if (fd >= 0) {
        ::close(fd);
    }
    return -1;
}

int listen_at(const char *host, const char *port, const char *address) {
    sockaddr_storage where{};
    socklen_t length = 0;
    const int fd = make_socket(host, port, SOCK_STREAM, &where, &length);
    if (fd < 0) {
        return -1;
    }
    const int yes = 1;
    setsockopt(fd, SOL_SOCKET, SO_REUSEADDR, &yes, sizeof yes);
    if (bind(fd, reinterpret_cast<sockaddr *>(&where), length) != 0) {
        return fail(fd, "cannot listen at", address);
    }
    return listen(fd, 4) == 0 ? fd : fail(fd, "cannot listen at", address);
}

unsigned local_port(int fd) {
    sockaddr_storage where{};
    socklen_t length = sizeof where;
    getsockname(fd, reinterpret_cast<sockaddr *>(&where), &length);
    const bool v6 = where.ss_family == AF_INET6;
    return ntohs(v6 ? reinterpret_cast<sockaddr_in6 *>(&where)->sin6_port
                    : reinterpret_cast<sockaddr_in *>(&where)->sin_port);
}

} // namespace

bool TcpPort::open(const char *address) {
    char host[128];
    const char *port = nullptr;
    if (!split_address(address, host, sizeof host, &port)) {
        return false;
    }
    listener_ = listen_at(host, port, address);
    if (listener_ < 0) {
        return false;
    }
    std::snprintf(url_, sizeof url_, "tcp:%s:%u", host, local_port(listener_));
    return true;
}

void TcpPort::close_port() {
    disconnected();
    if (listener_ >= 0) {
        ::close(listener_);
        listener_ = -1;
    }
}

void TcpPort::disconnected() {
    if (fd_ >= 0) {
        ::close(fd_);
        fd_ = -1;
    }
    session_ = 0;
}

size_t TcpPort::wait_for(pollfd *fds) {
    fds[0] = {listener_, POLLIN, 0};
    fds[1] = {fd_, wanted_events(), 0};
    return fd_ >= 0 ? 2 : 1;
}

void TcpPort::service(const pollfd *fds) {
    push();
    // A client whose last bytes or end are still to be read goes first: the new one may be its successor.
    const bool occupied = fd_ >= 0 && fds[1].revents != 0;
    if ((fds[0].revents & POLLIN) == 0 || occupied) {
        return;
    }
    const int fd = accept(listener_, nullptr, nullptr);
    if (fd < 0) {
        return;
    }
    if (fd_ >= 0) {
        // Two masters would fight over one robot: the first one stays.
        std::fprintf(stderr, "omni-firmware: %s: a second client was refused, one is connected already\n", url_);
        ::close(fd);
        return;
    }
    const int yes = 1;
    setsockopt(fd, IPPROTO_TCP, TCP_NODELAY, &yes, sizeof yes);
    connected(fd);
}

bool UdpPort::open(const char *address) {
    char host[128];
    const char *port = nullptr;
    if (!split_address(address, host, sizeof host, &port)) {
        return false;
    }
    sockaddr_storage where{};
    socklen_t length = 0;
    const int fd = make_socket(host, port, SOCK_DGRAM, &where, &length);
    if (fd < 0) {
        return false;
    }
    if (connect(fd, reinterpret_cast<sockaddr *>(&where), length) != 0) {
        return fail(fd, "cannot send to", address) >= 0;
    }
    std::snprintf(url_, sizeof url_, "udp:%s:%s", host, port);
    connected(fd);
    return true;
}

void UdpPort::close_port() {
    if (fd_ >= 0) {
        ::close(fd_);
        fd_ = -1;
    }
}

size_t UdpPort::wait_for(pollfd *fds) {
    fds[0] = {fd_, POLLIN, 0};
    return 1;
}

} // namespace omni
