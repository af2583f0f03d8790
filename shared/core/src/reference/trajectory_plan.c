/* SPDX-License-Identifier: MIT */
#include <string.h>

#include "../math/math_inline.h"
#include "trajectory_internal.h"

enum {
    SCAN_SAMPLES = 1024, /* per lap at least */
    CYCLE_SAMPLES = 64,  /* per petal, sine period or leg: peaks are met to 0.1 % */
    SCAN_SAMPLES_MAX = 131072,
    SCAN_LAPS = 8, /* where the heading differs from lap to lap */
    LEG_SAMPLES = 128,
    RAMP_ROUNDS = 60
};

static const omni_real_t near_m = 1e-3f;
static const omni_real_t near_rad = 1e-3f;
static const omni_real_t shortest_lead_in_s = 0.2f;
/* Largest time [s] and largest time scale that are accepted. */
static const omni_real_t largest = 1e6f;

/* Whole turns of a heading beyond this could not be counted. */
static const omni_real_t largest_heading_rad = 1e6f;

/* Peak demand of a motion on the wheels at scale 1. */
typedef struct demand_t {
    omni_real_t wheel_rad_s;
    omni_real_t voltage_V;
    omni_real_t scale; /* smallest time scale within the limits */
} demand_t;

/* Largest x with |speed_V x + acceleration_V x^2| <= limit for all of [0, x]; its inverse is the scale. */
static omni_real_t voltage_scale(omni_real_t speed_V, omni_real_t acceleration_V, omni_real_t limit) {
    const omni_real_t b = omni_absf(speed_V);
    const omni_real_t a = speed_V < 0.0f ? -acceleration_V : acceleration_V;
    const omni_real_t peak = b * b + 4.0f * a * limit;
    if (a >= 0.0f || peak >= 0.0f) {
        return (b + omni_sqrtf(peak)) / (2.0f * limit);
    }
    /* Braking: the sum only reaches the limit on the other side. */
    return 2.0f * -a / (b + omni_sqrtf(b * b - 4.0f * a * limit));
}

/* World rate and acceleration at heading theta, as wheel speeds and accelerations, the body's load added. */
static void to_wheels(const omni_kinematics_t *k, const omni_body_load_t *load, omni_real_t theta,
                      const omni_twist_t *rate, const omni_twist_t *acceleration, omni_real_t *wheel,
                      omni_real_t *wheel_change) {
    const omni_twist_t body = omni_twist_to_body(rate, theta);
    const omni_twist_t felt = omni_twist_to_body(acceleration, theta);
    omni_twist_t change = felt;
    /* (R xi')' = R xi'' + R' xi' */
    change.vx += body.wz * body.vy;
    change.vy -= body.wz * body.vx;
    omni_kinematics_inverse(k, &body, NULL, wheel);
    omni_kinematics_inverse(k, &change, NULL, wheel_change);
    if (load->used) {
        omni_kinematics_add_body_inertia(k, load, &felt, wheel_change);
    }
}

static omni_real_t larger_of(omni_real_t a, omni_real_t b) {
    return a > b ? a : b;
}

static void add_demand(demand_t *demand, const omni_trajectory_config_t *c, const omni_kinematics_t *k,
                       omni_real_t theta, const omni_twist_t *rate, const omni_twist_t *acceleration) {
    omni_real_t wheel[OMNI_MAX_WHEELS] = {0};
    omni_real_t change[OMNI_MAX_WHEELS] = {0};
    to_wheels(k, &c->body_load, theta, rate, acceleration, wheel, change);
    for (uint8_t i = 0; i < k->wheels; ++i) {
        const omni_real_t speed_V = c->ff_speed_V_s * wheel[i];
        const omni_real_t change_V = c->ff_acceleration_V_s2 * change[i];
        const omni_real_t speed = omni_absf(wheel[i]);
        demand->wheel_rad_s = larger_of(demand->wheel_rad_s, speed);
        demand->voltage_V = larger_of(demand->voltage_V, omni_absf(speed_V + change_V));
        demand->scale = larger_of(demand->scale, speed / (c->margin * c->wheel_limit_rad_s));
        demand->scale = larger_of(demand->scale, voltage_scale(speed_V, change_V, c->margin * c->voltage_limit_V));
    }
}

/* Is the wheel demand the same in each lap? */
static bool laps_repeat(const omni_trajectory_config_t *c) {
    if (omni_path_rows[c->type]->round_ns != NULL) {
        return true;
    }
    const omni_real_t turns = c->rotation == OMNI_TRJ_ROT_SPIN   ? c->rotation_amplitude_rad / omni_two_pi
                              : c->rotation == OMNI_TRJ_ROT_SINE ? c->rotation_cycles
                                                                 : 0.0f;
    return omni_absf(turns - (omni_real_t)(int32_t)turns) < 1e-5f;
}

static demand_t scan_demand(const omni_trajectory_t *plan, const omni_kinematics_t *k) {
    const omni_trajectory_config_t *c = &plan->config;
    demand_t demand = {0.0f, 0.0f, 0.0f};
    const uint32_t laps = laps_repeat(c) ? 1 : SCAN_LAPS;
    const uint64_t duration_ns = plan->timing.duration_ns;
    uint64_t length_ns = plan->timing.lap_ns * laps;
    omni_real_t samples = (omni_real_t)SCAN_SAMPLES + (omni_real_t)CYCLE_SAMPLES * (omni_real_t)c->petals;
    samples = (samples + (omni_real_t)CYCLE_SAMPLES * (c->rotation_cycles + (omni_real_t)plan->waypoints.count)) *
              (omni_real_t)laps;
    const omni_path_row_t *row = omni_path_row(plan);
    if (row->repeats_s > 0) {
        length_ns = omni_nanoseconds(row->repeats_s);
        samples = (omni_real_t)row->repeats_s * (omni_real_t)CYCLE_SAMPLES / 4.0f;
    }
    if (row->round_ns != NULL) {
        samples = (omni_real_t)SCAN_SAMPLES * (c->laps > 1.0f ? c->laps : 1.0f);
    }
    const uint32_t count = (uint32_t)omni_clampf(samples, (omni_real_t)SCAN_SAMPLES, (omni_real_t)SCAN_SAMPLES_MAX);
    length_ns = length_ns < duration_ns ? length_ns : duration_ns;
    for (uint32_t i = 0; i <= count; ++i) {
        omni_pose_t pose;
        omni_twist_t first;
        omni_twist_t second;
        omni_path_at(plan, length_ns / count * i, &pose, &first, &second);
        add_demand(&demand, c, k, pose.theta, &first, &second);
    }
    return demand;
}

/* Peak voltage while the clock ramps up or down at the plan's scale. */
static omni_real_t ramp_voltage(const omni_trajectory_t *plan, const omni_kinematics_t *k) {
    demand_t demand = {0.0f, 0.0f, 0.0f};
    const uint64_t total_ns = omni_path_real_ns(plan);
    const uint64_t ramp_ns = omni_nanoseconds(plan->config.ramp_s);
    const uint64_t step_ns = (ramp_ns < total_ns ? ramp_ns : total_ns) / LEG_SAMPLES;
    for (uint32_t i = 0; i < 2 * LEG_SAMPLES; ++i) {
        const bool end = i >= LEG_SAMPLES;
        if (end && total_ns == OMNI_ENDLESS_NS) {
            break;
        }
        const uint64_t time_ns = end ? total_ns - step_ns * (i + 1 - LEG_SAMPLES) : step_ns * (i + 1);
        const omni_path_clock_t clock = omni_path_clock(plan, time_ns);
        omni_pose_t pose;
        omni_twist_t first;
        omni_twist_t second;
        omni_twist_t rate;
        omni_twist_t acceleration;
        omni_path_at(plan, clock.path_ns, &pose, &first, &second);
        omni_path_chain(&clock, &first, &second, &rate, &acceleration);
        add_demand(&demand, &plan->config, k, pose.theta, &rate, &acceleration);
    }
    return demand.voltage_V;
}

/* Set the scale; the ramps' own acceleration may need a little more than the path. */
static void set_scale(omni_trajectory_t *plan, const omni_kinematics_t *k) {
    const demand_t demand = scan_demand(plan, k);
    plan->peak_wheel_rad_s = demand.wheel_rad_s;
    plan->peak_voltage_V = demand.voltage_V;
    plan->needed_scale = demand.scale;
    plan->scale = larger_of(demand.scale, 1.0f);
    omni_path_set_clock(plan);
    const omni_real_t by_wheel = demand.wheel_rad_s / (plan->config.margin * plan->config.wheel_limit_rad_s);
    const omni_real_t limit = plan->config.margin * plan->config.voltage_limit_V;
    for (int round = 0; round < RAMP_ROUNDS && ramp_voltage(plan, k) > limit * 1.0001f; ++round) {
        plan->scale *= 1.05f;
        plan->needed_scale = plan->scale;
        omni_path_set_clock(plan);
    }
    plan->by_voltage = plan->needed_scale > by_wheel;
    if (!plan->config.scale) {
        plan->scale = 1.0f;
        omni_path_set_clock(plan);
    }
}

/* Acceleration as a multiple of the lead-in's limit. */
static omni_real_t over_limit(const omni_trajectory_config_t *c, const omni_twist_t *acceleration) {
    const omni_real_t x = acceleration->vx;
    const omni_real_t y = acceleration->vy;
    const omni_real_t along = c->lead_in_m_s2 > 0.0f ? omni_sqrtf(x * x + y * y) / c->lead_in_m_s2 : 0.0f;
    const omni_real_t around = c->lead_in_rad_s2 > 0.0f ? omni_absf(acceleration->wz) / c->lead_in_rad_s2 : 0.0f;
    return larger_of(along, around);
}

static void set_lead_in(omni_trajectory_t *plan, const omni_kinematics_t *k) {
    const omni_pose_t *from = &plan->origin;
    const omni_pose_t *to = &plan->start;
    if (omni_absf(to->x - from->x) <= near_m && omni_absf(to->y - from->y) <= near_m &&
        omni_absf(to->theta - from->theta) <= near_rad) {
        return;
    }
    demand_t demand = {0.0f, 0.0f, 0.0f};
    omni_real_t steepest =
        0.0f; /* of both accelerations, over their limits, at a lead-in of 1 s: grows with 1 / time^2 */
    for (int i = 0; i <= LEG_SAMPLES; ++i) {
        omni_pose_t pose;
        omni_twist_t rate;
        omni_twist_t acceleration;
        omni_leg(from, to, 1.0f, (omni_real_t)i / (omni_real_t)LEG_SAMPLES, &pose, &rate, &acceleration);
        add_demand(&demand, &plan->config, k, pose.theta, &rate, &acceleration);
        steepest = larger_of(steepest, over_limit(&plan->config, &acceleration));
    }
    plan->lead_in_s = larger_of(larger_of(demand.scale, omni_sqrtf(steepest)), shortest_lead_in_s);
    /* Longer ones are refused, and must not be converted to an integer. */
    plan->timing.lead_in_us =
        omni_nanoseconds(omni_select(plan->lead_in_s <= largest, plan->lead_in_s, largest)) / 1000u;
}

/* Plan that holds `at`; also the result of a refused plan. */
static void plan_to_hold(omni_trajectory_t *plan, const omni_pose_t *at) {
    memset(plan, 0, sizeof *plan);
    if (omni_pose_is_finite(at)) {
        plan->origin = *at;
    }
    plan->start = plan->origin;
    plan->heading_offset_rad = plan->origin.theta;
    plan->config.type = OMNI_TRJ_TYPE_HOLD;
    plan->config.period_s = 1.0f;
    plan->scale = 1.0f;
    plan->duration_s = -1.0f;
    omni_path_set_lengths(plan);
    omni_path_set_clock(plan);
}

/* Start of the path, its heading within half a turn of the robot's. */
static void set_start(omni_trajectory_t *plan) {
    omni_twist_t first;
    omni_twist_t second;
    plan->heading_offset_rad = plan->config.type == OMNI_TRJ_TYPE_HOLD ? plan->origin.theta : 0.0f;
    omni_path_at(plan, 0, &plan->start, &first, &second);
    /* Turns beyond the resolution of a float have no effect, and must not be converted to an integer. */
    const omni_real_t turns = omni_clampf((plan->origin.theta - plan->start.theta) / omni_two_pi, -largest, largest);
    plan->heading_offset_rad += omni_two_pi * (omni_real_t)(int32_t)(turns + (turns < 0.0f ? -0.5f : 0.5f));
    omni_path_at(plan, 0, &plan->start, &first, &second);
}

static bool is_within(omni_real_t value, omni_real_t low, omni_real_t high) {
    return value >= low && value <= high;
}

static omni_result_t check_numbers(const omni_trajectory_config_t *c) {
    const omni_real_t all[] = {c->size_m,
                               c->period_s,
                               c->laps,
                               c->rotation_amplitude_rad,
                               c->margin,
                               c->ramp_s,
                               c->ff_speed_V_s,
                               c->wheel_limit_rad_s,
                               c->rotation_cycles,
                               c->voltage_limit_V,
                               c->ff_acceleration_V_s2,
                               c->body_load.mass_m2,
                               c->body_load.inertia,
                               c->lead_in_m_s2,
                               c->lead_in_rad_s2};
    for (size_t i = 0; i < sizeof all / sizeof all[0]; ++i) {
        if (!omni_is_finite(all[i])) {
            return OMNI_ERR_NOT_FINITE;
        }
    }
    const bool path = c->type < OMNI_TRJ_TYPE_COUNT && c->rotation < OMNI_TRJ_ROT_COUNT &&
                      is_within(c->size_m, 0.0f, 1e4f) && is_within(c->period_s, 1e-3f, 3600.0f) &&
                      is_within(c->laps, 0.0f, 1e4f) && is_within(c->rotation_cycles, 0.0f, 1e3f) &&
                      is_within(c->rotation_amplitude_rad, -1e3f, 1e3f) &&
                      (omni_path_rows[c->type]->accepts == NULL || omni_path_rows[c->type]->accepts(c));
    const bool limits = c->margin > 0.0f && c->margin <= 1.0f && is_within(c->ramp_s, 0.0f, 3600.0f) &&
                        c->wheel_limit_rad_s > 0.0f && c->voltage_limit_V > 0.0f && c->ff_speed_V_s >= 0.0f &&
                        c->ff_acceleration_V_s2 >= 0.0f && c->body_load.mass_m2 >= 0.0f && c->body_load.inertia >= 0.0f;
    return path && limits ? OMNI_OK : OMNI_ERR_RANGE;
}

static omni_result_t check_pose(const omni_pose_t *pose) {
    if (!omni_pose_is_finite(pose)) {
        return OMNI_ERR_NOT_FINITE;
    }
    return is_within(pose->theta, -largest_heading_rad, largest_heading_rad) ? OMNI_OK : OMNI_ERR_RANGE;
}

bool omni_trajectory_needs_waypoints(omni_uint_t type) {
    if (type >= OMNI_TRJ_TYPE_COUNT) {
        return false;
    }
    const uint8_t points = omni_path_rows[type]->points;
    return points == OMNI_POINTS_GIVEN || points == OMNI_POINTS_SMOOTH;
}

static omni_result_t check_points(const omni_trajectory_config_t *c, const omni_waypoints_t *waypoints) {
    if (!omni_trajectory_needs_waypoints(c->type)) {
        return OMNI_OK;
    }
    if (!waypoints || waypoints->count < 2 || waypoints->count > OMNI_MAX_WAYPOINTS) {
        return OMNI_ERR_RANGE;
    }
    for (uint8_t i = 0; i < waypoints->count; ++i) {
        const omni_result_t result = check_pose(&waypoints->pose[i]);
        if (result != OMNI_OK) {
            return result;
        }
    }
    return OMNI_OK;
}

omni_result_t omni_trajectory_plan(omni_trajectory_t *plan, const omni_trajectory_config_t *config,
                                   const omni_kinematics_t *k, const omni_waypoints_t *waypoints,
                                   const omni_pose_t *at) {
    plan_to_hold(plan, at);
    omni_result_t result = check_pose(at);
    if (result == OMNI_OK) {
        result = check_numbers(config);
    }
    if (result == OMNI_OK) {
        result = check_points(config, waypoints);
    }
    if (result != OMNI_OK) {
        return result;
    }
    plan->config = *config;
    plan->origin = *at; /* as set by plan_to_hold; repeated for the proof of its range */
    plan->scale = 1.0f;
    omni_path_points(plan, waypoints);
    omni_path_set_lengths(plan);
    set_start(plan);
    const uint64_t duration_ns = plan->timing.duration_ns;
    plan->duration_s = duration_ns == OMNI_ENDLESS_NS ? -1.0f : (omni_real_t)duration_ns * 1e-9f;
    set_scale(plan, k);
    set_lead_in(plan, k);
    if (!omni_is_finite(plan->needed_scale) || plan->needed_scale > largest || !(plan->lead_in_s <= largest)) {
        plan_to_hold(plan, at);
        return OMNI_ERR_RANGE;
    }
    return OMNI_OK;
}
