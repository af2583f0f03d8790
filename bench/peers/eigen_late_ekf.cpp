// SPDX-License-Identifier: MIT
/// @file eigen_late_ekf.cpp  The pose filter with Eigen's fixed-size matrices, doing what ours does beside the
/// textbook's equations. Fixes of up to 64 slots ago are used exactly, and inputs are checked. The update is Joseph's,
/// the heading is wrapped, and sums are compensated. Own writing; the equations are those of omni/pose_ekf.h.
#include <array>
#include <cmath>
#include <cstdint>
#include <Eigen/Dense>

#include "estimators.h"

namespace {

using Eigen::Matrix3f;
using Eigen::Vector3f;

constexpr float pi = 3.14159265f;
constexpr uint32_t slots = 64;
constexpr uint32_t slot_ticks = 4;
constexpr uint32_t slot_us = 8000;
constexpr uint64_t future_us = 5000;

float wrapped(float angle) {
    return angle - 2.0f * pi * std::floor((angle + pi) / (2.0f * pi));
}

/// F carries an error of the pose over a motion (world frame).
Matrix3f carry_over(const Vector3f &moved) {
    Matrix3f f = Matrix3f::Identity();
    f(0, 2) = -moved(1);
    f(1, 2) = moved(0);
    return f;
}

Vector3f turned(const Vector3f &v, float sine, float cosine) {
    return {cosine * v(0) - sine * v(1), sine * v(0) + cosine * v(1), v(2)};
}

/// What moved, seen from the heading at its start.
struct Slot {
    Vector3f move = Vector3f::Zero();
    float steps = 0.0f;
    uint32_t duration_us = 0;
};

class LateFilter {
public:
    LateFilter(const Vector3f &q, const Vector3f &r, float step_s) : m_q(q), m_r(r), m_step_us(step_s * 1e6f) {}

    void predict(const Vector3f &body, uint64_t time_us) {
        const Vector3f motion = body.allFinite() ? body : Vector3f::Zero();
        const auto elapsed =
            static_cast<uint32_t>(m_time_us == 0 ? m_step_us : static_cast<float>(time_us - m_time_us));
        m_time_us = time_us;
        const float heading = x(2) + (m_carry(2) + 0.5f * motion(2));
        const Vector3f moved = turned(motion, std::sin(heading), std::cos(heading));
        add(moved);
        Slot &slot = m_history[m_newest];
        slot.move += turned(moved, -m_sine, m_cosine);
        slot.steps += static_cast<float>(elapsed) / m_step_us;
        slot.duration_us += elapsed;
        m_unsettled += moved;
        m_unsettled_steps += static_cast<float>(elapsed) / m_step_us;
        if (++m_ticks >= slot_ticks || slot.duration_us >= slot_us) {
            settle();
            m_newest = (m_newest + 1) % slots;
            m_filled = m_filled < slots - 1 ? m_filled + 1 : m_filled;
            m_history[m_newest] = Slot();
            m_ticks = 0;
            open_slot();
        }
    }

    bool correct(const Vector3f &fix, uint64_t time_us) {
        settle();
        if (!fix.allFinite() || time_us > m_time_us + future_us || time_us <= m_taken_us) {
            return false;
        }
        Vector3f since = Vector3f::Zero();
        Matrix3f noise = Matrix3f::Zero();
        if (!look_back(m_time_us > time_us ? static_cast<uint32_t>(m_time_us - time_us) : 0, since, noise)) {
            return false;
        }
        const Matrix3f h = carry_over(-since);
        Vector3f innovation = fix + since - x;
        innovation(2) = wrapped(innovation(2));
        const Matrix3f before = p - noise;
        const Matrix3f ph = before * h.transpose();
        Matrix3f s = h * ph;
        s.diagonal() += m_r;
        const Eigen::LLT<Matrix3f> factor(s);
        const float nis = innovation.dot(factor.solve(innovation));
        if (factor.info() != Eigen::Success || !std::isfinite(nis)) {
            return false;
        }
        const Matrix3f gain = factor.solve(ph.transpose()).transpose();
        const Matrix3f left = Matrix3f::Identity() - gain * h;
        p = left * before * left.transpose() + gain * m_r.asDiagonal() * gain.transpose() + noise;
        add(gain * innovation);
        m_taken_us = time_us;
        open_slot();
        return true;
    }

    Vector3f x = Vector3f::Zero();
    Matrix3f p = Matrix3f::Zero();

private:
    /// Sums keep what rounding drops.
    void add(const Vector3f &increment) {
        const Vector3f whole = increment + m_carry;
        const Vector3f next = x + whole;
        m_carry = whole - (next - x);
        x = next;
        x(2) = wrapped(x(2));
    }

    /// The covariance follows the motion up to now.
    void settle() {
        if (m_unsettled_steps > 0.0f) {
            const Matrix3f f = carry_over(m_unsettled);
            p = f * p * f.transpose();
            p.diagonal() += m_q * m_unsettled_steps;
            m_unsettled.setZero();
            m_unsettled_steps = 0.0f;
        }
    }

    void open_slot() {
        const float start = x(2) - m_history[m_newest].move(2);
        m_sine = std::sin(start);
        m_cosine = std::cos(start);
    }

    /// Motion and noise of the last age_us, seen from now. False if the history does not reach back so far.
    bool look_back(uint32_t age_us, Vector3f &since, Matrix3f &noise) const {
        uint32_t left_us = age_us;
        for (uint32_t back = 0; left_us > 0; ++back) {
            if (back > m_filled) {
                return false;
            }
            const Slot &slot = m_history[(m_newest + slots - back) % slots];
            const uint32_t used_us = left_us < slot.duration_us ? left_us : slot.duration_us;
            const float share =
                static_cast<float>(used_us) / static_cast<float>(slot.duration_us > 0 ? slot.duration_us : 1);
            const float start = x(2) - since(2) - slot.move(2);
            const Matrix3f after = carry_over(since);
            noise += after * (m_q * slot.steps * share).asDiagonal() * after.transpose();
            since += share * turned(slot.move, std::sin(start), std::cos(start));
            left_us -= used_us;
        }
        return true;
    }

    Vector3f m_q, m_r;
    float m_step_us;
    Vector3f m_carry = Vector3f::Zero();
    Vector3f m_unsettled = Vector3f::Zero();
    float m_unsettled_steps = 0.0f;
    float m_sine = 0.0f;
    float m_cosine = 1.0f;
    uint64_t m_time_us = 0;
    uint64_t m_taken_us = 0;
    uint32_t m_ticks = 0;
    uint32_t m_newest = 0;
    uint32_t m_filled = 0;
    std::array<Slot, slots> m_history;
};

} // namespace

void eigen_late_pose(const bench_model_t *model, const bench_input_t *inputs, uint32_t steps, bench_output_t *output) {
    using ToBody = Eigen::Matrix<float, 3, BENCH_WHEELS, Eigen::RowMajor>;
    const ToBody to_body = Eigen::Map<const ToBody>(&model->to_body[0][0]);
    LateFilter ekf(Eigen::Map<const Vector3f>(model->pose_q), Eigen::Map<const Vector3f>(model->fix_r), model->step_s);
    const auto step_us = static_cast<uint64_t>(model->step_s * 1e6f + 0.5f);
    for (uint32_t n = 0; n < steps; ++n) {
        const uint64_t time_us = (n + 2) * step_us;
        ekf.predict(to_body * Eigen::Map<const Eigen::Matrix<float, BENCH_WHEELS, 1>>(inputs[n].turned_rad), time_us);
        (void)ekf.correct(Eigen::Map<const Vector3f>(inputs[n].fix), time_us);
    }
    Eigen::Map<Vector3f>(output->pose) = ekf.x;
    Eigen::Map<Matrix3f>(&output->pose_p[0][0]) = ekf.p;
}
