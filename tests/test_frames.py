"""Poses, CARLA's left-handed axes, spherical coordinates."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from shenron_rt.errors import InputError
from shenron_rt.frames import (
    Pose,
    direction,
    from_carla_points,
    from_carla_pose,
    rotation_matrix,
    spherical,
    to_carla,
    to_carla_pose,
)

angle = st.floats(-179, 179)
length = st.floats(-100, 100)
poses = st.builds(Pose, st.tuples(length, length, length), st.tuples(angle, st.floats(-89, 89), angle))


@pytest.mark.parametrize(
    ("ypr", "child", "parent"),
    [
        ((90, 0, 0), (1, 0, 0), (0, 1, 0)),  # yaw + left
        ((0, 90, 0), (1, 0, 0), (0, 0, 1)),  # pitch + nose up
        ((0, 0, 90), (0, 1, 0), (0, 0, 1)),  # roll + left side up
        ((90, 30, 0), (1, 0, 0), (0, np.cos(np.pi / 6), 0.5)),
    ],
)
def test_signs_of_the_angles(ypr, child, parent):
    np.testing.assert_allclose(rotation_matrix(ypr) @ child, parent, atol=1e-15)


@given(poses)
def test_rotation_is_proper(pose):
    R = pose.rotation
    np.testing.assert_allclose(R @ R.T, np.eye(3), atol=1e-14)
    assert np.linalg.det(R) == pytest.approx(1)


@given(poses, poses)
def test_compose_is_apply_after_apply(outer, inner):
    p = np.array([[1.0, -2.0, 3.0], [0, 0, 0], [50, 4, -7]])
    np.testing.assert_allclose(outer.compose(inner).apply(p), outer.apply(inner.apply(p)), atol=1e-9)


@given(poses)
def test_inverse_undoes(pose):
    p = np.array([[1.0, -2.0, 3.0], [40, 0, -9]])
    np.testing.assert_allclose(pose.inverse().apply(pose.apply(p)), p, atol=1e-9)
    np.testing.assert_allclose(pose.apply_inverse(pose.apply(p)), p, atol=1e-9)


@pytest.mark.parametrize("pitch", [90.0, -90.0])
@pytest.mark.parametrize(("yaw", "roll"), [(20, 0), (20, 50), (-130, 70)])
def test_straight_up_and_down_keep_their_rotation(pitch, yaw, roll):
    R = rotation_matrix((yaw, pitch, roll))
    np.testing.assert_allclose(Pose.from_matrix(R, (0, 0, 0)).rotation, R, atol=1e-9)


@given(st.tuples(length, length, length), st.tuples(st.floats(-89, 89), angle, angle))
def test_carla_pose_is_the_mirrored_matrix(location, rotation):
    """CARLA's Transform.h: forward (cp cy, cp sy, sp), right and up as there; y mirrored on both sides gives ours."""
    pitch, yaw, roll = np.radians(rotation)
    cp, sp, cy, sy, cr, sr = np.cos(pitch), np.sin(pitch), np.cos(yaw), np.sin(yaw), np.cos(roll), np.sin(roll)
    theirs = np.array(
        [
            [cp * cy, cy * sp * sr - sy * cr, -cy * sp * cr - sy * sr],
            [cp * sy, sy * sp * sr + cy * cr, -sy * sp * cr + cy * sr],
            [sp, -cp * sr, cp * cr],
        ]
    )
    flip = np.diag([1.0, -1.0, 1.0])
    pose = from_carla_pose(location, rotation)
    np.testing.assert_allclose(pose.rotation, flip @ theirs @ flip, atol=1e-12)
    p = np.array([[3.0, 2.0, 1.0]])
    in_carla = p @ theirs.T + location
    np.testing.assert_allclose(pose.apply(from_carla_points(p)), from_carla_points(in_carla), atol=1e-10)
    back_location, back_rotation = to_carla_pose(pose)
    np.testing.assert_allclose(back_location, location)
    np.testing.assert_allclose(back_rotation, rotation)


def test_mirror_is_its_own_inverse(rng):
    p = rng.normal(size=(5, 3))
    np.testing.assert_array_equal(to_carla(from_carla_points(p)), p)
    np.testing.assert_array_equal(to_carla([[1.0, 2.0, 3.0]]), [[1, -2, 3]])


def test_azimuth_is_left_and_elevation_up():
    r, az, el = spherical(np.array([[0.0, 2, 0], [0, 0, 3], [1, 0, 0], [0, 0, 0], [-1, 0, 0]]))
    np.testing.assert_allclose(r, [2, 3, 1, 0, 1])
    np.testing.assert_allclose(az, [np.pi / 2, 0, 0, 0, np.pi])
    np.testing.assert_allclose(el, [0, np.pi / 2, 0, 0, 0])


@given(st.floats(-3.1, 3.1), st.floats(-1.5, 1.5), st.floats(0.1, 300))
def test_direction_and_spherical_are_inverse(az, el, r):
    got = spherical(r * direction(az, el))
    np.testing.assert_allclose(got, (r, az, el), atol=1e-9)


@pytest.mark.parametrize("bad", [(1, 2), (1, 2, 3, 4), (1, 2, float("nan")), (1, float("inf"), 0)])
def test_pose_needs_three_finite_numbers(bad):
    with pytest.raises(InputError, match="three finite numbers"):
        Pose(bad)
    with pytest.raises(InputError, match="three finite numbers"):
        Pose((0, 0, 0), bad)
