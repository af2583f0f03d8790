/* SPDX-License-Identifier: MIT */
#include <math.h>
#include <omni/mavlink.h>
#include <string.h>

#include "fill_readings_gen.h"
#include "hil_sim/runner.h"
#include "record.h"
#include "wire.h"

enum {
    FRAME_START = 0xFD,
    HEADER = 10,
    CHECKSUM = 2,
    SIGNATURE = 13,
    STAMP = 8,
    FLAG_SIGNED = 1,
    RX_ENOUGH = HIL_LOCKSTEP_RX / 4 * 3,
    RESYNC_us = 200000,     /* silence within a frame after which its start was a false one */
    PACE_SLACK_us = 100000, /* further behind real time than this is not caught up */
    OUTSIDE_ENOUGH = 2      /* heartbeats; one may have been on its way when the robot entered */
};

typedef struct answer_t {
    bool arrived;
    hil_result_t result;
    mavlink_omni_hil_actuators_t message;
} answer_t;

void hil_lockstep_init(hil_lockstep_t *link, int32_t fd, uint8_t system_id, uint8_t component_id) {
    memset(link, 0, sizeof *link);
    link->fd = fd;
    link->system_id = system_id;
    link->component_id = component_id;
    link->send_fixes = true;
    link->timeout_s = 5.0;
    hil_waiting_init(&link->waiting, true);
}

/* ------------------------------------------------------------------ sending */

static uint32_t fix_frame(hil_lockstep_t *link, mavlink_status_t *status, const hil_fix_t *fix, uint8_t *bytes) {
    mavlink_vicon_position_estimate_t message = {
        .usec = fix->taken_us, .x = (float)fix->pose[0], .y = (float)-fix->pose[1], .yaw = (float)-fix->pose[2]};
    message.covariance[0] = NAN; /* MAVLink's "unknown" */
    mavlink_message_t frame;
    mavlink_msg_vicon_position_estimate_encode_status(link->system_id, link->component_id, status, &frame, &message);
    return mavlink_msg_to_send_buffer(bytes, &frame);
}

/* What is paced in real time has the time to sleep. */
static bool is_paced(const hil_lockstep_t *link) {
    return link->realtime_factor > 0.0;
}

static bool sleeps(const hil_lockstep_t *link) {
    return is_paced(link) || !hil_waiting_looks(&link->waiting);
}

static uint32_t sensors_frame(hil_lockstep_t *link, mavlink_status_t *status, const hil_sensors_t *sensors,
                              uint8_t *bytes) {
    mavlink_omni_hil_sensors_t message = {.time_us = sensors->time_us,
                                          .sequence = link->sequence,
                                          .i2c_status = sensors->i2c_status,
                                          .i2c_read_length = sensors->i2c_read_length,
                                          .stop_button = sensors->stop_button,
                                          .host_sleeps = sleeps(link) ? 1 : 0};
    fill_readings(&message, sensors);
    memcpy(message.i2c_read, sensors->i2c_read, sizeof message.i2c_read);
    mavlink_message_t frame;
    mavlink_msg_omni_hil_sensors_encode_status(link->system_id, link->component_id, status, &frame, &message);
    return mavlink_msg_to_send_buffer(bytes, &frame);
}

static hil_result_t write_sensors(hil_lockstep_t *link, const hil_sensors_t *sensors, int64_t deadline_us) {
    uint8_t bytes[2 * MAVLINK_MAX_PACKET_LEN];
    uint32_t length = 0;
    mavlink_status_t status = {.current_tx_seq = link->frame_sequence};
    if (sensors->has_fix && link->send_fixes && !sensors->link_silent) {
        length = fix_frame(link, &status, &sensors->fix, bytes);
    }
    length += sensors_frame(link, &status, sensors, bytes + length);
    link->frame_sequence = status.current_tx_seq;
    return hil_wire_write(link->fd, bytes, length, deadline_us);
}

/* ------------------------------------------------------------------ receiving */

static uint32_t frame_length(const uint8_t *frame) {
    const uint32_t signature = (frame[2] & FLAG_SIGNED) != 0 ? SIGNATURE : 0;
    return HEADER + (uint32_t)frame[1] + CHECKSUM + signature;
}

static uint32_t message_id(const uint8_t *frame) {
    return (uint32_t)frame[7] | (uint32_t)frame[8] << 8 | (uint32_t)frame[9] << 16;
}

static bool frame_is_sound(const uint8_t *frame) {
    const mavlink_msg_entry_t *entry = mavlink_get_msg_entry(message_id(frame));
    if (entry == NULL) {
        return false;
    }
    const uint32_t covered = HEADER + (uint32_t)frame[1];
    uint16_t checksum = crc_calculate(frame + 1, (uint16_t)(covered - 1));
    crc_accumulate(entry->crc_extra, &checksum);
    return frame[covered] == (checksum & 0xFF) && frame[covered + 1] == checksum >> 8;
}

/* @param message zero before: trailing zeros are not sent. */
static void copy_payload(const uint8_t *frame, void *message, size_t size) {
    const size_t sent = frame[1];
    memcpy(message, frame + HEADER, sent < size ? sent : size);
}

static void take_answer(hil_lockstep_t *link, const uint8_t *frame, answer_t *answer) {
    mavlink_omni_hil_actuators_t message = {0};
    copy_payload(frame, &message, sizeof message);
    const int32_t ahead = (int32_t)(message.sequence - link->sequence);
    if (ahead < 0) {
        link->stale_answers++;
        return;
    }
    const bool usable = ahead == 0 && message.i2c_length <= sizeof message.i2c;
    answer->arrived = true;
    answer->result = usable ? HIL_OK : HIL_ERR_PROTOCOL;
    answer->message = message;
}

static void collect(hil_lockstep_t *link, const uint8_t *frame, uint32_t length) {
    if (link->rx_length > HIL_LOCKSTEP_RX - length) {
        link->lost_frames++;
        return;
    }
    memcpy(link->rx + link->rx_length, frame, length);
    link->rx_length += length;
}

static void take_heartbeat(hil_lockstep_t *link, const uint8_t *frame) {
    mavlink_heartbeat_t message = {0};
    copy_payload(frame, &message, sizeof message);
    const bool robot = message.autopilot != MAV_AUTOPILOT_INVALID;
    link->outside += robot && (message.base_mode & MAV_MODE_FLAG_HIL_ENABLED) == 0 ? 1u : 0u;
}

static void take_frame(hil_lockstep_t *link, const uint8_t *frame, uint32_t length, answer_t *answer) {
    if (message_id(frame) == MAVLINK_MSG_ID_OMNI_HIL_ACTUATORS) {
        take_answer(link, frame, answer);
    } else {
        if (message_id(frame) == MAVLINK_MSG_ID_HEARTBEAT) {
            take_heartbeat(link, frame);
        }
        collect(link, frame, length);
    }
}

static bool frame_is_complete(const uint8_t *bytes, uint32_t left) {
    return left >= HEADER + CHECKSUM && frame_length(bytes) <= left;
}

/* Take the input apart and keep the start of an unfinished frame. */
static void take_input(hil_lockstep_t *link, answer_t *answer) {
    uint32_t at = 0;
    while (at < link->input_length) {
        const uint8_t *frame = link->input + at;
        if (frame[0] != FRAME_START) {
            at++;
        } else if (!frame_is_complete(frame, link->input_length - at)) {
            break;
        } else if (frame_is_sound(frame)) {
            take_frame(link, frame, frame_length(frame), answer);
            at += frame_length(frame);
        } else {
            link->bad_frames++;
            at++;
        }
    }
    link->input_length -= at;
    memmove(link->input, link->input + at, link->input_length);
}

static void drop_false_start(hil_lockstep_t *link, answer_t *answer) {
    link->bad_frames++;
    link->input[0] = 0;
    take_input(link, answer);
}

static hil_result_t read_some(hil_lockstep_t *link, int64_t deadline_us) {
    uint32_t got = 0;
    const uint32_t room = HIL_LOCKSTEP_INPUT - link->input_length;
    omni_poll_backoff_t *poll_backoff = is_paced(link) ? NULL : &link->waiting.poll_backoff;
    const hil_result_t result =
        hil_wire_read(link->fd, poll_backoff, link->input + link->input_length, room, deadline_us, &got);
    link->input_length += got;
    return result;
}

static hil_result_t await_answer(hil_lockstep_t *link, int64_t deadline_us, answer_t *answer) {
    take_input(link, answer);
    while (!answer->arrived) {
        if (link->outside >= OUTSIDE_ENOUGH) {
            return HIL_ERR_OUTSIDE;
        }
        const int64_t resync_us = hil_wire_now_us() + RESYNC_us;
        const bool within_frame = link->input_length > 0 && resync_us < deadline_us;
        const hil_result_t result = read_some(link, within_frame ? resync_us : deadline_us);
        if (result == HIL_ERR_TIMEOUT && within_frame) {
            drop_false_start(link, answer);
        } else if (result != HIL_OK) {
            return result;
        } else {
            take_input(link, answer);
        }
    }
    return answer->result;
}

/* ------------------------------------------------------------------ serving */

static bool skips(const hil_lockstep_t *link, uint32_t id) {
    bool found = false;
    for (uint32_t i = 0; i < link->skipped_count; i++) {
        found = found || link->skipped[i] == id;
    }
    return found;
}

static void log_frame(hil_lockstep_t *link, const uint8_t *frame, uint32_t length) {
    if (link->log == NULL || link->log_capacity - link->log_length < STAMP + length) {
        return;
    }
    const uint64_t time_us = link->log_epoch_us + link->ticks * OMNI_TICK_US;
    uint8_t *to = link->log + link->log_length;
    for (int i = 0; i < STAMP; i++) {
        to[i] = (uint8_t)(time_us >> (8 * (STAMP - 1 - i)));
    }
    memcpy(to + STAMP, frame, length);
    link->log_length += STAMP + length;
    link->log_frames++;
}

void hil_lockstep_serve(hil_lockstep_t *link) {
    uint32_t kept = link->rx_served;
    for (uint32_t at = kept; at < link->rx_length;) {
        const uint8_t *frame = link->rx + at;
        const uint32_t length = frame_length(frame);
        const bool keeps = !skips(link, message_id(frame));
        log_frame(link, frame, length);
        memmove(link->rx + kept, frame, keeps ? length : 0);
        kept += keeps ? length : 0;
        at += length;
    }
    link->rx_length = kept;
    link->rx_served = kept;
}

static bool has_room(const hil_lockstep_t *link) {
    const bool log_has_room = link->log == NULL || link->log_capacity - link->log_length >= 2 * HIL_LOCKSTEP_RX;
    return link->rx_length < RX_ENOUGH && log_has_room;
}

/* ------------------------------------------------------------------ running */

static void record_tick(hil_record_t *record, const hil_world_t *world, const mavlink_omni_hil_actuators_t *message) {
    hil_sample_t *row = hil_record_row(record, world);
    if (row == NULL) {
        return;
    }
    for (int axis = 0; axis < 3; axis++) {
        row->reference[axis] = (double)message->reference[axis];
        row->estimate[axis] = (double)message->pose[axis];
    }
    for (int i = 0; i < HIL_MAX_WHEELS; i++) {
        row->wheel_reference[i] = (double)message->wheel_reference[i];
    }
    row->wheel_scale = (double)message->wheel_scale;
    row->duty_scale = (double)message->duty_scale;
    row->faults = message->faults;
    row->config_sequence = message->config_sequence;
    row->state = message->state;
    row->phase = message->phase;
}

static void anchor_pace(hil_lockstep_t *link, const hil_world_t *world, int64_t now_us) {
    link->pace_factor = link->realtime_factor;
    link->pace_wall_us = now_us;
    link->pace_world_us = world->time_us;
}

static void pace(hil_lockstep_t *link, const hil_world_t *world) {
    const bool anchored = link->pace_factor == link->realtime_factor && world->time_us >= link->pace_world_us;
    if (!is_paced(link)) {
        link->pace_factor = 0.0;
        return;
    }
    const int64_t now_us = hil_wire_now_us();
    const double elapsed_us = (double)(world->time_us - link->pace_world_us) / link->realtime_factor;
    const int64_t due_us = link->pace_wall_us + (int64_t)elapsed_us;
    if (!anchored || due_us < now_us - PACE_SLACK_us) {
        anchor_pace(link, world, now_us);
    } else {
        hil_wire_sleep_until(due_us);
    }
}

/* A tick's first half: the robot gets its sensors. */
static hil_result_t send_sensors(hil_lockstep_t *link, hil_world_t *world) {
    hil_sensors_t sensors;
    if (link->serve_ticks != 0 && link->ticks % link->serve_ticks == 0) {
        hil_lockstep_serve(link);
    }
    pace(link, world);
    hil_world_sense(world, &sensors);
    link->outside = 0;
    const int64_t now_us = hil_wire_now_us();
    if (!is_paced(link)) {
        hil_waiting_turn(&link->waiting, now_us);
    }
    link->deadline_us = now_us + (int64_t)(link->timeout_s * 1e6);
    const hil_result_t result = write_sensors(link, &sensors, link->deadline_us);
    link->sequence += result == HIL_OK ? 0u : 1u; /* what was half sent is not sent again */
    return result;
}

/* Its second half: what the robot answers drives the chip and the bridges. The step is left. */
static hil_result_t apply_actuators(hil_lockstep_t *link, hil_world_t *world, hil_record_t *record) {
    answer_t answer = {.arrived = false};
    hil_result_t result = await_answer(link, link->deadline_us, &answer);
    link->sequence++;
    if (result == HIL_OK) {
        hil_world_output_enable(world, answer.message.output_enable);
        hil_world_motor_pins(world, answer.message.motor_pins);
        result = hil_world_i2c(world, answer.message.i2c, answer.message.i2c_length);
    }
    if (result == HIL_OK) {
        record_tick(record, world, &answer.message);
    }
    return result;
}

hil_result_t hil_lockstep_run(hil_lockstep_t *link, hil_world_t *world, uint64_t ticks, hil_record_t *record,
                              uint64_t *done) {
    hil_result_t result = HIL_OK;
    for (*done = 0; *done < ticks && has_room(link); ++*done) {
        result = send_sensors(link, world);
        if (result == HIL_OK) {
            result = apply_actuators(link, world, record);
        }
        if (result != HIL_OK) {
            return result;
        }
        hil_world_step(world, hil_world_tick_us(world, OMNI_TICK_US));
        link->ticks++;
    }
    return result;
}

hil_result_t hil_lockstep_send_sensors(hil_lockstep_t *link, hil_world_t *electronics, bool *asked) {
    *asked = has_room(link);
    return *asked ? send_sensors(link, electronics) : HIL_OK;
}

hil_result_t hil_lockstep_apply_actuators(hil_lockstep_t *link, hil_world_t *electronics, hil_record_t *record) {
    const hil_result_t result = apply_actuators(link, electronics, record);
    if (result == HIL_OK) {
        link->ticks++;
    }
    return result;
}
