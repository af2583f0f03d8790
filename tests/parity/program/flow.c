/* SPDX-License-Identifier: MIT */
#include "flow.h"

#include <math.h>

#include "omni/math.h"

enum { PERIOD = 20 };

void flow_draw(flow_t *flow, uint32_t episode, omni_real_t *values) {
    random_t *random = &flow->random;
    values[OMNI_PARAM_FLOW_MODE] = episode % 5 < 2 ? 1.0f + (omni_real_t)(episode % 5) : 0.0f;
    values[OMNI_PARAM_FLOW_X] = random_between(random, -0.1f, 0.1f);
    values[OMNI_PARAM_FLOW_Y] = random_between(random, -0.1f, 0.1f);
    values[OMNI_PARAM_FLOW_ANGLE] = random_between(random, -180.0f, 180.0f);
    values[OMNI_PARAM_FLOW_SCALE] = random_between(random, 0.95f, 1.05f);
    values[OMNI_PARAM_FLOW_SD] = random_between(random, 5e-5f, 1e-3f);
    values[OMNI_PARAM_FLOW_SHARE] = random_between(random, 0.0f, 0.05f);
    values[OMNI_PARAM_FLOW_T_SD] = random_between(random, 2e-5f, 1e-3f);
    values[OMNI_PARAM_FLOW_DELAY] = random_between(random, 0.0f, 0.01f);
    values[OMNI_PARAM_FLOW_GATE] = random_chance(random, 200000) ? 0.0f : random_between(random, 5.0f, 40.0f);
}

static void begin_flow_trouble(flow_t *flow) {
    random_t *random = &flow->random;
    if (flow->left > 0) {
        --flow->left;
        return;
    }
    flow->trouble = FLOW_FINE;
    if (random_chance(random, 30000)) {
        flow->trouble = 1 + random_below(random, FLOW_TROUBLES - 1);
        flow->left = 1 + random_below(random, 30);
    }
}

void flow_read(flow_t *flow, const world_t *world, const omni_robot_config_t *config, omni_inputs_t *inputs) {
    const omni_flow_config_t *c = &config->flow;
    inputs->flow_valid = 0;
    if (c->axes == 0 || flow->due-- > 0) {
        return;
    }
    flow->due = PERIOD - 1;
    begin_flow_trouble(flow);
    if (flow->trouble == FLOW_SILENT) {
        return;
    }
    const omni_pose_t *now = &world->pose;
    const omni_real_t turned = omni_wrap_pi(now->theta - flow->last.theta);
    omni_real_t sine;
    omni_real_t cosine;
    omni_sincosf(now->theta - 0.5f * turned, &sine, &cosine);
    const omni_real_t dx = now->x - flow->last.x;
    const omni_real_t dy = now->y - flow->last.y;
    const omni_real_t x = cosine * dx + sine * dy - c->lever_arm_m[1] * turned;
    const omni_real_t y = cosine * dy - sine * dx + c->lever_arm_m[0] * turned;
    flow->last = *now;
    const omni_real_t noise[2] = {1e-4f * random_normal(&flow->random), 1e-4f * random_normal(&flow->random)};
    inputs->flow_moved[0] = (c->mount_cosine * x + c->mount_sine * y) / c->scale + noise[0];
    inputs->flow_moved[1] = (c->mount_cosine * y - c->mount_sine * x) / c->scale + noise[1];
    inputs->flow_moved[2] = turned + 0.3f * noise[0];
    inputs->flow_valid = c->axes > 2 ? 15 : 11;
    if (flow->trouble == FLOW_STUCK) {
        inputs->flow_moved[0] = 0.0f;
        inputs->flow_moved[1] = 0.0f;
    } else if (flow->trouble == FLOW_NAN) {
        inputs->flow_moved[random_below(&flow->random, 2)] = random_chance(&flow->random, 500000) ? NAN : -INFINITY;
    } else if (flow->trouble == FLOW_FAR) {
        inputs->flow_moved[0] += 0.02f;
    } else if (flow->trouble == FLOW_MARKED) {
        inputs->flow_valid = 8;
    }
}
