// SPDX-License-Identifier: MIT
/* A robot in a few lines of physics around Omniwheel's firmware: ./circle HOST PORT robot.params */
#include <math.h>
#include <netdb.h>
#include <netinet/tcp.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>

#include "mavlink.h"

enum { WHEELS = 3, CHIP = 0x40, MODE1 = 0x00, GROUND_STATION = 254 };
static const double PI = 3.14159265358979323846, TICK_s = 1e-3;

typedef struct {
    double x, y, theta, speed[WHEELS], angle[WHEELS];
} plant_t;

static plant_t plant = {.x = 0.05}; /* where the robot stands [m, m, rad] */
static int wire;
static uint32_t ticks;
static uint8_t mode1 = 0x11;        /* the chip is asleep after power-up */
static uint8_t status, read_length; /* how the chip's transactions of the last tick went, and what was read */
static int acknowledged, wanted;    /* result of the command that is waited for: -1, none yet */
static mavlink_omni_hil_actuators_t answer;

/* ---- parameters, NAME=VALUE a line each */
static char text[65536];

static double parameter(const char *name) {
    const size_t length = strlen(name);
    for (const char *line = text; line != NULL; line = strchr(line, '\n')) {
        line += *line == '\n';
        if (strncmp(line, name, length) == 0 && line[length] == '=') {
            return atof(line + length + 1);
        }
    }
    fprintf(stderr, "the parameters have no %s\n", name);
    exit(1);
}

static double of_wheel(int wheel, const char *rest) {
    char name[32];
    snprintf(name, sizeof name, "W%d_%s", wheel + 1, rest);
    return parameter(name);
}

/* ---- physics: wheels follow their motors with a lag and roll without slip */
static void step(const mavlink_omni_hil_actuators_t *a) {
    const double k = parameter("MOT_K"), r = parameter("MOT_R"), radius = parameter("WHEEL_RADIUS");
    const double drag = parameter("MOT_B") + k * k / r, lag_s = 3 * parameter("MOT_J") / drag;
    double forward = 0, left = 0, turn = 0;
    for (int i = 0; i < WHEELS; ++i) {
        const int coasts = a->coast >> i & 1; /* here as if the motor were shorted */
        const double volts = coasts ? 0 : a->duty[i] / 4096.0 * parameter("BAT_V_NOM");
        const double bearing = of_wheel(i, "ANGLE") * PI / 180;
        plant.speed[i] += (k / r / drag * volts - plant.speed[i]) * TICK_s / lag_s;
        plant.angle[i] += plant.speed[i] * TICK_s;
        forward -= 2.0 / 3 * sin(bearing) * radius * plant.speed[i];
        left += 2.0 / 3 * cos(bearing) * radius * plant.speed[i];
        turn += radius * plant.speed[i] / (3 * parameter("WHEEL_DIST"));
    }
    const double heading = plant.theta + 0.5 * TICK_s * turn;
    plant.x += TICK_s * (forward * cos(heading) - left * sin(heading));
    plant.y += TICK_s * (forward * sin(heading) + left * cos(heading));
    plant.theta += TICK_s * turn;
}

/* ---- the chip, as far as its duties come as numbers: it keeps MODE1 and reads it back */
static void chip(const uint8_t *i2c, int length) {
    status = read_length = 0;
    for (int at = 0; at < length;) {
        const uint8_t address = i2c[at], written = i2c[at + 1], *bytes = i2c + at + 2, wants = bytes[written];
        at += 3 + written;
        if (address != CHIP) {
            status |= 1; /* nobody has that address: not acknowledged */
        } else if (written == 2 && bytes[0] == MODE1) {
            mode1 = bytes[1];
        } else if (written == 1 && bytes[0] == MODE1 && wants == 1) {
            read_length = 1;
        }
    }
}

/* ---- the link */
static void send_message(const mavlink_message_t *message) {
    uint8_t bytes[MAVLINK_MAX_PACKET_LEN];
    const int length = mavlink_msg_to_send_buffer(bytes, message);
    if (write(wire, bytes, (size_t)length) != length) {
        perror("send");
        exit(1);
    }
}

static void send_sensors(void) {
    mavlink_message_t message;
    const uint64_t time_us = 1000u * (uint64_t)ticks;
    if (ticks % 500 == 0) { /* a robot that hears no ground station stops */
        mavlink_msg_heartbeat_pack(GROUND_STATION, 1, &message, MAV_TYPE_GCS, MAV_AUTOPILOT_INVALID, 0, 0, 0);
        send_message(&message);
    }
    if (ticks % 20 == 0) { /* a fix goes before the sensors of its tick; North, East, Down: y and yaw change sign */
        float covariance[21] = {NAN};
        mavlink_msg_vicon_position_estimate_pack(GROUND_STATION, 1, &message, time_us, (float)plant.x, (float)-plant.y,
                                                 0, 0, 0, (float)-plant.theta, covariance);
        send_message(&message);
    }
    mavlink_omni_hil_sensors_t sensors = {.time_us = time_us, .sequence = ticks, .counts_valid = 7};
    sensors.battery_voltage = (float)parameter("BAT_V_NOM");
    sensors.i2c_status = status;
    sensors.i2c_read_length = read_length;
    sensors.i2c_read[0] = mode1;
    for (int i = 0; i < WHEELS; ++i) {
        const double edges = floor(plant.angle[i] * parameter("ENC_CPR") / (2 * PI));
        sensors.counts[i] = (int32_t)(of_wheel(i, "ENC_DIR") * edges);
    }
    mavlink_msg_omni_hil_sensors_encode(GROUND_STATION, 1, &message, &sensors);
    send_message(&message);
}

static void take_answer(void) {
    static uint8_t bytes[4096];
    static ssize_t length, at;
    mavlink_message_t message;
    mavlink_status_t parsed;
    for (;;) {
        if (at == length) {
            at = 0;
            length = read(wire, bytes, sizeof bytes);
            if (length <= 0) {
                fprintf(stderr, "the firmware closed the connection\n");
                exit(1);
            }
        }
        if (!mavlink_parse_char(MAVLINK_COMM_0, bytes[at++], &message, &parsed)) {
            continue;
        }
        if (message.msgid == MAVLINK_MSG_ID_COMMAND_ACK && mavlink_msg_command_ack_get_command(&message) == wanted) {
            acknowledged = mavlink_msg_command_ack_get_result(&message);
        } else if (message.msgid == MAVLINK_MSG_ID_OMNI_HIL_ACTUATORS) {
            mavlink_msg_omni_hil_actuators_decode(&message, &answer);
            if (answer.sequence == ticks) {
                return; /* the last frame of the tick */
            }
        }
    }
}

static void tick(void) {
    send_sensors();
    take_answer();
    chip(answer.i2c, answer.i2c_length);
    step(&answer);
    ++ticks;
}

static void command(int number, float p1, float p2, float p3) {
    mavlink_message_t message;
    const uint8_t robot = (uint8_t)parameter("SYS_ID");
    mavlink_msg_command_long_pack(GROUND_STATION, 1, &message, robot, 1, (uint16_t)number, 0, p1, p2, p3, 0, 0, 0, 0);
    send_message(&message);
    acknowledged = -1;
    wanted = number;
    for (int i = 0; i < 500 && acknowledged < 0; ++i) {
        tick();
    }
    if (acknowledged != MAV_RESULT_ACCEPTED) {
        fprintf(stderr, "command %d: result %d\n", number, acknowledged);
        exit(1);
    }
}

static void open_wire(const char *host, const char *port) {
    struct addrinfo hints = {.ai_socktype = SOCK_STREAM}, *found = NULL;
    const int on = 1;
    int connected = getaddrinfo(host, port, &hints, &found);
    for (int i = 0; i < 100 && found != NULL; ++i) { /* the firmware may have been started a moment ago */
        wire = socket(found->ai_family, found->ai_socktype, 0);
        connected = connect(wire, found->ai_addr, found->ai_addrlen);
        if (connected == 0) {
            break;
        }
        close(wire);
        usleep(100000);
    }
    if (connected != 0) {
        fprintf(stderr, "nobody listens at %s:%s: start the firmware first\n", host, port);
        exit(1);
    }
    setsockopt(wire, IPPROTO_TCP, TCP_NODELAY, &on, sizeof on);
    freeaddrinfo(found);
}

int main(int count, char **words) {
    FILE *file = count == 4 ? fopen(words[3], "r") : NULL;
    if (file == NULL || fread(text, 1, sizeof text - 1, file) == 0) {
        fprintf(stderr, "usage: circle HOST PORT robot.params\n");
        return 2;
    }
    fclose(file);
    open_wire(words[1], words[2]);
    for (int i = 0; i < 300; ++i) { /* the chip wakes up, the first fix arrives */
        tick();
    }
    command(MAV_CMD_OMNI_SET_POSE, (float)plant.x, (float)plant.y, (float)plant.theta);
    command(MAV_CMD_OMNI_TRAJECTORY_START, -1, -1, 0); /* as the TRJ_* parameters say */
    command(MAV_CMD_COMPONENT_ARM_DISARM, 1, 0, 0);
    double squares = 0;
    int driven = 0;
    while (answer.phase != 3 && ticks < 120000) {
        const double x = plant.x, y = plant.y;
        tick();
        if (answer.phase == 2) { /* on the path */
            squares += pow(x - answer.reference[0], 2) + pow(y - answer.reference[1], 2);
            ++driven;
        }
    }
    command(MAV_CMD_COMPONENT_ARM_DISARM, 0, 0, 0);
    printf("path driven in %.1f s, position RMSE %.3f mm\n", driven * TICK_s, 1e3 * sqrt(squares / (driven + !driven)));
    return 0;
}
