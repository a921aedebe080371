"""Pictures: what they show, and in which direction."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from run_tools import NAMES, hand_made_frame

import shenron_rt as srt
from shenron_rt.config.profile import load_profile
from shenron_rt.dsp import noise_threshold
from shenron_rt.plot import antenna_cuts, birds_eye, range_doppler, range_profile, top_view, write_pictures
from shenron_rt.plot._style import SPAN_DB
from shenron_rt.plot.antenna import loss_table
from shenron_rt.plot.top_view import feature_edges
from shenron_rt.plot.truth import truth_of

BOX_VERTICES = np.array([[x, y, z] for x in (18.0, 22.0) for y in (3.0, 5.0) for z in (-1.0, 1.0)])
BOX_FACES = np.array([
    [0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1],
    [2, 3, 7], [2, 7, 6], [0, 2, 6], [0, 6, 4], [1, 5, 7], [1, 7, 3],
])  # fmt: skip


@pytest.fixture(scope="module")
def frame() -> Any:
    return hand_made_frame()


def _texts(figure: Any) -> str:
    from matplotlib.text import Text

    return "\n".join(t.get_text() for t in figure.findobj(Text))


def _rings(figure: Any) -> np.ndarray:
    """Return the data of the one line that rings the detections."""
    lines = [line for line in figure.axes[0].get_lines() if line.get_marker() == "o"]
    assert len(lines) == 1
    return np.column_stack([np.asarray(v, dtype=np.float64) for v in lines[0].get_data()])


def test_all_pictures_of_a_frame_are_png_files_of_their_names(frame: Any, tmp_path: Path) -> None:
    written = write_pictures(tmp_path, frame, names=NAMES, mesh=(BOX_VERTICES, BOX_FACES), title="hand-made")
    assert [p.name for p in written] == ["range_profile.png", "range_doppler.png", "range_azimuth.png", "top_view.png"]
    for path in written:
        assert path.read_bytes()[:8] == b"\x89PNG\r\n\x1a\n"
        assert path.stat().st_size > 5000


def test_range_profile_shows_the_threshold_the_detections_and_the_truth(frame: Any) -> None:
    threshold = noise_threshold(frame.cube, pfa=1e-3)
    figure = range_profile(frame.cube, frame.detections, threshold=threshold, truth=truth_of(frame.returns, NAMES))
    axes = figure.axes[0]
    assert axes.get_xlabel() == "range [m]"
    assert "dBm" in axes.get_ylabel()
    profile, limit = axes.get_lines()[:2]
    best = frame.cube.range_doppler.max(axis=1)
    np.testing.assert_allclose(profile.get_ydata(), 10 * np.log10(best) + 30, atol=1e-9)
    row = int(np.argmax(best))
    column = int(np.argmax(frame.cube.range_doppler[row]))
    assert limit.get_ydata()[row] == pytest.approx(10 * np.log10(threshold[row, column]) + 30)
    text = _texts(figure)
    assert "post" in text
    assert "car" in text
    assert "static" not in text


def test_names_of_objects_close_in_range_do_not_cover_each_other() -> None:
    scene = srt.load_scene("braking")
    frame = srt.simulate(scene, rays=2000)
    figure = range_profile(frame.cube, truth=truth_of(frame.returns, scene.object_names()))
    figure.canvas.draw()
    names = figure.axes[0].texts
    assert {t.get_text() for t in names} >= {"bollard", "left_wall", "right_wall"}  # 1.5 m from first to last
    boxes = [t.get_window_extent() for t in names]
    assert not any(a.overlaps(b) for k, a in enumerate(boxes) for b in boxes[:k])


def test_range_doppler_has_range_up_velocity_right_and_rings_on_the_detections(frame: Any) -> None:
    figure = range_doppler(frame.cube, frame.detections, truth=truth_of(frame.returns, NAMES))
    axes = figure.axes[0]
    left, right, bottom, top = axes.get_images()[0].get_extent()
    assert left < 0 < right
    assert bottom < top
    assert axes.get_ylim()[0] < axes.get_ylim()[1]
    assert "receding" in axes.get_xlabel()
    low, high = axes.get_images()[0].get_clim()
    assert 10 <= high - low <= SPAN_DB
    assert high == pytest.approx(10 * np.log10(frame.cube.range_doppler.max()) + 30, abs=1.0)
    assert f"{high - low:.0f} dB shown" in _texts(figure)
    np.testing.assert_allclose(_rings(figure), np.column_stack([frame.detections.velocity, frame.detections.range]))
    # the picture itself: the brightest pixel is the post, still and at 20.4 m
    pixels = np.asarray(axes.get_images()[0].get_array())
    row, column = np.unravel_index(np.argmax(pixels), pixels.shape)
    assert frame.cube.range_m[row] == pytest.approx(np.hypot(20, 4), abs=frame.cube.range_step_m)
    assert abs(frame.cube.velocity_mps[column]) <= frame.cube.velocity_step_mps


def test_birds_eye_has_forward_up_and_left_on_the_left(frame: Any) -> None:
    figure = birds_eye(frame.cube, frame.detections, truth=truth_of(frame.returns, NAMES))
    axes = figure.axes[0]
    assert axes.get_xlim()[0] > axes.get_xlim()[1], "y grows to the left"
    assert axes.get_ylim()[0] < axes.get_ylim()[1]
    image = axes.get_images()[0]
    left, right, bottom, top = image.get_extent()
    pixels = np.asarray(image.get_array(), dtype=np.float64)
    row, column = np.unravel_index(np.nanargmax(pixels), pixels.shape)
    y = left + (column + 0.5) / pixels.shape[1] * (right - left)
    x = bottom + (row + 0.5) / pixels.shape[0] * (top - bottom)
    # the post at (20, 4): one range bin, and one of the beams (a twelfth of the sine) at 20 m
    step = frame.cube.azimuth_sine[1] - frame.cube.azimuth_sine[0]
    assert np.hypot(x, y) == pytest.approx(np.hypot(20, 4), abs=frame.cube.range_step_m)
    assert y / np.hypot(x, y) == pytest.approx(4 / np.hypot(20, 4), abs=step)
    sine = np.sin(frame.detections.azimuth)
    wanted = frame.detections.range[:, None] * np.column_stack([sine, np.sqrt(1 - sine**2)])
    np.testing.assert_allclose(_rings(figure), wanted, atol=1e-9)


@pytest.mark.parametrize("name", ["awrl1432", "ti_cascade", "awrl1432boost"])
def test_birds_eye_shows_the_noise_floor_dark_but_not_black(name: str) -> None:
    frame = hand_made_frame(name)
    image = birds_eye(frame.cube).axes[0].get_images()[0]
    low, high = image.get_clim()
    floor = float(np.nanmedian(np.asarray(image.get_array(), dtype=np.float64)))
    # 86 channels beamform noise down by 19 dB: the floor follows, or stays outside the 50 dB shown
    assert high - low <= SPAN_DB
    assert high - floor > 10
    assert low == pytest.approx(high - SPAN_DB) or 1 <= floor - low <= 6


def test_top_view_paints_scatterers_over_grey_edges(frame: Any) -> None:
    figure = top_view(frame.scatterers, frame.returns, frame.detections, mesh=(BOX_VERTICES, BOX_FACES))
    axes = figure.axes[0]
    assert axes.get_xlim()[0] > axes.get_xlim()[1]
    image = axes.get_images()[0]
    pixels, (left, right, bottom, top) = np.asarray(image.get_array()), image.get_extent()
    assert bottom < 0 < top

    def at(x: float, y: float) -> np.ndarray:
        row = int((x - bottom) / (top - bottom) * pixels.shape[0])
        column = int((y - left) / (right - left) * pixels.shape[1])
        return pixels[row - 1 : row + 2, column - 1 : column + 2].reshape(-1, 3)

    coloured = np.ptp(at(20.0, 4.0), axis=1)
    assert coloured.max() > 0.2, "the post is there, in colour"
    grey = at(22.0, 4.0)
    assert np.any((np.ptp(grey, axis=1) < 0.01) & (grey[:, 0] > 0.3)), "the far edge of the box is there, in grey"
    assert np.all(at(21.0, 3.5) < 0.1), "nothing inside the box"
    mirrored = at(20.0, -4.0)
    assert np.all(np.ptp(mirrored, axis=1) < 0.01), "nothing on the other side"


def test_top_view_of_no_scatterers_is_an_empty_map() -> None:
    empty = hand_made_frame().scatterers.select(np.zeros(4, dtype=bool))
    assert "0 scatterers" in _texts(top_view(empty))


def test_feature_edges_are_the_creases_and_borders() -> None:
    edges = feature_edges(BOX_VERTICES, BOX_FACES)
    lengths = np.linalg.norm(BOX_VERTICES[edges[:, 0]] - BOX_VERTICES[edges[:, 1]], axis=1)
    assert len(edges) == 12, "the diagonals of the six faces are flat"
    assert sorted(lengths) == pytest.approx([2.0] * 8 + [4.0] * 4)
    assert len(feature_edges(BOX_VERTICES, BOX_FACES[:2])) == 4, "a border counts"
    # three vertices of its own for every face, as game-engine exporters write them
    assert len(feature_edges(BOX_VERTICES[BOX_FACES].reshape(-1, 3), np.arange(36).reshape(-1, 3))) == 12


def test_antenna_cuts_state_the_loss_far_off_boresight() -> None:
    profile = load_profile("awrl1432")
    losses = loss_table(profile)
    # gaussian of full half-power width w: 3.01 (2 a / w)^2 dB
    for angle in (60, 80, 90):
        assert losses["azimuth"][angle] == pytest.approx(10 * np.log10(2) * (2 * angle / 120) ** 2, rel=1e-9)
        assert losses["elevation"][angle] == pytest.approx(10 * np.log10(2) * (2 * angle / 40) ** 2, rel=1e-9)
    figure = antenna_cuts(profile)
    text = _texts(figure)
    assert "3.0 / 5.4 / 6.8 dB" in text
    assert "27.1 / 48.2 / 61.0 dB" in text
    marks = [
        np.asarray(line.get_data(), dtype=float).ravel()
        for line in figure.axes[0].get_lines()
        if line.get_marker() == "o"
    ]
    assert sorted(m[0] for m in marks) == pytest.approx([-60, -20, 20, 60])
    assert [m[1] for m in marks] == pytest.approx([-3.01] * 4)


def test_pictures_of_a_real_adc_and_of_an_empty_frame(tmp_path: Path) -> None:
    write_pictures(tmp_path, hand_made_frame("awrl1432boost"))
    nothing = hand_made_frame()
    nothing.returns = nothing.scatterers = None
    nothing.detections = type(nothing.detections)(nothing.detections.table[:0])
    assert len(write_pictures(tmp_path, nothing)) == 3


def test_truth_is_the_power_weighted_mean_and_folds_as_the_radar_does(frame: Any) -> None:
    post, car = truth_of(frame.returns, NAMES)
    assert (post.name, car.name) == ("post", "car")
    assert post.range_m == pytest.approx(np.hypot(20, 4))
    assert car.velocity_mps == pytest.approx(-5 * 30 / np.hypot(30, 3))
    assert car.azimuth_rad == pytest.approx(np.arctan2(-3, 30))
    assert car.folded(3.0) == pytest.approx(car.velocity_mps + 6.0)
    assert truth_of(None) == []


def test_importing_the_plots_loads_no_matplotlib() -> None:
    code = "import sys, shenron_rt.plot; sys.exit('matplotlib' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
