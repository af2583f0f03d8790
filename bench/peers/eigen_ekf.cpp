// SPDX-License-Identifier: MIT
/// @file eigen_ekf.cpp  The same filters with Eigen's fixed-size matrices of float: what a C++ user would write,
/// letting the compiler unroll. Own writing. Left out: late fixes, gates, checks of the inputs, Joseph form, wrapped
/// angles, compensated sums.
#include <cmath>
#include <Eigen/Dense>

#include "estimators.h"

namespace {

template <int N, int M>
struct Filter {
    using State = Eigen::Matrix<float, N, 1>;
    using Square = Eigen::Matrix<float, N, N>;
    using Measurement = Eigen::Matrix<float, M, 1>;

    State x = State::Zero();
    Square p = Square::Zero();

    void predict(const State &fx, const Square &f, const State &q) {
        x = fx;
        p = f * p * f.transpose();
        p.diagonal() += q;
    }

    void update(const Measurement &innovation, const Eigen::Matrix<float, M, N> &h, const Measurement &r) {
        const Eigen::Matrix<float, N, M> pht = p * h.transpose();
        Eigen::Matrix<float, M, M> s = h * pht;
        s.diagonal() += r;
        const Eigen::Matrix<float, N, M> gain = pht * s.inverse();
        x += gain * innovation;
        p = (Square::Identity() - gain * h) * p;
    }
};

template <int Rows, int Columns>
Eigen::Matrix<float, Rows, Columns> matrix(const float *values) {
    constexpr int order = Columns == 1 ? Eigen::ColMajor : Eigen::RowMajor;
    return Eigen::Map<const Eigen::Matrix<float, Rows, Columns, order>>(values);
}

} // namespace

void eigen_pose(const bench_model_t *model, const bench_input_t *inputs, uint32_t steps, bench_output_t *output) {
    Filter<3, 3> ekf;
    const auto to_body = matrix<3, BENCH_WHEELS>(&model->to_body[0][0]);
    const Eigen::Vector3f q = matrix<3, 1>(model->pose_q);
    const Eigen::Vector3f r = matrix<3, 1>(model->fix_r);
    for (uint32_t k = 0; k < steps; ++k) {
        const Eigen::Vector3f body = to_body * matrix<BENCH_WHEELS, 1>(inputs[k].turned_rad);
        const float heading = ekf.x(2) + 0.5f * body(2);
        const float sine = std::sin(heading);
        const float cosine = std::cos(heading);
        const Eigen::Vector3f moved(cosine * body(0) - sine * body(1), sine * body(0) + cosine * body(1), body(2));
        Eigen::Matrix3f f = Eigen::Matrix3f::Identity();
        f(0, 2) = -moved(1);
        f(1, 2) = moved(0);
        ekf.predict(ekf.x + moved, f, q);
        ekf.update(matrix<3, 1>(inputs[k].fix) - ekf.x, Eigen::Matrix3f::Identity(), r);
    }
    Eigen::Map<Eigen::Vector3f>(output->pose) = ekf.x;
    Eigen::Map<Eigen::Matrix3f>(&output->pose_p[0][0]) = ekf.p;
}

void eigen_motor(const bench_model_t *model, const bench_input_t *inputs, uint32_t steps, bench_output_t *output) {
    Filter<2, 1> kf;
    kf.p.setIdentity();
    const Eigen::Matrix2f a = matrix<2, 2>(&model->motor_a[0][0]);
    const Eigen::Vector2f b = matrix<2, 1>(model->motor_b);
    const Eigen::Vector2f q = matrix<2, 1>(model->motor_q);
    const Eigen::RowVector2f h(1.0f, 0.0f);
    using Scalar = Filter<2, 1>::Measurement;
    for (uint32_t k = 0; k < steps; ++k) {
        kf.predict(a * kf.x + b * inputs[k].voltage_V, a, q);
        kf.update(Scalar(inputs[k].speed_rad_s) - h * kf.x, h, Scalar(model->motor_r));
    }
    Eigen::Map<Eigen::Vector2f>(output->motor) = kf.x;
    Eigen::Map<Eigen::Matrix2f>(&output->motor_p[0][0]) = kf.p;
}
