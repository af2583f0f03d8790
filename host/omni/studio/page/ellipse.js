// SPDX-License-Identifier: MIT
// How unsure a place is, as an ellipse: the eigenvectors of the covariance of x and y are its axes.

/**
 * sd: standard deviations of x and y [m], correlation: of both, -1..1, sigmas: how many of them it reaches.
 * Return half axes [m] and the angle from x to the longer one [rad, counter-clockwise]: {major, minor, angle}.
 */
export function ellipse([sd_x, sd_y], correlation, sigmas) {
  const [xx, yy, xy] = [sd_x * sd_x, sd_y * sd_y, correlation * sd_x * sd_y];
  const [mean, apart] = [(xx + yy) / 2, Math.hypot((xx - yy) / 2, xy)];
  return {
    major: sigmas * Math.sqrt(mean + apart),
    minor: sigmas * Math.sqrt(Math.max(0, mean - apart)),
    angle: Math.atan2(2 * xy, xx - yy) / 2,
  };
}
