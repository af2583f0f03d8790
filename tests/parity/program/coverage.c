/* SPDX-License-Identifier: MIT */
#include "coverage.h"

#include <inttypes.h>
#include <stdio.h>

#include "omni/safety.h"

static const char *const kinds[COVERAGE_KINDS] = {"hold", "pose", "velocity body", "velocity world", "path", "duty"};
#define NAME(NUMBER, name) #name,
static const char *const controllers[COVERAGE_CONTROLLERS] = {OMNI_CTL_MODE_ROWS(NAME)};
static const char *const paths[COVERAGE_PATHS] = {OMNI_TRJ_TYPE_ROWS(NAME)};
#undef NAME
static const char *const rotations[COVERAGE_ROTATIONS] = {"fixed", "spin", "sine", "tangent"};
static const char *const phases[] = {"none", "lead-in", "path", "done"};
static const char *const wheel_filters[] = {"off", "speed", "angle"};
static const char *const pose_filters[] = {"odometry", "pose", "slip"};
static const char *const switchings[] = {"sign", "boundary", "super-twisting"};

/* Bits that a tick can raise: OMNI_FAULT_CONFIG is the firmware's. */
static const uint32_t reachable =
    ((uint32_t)OMNI_FAULT_STOP_MASK | (uint32_t)OMNI_WARN_MASK) & ~(uint32_t)OMNI_FAULT_CONFIG;

static void note_bits(uint32_t *counts, uint32_t bits) {
    for (int bit = 0; bit < COVERAGE_BITS; ++bit) {
        counts[bit] += bits >> bit & 1u;
    }
}

static void note_armed(coverage_t *coverage, const scene_t *scene) {
    const omni_outputs_t *out = &scene->outputs;
    const omni_robot_config_t *c = scene->robot.config;
    ++coverage->driven[out->setpoint_kind][out->controller];
    ++coverage->wheels[c->kinematics.wheels];
    ++coverage->phase[out->reference.phase];
    coverage->held += scene->robot.control.tracking && scene->robot.control.ticks > 1 ? 1u : 0u;
    coverage->cut += out->wheel_scale < 1.0f || out->duty_scale < 1.0f ? 1u : 0u;
    if (out->setpoint_kind == OMNI_SETPOINT_TRAJECTORY && out->reference.phase == OMNI_PHASE_PATH) {
        const omni_trajectory_config_t *path = &scene->robot.reference_generator.trajectory->config;
        ++coverage->path[path->type][path->rotation];
    }
    if (out->controller == OMNI_CTL_MODE_ISMC) {
        ++coverage->switching[c->ismc.switching];
    }
}

void coverage_note(coverage_t *coverage, const scene_t *scene) {
    const omni_outputs_t *out = &scene->outputs;
    const omni_robot_config_t *c = scene->robot.config;
    const uint32_t used = scene->robot.estimator.pose_ekf.accepted;
    ++coverage->state[out->state];
    ++coverage->wheel_filter[c->motor_kf.mode];
    ++coverage->pose_filter[c->pose_ekf.mode];
    /* A turning wheel is a fault of a robot that is to be armed. OMNI_FAULT_CONFIG only says that it is not now. */
    note_bits(coverage->fault, out->faults | (omni_robot_arming_faults(&scene->robot) & ~(uint32_t)OMNI_FAULT_CONFIG));
    if (out->state == OMNI_STATE_FAILSAFE) {
        note_bits(coverage->history, out->fault_history);
    }
    coverage->fixes_used +=
        scene->inputs.has_fix && scene->robot.estimator.pose_ekf.last_fix_us == scene->now_us && used > 0 ? 1u : 0u;
    coverage->fixes_refused +=
        scene->inputs.has_fix && scene->robot.estimator.pose_ekf.last_fix_us != scene->now_us ? 1u : 0u;
    coverage->restarts +=
        scene->robot.estimator.pose_ekf.restarts > 0 && scene->robot.estimator.pose_ekf.last_fix_us == scene->now_us
            ? 1u
            : 0u;
    coverage->gyro_leads += scene->robot.estimator.gyro.turn.overrides_wheels ? 1u : 0u;
    coverage->gyro_rests += scene->robot.estimator.gyro.turn.at_rest ? 1u : 0u;
    coverage->gyro_rejected += scene->robot.estimator.gyro.rejected ? 1u : 0u;
    const omni_flow_state_t *flow = &scene->robot.estimator.flow;
    coverage->flow_used +=
        flow->last_received_us == scene->now_us && flow->readings_used > 0 && flow->consecutive_fits > 0 ? 1u : 0u;
    coverage->flow_refused += flow->last_received_us == scene->now_us && flow->consecutive_refusals > 0 ? 1u : 0u;
    coverage->currents_cut += out->current_reduction > 0.0f ? 1u : 0u;
    if (out->state == OMNI_STATE_ARMED) {
        note_armed(coverage, scene);
    }
}

/* One line. @return false if it was not reached. */
static bool line(const char *what, const char *of, const char *with, uint32_t ticks, uint32_t least) {
    printf("coverage %s %s%s%s: %" PRIu32 "%s\n", what, of, with[0] != '\0' ? " + " : "", with, ticks,
           ticks < least ? " NOT REACHED" : "");
    return ticks >= least;
}

static bool lines(const char *what, const char *const *names, const uint32_t *ticks, size_t count, uint32_t least) {
    bool reached = true;
    for (size_t i = 0; i < count; ++i) {
        reached = line(what, names[i], "", ticks[i], least) && reached;
    }
    return reached;
}

static bool report_faults(const coverage_t *coverage, uint32_t least) {
    bool reached = true;
    for (int bit = 0; bit < COVERAGE_BITS; ++bit) {
        const uint32_t mask = (uint32_t)1 << bit;
        if ((reachable & mask) != 0) {
            reached = line("fault", omni_fault_name(mask), "", coverage->fault[bit], least) && reached;
        }
        if ((reachable & mask & (uint32_t)OMNI_FAULT_STOP_MASK) != 0) {
            reached = line("stopped by", omni_fault_name(mask), "", coverage->history[bit], least) && reached;
        }
    }
    return reached;
}

bool coverage_report(const coverage_t *coverage, const scene_t *scene, uint32_t least) {
    bool reached = true;
    for (int i = 0; i < COVERAGE_STATES; ++i) {
        /* INIT lasts less than a tick. */
        const uint32_t wanted = i == OMNI_STATE_INIT ? 0 : least;
        reached =
            line("state", omni_safety_state_name((omni_safety_state_t)i), "", coverage->state[i], wanted) && reached;
    }
    for (int kind = 0; kind < COVERAGE_KINDS; ++kind) {
        for (int i = 0; i < COVERAGE_CONTROLLERS; ++i) {
            reached = line("driven by", kinds[kind], controllers[i], coverage->driven[kind][i], least) && reached;
        }
    }
    for (int path = 0; path < COVERAGE_PATHS; ++path) {
        for (int i = 0; i < COVERAGE_ROTATIONS; ++i) {
            reached = line("path", paths[path], rotations[i], coverage->path[path][i], least) && reached;
        }
    }
    reached = report_faults(coverage, least) && reached;
    reached = lines("phase", phases, coverage->phase, sizeof phases / sizeof phases[0], least) && reached;
    reached = lines("wheel filter", wheel_filters, coverage->wheel_filter, 3, least) && reached;
    reached = lines("pose filter", pose_filters, coverage->pose_filter, 3, least) && reached;
    reached = lines("switching", switchings, coverage->switching, 3, least) && reached;
    const char *const other[] = {
        "three wheels",  "four wheels",   "between control steps", "cut",          "fixes used",
        "fixes refused", "pose restarts", "changes while armed",   "sets refused", "plans refused",
        "gyro leads",    "gyro at rest",  "gyro rejected",         "currents cut", "flow used",
        "flow refused"};
    const uint32_t figures[] = {
        coverage->wheels[3],     coverage->wheels[4],     coverage->held,       coverage->cut,
        coverage->fixes_used,    coverage->fixes_refused, coverage->restarts,   scene->changes_while_armed,
        scene->configs_refused,  scene->plans_refused,    coverage->gyro_leads, coverage->gyro_rests,
        coverage->gyro_rejected, coverage->currents_cut,  coverage->flow_used,  coverage->flow_refused};
    return lines("other", other, figures, sizeof figures / sizeof figures[0], least < 1 ? least : 1) && reached;
}
