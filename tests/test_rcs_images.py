"""Range profiles and images of point scatterers in closed form, and the pictures of a sweep."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import shenron_rt as srt
from shenron_rt.constants import SPEED_OF_LIGHT
from shenron_rt.errors import InputError
from shenron_rt.plot._style import save
from shenron_rt.plot.rcs import cut_of, rcs_cut, rcs_map, rcs_polar
from shenron_rt.plot.rcs_convergence import convergence_picture
from shenron_rt.plot.rcs_images import isar_picture, range_aspect, range_profile_of_target
from shenron_rt.turntable import angular_statistics, isar_image, range_profile, reference_of
from shenron_rt.turntable.convergence import Convergence, compare_densities

#: c/(2 step) is 2.5 m, and a profile of 25 frequencies has a point every 2.5 cm.
EXTENT_M, N_FREQ = 2.5, 25
FREQUENCY = 24e9 + SPEED_OF_LIGHT / (2 * EXTENT_M) * np.arange(N_FREQ)


def _points(
    positions: list[tuple[float, float]], sigmas: list[float], azimuth_deg: np.ndarray, elevation_deg: float = 0.0
) -> np.ndarray:
    """Return (n_freq, n_az) amplitudes of points in the x-y plane: sqrt(sigma) e^{2 j k u.p}."""
    az, k = np.radians(azimuth_deg), 2 * np.pi * FREQUENCY / SPEED_OF_LIGHT
    u = np.cos(np.radians(elevation_deg)) * np.stack([np.cos(az), np.sin(az)])
    ahead = np.asarray(positions) @ u
    return np.einsum("p,fpa->fa", np.sqrt(sigmas), np.exp(2j * k[:, None, None] * ahead))


# ---- range profile
def test_a_point_reads_its_sigma_at_its_range_on_the_side_of_the_radar() -> None:
    # 0.5 m towards the radar, and 0.75 m behind the origin: both on the grid of 2.5 cm
    found = range_profile(_points([(0.5, 0.0), (-0.75, 0.0)], [4.0, 0.25], np.array([0.0]))[:, 0], FREQUENCY)
    assert found.extent_m == pytest.approx(EXTENT_M)
    assert found.cell_m == pytest.approx(SPEED_OF_LIGHT / (2 * N_FREQ * np.diff(FREQUENCY)[0]))
    power = np.abs(found.amplitude) ** 2
    near, far = (int(np.abs(found.range_m - r).argmin()) for r in (-0.5, 0.75))
    assert found.range_m[near] == pytest.approx(-0.5, abs=1e-9)
    assert power.argmax() == near
    # 12.5 cells apart, the Hann window's side lobes are below -70 dB: 2 x 10^(-70/20) of the other's amplitude ratio 4
    assert power[near] == pytest.approx(4.0, rel=1e-3)
    assert power[far] == pytest.approx(0.25, rel=3e-3)


def test_without_a_taper_the_first_null_is_one_cell_off_and_half_power_less_than_half_a_cell() -> None:
    found = range_profile(_points([(0.0, 0.0)], [1.0], np.array([0.0]))[:, 0], FREQUENCY, window="rect")
    power = np.abs(found.amplitude) ** 2
    middle = int(power.argmax())
    assert found.range_m[middle] == 0.0
    assert power[middle] == pytest.approx(1.0, rel=1e-12)
    # 4 points a cell; the Dirichlet kernel vanishes at every whole cell
    assert power[middle + 4 :: 4].max() < 1e-20
    assert power[middle + 2] == pytest.approx((2 / np.pi) ** 2, rel=5e-3)  # sinc(1/2)^2, n sin(x/n) for x to 0.3 %


def test_a_point_beyond_the_unambiguous_extent_folds() -> None:
    found = range_profile(_points([(-EXTENT_M - 0.25, 0.0)], [1.0], np.array([0.0]))[:, 0], FREQUENCY)
    assert found.range_m[np.abs(found.amplitude).argmax()] == pytest.approx(0.25, abs=1e-9)


def test_profiles_need_equal_steps_and_enough_frequencies() -> None:
    with pytest.raises(InputError, match="equal steps"):
        range_profile(np.ones(3, dtype=complex), [1e9, 2e9, 4e9])
    with pytest.raises(InputError, match="3 values"):
        range_profile(np.ones(3, dtype=complex), [1e9, 2e9])
    with pytest.raises(InputError, match="too few"):
        range_profile(np.ones(2, dtype=complex), [1e9, 2e9])  # both samples of a Hann window of two are zero


def test_the_near_face_of_a_box_is_where_it_stands_and_reads_as_a_plate() -> None:
    sweep = srt.sweep_rcs("box:0.5x0.1x0.08", frequency_hz=FREQUENCY, azimuth_deg=0.0, max_bounces=1)
    found = range_profile(sweep.amplitude[:, 0, 0, 0], sweep.frequency_hz)
    level = 20 * np.log10(np.abs(found.amplitude))
    assert found.range_m[level.argmax()] == pytest.approx(-0.25, abs=1e-9)
    # a plate's amplitude grows with frequency, and a symmetric window averages that to the middle frequency's;
    # 0.05 dB is the bar of the solver at normal incidence
    wavelength = SPEED_OF_LIGHT / FREQUENCY.mean()
    assert level.max() == pytest.approx(10 * np.log10(4 * np.pi * (0.008 / wavelength) ** 2), abs=0.05)


# ---- image
def test_an_image_is_the_direct_sum_over_frequencies_and_angles(rng: np.random.Generator) -> None:
    azimuth = np.linspace(20, 50, 13)
    data = rng.normal(size=(N_FREQ, 13)) + 1j * rng.normal(size=(N_FREQ, 13))
    found = isar_image(data, FREQUENCY, azimuth, size_m=0.3, elevation_deg=25.0, window="rect")
    rows, columns = [3, 40, 101], [0, 57, 90]
    x, y = found.x_m[columns], found.y_m[rows]
    k = 2 * np.pi * FREQUENCY / SPEED_OF_LIGHT * np.cos(np.radians(25.0))
    az = np.radians(azimuth)
    ahead = x[None, :, None] * np.cos(az) + y[:, None, None] * np.sin(az)
    direct = np.einsum("fa,yxfa->yx", data, np.exp(-2j * k[:, None] * ahead[:, :, None, :])) / data.size
    # finufft to 1e-9 of the sum of the strengths' moduli, which is 1.25 of their count
    assert found.amplitude[np.ix_(rows, columns)] == pytest.approx(direct, abs=3e-9)


@pytest.mark.parametrize("elevation", [0.0, 30.0])
def test_points_stand_in_the_image_where_they_are_with_their_sigma(elevation: float) -> None:
    azimuth = np.arange(-10.0, 10.1, 0.25)
    # the side of the picture makes pixels of size/pixels: points on pixels are read exactly
    blank = isar_image(np.zeros((N_FREQ, len(azimuth))), FREQUENCY, azimuth, size_m=1.0, elevation_deg=elevation)
    i, j = len(blank.y_m) * 3 // 4, len(blank.x_m) // 4
    at = (float(blank.x_m[j]), float(blank.y_m[i]))  # a quarter of a metre behind and to the left of the origin
    assert at == pytest.approx((-0.25, 0.25), abs=0.01)
    data = _points([at, (0.3, -0.2)], [2.0, 0.5], azimuth, elevation)
    found = isar_image(data, FREQUENCY, azimuth, size_m=1.0, elevation_deg=elevation)
    power = np.abs(found.amplitude) ** 2
    assert np.unravel_index(power.argmax(), power.shape) == (i, j)
    # the other is 7 cells away in range and more across: its side lobes are below -60 dB of half the amplitude
    assert power[i, j] == pytest.approx(2.0, rel=2e-3)
    weak = np.ix_(np.abs(found.y_m + 0.2) < 0.05, np.abs(found.x_m - 0.3) < 0.05)
    # four pixels a cell: at worst an eighth of a cell off in both directions, 0.06 dB each with a Hann window
    assert 10 * np.log10(power[weak].max()) == pytest.approx(10 * np.log10(0.5), abs=0.15)


def test_cells_and_extents_of_an_image_are_those_of_bandwidth_and_angle() -> None:
    azimuth = np.arange(-2.0, 2.01, 0.25)
    found = isar_image(
        _points([(0.0, 0.0)], [1.0], azimuth), FREQUENCY, azimuth, window="rect", size_m=0.8
    )  # fmt: skip
    wavelength = SPEED_OF_LIGHT / FREQUENCY.mean()
    step = np.radians(0.25)
    assert found.cross_cell_m == pytest.approx(wavelength / (2 * len(azimuth) * step))
    assert found.cross_extent_m == pytest.approx(wavelength / (2 * step))
    assert found.down_cell_m == pytest.approx(EXTENT_M / N_FREQ)
    assert found.down_extent_m == pytest.approx(EXTENT_M)
    # the first null across: one cell off, but for the wavelength's 5 % change over the band
    column = np.abs(found.amplitude[:, len(found.x_m) // 2])
    null = column[np.abs(np.abs(found.y_m) - found.cross_cell_m).argmin()]
    assert null < 0.05
    row = np.abs(found.amplitude[len(found.y_m) // 2])
    assert row[np.abs(np.abs(found.x_m) - found.down_cell_m).argmin()] < 0.05


def test_an_image_refuses_full_circles_and_uneven_angles() -> None:
    with pytest.raises(InputError, match="full circle"):
        isar_image(np.ones((N_FREQ, 72), complex), FREQUENCY, np.arange(-180, 183, 5.1)[:72])
    with pytest.raises(InputError, match="azimuth_deg"):
        isar_image(np.ones((N_FREQ, 3), complex), FREQUENCY, [0.0, 1.0, 3.0])
    with pytest.raises(InputError, match="size_m"):
        isar_image(np.ones((N_FREQ, 3), complex), FREQUENCY, [0.0, 1.0, 2.0], size_m=0.0)


# ---- pictures
@pytest.fixture(scope="module")
def sweep() -> srt.RcsSweep:
    return srt.sweep_rcs(
        "plate:0.05x0.05", frequency_hz=24e9, azimuth_deg=np.arange(-90, 91, 2.0), elevation_deg=[-5.0, 0.0, 5.0],
        polarization=("VV", "HH"), max_bounces=1,
    )  # fmt: skip


def _texts(figure: Any) -> str:
    from matplotlib.text import Text

    return "\n".join(t.get_text() for t in figure.findobj(Text))


def _png(figure: Any, path: Path) -> None:
    assert save(figure, path).read_bytes()[:8] == b"\x89PNG\r\n\x1a\n"
    assert path.stat().st_size > 5000


def test_the_cut_shows_both_polarisations_the_band_and_the_closed_form(sweep: srt.RcsSweep, tmp_path: Path) -> None:
    cut = cut_of(sweep)
    assert (cut.axis, cut.index[1]) == ("azimuth", 1)  # the elevation nearest to 0
    found = angular_statistics(cut.x, sweep.rcs_m2[cut.index][:, 0], 10.0)
    figure = rcs_cut(sweep, statistics=found, reference=reference_of(sweep), title="plate")
    text = _texts(figure)
    for word in ("VV", "HH", "median, 10 deg window", "10 to 90 %", "closed form", "RCS [dBsm]", "24 GHz", "[deg]"):
        assert word in text
    low, high = figure.axes[0].get_ylim()
    peak = sweep.rcs_dbsm.max()
    assert peak < high < peak + 5
    assert high - low < 70
    _png(figure, tmp_path / "cut.png")


def test_the_polar_picture_has_the_nose_up_and_left_on_the_left(sweep: srt.RcsSweep, tmp_path: Path) -> None:
    figure = rcs_polar(sweep)
    axes: Any = figure.axes[0]
    figure.canvas.draw()
    peak = float(sweep.rcs_dbsm.max())
    up, left = (axes.transData.transform((a, peak)) for a in (0.0, np.pi / 2))
    middle = axes.transAxes.transform((0.5, 0.5))
    assert up[1] > middle[1]
    assert up[0] == pytest.approx(middle[0], abs=1e-6)
    assert left[0] < middle[0]
    assert "left" in _texts(figure)
    assert "dBsm" in _texts(figure)
    _png(figure, tmp_path / "polar.png")


def test_the_map_has_azimuth_across_and_elevation_up_and_rings_the_peak(sweep: srt.RcsSweep, tmp_path: Path) -> None:
    figure = rcs_map(sweep)
    axes = figure.axes[0]
    x, y = (float(v[0]) for v in axes.get_lines()[0].get_data())
    assert (x, y) == (0.0, 0.0)
    assert axes.get_xlim()[0] < axes.get_xlim()[1]
    assert "azimuth" in axes.get_xlabel()
    _png(figure, tmp_path / "map.png")


def test_cuts_follow_the_axis_that_is_swept() -> None:
    one = srt.sweep_rcs("plate:0.05x0.05", frequency_hz=[24e9, 25e9], azimuth_deg=0.0, max_bounces=1)
    assert cut_of(one).axis == "frequency"
    assert cut_of(one).x.tolist() == [24.0, 25.0]
    assert "frequency [GHz]" in _texts(rcs_cut(one))
    tilted = srt.sweep_rcs("plate:0.05x0.05", frequency_hz=24e9, azimuth_deg=0.0, elevation_deg=[0, 9], max_bounces=1)
    assert cut_of(tilted).axis == "elevation"
    assert "elevation" in rcs_cut(tilted).axes[0].get_xlabel()


def test_pictures_of_profiles_and_images_name_sides_cells_and_extents(tmp_path: Path) -> None:
    azimuth = np.arange(-10.0, 10.1, 1.0)
    data = _points([(0.5, 0.2)], [1.0], azimuth)
    whole, one = range_profile(data, FREQUENCY), range_profile(data[:, 10], FREQUENCY)
    line = range_profile_of_target(one, depth_m=(-0.6, 0.6), label="VV", title="point")
    assert "near side, towards the radar" in _texts(line)
    assert "unambiguous 2.5 m" in _texts(line)
    waterfall = range_aspect(whole, azimuth, depth_m=(-0.6, 0.6), title="point")
    image = isar_picture(
        isar_image(data, FREQUENCY, azimuth), outline=np.array([[0, 0], [0.5, 0], [0.5, 0.2], [0, 0]]), title="point"
    )
    assert "x of the target [m], + nose" in _texts(image)
    assert "cross range" in _texts(image)
    for name, figure in (("line", line), ("waterfall", waterfall), ("image", image)):
        _png(figure, tmp_path / f"{name}.png")


def test_the_convergence_picture_shows_both_densities_and_their_difference(tmp_path: Path) -> None:
    two = [
        srt.sweep_rcs("plate:0.05x0.05", frequency_hz=24e9, azimuth_deg=np.arange(-20, 21.0), rays_per_wavelength=d)
        for d in (1.0, 2.0)
    ]
    figure = convergence_picture(Convergence(tuple(two), (compare_densities(*two),)))
    assert "coarse - fine [dB]" in _texts(figure)
    assert "rays per wavelength: 2" in _texts(figure)
    _png(figure, tmp_path / "convergence.png")
