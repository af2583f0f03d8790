% SPDX-License-Identifier: MIT
% The filter study for GNU Octave, written as the report's scripts were: one step after the other, every history an array that
% grows by a column per step, and estimates read back out of it. In double precision; joint motor filter of eight states.
% Left out: checks of the inputs, late fixes, gates, wrapped angles. Growing arrays get slower the longer a run is: the time
% per step is that of the given number of steps.
%
% usage: octave-cli filter_study.m FOLDER, where model.m (variables), and perhaps normals.txt, are. Prints the CPU seconds of the loop;
% leaves truth.txt (3 x steps) and estimates.txt (12 x steps) in the folder.
1;

function [moved, f] = roll(to_body, heading, speeds, t)
    body = to_body * speeds * t;
    s = sin(heading + 0.5 * body(3));
    c = cos(heading + 0.5 * body(3));
    moved = [c, -s, 0; s, c, 0; 0, 0, 1] * body;
    f = [1, 0, -moved(2); 0, 1, moved(1); 0, 0, 1];
end

folder = argv(){end};
run(fullfile(folder, 'model.m'));
noise = fullfile(folder, 'normals.txt');
given = exist(noise, 'file');
if given
    normals = load('-ascii', noise)';
end

wheels = rows(to_wheels);
A = kron(eye(wheels), motor_a);
B = kron(eye(wheels), motor_b);
C = kron(eye(wheels), [1, 0]);
Qm = diag(repmat(kf_q, wheels, 1));
Rm = measured_sd ^ 2 * eye(wheels);
R = diag(fix_sd .^ 2);
motor = zeros(2 * wheels, 1);
open_loop = motor;
kf = motor;
Pm = eye(2 * wheels);
truth = poses(:, 1);
none = truth;
only_kf = truth;
ekf = truth;
kf_ekf = truth;
P1 = zeros(3);
P2 = zeros(3);
integral = zeros(3, 1);
voltage = zeros(wheels, 0);
measured = zeros(wheels, 0);
fix = zeros(3, 0);

begin = cputime();
for k = 1:steps
    if given
        n = normals(:, k);
    else
        n = randn(20, 1);
    end
    e = kf_ekf(:, k) - poses(:, k);
    s = e + lambda .* integral(:, k);
    u = rates(:, k) - lambda .* e - gain .* sign(s);
    integral(:, k + 1) = integral(:, k) + e * step_s;
    h = kf_ekf(3, k);
    voltage(:, k) = to_wheels * [cos(h), sin(h), 0; -sin(h), cos(h), 0; 0, 0, 1] * u;

    open_loop(:, k + 1) = A * open_loop(:, k) + B * voltage(:, k);
    motor(:, k + 1) = A * motor(:, k) + B * voltage(:, k) + repmat(motor_sd, wheels, 1) .* n(1:8);
    measured(:, k) = C * motor(:, k + 1) + measured_sd * n(9:12);

    x = A * kf(:, k) + B * voltage(:, k);
    Pm = A * Pm * A' + Qm;
    K = Pm * C' * inv(C * Pm * C' + Rm);
    kf(:, k + 1) = x + K * (measured(:, k) - C * x);
    Pm = (eye(2 * wheels) - K * C) * Pm;
    filtered = C * kf(:, k + 1);

    if drive_true
        moved = roll(to_body, truth(3, k), C * motor(:, k + 1), step_s);
    else
        moved = roll(to_body, truth(3, k), filtered, step_s);
    end
    truth(:, k + 1) = truth(:, k) + moved + pose_sd .* n(13:15);
    fix(:, k) = truth(:, k + 1 - stale) + fix_sd .* n(16:18);

    if raw_measured
        raw = measured(:, k);
    else
        raw = C * open_loop(:, k + 1);
    end
    none(:, k + 1) = none(:, k) + roll(to_body, none(3, k), raw, step_s);
    only_kf(:, k + 1) = only_kf(:, k) + roll(to_body, only_kf(3, k), filtered, step_s);

    [moved, F] = roll(to_body, ekf(3, k), raw, step_s);
    P1 = F * P1 * F' + diag(ekf_q(:, 1));
    K = P1 * inv(P1 + R);
    ekf(:, k + 1) = ekf(:, k) + moved + K * (fix(:, k) - ekf(:, k) - moved);
    P1 = (eye(3) - K) * P1;

    [moved, F] = roll(to_body, kf_ekf(3, k), filtered, step_s);
    P2 = F * P2 * F' + diag(ekf_q(:, 2));
    K = P2 * inv(P2 + R);
    kf_ekf(:, k + 1) = kf_ekf(:, k) + moved + K * (fix(:, k) - kf_ekf(:, k) - moved);
    P2 = (eye(3) - K) * P2;
end
printf('%.9f\n', cputime() - begin);

truth = truth(:, 2:end);
estimates = [none(:, 2:end); only_kf(:, 2:end); ekf(:, 2:end); kf_ekf(:, 2:end)];
save('-ascii', '-double', fullfile(folder, 'truth.txt'), 'truth');
save('-ascii', '-double', fullfile(folder, 'estimates.txt'), 'estimates');
