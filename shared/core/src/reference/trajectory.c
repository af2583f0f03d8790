/* SPDX-License-Identifier: MIT */
#include "omni/trajectory.h"

#include "trajectory_internal.h"

#define OMNI_ROW(NAME, name) [OMNI_TRJ_TYPE_##NAME] = &omni_path_row_##name,
const omni_path_row_t *const omni_path_rows[OMNI_TRJ_TYPE_COUNT] = {OMNI_TRJ_TYPE_ROWS(OMNI_ROW)};
#undef OMNI_ROW

void omni_leg(const omni_pose_t *from, const omni_pose_t *to, omni_real_t duration_s, omni_real_t p, omni_pose_t *pose,
              omni_twist_t *rate, omni_twist_t *acceleration) {
    const omni_jet_t share = omni_quintic(p);
    const omni_real_t per_s = 1.0f / duration_s;
    const omni_real_t dx = to->x - from->x;
    const omni_real_t dy = to->y - from->y;
    const omni_real_t dtheta = to->theta - from->theta;
    const omni_real_t speed = share.d[1] * per_s;
    const omni_real_t change = share.d[2] * per_s * per_s;
    *pose = (omni_pose_t){from->x + dx * share.d[0], from->y + dy * share.d[0], from->theta + dtheta * share.d[0]};
    *rate = (omni_twist_t){dx * speed, dy * speed, dtheta * speed};
    *acceleration = (omni_twist_t){dx * change, dy * change, dtheta * change};
}

void omni_path_chain(const omni_path_clock_t *clock, const omni_twist_t *first, const omni_twist_t *second,
                     omni_twist_t *rate, omni_twist_t *acceleration) {
    const omni_real_t square = clock->rate * clock->rate;
    rate->vx = first->vx * clock->rate;
    rate->vy = first->vy * clock->rate;
    rate->wz = first->wz * clock->rate;
    acceleration->vx = second->vx * square + first->vx * clock->rate_change;
    acceleration->vy = second->vy * square + first->vy * clock->rate_change;
    acceleration->wz = second->wz * square + first->wz * clock->rate_change;
}

void omni_trajectory_evaluate(const omni_trajectory_t *plan, uint64_t time_us, omni_reference_t *reference) {
    const omni_ns_t lead_in_us = plan->timing.lead_in_us;
    reference->path_time_s = 0.0f;
    if (time_us < lead_in_us) {
        reference->phase = OMNI_PHASE_LEAD_IN;
        omni_leg(&plan->origin, &plan->start, plan->lead_in_s, omni_real_of(time_us) / omni_real_of(lead_in_us),
                 &reference->pose, &reference->rate, &reference->acceleration);
        return;
    }
    omni_twist_t first;
    omni_twist_t second;
    const omni_path_clock_t clock = omni_path_clock(plan, (time_us - lead_in_us) * 1000u);
    omni_path_at(plan, clock.path_ns, &reference->pose, &first, &second);
    omni_path_chain(&clock, &first, &second, &reference->rate, &reference->acceleration);
    reference->path_time_s = omni_real_of(clock.path_ns) * 1e-9f;
    reference->phase = clock.done ? OMNI_PHASE_DONE : OMNI_PHASE_PATH;
}
