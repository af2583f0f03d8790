/* SPDX-License-Identifier: MIT */
#include "wire.h"

#include <errno.h>
#include <limits.h>
#include <poll.h>
#include <sys/socket.h>
#include <time.h>
#include <unistd.h>

int64_t hil_wire_now_us(void) {
    struct timespec now;
    (void)clock_gettime(CLOCK_MONOTONIC, &now);
    return (int64_t)now.tv_sec * 1000000 + now.tv_nsec / 1000;
}

void hil_wire_sleep_until(int64_t wall_us) {
    for (int64_t left_us = wall_us - hil_wire_now_us(); left_us > 0; left_us = wall_us - hil_wire_now_us()) {
        const struct timespec pause = {.tv_sec = (time_t)(left_us / 1000000),
                                       .tv_nsec = (long)(left_us % 1000000) * 1000};
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

/* Without waiting. A descriptor that is no socket may block: it is asked first. @return as read() and write(). */
static ssize_t receive_now(int32_t fd, uint8_t *data, uint32_t capacity) {
    const ssize_t count = recv(fd, data, capacity, MSG_DONTWAIT);
    if (count >= 0 || errno != ENOTSOCK) {
        return count;
    }
    struct pollfd poller = {.fd = fd, .events = POLLIN};
    if (poll(&poller, 1, 0) == 0) {
        errno = EAGAIN;
        return -1;
    }
    return read(fd, data, capacity);
}

static ssize_t send_now(int32_t fd, const uint8_t *data, uint32_t length) {
    const ssize_t count = send(fd, data, length, MSG_DONTWAIT);
    if (count >= 0 || errno != ENOTSOCK) {
        return count;
    }
    struct pollfd poller = {.fd = fd, .events = POLLOUT};
    if (poll(&poller, 1, 0) == 0) {
        errno = EAGAIN;
        return -1;
    }
    return write(fd, data, length);
}

hil_result_t hil_wire_write(int32_t fd, const uint8_t *data, uint32_t length, int64_t deadline_us) {
    uint32_t written = 0;
    while (written < length) {
        const ssize_t count = send_now(fd, data + written, length - written);
        if (count > 0) {
            written += (uint32_t)count;
            continue;
        }
        const hil_result_t result = try_again() ? wait_for(fd, POLLOUT, deadline_us) : HIL_ERR_LINK;
        if (result != HIL_OK) {
            return result;
        }
    }
    return HIL_OK;
}

/* @return HIL_ERR_TIMEOUT: nothing has come. */
static hil_result_t take(int32_t fd, uint8_t *data, uint32_t capacity, uint32_t *got) {
    const ssize_t count = receive_now(fd, data, capacity);
    if (count > 0) {
        *got = (uint32_t)count;
        return HIL_OK;
    }
    return count < 0 && try_again() ? HIL_ERR_TIMEOUT : HIL_ERR_LINK;
}

static hil_result_t look(int32_t fd, uint8_t *data, uint32_t capacity, int64_t end_us, uint32_t *got) {
    hil_result_t result = take(fd, data, capacity, got);
    while (result == HIL_ERR_TIMEOUT && hil_wire_now_us() < end_us) {
        omni_poll_pause();
        result = take(fd, data, capacity, got);
    }
    return result;
}

static hil_result_t sleep_and_take(int32_t fd, uint8_t *data, uint32_t capacity, int64_t deadline_us, uint32_t *got) {
    hil_result_t result = HIL_ERR_TIMEOUT;
    while (result == HIL_ERR_TIMEOUT) {
        const hil_result_t ready = wait_for(fd, POLLIN, deadline_us);
        if (ready != HIL_OK) {
            return ready;
        }
        result = take(fd, data, capacity, got);
    }
    return result;
}

hil_result_t hil_wire_read(int32_t fd, omni_poll_backoff_t *poll_backoff, uint8_t *data, uint32_t capacity,
                           int64_t deadline_us, uint32_t *got) {
    const int64_t begin_us = hil_wire_now_us();
    const bool looks = poll_backoff != NULL && omni_poll_backoff_should_poll(poll_backoff);
    hil_result_t result = HIL_ERR_TIMEOUT;
    if (looks) {
        const int64_t enough_us = begin_us + OMNI_POLL_MAX_us;
        result = look(fd, data, capacity, enough_us < deadline_us ? enough_us : deadline_us, got);
    }
    if (result == HIL_ERR_TIMEOUT) {
        result = sleep_and_take(fd, data, capacity, deadline_us, got);
    }
    if (poll_backoff != NULL) {
        omni_poll_backoff_record(poll_backoff, looks, (uint64_t)(hil_wire_now_us() - begin_us));
    }
    return result;
}
