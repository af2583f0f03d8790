/* SPDX-License-Identifier: MIT */
/**
 * @file usb.h
 * USB1 as a device controller [RM, chapters USB and USB-PHY], and the host at the other end of its cable.
 *
 * The device keeps its queue heads and transfer descriptors in the program's memory. Packets take their time on a bus
 * of 480 (or 12) Mbit/s. A transaction that the device would answer with NAK is not shown: it happens as soon as the
 * endpoint is ready.
 *
 * The host is as a PC's. It waits 100 ms after a device has shown up, resets it, asks for its descriptors, and gives it
 * an address and a configuration. Then it is a CDC serial port: while a program holds it open it reads whatever comes,
 * and writes.
 */
#ifndef EMULATED_TEENSY_USB_H
#define EMULATED_TEENSY_USB_H

#include <stdbool.h>
#include <stdint.h>

#include "emulated_teensy/rt1062.h"

enum {
    RT_USB_ENDPOINTS = 8,
    RT_USB_TIMERS = 2,
    RT_USB_TO_ROBOT = 16384, /* bytes that the host keeps for the robot */
    RT_USB_CONTROL = 512,    /* longest control transfer of the host */
    RT_USB_PACKET = 512      /* longest packet */
};

/* What a USB deadline is for. */
typedef enum rt_usb_due_t {
    RT_USB_DUE_PRIME = 0, /* the controller has looked at the primed endpoints' queue heads */
    RT_USB_DUE_HOST,      /* the host's next step or packet */
    RT_USB_DUE_FRAME,     /* start of the next microframe, if somebody wants to know */
    RT_USB_DUE_SUSPEND,   /* the bus has been silent for 3 ms */
    RT_USB_DUE_TIMER0,
    RT_USB_DUE_TIMER1,
    RT_USB_DUE_COUNT
} rt_usb_due_t;

typedef enum rt_usb_host_step_t {
    RT_USB_HOST_ALONE = 0, /* nothing at the cable */
    RT_USB_HOST_DEBOUNCE,  /* a device pulls the data line up */
    RT_USB_HOST_RESET,     /* bus reset */
    RT_USB_HOST_RECOVERY,  /* bus reset is over */
    RT_USB_HOST_DEVICE_8,  /* from here: control transfers of the enumeration */
    RT_USB_HOST_ADDRESS,
    RT_USB_HOST_DEVICE,
    RT_USB_HOST_CONFIGURATION_9,
    RT_USB_HOST_CONFIGURATION,
    RT_USB_HOST_CONFIGURE,
    RT_USB_HOST_READY,  /* configured; a serial port */
    RT_USB_HOST_GAVE_UP /* a device that can't be used */
} rt_usb_host_step_t;

typedef enum rt_usb_stage_t { RT_USB_NO_TRANSFER = 0, RT_USB_SETUP, RT_USB_DATA, RT_USB_STATUS } rt_usb_stage_t;

/* What is on the bus. */
typedef enum rt_usb_work_t {
    RT_USB_IDLE = 0,
    RT_USB_GAP,
    RT_USB_CONTROL_PACKET,
    RT_USB_BULK_OUT,
    RT_USB_BULK_IN
} rt_usb_work_t;

typedef struct rt_usb_control_t {
    rt_usb_stage_t stage;
    uint8_t setup[8];
    uint8_t data[RT_USB_CONTROL];
    uint32_t length; /* bytes of data: to be sent, or received so far */
    uint32_t at;     /* bytes sent so far */
    uint64_t give_up_ns;
} rt_usb_control_t;

typedef struct rt_usb_host_t {
    bool cable;
    bool full_speed;    /* a host of 12 Mbit/s */
    bool deaf;          /* whoever has the port open does not read, and what the computer keeps for it is full */
    bool open_wanted;   /* a program holds the port open, or waits for it */
    bool open_told;     /* the device knows */
    uint32_t baud;      /* of the line coding that the program wants */
    uint32_t baud_told; /* 0: none yet */
    rt_usb_host_step_t step;
    uint32_t tries;
    uint8_t address;
    uint8_t bulk_in; /* endpoint numbers, 0: not found */
    uint8_t bulk_out;
    uint16_t bulk_in_packet;
    uint16_t bulk_out_packet;
    uint8_t control_packet;
    uint8_t interface; /* of the CDC control */
    uint16_t toggle;   /* data toggles: a bit per endpoint, from bit 8 on those from the device */
    bool out_last;     /* the two directions take turns */
    rt_usb_work_t work;
    rt_usb_control_t control;
    uint8_t to_robot[RT_USB_TO_ROBOT]; /* a ring */
    uint32_t to_robot_begin;
    uint32_t to_robot_count;
} rt_usb_host_t;

typedef struct rt_usb_timer_t {
    uint32_t load; /* GPTIMERnLD: us less one */
    bool running;
    bool repeats;
    uint64_t left_ns; /* while it does not run */
    uint64_t end_ns;  /* while it runs */
} rt_usb_timer_t;

typedef struct rt_usb_t {
    uint32_t usbcmd;
    uint32_t usbsts;
    uint32_t usbintr;
    uint32_t usbmode;
    uint32_t address; /* DEVICEADDR; bit 24: staged */
    uint32_t address_in_force;
    uint32_t list; /* ENDPOINTLISTADDR */
    uint32_t burst;
    uint32_t setup_stat;
    uint32_t prime;
    uint32_t ready; /* ENDPTSTAT */
    uint32_t complete;
    uint32_t toggle;                     /* data toggles, bits as in ENDPTSTAT */
    uint32_t endpoint[RT_USB_ENDPOINTS]; /* ENDPTCTRLn */
    bool in_reset;                       /* the host holds the bus in reset */
    bool enabled;                        /* after it */
    bool high_speed;
    bool suspended;
    bool frames;            /* the host sends starts of frames */
    uint64_t frames_ns;     /* ... since then */
    uint64_t frame_seen_ns; /* SRI was last cleared */
    rt_usb_timer_t timer[RT_USB_TIMERS];
    uint32_t phy_pwd;
    uint32_t phy_tx;
    uint32_t phy_rx;
    uint32_t phy_ctrl;
    uint64_t due_ns[RT_USB_DUE_COUNT];
    rt_usb_host_t host;
} rt_usb_t;

/* How a device answers a token. */
typedef enum rt_usb_answer_t { RT_USB_ACK = 0, RT_USB_NAK, RT_USB_STALL, RT_USB_SILENT } rt_usb_answer_t;

/* DEVICEADDR: the address comes into force with the next IN on endpoint 0 that is acknowledged. */
#define RT_USB_ADDRESS_STAGED (1u << 24)

/* USBCMD: tripwires. The controller clears them when it does what the program wants to be sure did not happen. */
#define RT_USB_TRIPWIRE_SETUP (1u << 13)
#define RT_USB_TRIPWIRE_DESCRIPTOR (1u << 14)

/* Bits of USBSTS and USBINTR. */
#define RT_USB_UI (1u << 0)
#define RT_USB_PCI (1u << 2)
#define RT_USB_SEI (1u << 4)
#define RT_USB_URI (1u << 6)
#define RT_USB_SRI (1u << 7)
#define RT_USB_SLI (1u << 8)

/* ---- usb.c: the controller */

void rt_usb_at(rt1062_t *m, rt_usb_due_t due, uint64_t at_ns);
void rt_usb_raise(rt1062_t *m, uint32_t status);
/* The device pulls the data line up: the controller runs and its transceiver is awake. */
bool rt_usb_attached(const rt1062_t *m);
/* Call it with what rt_usb_attached() was before something it depends on changed. */
void rt_usb_attachment_changed(rt1062_t *m, bool before);
/* The host begins and ends a bus reset; after it the bus is at high or full speed and has frames. */
void rt_usb_bus_reset(rt1062_t *m, bool on);
/* No more frames: the cable is out, or the host sleeps. */
void rt_usb_bus_silent(rt1062_t *m);

/* ---- usb_phy.c: the transceiver */

bool rt_usb_phy_awake(const rt1062_t *m);

/* ---- usb_endpoint.c: what the controller does with tokens, by queue heads and transfer descriptors in memory */

/* Fetch the first descriptor of every primed endpoint. */
void rt_usb_fetch_primed(rt1062_t *m);
/* The answer that a token to this endpoint would get now. @param in from the device. @param bytes out: that it would
 * send. */
rt_usb_answer_t rt_usb_would(rt1062_t *m, uint8_t address, uint32_t endpoint, bool in, uint32_t *bytes);
rt_usb_answer_t rt_usb_setup(rt1062_t *m, uint8_t address, const uint8_t packet[8]);
/* @param toggle the packet's data toggle; one that the device has had already is acknowledged and dropped. Not looked
 * at on endpoint 0. */
rt_usb_answer_t rt_usb_out(rt1062_t *m, uint8_t address, uint32_t endpoint, bool toggle, const uint8_t *bytes,
                           uint32_t count);
/* @param toggle out. @param bytes room for RT_USB_PACKET. */
rt_usb_answer_t rt_usb_in(rt1062_t *m, uint8_t address, uint32_t endpoint, bool *toggle, uint8_t *bytes,
                          uint32_t *count);

/* ---- usb_host.c */

void rt_usb_host_step(rt1062_t *m, uint64_t at_ns);
/* Something may have changed that the host waits for: a device on the cable, a primed endpoint, bytes to send, room for
 * bytes. */
void rt_usb_host_look(rt1062_t *m);
/* The device has let the bus go. */
void rt_usb_host_lost(rt1062_t *m);

#endif
