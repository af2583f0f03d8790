/* SPDX-License-Identifier: MIT */
/* Endpoints of USB1: queue heads and transfer descriptors in the program's memory [RM, chapter USB, device data
 * structures]. */
#include <string.h>

#include "machine.h"
#include "usb.h"

enum { QUEUE_HEAD = 64, QUEUE_HEAD_USED = 48, DESCRIPTOR = 28, PAGE = 4096, PAGES = 5 };

/* Words of a queue head. */
enum { QH_CAPABILITIES = 0, QH_CURRENT = 1, QH_NEXT = 2, QH_TOKEN = 3, QH_SETUP = 10 };
/* ... and of a transfer descriptor. */
enum { TD_NEXT = 0, TD_TOKEN = 1, TD_PAGES = 2 };

#define TERMINATE 1u
#define TOKEN_ACTIVE (1u << 7)
#define TOKEN_IOC (1u << 15)
#define TOKEN_TOTAL_SHIFT 16
#define TOKEN_TOTAL_MASK 0x7FFFu
#define CAPABILITY_NO_ZERO_LENGTH (1u << 29)
#define CAPABILITY_PACKET_MASK 0x7FFu
#define ENDPTCTRL_TXE (1u << 23)
#define ENDPTCTRL_TXS (1u << 16)
#define ENDPTCTRL_RXE (1u << 7)
#define ENDPTCTRL_RXS (1u << 0)

static uint32_t bit_of(uint32_t endpoint, bool in) {
    return 1u << (in ? endpoint + 16 : endpoint);
}

/* NULL, and the model refuses: the program gave the controller an address that is no memory. */
static uint32_t *words_at(rt1062_t *m, uint32_t address, uint32_t size, const char *what) {
    uint8_t *bytes = rt_memory(m, address, size);
    if (bytes == NULL || address % 4 != 0) {
        rt_refuse(m, "USB1 wants a %s at 0x%08X, where no memory is", what, (unsigned)address);
        return NULL;
    }
    return (uint32_t *)(void *)bytes;
}

static uint32_t *queue_head(rt1062_t *m, uint32_t endpoint, bool in) {
    const uint32_t address = m->s.usb.list + (endpoint * 2 + (in ? 1 : 0)) * QUEUE_HEAD;
    return words_at(m, address, QUEUE_HEAD_USED, "queue head");
}

/* Into the queue head, if there is an active one. @return whether there is. */
static bool fetch_descriptor(rt1062_t *m, uint32_t *head, uint32_t next) {
    if ((next & TERMINATE) != 0) {
        return false;
    }
    const uint32_t *descriptor = words_at(m, next & ~31u, DESCRIPTOR, "transfer descriptor");
    if (descriptor == NULL) {
        return false;
    }
    head[QH_CURRENT] = next & ~31u;
    memcpy(&head[QH_NEXT], descriptor, DESCRIPTOR);
    return (head[QH_TOKEN] & TOKEN_ACTIVE) != 0;
}

void rt_usb_fetch_primed(rt1062_t *m) {
    rt_usb_t *u = &m->s.usb;
    for (uint32_t i = 0; i < 2 * RT_USB_ENDPOINTS; i++) {
        const uint32_t bit = bit_of(i / 2, i % 2 != 0);
        uint32_t *head = (u->prime & bit) != 0 ? queue_head(m, i / 2, i % 2 != 0) : NULL;
        if (head != NULL && fetch_descriptor(m, head, head[QH_NEXT])) {
            u->ready |= bit;
        }
        u->prime &= ~bit;
    }
    rt_usb_host_look(m);
}

static uint32_t packet_size(const uint32_t *head) {
    return head[QH_CAPABILITIES] >> 16 & CAPABILITY_PACKET_MASK;
}

static uint32_t bytes_left(const uint32_t *head) {
    return head[QH_TOKEN] >> TOKEN_TOTAL_SHIFT & TOKEN_TOTAL_MASK;
}

static bool answers_at_all(const rt1062_t *m, uint8_t address, uint32_t endpoint, bool in) {
    const rt_usb_t *u = &m->s.usb;
    return rt_usb_attached(m) && u->enabled && !u->suspended && address == u->address_in_force &&
           (u->endpoint[endpoint] & (in ? ENDPTCTRL_TXE : ENDPTCTRL_RXE)) != 0;
}

rt_usb_answer_t rt_usb_would(rt1062_t *m, uint8_t address, uint32_t endpoint, bool in, uint32_t *bytes) {
    const rt_usb_t *u = &m->s.usb;
    *bytes = 0;
    if (!answers_at_all(m, address, endpoint, in)) {
        return RT_USB_SILENT;
    }
    if ((u->endpoint[endpoint] & (in ? ENDPTCTRL_TXS : ENDPTCTRL_RXS)) != 0) {
        return RT_USB_STALL;
    }
    if ((u->ready & bit_of(endpoint, in)) == 0 || (endpoint == 0 && (u->setup_stat & 1) != 0)) {
        return RT_USB_NAK;
    }
    const uint32_t *head = queue_head(m, endpoint, in);
    if (head == NULL) {
        return RT_USB_SILENT;
    }
    *bytes = bytes_left(head) < packet_size(head) ? bytes_left(head) : packet_size(head);
    return RT_USB_ACK;
}

/* The place of byte `at` of the transfer: the first page pointer has an offset, the others are whole pages. NULL: no
 * memory, refused. */
static uint8_t *byte_at(rt1062_t *m, const uint32_t *descriptor, uint32_t at) {
    const uint32_t offset = descriptor[TD_PAGES] % PAGE + at;
    const uint32_t page = offset / PAGE;
    const uint32_t address = page < PAGES ? (descriptor[TD_PAGES + page] & ~(PAGE - 1u)) + offset % PAGE : 0;
    uint8_t *byte = page < PAGES ? rt_memory(m, address, 1) : NULL;
    if (byte == NULL) {
        rt_refuse(m, "USB1 wants a buffer at 0x%08X, where no memory is", (unsigned)address);
    }
    return byte;
}

/* Between the transfer's buffer and a packet. @return false: refused. */
static bool copy_packet(rt1062_t *m, const uint32_t *head, bool in, uint8_t *packet, uint32_t count) {
    const uint32_t *descriptor = words_at(m, head[QH_CURRENT], DESCRIPTOR, "transfer descriptor");
    if (descriptor == NULL) {
        return false;
    }
    const uint32_t done = (descriptor[TD_TOKEN] >> TOKEN_TOTAL_SHIFT & TOKEN_TOTAL_MASK) - bytes_left(head);
    for (uint32_t i = 0; i < count; i++) {
        uint8_t *byte = byte_at(m, descriptor, done + i);
        if (byte == NULL) {
            return false;
        }
        if (in) {
            packet[i] = *byte;
        } else {
            *byte = packet[i];
        }
    }
    return true;
}

/* A transfer is over: tell its descriptor, and go on with the next one, which the program may have appended meanwhile.
 */
static void retire(rt1062_t *m, uint32_t *head, uint32_t bit, bool short_packet) {
    rt_usb_t *u = &m->s.usb;
    uint32_t *descriptor = words_at(m, head[QH_CURRENT], DESCRIPTOR, "transfer descriptor");
    if (descriptor == NULL) {
        return;
    }
    head[QH_TOKEN] &= ~TOKEN_ACTIVE;
    descriptor[TD_TOKEN] = head[QH_TOKEN];
    u->usbcmd &= ~RT_USB_TRIPWIRE_DESCRIPTOR;
    if ((head[QH_TOKEN] & TOKEN_IOC) != 0 || short_packet) {
        u->complete |= bit;
        rt_usb_raise(m, RT_USB_UI);
    }
    head[QH_NEXT] = descriptor[TD_NEXT];
    if (!fetch_descriptor(m, head, head[QH_NEXT])) {
        u->ready &= ~bit;
    }
}

/* A packet went over the bus. A transfer ends with a short one, or when all is done and no empty packet is to follow.
 */
static void packet_done(rt1062_t *m, uint32_t *head, uint32_t bit, bool in, uint32_t count) {
    const uint32_t left = bytes_left(head) - count;
    head[QH_TOKEN] = (head[QH_TOKEN] & ~(TOKEN_TOTAL_MASK << TOKEN_TOTAL_SHIFT)) | left << TOKEN_TOTAL_SHIFT;
    const bool short_packet = count < packet_size(head);
    if (short_packet || (left == 0 && (head[QH_CAPABILITIES] & CAPABILITY_NO_ZERO_LENGTH) != 0)) {
        retire(m, head, bit, short_packet && !in && left > 0);
    }
}

rt_usb_answer_t rt_usb_setup(rt1062_t *m, uint8_t address, const uint8_t packet[8]) {
    rt_usb_t *u = &m->s.usb;
    if (!answers_at_all(m, address, 0, false)) {
        return RT_USB_SILENT;
    }
    uint32_t *head = queue_head(m, 0, false);
    if (head == NULL) {
        return RT_USB_SILENT;
    }
    memcpy(&head[QH_SETUP], packet, 8);
    u->address &= ~RT_USB_ADDRESS_STAGED;
    u->endpoint[0] &= ~(ENDPTCTRL_TXS | ENDPTCTRL_RXS);
    u->usbcmd &= ~RT_USB_TRIPWIRE_SETUP;
    u->setup_stat |= 1;
    rt_usb_raise(m, RT_USB_UI);
    return RT_USB_ACK;
}

rt_usb_answer_t rt_usb_out(rt1062_t *m, uint8_t address, uint32_t endpoint, bool toggle, const uint8_t *bytes,
                           uint32_t count) {
    rt_usb_t *u = &m->s.usb;
    const uint32_t bit = bit_of(endpoint, false);
    uint32_t room = 0;
    const rt_usb_answer_t answer = rt_usb_would(m, address, endpoint, false, &room);
    if (answer != RT_USB_ACK) {
        return answer;
    }
    if (endpoint != 0 && toggle != ((u->toggle & bit) != 0)) {
        return RT_USB_ACK;
    }
    uint32_t *head = queue_head(m, endpoint, false);
    if (count > room) {
        rt_refuse(m, "a packet of %u bytes for endpoint %u, which wants %u", (unsigned)count, (unsigned)endpoint,
                  (unsigned)room);
        return RT_USB_SILENT;
    }
    uint8_t packet[RT_USB_PACKET];
    memcpy(packet, bytes, count);
    if (head == NULL || !copy_packet(m, head, false, packet, count)) {
        return RT_USB_SILENT;
    }
    u->toggle ^= bit;
    u->address &= endpoint == 0 ? ~RT_USB_ADDRESS_STAGED : ~0u;
    packet_done(m, head, bit, false, count);
    return RT_USB_ACK;
}

rt_usb_answer_t rt_usb_in(rt1062_t *m, uint8_t address, uint32_t endpoint, bool *toggle, uint8_t *bytes,
                          uint32_t *count) {
    rt_usb_t *u = &m->s.usb;
    const uint32_t bit = bit_of(endpoint, true);
    const rt_usb_answer_t answer = rt_usb_would(m, address, endpoint, true, count);
    if (answer != RT_USB_ACK) {
        return answer;
    }
    uint32_t *head = queue_head(m, endpoint, true);
    if (head == NULL || !copy_packet(m, head, true, bytes, *count)) {
        return RT_USB_SILENT;
    }
    *toggle = (u->toggle & bit) != 0;
    u->toggle ^= bit;
    if (endpoint == 0 && (u->address & RT_USB_ADDRESS_STAGED) != 0) {
        u->address &= ~RT_USB_ADDRESS_STAGED;
        u->address_in_force = u->address >> 25;
    }
    packet_done(m, head, bit, true, *count);
    return RT_USB_ACK;
}
