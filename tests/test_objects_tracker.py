"""Clusters, Kalman filter and tracker against closed forms and brute force."""

from __future__ import annotations

import math

import numpy as np
import pytest

from shenron_rt.errors import InputError
from shenron_rt.objects import ClusterSettings, Measurement, Tracker, TrackerSettings, cluster
from shenron_rt.objects.clusters import density_clusters
from shenron_rt.objects.kalman import constant_velocity, predict, update


# ---- clusters
def _brute_force(points: np.ndarray, min_points: int) -> list[set[int]]:
    """Return the sets of cores of DBSCAN, by walking from each core."""
    near = np.linalg.norm(points[:, None] - points[None], axis=-1) <= 1.0
    cores = set(np.flatnonzero(near.sum(axis=1) >= min_points).tolist())
    found = []
    while cores:
        group, front = set(), {cores.pop()}
        while front:
            here = front.pop()
            group.add(here)
            reached = {int(j) for j in np.flatnonzero(near[here]) if int(j) in cores}
            cores -= reached
            front |= reached
        found.append(group)
    return found


@pytest.mark.parametrize("min_points", [1, 3, 5])
def test_clusters_are_those_of_dbscan_by_brute_force(rng: np.random.Generator, min_points: int) -> None:
    points = rng.uniform(0, 9, (120, 2))
    label = density_clusters(points, min_points)
    near = np.linalg.norm(points[:, None] - points[None], axis=-1) <= 1.0
    core = near.sum(axis=1) >= min_points
    found = [set(np.flatnonzero((label == k) & core).tolist()) for k in range(label.max() + 1)]
    assert sorted(map(sorted, found)) == sorted(map(sorted, _brute_force(points, min_points)))
    # a point beside no core is noise, one beside a core belongs to one of those
    for i in np.flatnonzero(~core):
        beside = {int(label[j]) for j in np.flatnonzero(near[i] & core)}
        assert int(label[i]) in (beside or {-1})


def test_things_at_one_place_with_other_velocities_are_two_objects() -> None:
    position = np.array([[20.0, 0.0], [20.5, 0.2], [20.2, 0.1]])
    found = cluster(position, np.array([-5.0, -5.2, 3.0]), np.array([1.0, 1.0, 4.0]), ClusterSettings(2, 1))
    assert found.count.tolist() == [1, 2]  # strongest first
    assert found.label.tolist() == [1, 1, 0]
    assert found.position[1] == pytest.approx([20.25, 0.1])
    assert found.size_m[1] == pytest.approx([0.5, 0.2])
    assert found.range_rate.tolist() == pytest.approx([3.0, -5.1])


def test_no_detections_are_no_objects() -> None:
    assert len(cluster(np.zeros((0, 2)), np.zeros(0), np.zeros(0))) == 0
    assert len(cluster(np.zeros((2, 2)), np.array([0.0, 9.0]), np.ones(2), ClusterSettings(min_points=2))) == 0


def test_a_reach_of_nothing_is_refused() -> None:
    with pytest.raises(InputError, match="reach_m 0 "):
        ClusterSettings(reach_m=0)


# ---- Kalman
def alpha_beta(tracking_index: float) -> tuple[float, float]:
    """Gains of position and (over T) velocity that the filter settles at, for acceleration_std T^2 / measurement_std.

    P. R. Kalata, IEEE Trans. Aerosp. Electron. Syst. AES-20, 174-182 (1984), doi:10.1109/TAES.1984.310438.
    """
    r = (4 + tracking_index - np.sqrt(8 * tracking_index + tracking_index**2)) / 4
    alpha = 1 - r**2
    return float(alpha), float(2 * (2 - alpha) - 4 * np.sqrt(1 - alpha))


@pytest.mark.parametrize("index", [0.01, 0.3, 1.0, 5.0])
def test_the_filter_settles_at_the_alpha_beta_gains(index: float) -> None:
    T, sigma = 0.1, 0.7
    F, Q = constant_velocity(T, index * sigma / T**2, dimensions=1)
    H, R = np.array([[1.0, 0.0]]), np.array([[sigma**2]])
    P = np.eye(2) * 100.0
    for _ in range(3_000):
        _, P = predict(np.zeros(2), P, F, Q)
        gain = (P @ H.T / (H @ P @ H.T + R))[:, 0]
        _, P = update(np.zeros(2), P, np.zeros(1), H, R)
    alpha, beta = alpha_beta(index)
    assert gain[0] == pytest.approx(alpha, rel=1e-9)
    assert gain[1] * T == pytest.approx(beta, rel=1e-9)
    # and the covariance after the measurement is that of the closed form, alpha sigma^2
    assert P[0, 0] == pytest.approx(alpha * sigma**2, rel=1e-9)


def test_without_accelerations_the_filter_is_the_least_squares_line(rng: np.random.Generator) -> None:
    T = 0.1
    times = np.arange(30) * T
    measured = 5 - 3 * times + rng.normal(0, 0.4, 30)
    F, Q = constant_velocity(T, 0.0, dimensions=1)
    H, R = np.array([[1.0, 0.0]]), np.array([[0.16]])
    x, P = np.zeros(2), np.eye(2) * 1e9  # as good as no prior: it moves the line by 1e-9 of the measurements
    for k, z in enumerate(measured):
        if k:
            x, P = predict(x, P, F, Q)
        x, P = update(x, P, z - H @ x, H, R)
    slope, offset = np.polyfit(times, measured, 1)
    assert x == pytest.approx([offset + slope * times[-1], slope], abs=1e-6)


def test_the_covariance_stays_symmetric_and_positive(rng: np.random.Generator) -> None:
    F, Q = constant_velocity(0.1, 2.0)
    P = np.eye(4) * 1e6
    for _ in range(500):
        _, P = predict(np.zeros(4), P, F, Q)
        H = np.zeros((3, 4))
        H[0, 0] = H[1, 1] = 1
        H[2, 2:] = (lambda a: (math.cos(a), math.sin(a)))(rng.uniform(-1, 1))
        _, P = update(np.zeros(4), P, np.zeros(3), H, np.diag([1e-6, 1.0, 1e-8]))
        assert np.abs(P - P.T).max() < 1e-9 * P.max()
        assert np.linalg.eigvalsh(P).min() > 0


# ---- tracker
def _seen(x: float, y: float, vx: float, vy: float, *, noise: np.ndarray | None = None, **more: float) -> Measurement:
    """Return what a radar at the origin measures of a point."""
    u = np.array([x, y]) / math.hypot(x, y)
    across = np.array([-u[1], u[0]])
    s = TrackerSettings()
    spread = math.hypot(x, y) * math.radians(s.azimuth_std_deg)
    n = np.zeros(3) if noise is None else noise
    return Measurement(
        position=np.array([x, y]) + n[0] * s.range_std_m * u + n[1] * spread * across,
        covariance=s.range_std_m**2 * np.outer(u, u) + spread**2 * np.outer(across, across),
        direction=u,
        range_rate=float(u @ [vx, vy]) + n[2] * s.range_rate_std_mps,
        range_rate_std=s.range_rate_std_mps,
        **more,
    )


def test_a_track_is_confirmed_after_its_hits_and_dropped_after_its_misses() -> None:
    s = TrackerSettings(confirm_hits=3, confirm_frames=4, max_misses=2)
    tracker = Tracker(s)
    confirmed = []
    for k in range(12):
        there = k < 6 and k != 1  # one miss while tentative
        confirmed.append(len(tracker.step(0.1 * k, [_seen(20 + k * 0.1, 0, 1, 0)] if there else [])))
    # hits in frames 0, 2, 3 of the first four; the last in frame 5, then two frames of coasting
    assert confirmed == [0, 0, 0, 1, 1, 1, 1, 1, 0, 0, 0, 0]


def test_what_is_seen_too_rarely_is_never_confirmed() -> None:
    tracker = Tracker(TrackerSettings(confirm_hits=3, confirm_frames=4))
    for k in range(20):
        assert tracker.step(0.1 * k, [_seen(20, 0, 0, 0)] if k % 4 < 1 else []) == []


def test_two_objects_that_cross_keep_their_identity_by_their_range_rates() -> None:
    tracker = Tracker()
    numbers = []
    for k in range(60):
        t = 0.1 * k - 3.0
        both = [_seen(30 + 5 * t, 0.3, 5, 0), _seen(30 - 5 * t, -0.3, -5, 0)]
        found = tracker.step(0.1 * k, both[:: 1 if k % 2 else -1])
        numbers.append({t.number: t.state[2] for t in found})
    assert set(numbers[10]) == set(numbers[-1])
    assert len(numbers[-1]) == 2
    for number, speed in numbers[10].items():
        assert numbers[-1][number] == pytest.approx(speed, abs=0.3)


def test_a_velocity_beyond_folding_is_tracked_by_its_folded_range_rates() -> None:
    fold = 20.0
    tracker = Tracker()
    # begins at 8 m/s within the unfolded range, and speeds up to 14 m/s, which reads -6 m/s
    x, v = 20.0, 8.0
    for k in range(160):
        v = min(v + 0.1, 14.0) if k >= 10 else v
        x += 0.1 * v
        true = _seen(x, 0, v, 0, fold_mps=fold)
        read = Measurement(
            true.position, true.covariance, true.direction, (v + 10) % fold - 10, true.range_rate_std, fold
        )
        found = tracker.step(0.1 * k, [read])
    assert len(found) == 1
    assert found[0].number == 1
    assert found[0].state[2] == pytest.approx(14.0, abs=0.01)


def test_the_assignment_minimises_the_total_not_the_first_distance() -> None:
    s = TrackerSettings(confirm_hits=1, confirm_frames=1, range_std_m=2.0)
    tracker = Tracker(s)
    tracker.step(0.0, [_seen(20, 0, 0, 0), _seen(22, 0, 0, 0)])
    # 21.4 is nearer to the second track; alone with it, the first would lose its only partner
    found = tracker.step(0.1, [_seen(21.4, 0, 0, 0), _seen(23.5, 0, 0, 0)])
    assert [round(float(t.last.position[0]), 1) for t in found if t.misses == 0] == [21.4, 23.5]
    assert [t.number for t in found] == [1, 2]


def test_the_gate_passes_the_share_of_true_measurements_it_promises(rng: np.random.Generator) -> None:
    """Draws from the tracker's own model: 4000 with p = 0.95 have a standard deviation of 0.35 %; five of them."""
    s = TrackerSettings(gate_probability=0.95, confirm_hits=1, confirm_frames=1, acceleration_std_mps2=1e-6)
    passed = 0
    for _ in range(4000):
        tracker = Tracker(s)
        first = _seen(30, 5, 0, 0)
        tracker.step(0.0, [first])
        # the true state is drawn from the new track's own distribution
        x = rng.multivariate_normal(tracker.tracks[0].state, tracker.tracks[0].covariance, method="eigh")
        x[:2] += 0.1 * x[2:]
        noise = rng.multivariate_normal(np.zeros(3), first.noise)
        z = Measurement(
            x[:2] + noise[:2], first.covariance, first.direction, float(first.direction @ x[2:]) + noise[2],
            first.range_rate_std,
        )  # fmt: skip
        passed += len([t for t in tracker.step(0.1, [z]) if t.hits == 2])
    assert passed / 4000 == pytest.approx(0.95, abs=5 * 0.0035)


def test_the_covariance_of_a_track_tells_its_error(rng: np.random.Generator) -> None:
    """The normalised squared error of 200 tracks averages to its 4 degrees of freedom: +-5 sqrt(2 x 4 / 200)."""
    s = TrackerSettings(confirm_hits=1, confirm_frames=1, gate_probability=1 - 1e-9, speed_std_mps=3.0)
    total = 0.0
    for _ in range(200):
        tracker = Tracker(s)
        x = np.array([30.0, 4.0, -2.0, 0.0])
        u = x[:2] / np.linalg.norm(x[:2])
        x[2:] = -2.0 * u + rng.normal(0, s.speed_std_mps) * np.array([-u[1], u[0]])
        for k in range(15):
            push = rng.normal(0, s.acceleration_std_mps2, 2) if k else np.zeros(2)
            if k:
                x[:2] += 0.1 * x[2:] + 0.005 * push
                x[2:] += 0.1 * push
            (found,) = tracker.step(0.1 * k, [_seen(*x, noise=rng.standard_normal(3))])
        error = found.state - x
        total += float(error @ np.linalg.solve(found.covariance, error))
    assert total / 200 == pytest.approx(4.0, abs=5 * math.sqrt(8 / 200))


def test_frames_out_of_order_are_refused() -> None:
    tracker = Tracker()
    tracker.step(1.0, [])
    with pytest.raises(InputError, match="times must ascend"):
        tracker.step(1.0, [])


def test_settings_that_confirm_nothing_are_refused() -> None:
    with pytest.raises(InputError, match="confirm_hits <= confirm_frames"):
        TrackerSettings(confirm_hits=5, confirm_frames=3)
