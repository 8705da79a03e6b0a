"""A Kalman filter tracks a bouncing ball, with and without the saltation matrix.

    python examples/kalman_bounces.py                   # prints the consistency of each filter
    python examples/kalman_bounces.py --plot file.png   # needs matplotlib

A camera measures the position of the ball to 5 cm, 20 times a second. Between bounces the motion is linear.
At a bounce the naive filter multiplies only by the derivatives of the impact by the velocities. It does not
know that a ball which is higher than expected bounces later, and becomes too confident. The other filter uses
the saltation matrix. A filter is consistent if its errors are as large as its covariance says: if the mean of
``error . P^-1 error`` is 6, the number of components of position and velocity.
"""

from __future__ import annotations

import argparse
import math
from typing import Any, NamedTuple

import numpy as np

from collision_response import Body, Contact, ImpactModel, Law, resolve
from collision_response.derivatives import differentiate, propagate_covariance, sphere_on_plane

Array = np.ndarray[Any, Any]

RADIUS, MASS, STEP, DURATION = 0.1, 0.5, 0.05, 2.5
GRAVITY = np.array([0.0, 0.0, -9.81])
E, MU, E_SD, MU_SD, SEEN_SD = 0.8, 0.1, 0.005, 0.005, 0.05
MODEL = ImpactModel(Law.COULOMB)
START = np.array([0.0, 0.0, 1.0, 0, 0, 0, 1.5, 0.5, 0.0, 1.0, -4.0, 7.0])
START_SD = np.array([0.05] * 3 + [0.0] * 3 + [0.1] * 3 + [1.0] * 3)
POSITION, VELOCITY, SPIN = slice(0, 3), slice(6, 9), slice(9, 12)
MOTION = [0, 1, 2, 6, 7, 8]


class Track(NamedTuple):
    """Estimates of a filter at each step, and whether the step was far from a bounce."""

    time: Array
    truth: Array
    estimate: Array
    covariance: Array
    clear: Array

    def trust(self) -> Array:
        """``error . P^-1 error`` of position and velocity; its mean should be 6."""
        error = (self.estimate - self.truth)[self.clear][:, MOTION]
        P = self.covariance[self.clear][:, MOTION][:, :, MOTION]
        return np.einsum("ni,ni->n", error, np.linalg.solve(P, error[..., None])[..., 0])


def ball(state: Array) -> Body:
    """The ball in a state ``(x, theta, v, w)``; its orientation does not matter."""
    x, v, w = (state[part].tolist() for part in (POSITION, VELOCITY, SPIN))
    return Body.sphere(MASS, RADIUS, position=x, velocity=v, angular_velocity=w)


def contact_of(state: Array, e: float, mu: float) -> Contact:
    """Contact of the ball with the floor below it."""
    return Contact.of((state[0], state[1], state[2] - RADIUS), (0.0, 0.0, 1.0), e, mu)


def flown(state: Array, time: float) -> Array:
    """The state after free flight."""
    later = state.copy()
    later[POSITION] += state[VELOCITY] * time + GRAVITY * (time * time / 2)
    later[VELOCITY] += GRAVITY * time
    return later


def time_to_floor(state: Array) -> float:
    """Time until the ball meets the floor [s]."""
    height, speed, g = state[2] - RADIUS, state[8], -GRAVITY[2]
    if height <= 0:
        return 0.0 if speed < 0 else 2 * speed / g
    return (speed + math.sqrt(speed * speed + 2 * g * height)) / g


def struck(state: Array, e: float, mu: float) -> Array:
    """The state after a bounce."""
    impact = resolve(ball(state), Body.static(), contact_of(state, e, mu), MODEL)
    after = state.copy()
    after[VELOCITY], after[SPIN] = impact.twist_a.linear, impact.twist_a.angular
    return after


def covariance_after(state: Array, P: Array, with_matrix: bool) -> Array:
    """Estimate and covariance of a filter after a bounce."""
    request = ball(state), Body.static(), contact_of(state, E, MU), MODEL
    if with_matrix:
        known = propagate_covariance(
            *request, P, sphere_on_plane(RADIUS), restitution_sd=E_SD, friction_sd=MU_SD, gravity=GRAVITY
        )
        return known.covariance
    names = ("body_a.velocity", "body_a.angular_velocity", "contact.restitution", "contact.friction")
    J = differentiate(*request, names).jacobian[:6]
    reset, by = np.eye(12), np.zeros((12, 2))
    reset[6:, 6:], by[6:] = J[:, :6], J[:, 6:] * [E_SD, MU_SD]
    return reset @ P @ reset.T + by @ by.T


def track(seed: int, with_matrix: bool) -> Track:
    """One run: the ball flies, the camera measures it, the filter follows."""
    random = np.random.default_rng(seed)
    truth = START + START_SD * random.normal(size=12)
    estimate, P = START.copy(), np.diag(START_SD**2)
    steps, since = [], math.inf
    for i in range(round(DURATION / STEP)):
        left = STEP
        while (time := time_to_floor(truth)) < left:
            e = min(1.0, E + E_SD * random.normal())
            truth, left = struck(flown(truth, time), e, abs(MU + MU_SD * random.normal())), left - time
        truth = flown(truth, left)

        left = STEP
        while (time := time_to_floor(estimate)) < left:
            estimate, P = flown(estimate, time), flight(time) @ P @ flight(time).T
            P = covariance_after(estimate, P, with_matrix)
            estimate, left, since = struck(estimate, E, MU), left - time, 0.0
        estimate, P, since = flown(estimate, left), flight(left) @ P @ flight(left).T, since + left

        seen = truth[POSITION] + SEEN_SD * random.normal(size=3)
        clear = is_clear(estimate, P, since)
        if clear:
            gain = P[:, POSITION] @ np.linalg.inv(P[POSITION, POSITION] + SEEN_SD**2 * np.eye(3))
            estimate = estimate + gain @ (seen - estimate[POSITION])
            keep = np.eye(12)
            keep[:, POSITION] -= gain
            P = keep @ P @ keep.T + SEEN_SD**2 * gain @ gain.T
        steps.append((STEP * (i + 1), truth, estimate, P, clear))
    return Track(*map(np.array, zip(*steps, strict=True)))


def is_clear(estimate: Array, P: Array, since: float) -> bool:
    """Whether ball and estimate are on the same side of a bounce, to four standard deviations of its time."""
    impact_speed = math.hypot(estimate[8], math.sqrt(2 * -GRAVITY[2] * max(estimate[2] - RADIUS, 0.0)))
    return min(since, time_to_floor(estimate)) > 4 * math.sqrt(P[2, 2]) / impact_speed


def flight(time: float) -> Array:
    """Transition matrix of the state in free flight."""
    matrix = np.eye(12)
    matrix[POSITION, VELOCITY] = matrix[3:6, SPIN] = np.eye(3) * time
    return matrix


def compare(runs: int) -> tuple[float, float]:
    """Mean of ``error . P^-1 error`` for the filter with the matrix and the one without."""
    with_matrix, without = (
        float(np.mean(np.concatenate([track(seed, choice).trust() for seed in range(runs)])))
        for choice in (True, False)
    )
    return with_matrix, without


def plot(file: str) -> None:
    """Plot the height of the ball and the consistency of each filter: means of 100 runs at each step."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot as plt

    figure, (above, below) = plt.subplots(2, sharex=True, figsize=(8, 5), layout="constrained")
    for choice, name in ((False, "without the saltation matrix"), (True, "with it")):
        runs = [track(seed, choice) for seed in range(100)]
        trust = np.full((len(runs), runs[0].time.size), np.nan)
        for row, run in zip(trust, runs, strict=True):
            row[run.clear] = run.trust()
        often = np.isfinite(trust).sum(0) > 50
        below.plot(runs[0].time[often], np.nanmean(trust[:, often], 0), ".-", label=name)
    above.plot(runs[0].time, runs[0].truth[:, 2])
    above.set_ylabel("height of one ball [m]")
    below.set_yscale("log")
    below.axhline(6, color="0.6", lw=1)
    below.set_ylabel("squared error / covariance\n(6 is right)")
    below.set_xlabel("time [s]")
    below.legend()
    figure.savefig(file, dpi=110)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description="A Kalman filter tracks a bouncing ball.")
    parser.add_argument("--plot", metavar="FILE", help="draw the means of 100 runs")
    arguments = parser.parse_args()
    good, naive = compare(runs=40)
    print("mean of error . P^-1 error, which should be 6:")
    print(f"{good:.2f} with the saltation matrix, {naive:.2f} without")
    if not (5 < good < 7.5 < naive):
        raise SystemExit("failed: the filter with the saltation matrix is not consistent")
    print("passed: the filter with the saltation matrix is consistent")
    if arguments.plot:
        plot(arguments.plot)
