// SPDX-License-Identifier: MIT
// extern "C" access to one link on a port whose connection and room the test decides.
#include <cstring>

#include "app/link/link.h"
#include "app/link/mavlink_types.h"

namespace {

struct Port final : omni::SerialPort {
    size_t room = 0;
    size_t written = 0;
    uint8_t bytes[omni::Link::buffer_size] = {}; ///< of the last flush
    uint32_t connection = 1;
    size_t read(uint8_t *, size_t) override { return 0; }
    size_t write_space() override { return room - written; }
    bool write(const uint8_t *data, size_t length) override {
        std::memcpy(bytes + written, data, length);
        written += length;
        return true;
    }
    uint32_t session() override { return connection; }
    bool modem = false;
    bool has_baud() override { return modem; }
};

Port port;
omni::Link link;

} // namespace

extern "C" {

void link_connect(uint32_t session) {
    port.connection = session;
    link.attach(&port);
}

/// A serial line with a modem, which may carry a frame now.
void link_modem() {
    port.modem = true;
    link.set_budget(1e6f);
    link.refill(1'000'000);
}

void link_receive() {
    link.receive(0);
}

bool link_send() {
    return link.send(MAVLINK_MSG_ID_HEARTBEAT, mavlink_heartbeat_t{}, omni::Priority::reply);
}

/// An answer to a stop, told apart by a number.
bool link_answer(uint16_t number) {
    mavlink_command_ack_t ack{};
    ack.command = number;
    return link.send(MAVLINK_MSG_ID_COMMAND_ACK, ack, omni::Priority::stop);
}

const uint8_t *link_bytes() {
    return port.bytes;
}

/// Flush into this much room. @return bytes that went out.
uint32_t link_flush(uint32_t room) {
    port.room = room;
    port.written = 0;
    link.flush();
    return static_cast<uint32_t>(port.written);
}
}
