/* SPDX-License-Identifier: MIT */
/* A smooth path through given points: a uniform cubic B-spline, twice differentiable everywhere
 * (de Boor, A Practical Guide to Splines, 1978, chapter IX). With control points c and the share s of a leg done:
 *
 *   6 p(s) = (1 - s)^3 c[i-1] + (3 s^3 - 6 s^2 + 4) c[i] + (-3 s^3 + 3 s^2 + 3 s + 1) c[i+1] + s^3 c[i+2]
 *
 * It passes point i where c[i-1] + 4 c[i] + c[i+1] = 6 point[i]. Once or less often than once, the path is open: it
 * begins and ends at a point, without curvature there. Otherwise it is closed and leads from the last point to the
 * first.
 *
 * Every leg takes the same time. So the robot keeps its speed where the points have equal distances. */
#include "../math/math_inline.h"
#include "trajectory_internal.h"

/* Each sweep leaves at most half of the error: 2^-26 is below the resolution of a float. */
enum { SWEEPS = 26 };

static bool is_closed(const omni_trajectory_t *plan) {
    return !(plan->config.laps > 0.0f && plan->config.laps <= 1.0f);
}

/* Control point -1..count+1 of a closed path, -1..count of an open one: an open path goes on in line with its last two.
 */
static omni_pose_t control_point(const omni_trajectory_t *plan, int32_t index) {
    const omni_pose_t *points = plan->waypoints.pose;
    const int32_t count = plan->waypoints.count;
    if (index >= 0 && index < count) {
        return points[index];
    }
    const bool before = index < 0;
    omni_pose_t pose;
    if (is_closed(plan)) {
        pose = points[before ? index + count : index - count];
        pose.theta += before ? -plan->lap_turn_rad : plan->lap_turn_rad;
    } else {
        const omni_pose_t *end = &points[before ? 0 : count - 1];
        const omni_pose_t *inner = &points[before ? 1 : count - 2];
        pose.x = 2.0f * end->x - inner->x;
        pose.y = 2.0f * end->y - inner->y;
        pose.theta = 2.0f * end->theta - inner->theta;
    }
    return pose;
}

void omni_path_spline(omni_trajectory_t *plan) {
    const omni_waypoints_t wanted = plan->waypoints;
    omni_pose_t *control = plan->waypoints.pose;
    const int32_t last = (int32_t)wanted.count - 1;
    const omni_real_t first_rad = wanted.pose[0].theta;
    const omni_real_t last_rad = wanted.pose[last].theta;
    plan->lap_turn_rad = last_rad + omni_wrap_pi(first_rad - last_rad) - first_rad;
    const int32_t ends = is_closed(plan) ? 0 : 1;
    for (int sweep = 0; sweep < SWEEPS; ++sweep) {
        for (int32_t i = ends; i <= last - ends; ++i) {
            const omni_pose_t before = control_point(plan, i - 1);
            const omni_pose_t after = control_point(plan, i + 1);
            control[i].x = 0.25f * (6.0f * wanted.pose[i].x - before.x - after.x);
            control[i].y = 0.25f * (6.0f * wanted.pose[i].y - before.y - after.y);
            control[i].theta = 0.25f * (6.0f * wanted.pose[i].theta - before.theta - after.theta);
        }
    }
}

/* Spline from the four control points around a leg, at the fraction s of it. @param legs_per_s converts derivatives to
 * path time. */
static omni_jet_t spline_jet(const omni_real_t *c, omni_real_t s, omni_real_t legs_per_s) {
    const omni_real_t first = c[1] - c[0];
    const omni_real_t second = c[0] - 2.0f * c[1] + c[2];
    const omni_real_t third = c[3] - 3.0f * c[2] + 3.0f * c[1] - c[0];
    const omni_real_t slope = first + 0.5f * second;
    omni_jet_t jet;
    jet.d[0] = c[1] + second / 6.0f + s * (slope + s * (0.5f * second + s * (third / 6.0f)));
    jet.d[1] = legs_per_s * (slope + s * (second + s * (0.5f * third)));
    jet.d[2] = legs_per_s * legs_per_s * (second + s * third);
    jet.d[3] = legs_per_s * legs_per_s * legs_per_s * third;
    return jet;
}

static void path_jets_spline(const omni_trajectory_t *plan, omni_ns_t ns, omni_jet_t *x, omni_jet_t *y,
                             omni_jet_t *theta) {
    const omni_ns_t lap_ns = plan->timing.period_ns;
    const int32_t legs = (int32_t)plan->waypoints.count - (is_closed(plan) ? 0 : 1);
    const bool at_end = !is_closed(plan) && ns >= lap_ns;
    const omni_real_t done = at_end ? (omni_real_t)legs : omni_phase(ns, lap_ns) * (omni_real_t)legs;
    const int32_t leg = (int32_t)omni_clampf(done, 0.0f, (omni_real_t)(legs - 1));
    const omni_real_t share = done - (omni_real_t)leg;
    omni_real_t control[3][4];
    for (int32_t i = 0; i < 4; ++i) {
        const omni_pose_t pose = control_point(plan, leg - 1 + i);
        control[0][i] = pose.x;
        control[1][i] = pose.y;
        control[2][i] = pose.theta;
    }
    const omni_real_t legs_per_s = (omni_real_t)legs / plan->timing.period_s;
    *x = spline_jet(control[0], share, legs_per_s);
    *y = spline_jet(control[1], share, legs_per_s);
    *theta = spline_jet(control[2], share, legs_per_s);
}

const omni_path_row_t omni_path_row_spline = {path_jets_spline, true, OMNI_POINTS_SMOOTH, 0, NULL, NULL, NULL};
