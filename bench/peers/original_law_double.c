/* SPDX-License-Identifier: MIT */
/**
 * @file original_law_double.c
 * The original robot's control law as a first sketch has it. That is double precision throughout, B(theta) with libm's
 * sine and cosine per wheel, and windows of 100 samples that every period shifts and sums. The law is that of
 * omni/original_law.h, own writing. Left out: everything around it (dead reckoning, link, safety, PWM chip), checks of
 * the inputs, wrapped heading.
 */
#include <math.h>

#include "law.h"

enum { WINDOW = 100 };

static const double LAMBDA = 14.0;
static const double K = 0.01;
static const double MOTOR_P = 10.0;
static const double MOTOR_I = 30.0;
static const double WHEEL_LIMIT = 4.0;
static const double PERIOD_S = 0.02;

typedef struct window_t {
    double sample[WINDOW];
} window_t;

static double windowed(window_t *window, double newest) {
    double sum = 0.0;
    for (int i = 0; i < WINDOW - 1; i++) {
        window->sample[i] = window->sample[i + 1];
        sum += window->sample[i];
    }
    window->sample[WINDOW - 1] = newest;
    return (sum + newest) / WINDOW;
}

static double sign(double value) {
    return value > 0.0 ? 1.0 : value < 0.0 ? -1.0 : 0.0;
}

/* Scale all so that none is beyond the limit. */
static void scale(double *values, double limit) {
    double largest = 0.0;
    for (int i = 0; i < LAW_WHEELS; i++) {
        largest = fmax(largest, fabs(values[i]));
    }
    if (largest > limit) {
        for (int i = 0; i < LAW_WHEELS; i++) {
            values[i] *= limit / largest;
        }
    }
}

static void period(window_t *pose_window, window_t *wheel_window, const law_input_t *input, double *voltage_V) {
    double wanted[3];
    for (int axis = 0; axis < 3; axis++) {
        const double error = (double)input->pose[axis] - (double)input->reference[axis];
        const double surface = error + LAMBDA * windowed(&pose_window[axis], error);
        wanted[axis] = (double)input->rate[axis] - LAMBDA * error - K * sign(surface);
    }
    double reference[LAW_WHEELS];
    for (int i = 0; i < LAW_WHEELS; i++) {
        const double bearing = (double)input->pose[2] + 2.0943951023931953 * i;
        reference[i] =
            (-sin(bearing) * wanted[0] + cos(bearing) * wanted[1] + LAW_DISTANCE_M * wanted[2]) / LAW_RADIUS_M;
    }
    scale(reference, WHEEL_LIMIT);
    for (int i = 0; i < LAW_WHEELS; i++) {
        const double speed = (double)input->moved_counts[i] * LAW_RAD_PER_COUNT / PERIOD_S;
        const double error = reference[i] - speed;
        voltage_V[i] = MOTOR_P * error + MOTOR_I * windowed(&wheel_window[i], error);
    }
    scale(voltage_V, LAW_SUPPLY_V);
}

void double_law(const law_input_t *inputs, uint32_t periods, float *voltage_V) {
    window_t pose_window[3] = {0};
    window_t wheel_window[LAW_WHEELS] = {0};
    for (uint32_t n = 0; n < periods; n++) {
        double voltage[LAW_WHEELS];
        period(pose_window, wheel_window, &inputs[n], voltage);
        for (int i = 0; i < LAW_WHEELS; i++) {
            voltage_V[n * LAW_WHEELS + (uint32_t)i] = (float)voltage[i];
        }
    }
}
