// SPDX-License-Identifier: MIT
/// @file main.cpp  The firmware as a process: opens the links, then ticks by the clock, or by the host in lockstep.
#include <poll.h>
#include <signal.h>
#include <unistd.h>

#include <cstdio>
#include <cstring>
#include <optional>

#include "app/app.h"
#include "boards/posix/options.h"
#include "boards/posix/parts.h"
#include "boards/posix/ports.h"
#include "omni_link/poll_backoff.h"

namespace omni {
namespace {

volatile sig_atomic_t stop_wanted = 0;
int wake_pipe[2] = {-1, -1};

void on_signal(int) {
    stop_wanted = 1;
    const char byte = 0;
    // A full pipe wakes just as well.
    [[maybe_unused]] const ssize_t count = write(wake_pipe[1], &byte, 1);
}

/// @return false at the end of standard input; earlier input is dropped.
bool stdin_goes_on() {
    char dropped[256];
    return read(STDIN_FILENO, dropped, sizeof dropped) > 0;
}

/// Maximum number of missed ticks that are caught up; beyond that time jumps, which the core reports.
constexpr uint64_t catch_up_us = 1'000'000;
/// Timeout of an incomplete frame.
constexpr int idle_ms = 250;
/// Number of waits in lockstep after which new clients and queued output are served, however fast the host is.
constexpr uint32_t waits_per_service = 64;

alignas(8) uint8_t burst_memory[default_burst_bytes];

class Process {
public:
    explicit Process(const Options &options) : options_(options) {}

    bool open();
    void announce() const;
    int run();
    void close_all();

private:
    PosixPort *make_port(const char *link, size_t number, const char **address);
    void start_app();
    void wait(int timeout_ms);
    uint64_t received() const;
    bool look_for_host();
    void obey_host();
    void await_host(int timeout_ms);
    void run_due_ticks();

    const Options &options_;
    PosixClock clock_;
    FileStorage storage_;
    NoWatchdog watchdog_;
    NoEncoders encoders_;
    NoMotorsBus bus_;
    NoOutputEnable output_enable_;
    TcpPort tcp_[Board::max_ports];
    UdpPort udp_[Board::max_ports];
    PtyPort pty_[Board::max_ports];
    PosixPort *ports_[Board::max_ports] = {};
    Board board_;
    std::optional<App> app_;
    omni_poll_backoff_t poll_backoff_{};
    bool sleeps_ = false;
    uint32_t waits_ = 0;
    uint64_t boot_ns_ = 0;
    uint64_t ticked_us_ = 0;
};

PosixPort *Process::make_port(const char *link, size_t number, const char **address) {
    *address = link + 4;
    if (std::strncmp(link, "tcp:", 4) == 0) {
        return &tcp_[number];
    }
    if (std::strncmp(link, "udp:", 4) == 0) {
        return &udp_[number];
    }
    if (std::strncmp(link, "pty:", 4) == 0) {
        return &pty_[number];
    }
    *address = "";
    if (std::strcmp(link, "pty") == 0) {
        return &pty_[number];
    }
    std::fprintf(stderr, "omni-firmware: --link '%s': tcp:HOST:PORT, udp:HOST:PORT or pty[:SYMLINK] is needed\n", link);
    return nullptr;
}

bool Process::open() {
    if (!storage_.open(options_.storage)) {
        return false;
    }
    for (size_t i = 0; i < options_.link_count; ++i) {
        const char *address = nullptr;
        PosixPort *port = make_port(options_.links[i], i, &address);
        if (port == nullptr || !port->open(address)) {
            return false;
        }
        if ((options_.radios >> i & 1) != 0) {
            port->set_radio();
            if (options_.radio_line) {
                port->set_has_baud();
            }
        }
        ports_[i] = port;
        board_.ports[i] = port;
        board_.port_count = i + 1;
    }
    board_.clock = &clock_;
    board_.encoders = &encoders_;
    board_.i2c = &bus_;
    board_.output_enable = &output_enable_;
    board_.storage = &storage_;
    board_.watchdog = &watchdog_;
    board_.robot_values = options_.values;
    board_.use_posix();
    board_.burst_memory = burst_memory;
    board_.burst_bytes = sizeof burst_memory;
    return true;
}

void Process::close_all() {
    for (size_t i = 0; i < board_.port_count; ++i) {
        ports_[i]->close_port();
    }
    storage_.close_file();
}

void print_json_string(const char *text) {
    std::putchar('"');
    for (; *text != '\0'; ++text) {
        if (*text == '"' || *text == '\\') {
            std::putchar('\\');
        }
        std::putchar(*text);
    }
    std::putchar('"');
}

void Process::announce() const {
    std::printf("{\"ready\":true,\"lockstep\":%s,\"links\":[", options_.lockstep ? "true" : "false");
    for (size_t i = 0; i < board_.port_count; ++i) {
        if (i > 0) {
            std::putchar(',');
        }
        print_json_string(ports_[i]->url());
    }
    std::puts("]}");
    std::fflush(stdout);
}

void Process::start_app() {
    boot_ns_ = clock_.stopwatch_ns();
    ticked_us_ = 0;
    clock_.set(0);
    app_.emplace(board_, options_.lockstep);
}

void Process::wait(int timeout_ms) {
    pollfd fds[2 + PosixPort::max_fds * Board::max_ports];
    fds[0] = {wake_pipe[0], POLLIN, 0};
    fds[1] = {options_.end_with_stdin ? STDIN_FILENO : -1, POLLIN, 0};
    size_t count = 2;
    size_t first[Board::max_ports] = {};
    for (size_t i = 0; i < board_.port_count; ++i) {
        first[i] = count;
        count += ports_[i]->wait_for(fds + count);
    }
    if (poll(fds, static_cast<nfds_t>(count), timeout_ms) <= 0) {
        return;
    }
    if (fds[1].revents != 0 && !stdin_goes_on()) {
        stop_wanted = 1;
    }
    for (size_t i = 0; i < board_.port_count; ++i) {
        ports_[i]->service(fds + first[i]);
    }
}

uint64_t Process::received() const {
    uint64_t bytes = 0;
    for (size_t i = 0; i < board_.port_count; ++i) {
        bytes += ports_[i]->received();
    }
    return bytes;
}

/// Serve the links until data arrives, for a short time. @return true if it has arrived and was processed.
bool Process::look_for_host() {
    constexpr uint64_t enough_ns = OMNI_POLL_MAX_us * uint64_t{1000};
    const uint64_t begin_ns = clock_.stopwatch_ns();
    const uint64_t before = received();
    app_->background();
    while (received() == before && clock_.stopwatch_ns() - begin_ns < enough_ns) {
        omni_poll_pause();
        app_->background();
    }
    return received() != before;
}

/// The host measures which way of waiting is faster for both. Each change begins without experience.
void Process::obey_host() {
    if (app_->host_sleeps() != sleeps_) {
        sleeps_ = !sleeps_;
        omni_poll_backoff_init(&poll_backoff_, !sleeps_);
    }
}

void Process::await_host(int timeout_ms) {
    if (++waits_ % waits_per_service == 0) {
        wait(0);
    }
    obey_host();
    const bool polls = omni_poll_backoff_should_poll(&poll_backoff_);
    const uint64_t begin_ns = clock_.stopwatch_ns();
    const bool served = polls && look_for_host();
    if (!served) {
        wait(timeout_ms);
    }
    omni_poll_backoff_record(&poll_backoff_, polls, (clock_.stopwatch_ns() - begin_ns) / 1000);
    if (!served) {
        app_->background();
    }
}

void Process::run_due_ticks() {
    const uint64_t now_us = (clock_.stopwatch_ns() - boot_ns_) / 1000;
    if (now_us > ticked_us_ + catch_up_us) {
        ticked_us_ = now_us - OMNI_TICK_US;
    }
    while (ticked_us_ + OMNI_TICK_US <= now_us) {
        ticked_us_ += OMNI_TICK_US;
        clock_.set(ticked_us_);
        app_->tick();
        app_->background();
    }
}

int Process::run() {
    omni_poll_backoff_init(&poll_backoff_, true);
    start_app();
    while (stop_wanted == 0) {
        if (options_.lockstep) {
            await_host(idle_ms);
        } else if (app_->uses_host_sensors()) {
            await_host(1);
            run_due_ticks();
        } else {
            wait(1);
            run_due_ticks();
            app_->background();
        }
        if (app_->reboot_wanted()) {
            start_app();
        }
    }
    return 0;
}

bool catch_signals() {
    if (pipe(wake_pipe) != 0) {
        std::perror("omni-firmware: pipe");
        return false;
    }
    signal(SIGPIPE, SIG_IGN);
    // A file at its size limit is a write that fails, not the end.
    signal(SIGXFSZ, SIG_IGN);
    signal(SIGINT, on_signal);
    signal(SIGTERM, on_signal);
    if (signal(SIGHUP, on_signal) == SIG_IGN) {
        signal(SIGHUP, SIG_IGN); // nohup
    }
    return true;
}

} // namespace
} // namespace omni

int main(int argc, char **argv) {
    static omni::Options options;
    int exit_code = 0;
    if (!omni::parse_options(argc, argv, &options, &exit_code)) {
        return exit_code;
    }
    static omni::Process process(options);
    if (!omni::catch_signals() || !process.open()) {
        process.close_all();
        return 2;
    }
    process.announce();
    exit_code = process.run();
    process.close_all();
    return exit_code;
}
