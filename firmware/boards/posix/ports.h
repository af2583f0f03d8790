// SPDX-License-Identifier: MIT
/// @file ports.h  Byte links of the PC board: TCP server, UDP, pseudo-terminal. Non-blocking.
#pragma once

#include <poll.h>

#include <cstddef>
#include <cstdint>

#include "app/base/board.h"

namespace omni {

/// A port with file descriptors to wait for. Sending is buffered, so that one write() takes all of a background pass.
class PosixPort : public SerialPort {
public:
    static constexpr size_t max_fds = 2;

    /// Open from what follows the scheme of a link's URL. @return false after saying why on standard error.
    virtual bool open(const char *address) = 0;
    virtual void close_port() = 0;
    /// What to wait for. @return how many entries were filled.
    virtual size_t wait_for(struct pollfd *fds) = 0;
    /// Accept or refuse connections, send what waits. @param fds what wait_for() filled, after poll().
    virtual void service(const struct pollfd *fds) = 0;
    /// URL under which a ground station reaches this port.
    const char *url() const { return url_; }

    size_t read(uint8_t *data, size_t capacity) override;
    size_t write_space() override { return session_ != 0 ? sizeof out_ - pending_ : 0; }
    bool write(const uint8_t *data, size_t length) override;
    uint32_t session() override { return session_; }
    bool has_baud() override { return has_baud_; }
    bool is_radio() override { return is_radio_; }
    /// Bytes read since the start.
    uint64_t received() const { return received_; }
    /// The port stands for a modem, whose baud rate limits it.
    void set_has_baud() { has_baud_ = true; }
    /// Others reach this port through the air.
    void set_radio() { is_radio_ = true; }

protected:
    ~PosixPort() = default;
    void connected(int fd);
    /// The other end has closed.
    virtual void disconnected() = 0;
    void push();
    short wanted_events() const;

    char url_[192] = {};
    int fd_ = -1; ///< connection
    bool has_baud_ = false;
    bool is_radio_ = false;
    uint32_t session_ = 0;
    uint32_t sessions_ = 0;
    uint64_t received_ = 0;
    size_t pending_ = 0;
    uint8_t out_[65536];
};

class TcpPort final : public PosixPort {
public:
    bool open(const char *address) override;
    void close_port() override;
    size_t wait_for(struct pollfd *fds) override;
    void service(const struct pollfd *fds) override;

private:
    void disconnected() override;
    int listener_ = -1;
};

class UdpPort final : public PosixPort {
public:
    bool open(const char *address) override;
    void close_port() override;
    size_t wait_for(struct pollfd *fds) override;
    void service(const struct pollfd *) override { push(); }

private:
    void disconnected() override {} ///< no peer yet: keep trying
};

class PtyPort final : public PosixPort {
public:
    bool open(const char *address) override;
    void close_port() override;
    size_t wait_for(struct pollfd *fds) override;
    void service(const struct pollfd *) override { push(); }

private:
    void disconnected() override {} ///< we hold the other side open ourselves
    int other_side_ = -1;
    char symlink_[160] = {};
};

/// Split HOST:PORT. @return false after saying why on standard error.
bool split_address(const char *address, char *host, size_t host_size, const char **port);

} // namespace omni
