"""The one-call entry: released numbers, corrected ones, and what it needs to be told."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from shenron_rt import InputError, Pose, illuminate
from shenron_rt.cshenron import ShenronRadarModel, range_angle
from shenron_rt.cshenron.model import NOISE_COUNTS
from shenron_rt.cshenron.place import place_points
from shenron_rt.echo.shenron import ShenronModel
from shenron_rt.lidar.grid import LidarGrid

VEHICLE = 10  # CARLA up to 0.9.13
#: Corrected, without the noise that a lone patch of metal seen aslant drowns in.
QUIET = "corrected-noise_per_chirp"


def _target(right: float = 4.0, speed: float = 0.0) -> np.ndarray:
    """A small patch of a vehicle 22 m ahead of the ego origin, 20 m ahead of the bumper."""
    y, z = np.meshgrid(np.linspace(-0.2, 0.2, 5) + right, [0.8, 1.0, 1.2])
    rows = np.zeros((y.size, 7))
    rows[:, :3] = np.column_stack([np.full(y.size, 22.0), y.ravel(), z.ravel()])
    rows[:, 3], rows[:, 4], rows[:, 5], rows[:, 6] = 0.9, 5, VEHICLE, speed
    return rows


def test_as_released_gives_the_public_cube_and_composite(shared_reference: Path) -> None:
    ref = np.load(shared_reference / "c_shenron_parity.npz")
    model = ShenronRadarModel("ti_cascade")
    adc, expected = model(ref["points"]), ref["tic_v000_adc_ref"]
    assert np.sqrt(np.mean(np.abs(adc - expected) ** 2) / np.mean(np.abs(expected) ** 2)) < 1e-6
    # the composite adds the spurs of the side views, 2.2e-3 of their smaller peaks
    assert np.abs(model.fblr(ref["points"]) - ref["fblr"]).max() < 3e-3 * ref["fblr"].max()


def test_as_released_takes_later_tags_by_their_meaning(rng: np.random.Generator) -> None:
    old = _target()[:, :6]
    old[:, 5] = rng.permutation([1, 2, 4, 5, 7, 8, 9, 10, 11, 12, 15, 17, 18, 22, 0])
    new = old.copy()
    meaning = {1: 3, 2: 5, 4: 12, 5: 6, 7: 1, 8: 2, 9: 9, 10: 16, 11: 4, 12: 8, 15: 26, 17: 28, 18: 7, 22: 10, 0: 0}
    new[:, 5] = [meaning[int(t)] for t in old[:, 5]]
    np.testing.assert_array_equal(
        ShenronRadarModel("ti_cascade")(old), ShenronRadarModel("ti_cascade", tags="0.9.14")(new)
    )


def test_as_released_sets_speeds_to_zero() -> None:
    model = ShenronRadarModel("ti_cascade")
    np.testing.assert_array_equal(model(_target(speed=9.0)), model(_target()[:, :6]))


@pytest.mark.parametrize("preset", ["as_released", QUIET])
def test_a_target_stands_right_of_ahead_in_the_image(preset: str) -> None:
    model = ShenronRadarModel("ti_cascade", preset)
    image = model.image(_target())
    row, column = np.unravel_index(image.argmax(), image.shape)
    pixel = 75 / 255
    # from the vehicle's centre as released, from the bumper otherwise; a range bin is two pixels
    ahead = 22.0 if preset == "as_released" else 20.0
    assert 37.5 - row * pixel == pytest.approx(ahead, abs=3 * pixel)
    assert column * pixel - 37.5 == pytest.approx(4.0, abs=3 * pixel)
    assert not image[128:].any()


@pytest.mark.parametrize(("view", "x", "y"), [(0, 1, 0), (90, 0, 1), (180, -1, 0), (270, 0, -1)])
@pytest.mark.parametrize("preset", ["as_released", QUIET, f"{QUIET}-mount"])
def test_every_view_looks_its_way(preset: str, view: int, x: int, y: int) -> None:
    point = np.array([[20.0 * x, 20.0 * y, 1.0, 0.9, 1, VEHICLE]])
    model = ShenronRadarModel("ti_cascade", preset)
    levels = {v: np.abs(range_angle(model(point, view=v))).max() for v in (0, 90, 180, 270)}
    assert max(levels, key=lambda v: levels[v]) == view
    polar = range_angle(model(point, view=view))
    assert abs(int(np.unravel_index(polar.argmax(), polar.shape)[1]) - 128) <= 1


def test_corrected_targets_move() -> None:
    model = ShenronRadarModel("radarbook", QUIET)
    speed = 1.5
    adc = model(_target(speed=speed))
    doppler = np.fft.fftshift(np.abs(np.fft.fft(np.fft.fft(adc[:, 0], axis=1)[:, :100], axis=0)).max(axis=1))
    resolution = model.profile.velocity_resolution_mps
    assert (doppler.argmax() - 64) * resolution == pytest.approx(speed, abs=resolution)


def test_noise_is_new_on_every_chirp_and_has_its_level() -> None:
    nothing = _target()[:0]
    thermal = ShenronRadarModel("ti_cascade", "corrected")
    for model, power in (
        (thermal, thermal.profile.noise_power_w),
        (ShenronRadarModel("ti_cascade", "as_released+noise_per_chirp"), NOISE_COUNTS**2),
    ):
        adc = model(nothing)
        samples = adc[0].size
        assert np.mean(np.abs(adc) ** 2) == pytest.approx(power, rel=5 / np.sqrt(adc.size))  # 5 sigma
        correlation = abs(np.vdot(adc[0], adc[1])) / (np.linalg.norm(adc[0]) * np.linalg.norm(adc[1]))
        assert correlation < 5 / np.sqrt(samples)
        np.testing.assert_array_equal(adc, model(nothing))
        assert not np.allclose(adc, model(nothing, frame=1))
    assert not ShenronRadarModel("ti_cascade")(nothing).any()


def test_brightness_follows_the_grid_that_is_stated_not_the_number_of_points() -> None:
    powers = []
    for step in (0.4, 0.2):
        az, el = np.meshgrid(np.arange(-10, 10, step) + step / 2, np.arange(-8, 4, step) + step / 2)
        r = 20.0 / (np.cos(np.radians(az)) * np.cos(np.radians(el)))
        direction = np.stack([np.cos(np.radians(el)) * np.cos(np.radians(az)),
                              np.cos(np.radians(el)) * np.sin(np.radians(az)), np.sin(np.radians(el))])  # fmt: skip
        xyz = (r * direction).reshape(3, -1).T + np.array([0.0, 0.0, 2.5])
        wall = np.column_stack([xyz, direction[0].ravel(), np.full(len(xyz), 3), np.full(len(xyz), 11), 0 * xyz[:, 0]])
        model = ShenronRadarModel("ti_cascade", "corrected", grid=LidarGrid(2, step, 0.0, step))
        echoes = illuminate(model.scatterers(wall), model.profile, model=model.model)
        powers.append(float(np.sum(np.abs(echoes.amplitude) ** 2)))
    assert 10 * np.log10(powers[1] / powers[0]) == pytest.approx(0.0, abs=0.1)  # the contract has 0.5 dB


def test_the_own_car_and_what_is_behind_are_dropped() -> None:
    rows = np.repeat(_target()[:1], 4, axis=0)
    rows[:, 0] = [22.0, -10.0, 2.3, 30.0]
    rows[:, 1] = [0.0, 0.0, 0.5, 3.0]
    placed = place_points(rows, Pose((1.0, 0.0, 1.0)))
    np.testing.assert_allclose(placed.position, [[21.0, 0.0, -0.2], [29.0, -3.0, -0.2]], atol=1e-12)


def test_what_it_cannot_read_is_refused() -> None:
    with pytest.raises(InputError, match="unknown tag table"):
        ShenronRadarModel("ti_cascade", tags="0.9")
    with pytest.raises(InputError, match="no mount for view 45"):
        ShenronRadarModel("ti_cascade", "corrected")(_target(), view=45)
    with pytest.raises(InputError, match="one horizontal line"):
        ShenronRadarModel("mmwcas", "corrected")
    bits = _target()
    bits[:, 4] = 1.2e-42
    with pytest.raises(InputError, match="object id"):
        ShenronRadarModel("ti_cascade", "corrected")(bits)
    model = ShenronRadarModel("ti_cascade", replace(ShenronModel.as_released(), tag_table_fixed=True), tags="0.9.14")
    assert model(_target()).shape == (3, 86, 256)
