/* SPDX-License-Identifier: MIT */
#include "wire.h"

#include <errno.h>
#include <limits.h>
#include <poll.h>
#include <time.h>
#include <unistd.h>

int64_t hil_wire_now_us(void) {
    struct timespec now;
    (void)clock_gettime(CLOCK_MONOTONIC, &now);
    return (int64_t)now.tv_sec * 1000000 + now.tv_nsec / 1000;
}

void hil_wire_sleep_until(int64_t wall_us) {
    for (int64_t left_us = wall_us - hil_wire_now_us(); left_us > 0; left_us = wall_us - hil_wire_now_us()) {
        const struct timespec pause = {.tv_sec = (time_t)(left_us / 1000000), .tv_nsec = (long)(left_us % 1000000) * 1000};
        (void)nanosleep(&pause, NULL); /* a signal only makes another round */
    }
}

/* Milliseconds to the deadline, rounded up, so that the last one is waited for. */
static int poll_timeout_ms(int64_t deadline_us) {
    const int64_t left_ms = (deadline_us - hil_wire_now_us() + 999) / 1000;
    if (left_ms < 0) {
        return 0;
    }
    return left_ms < INT_MAX ? (int)left_ms : INT_MAX;
}

static hil_result_t wait_for(int32_t fd, short events, int64_t deadline_us) {
    for (;;) {
        struct pollfd poller = {.fd = fd, .events = events};
        const int ready = poll(&poller, 1, poll_timeout_ms(deadline_us));
        if (ready > 0) {
            /* A closed link with bytes left to read reports both; read() tells when they are used up. */
            return (poller.revents & (events | POLLHUP)) != 0 ? HIL_OK : HIL_ERR_LINK;
        }
        if (ready == 0) {
            return HIL_ERR_TIMEOUT;
        }
        if (errno != EINTR) {
            return HIL_ERR_LINK;
        }
    }
}

static bool try_again(void) {
    return errno == EINTR || errno == EAGAIN || errno == EWOULDBLOCK;
}

hil_result_t hil_wire_write(int32_t fd, const uint8_t *data, uint32_t length, int64_t deadline_us) {
    uint32_t written = 0;
    while (written < length) {
        const hil_result_t ready = wait_for(fd, POLLOUT, deadline_us);
        if (ready != HIL_OK) {
            return ready;
        }
        const ssize_t count = write(fd, data + written, length - written);
        if (count > 0) {
            written += (uint32_t)count;
        } else if (!try_again()) {
            return HIL_ERR_LINK;
        }
    }
    return HIL_OK;
}

hil_result_t hil_wire_read(int32_t fd, uint8_t *data, uint32_t capacity, int64_t deadline_us, uint32_t *got) {
    for (;;) {
        const hil_result_t ready = wait_for(fd, POLLIN, deadline_us);
        if (ready != HIL_OK) {
            return ready;
        }
        const ssize_t count = read(fd, data, capacity);
        if (count > 0) {
            *got = (uint32_t)count;
            return HIL_OK;
        }
        if (count == 0 || !try_again()) {
            return HIL_ERR_LINK;
        }
    }
}
