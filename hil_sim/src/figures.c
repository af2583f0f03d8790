/* SPDX-License-Identifier: MIT */
#include "hil_sim/figures.h"

#include <math.h>

static void errors_of(hil_figures_t *f, const hil_metrics_t *m, double ticks) {
    f->x_m = sqrt(m->tracking_square[0] / ticks);
    f->y_m = sqrt(m->tracking_square[1] / ticks);
    f->theta_rad = sqrt(m->tracking_square[2] / ticks);
    f->position_m = hypot(f->x_m, f->y_m);
    f->estimate_x_m = sqrt(m->estimate_square[0] / ticks);
    f->estimate_y_m = sqrt(m->estimate_square[1] / ticks);
    f->estimate_theta_rad = sqrt(m->estimate_square[2] / ticks);
    f->estimate_position_m = hypot(f->estimate_x_m, f->estimate_y_m);
    f->nis = m->fixes > 0.0 ? m->nis / m->fixes : (double)NAN;
}

static void extremes_of(hil_figures_t *f, const hil_metrics_t *m) {
    const bool path = m->path_ticks > 0;
    const bool followed = path || m->milestones.done_us != UINT64_MAX;
    f->max_position_m = path ? sqrt(m->distance_square_max) : (double)NAN;
    f->max_theta_rad = path ? m->turn_max : (double)NAN;
    f->final_position_m = followed ? hypot(m->final_error[0], m->final_error[1]) : (double)NAN;
    f->final_theta_rad = followed ? fabs(m->final_error[2]) : (double)NAN;
}

/* Of fewer than two ticks nothing is said: there is no change from one to the next. */
static void effort_of(hil_figures_t *f, const hil_metrics_t *m, uint32_t wheels) {
    const bool enough = m->path_ticks >= 2;
    const double ticks = enough ? (double)m->path_ticks : (double)NAN;
    const double duty = m->duty_sum / (ticks * wheels);
    const double change = m->duty_change / ((ticks - 1.0) * wheels);
    f->peak_wheel_rad_s = enough ? m->wheel_peak : (double)NAN;
    f->peak_duty = enough ? m->duty_peak : (double)NAN;
    f->rms_duty = sqrt(m->duty_square / (ticks * wheels));
    f->saturated_share = m->cut_ticks / ticks;
    f->chatter = duty <= 0.0 ? 0.0 : change / duty;
}

void hil_figures_from_metrics(hil_figures_t *figures, const hil_metrics_t *metrics, uint32_t wheels) {
    figures->faults = metrics->faults;
    figures->completed = metrics->milestones.done_us != UINT64_MAX ? 1.0 : 0.0;
    errors_of(figures, metrics, metrics->path_ticks > 0 ? (double)metrics->path_ticks : (double)NAN);
    extremes_of(figures, metrics);
    effort_of(figures, metrics, wheels);
}
