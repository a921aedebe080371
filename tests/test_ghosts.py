"""Ghosts: detections that show an object where it is not, and the chains of objects behind them."""

from __future__ import annotations

import functools
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import shenron_rt as srt
from shenron_rt import runs
from shenron_rt.chains import Chains
from shenron_rt.config.scene import Scene
from shenron_rt.dsp import Detections
from shenron_rt.errors import InputError
from shenron_rt.paths import Paths
from shenron_rt.plot.truth import truth_of

#: Where the reflecting side of the rail stands [m].
RAIL_Y = 4.0
RAIL: dict[str, Any] = {
    "id": 40, "name": "rail", "shape": "box:60x0.1x3", "xyz_m": [30, RAIL_Y + 0.05, 0.6], "tag": "GuardRail",
    "material": "metal",
}  # fmt: skip
ROAD: dict[str, Any] = {"name": "road", "shape": "ground:120x40", "xyz_m": [60, 0, 0], "material": "asphalt"}


def scene_of(static: list[dict[str, Any]], *actors: dict[str, Any]) -> Scene:
    radar = {"name": "r", "profile": "awrl1432", "xyz_m": [0, 0, 0.6]}
    return Scene.model_validate({"static": static, "actors": list(actors), "radars": [radar]})


def car(y: float, yaw: float) -> dict[str, Any]:
    return {"id": 101, "name": "car", "shape": "car", "xyz_m": [18, y, 0], "ypr_deg": [yaw, 0, 0], "tag": "Car",
            "aim": 30_000}  # fmt: skip


def ball(x: float, y: float) -> dict[str, Any]:
    return {"id": 7, "name": "ball", "shape": "sphere:r=0.3,edge=0.02", "xyz_m": [x, y, 0.6], "tag": "Other",
            "material": "metal", "aim": 20_000}  # fmt: skip


def frame_of(scene: Scene, profile: str = "awrl1432", max_bounces: int = 3) -> srt.Frame:
    used = srt.load_profile(profile, {"waveform.chirps": 8})
    return srt.simulate(scene, used, max_bounces=max_bounces, rays=20_000, noise=None)


@functools.cache
def ball_before_the_rail(profile: str = "awrl1432") -> srt.Frame:
    return frame_of(scene_of([RAIL], ball(14, 0)), profile)


def cells_apart(a: Any, b: Any, profile: srt.RadarProfile) -> tuple[float, float]:
    """Distance of two rows of detections in resolution cells of range and of the sine of azimuth."""
    aperture = np.ptp(profile.positions_m[:, 1]) / profile.wavelength_m
    sines = np.sin(a["azimuth"]) - np.sin(b["azimuth"])
    return (a["range"] - b["range"]) / profile.range_resolution_m, float(sines) * (2 * aperture + 1) / 2


def select(returns: srt.Returns, rows: np.ndarray) -> srt.Returns:
    """The same echoes, silent but for some."""
    return replace(returns, amplitude=np.where(rows, returns.amplitude, 0.0))


# ---- where ghosts are
@pytest.mark.parametrize("profile", ["awrl1432", "mmwcas"])
def test_the_ghost_of_a_ball_behind_a_rail_is_at_its_mirror_image(profile: str) -> None:
    frame = ball_before_the_rail(profile)
    found = frame.detections
    picked = found.table[found.chain == "40>7>40"]
    assert len(picked) == 1
    assert found.ghost[found.chain == "40>7>40"].all()
    assert (picked["object_id"] == 7).all()
    image = np.zeros(1, dtype=picked.dtype)
    # a ball shows the point of it that is nearest
    image["range"], image["azimuth"] = np.hypot(14, 2 * RAIL_Y) - 0.3, np.arctan2(2 * RAIL_Y, 14)
    assert np.max(np.abs(cells_apart(picked[0], image[0], frame.profile))) < 0.25


@pytest.mark.parametrize("profile", ["awrl1432", "mmwcas"])
def test_over_the_rail_one_way_a_ball_appears_at_half_the_way(profile: str) -> None:
    frame = ball_before_the_rail(profile)
    found = frame.detections
    there = np.hypot(14, 2 * RAIL_Y)
    for chain, sine in (("40>7", 0.0), ("7>40", 2 * RAIL_Y / there)):
        (row,) = np.flatnonzero(found.chain == chain)
        assert found.ghost[row]
        half = (there + 14) / 2 - 0.3
        # the bright spot of the ball faces between the two ways, 0.3 (1 - cos 15 deg) = 0.01 m off
        assert found.range[row] == pytest.approx(half, abs=0.25 * frame.profile.range_resolution_m)
        if frame.profile.n_tx == 1:
            assert np.sin(found.azimuth[row]) == pytest.approx(sine, abs=0.1 / 3)


def test_the_ghost_of_a_car_is_where_the_car_would_be_in_the_mirror() -> None:
    ghost = frame_of(scene_of([RAIL], car(0, 12))).detections
    other = frame_of(scene_of([], car(2 * RAIL_Y, -12)), max_bounces=1)
    shown = ghost.table[ghost.chain == "40>101>40"][0]
    assert ghost.ghost[ghost.chain == "40>101>40"].all()
    assert np.max(np.abs(cells_apart(shown, other.detections.table[0], other.profile))) < 1.0


def test_a_metal_mirror_keeps_the_level() -> None:
    behind = ball_before_the_rail().returns.power_by_chain()["40>7>40"]
    there = frame_of(scene_of([], ball(14, 2 * RAIL_Y)), max_bounces=1).returns.power_by_chain()["7"]
    # facets of 0.02 m make the ball's own level fluctuate by 0.4 dB from lattice to lattice of rays
    assert 10 * np.log10(behind / there) == pytest.approx(0.0, abs=1.0)


# ---- what is none
def test_a_road_bounce_is_no_ghost_where_the_radar_has_no_elevation() -> None:
    frame = frame_of(scene_of([ROAD], car(0, 0)))
    echoes = frame.returns
    bounced = np.isin(echoes.chain, ["0>101", "101>0", "0>101>0"])
    assert np.count_nonzero(bounced) > 1000
    assert not echoes.ghost[bounced].any()
    assert not frame.detections.ghost.any()


def test_a_road_bounce_is_a_ghost_below_the_road_to_a_radar_that_sees_it_there() -> None:
    high = ball(14, 0) | {"xyz_m": [14, 0, 2.6]}
    upright = srt.load_profile("awrl1432").model_dump() | {
        "array": {"tx": [[0, 0, 0]], "rx": [[0, 0, i] for i in range(24)]}
    }
    scene = scene_of([ROAD], high)
    echoes = srt.simulate(scene, srt.RadarProfile(**upright), max_bounces=3, rays=5000, noise=None).returns
    # the wave of "0>7" comes from the ball itself, that of the others from its image: elevation -13 against 8 degrees,
    # the beam is 2/24
    assert not echoes.ghost[echoes.chain == "0>7"].any()
    for chain in ("7>0", "0>7>0"):
        assert echoes.ghost[echoes.chain == chain].mean() > 0.99


@pytest.mark.parametrize("road", [False, True])
def test_three_bounces_in_a_corner_are_no_ghost(road: bool) -> None:
    corner = {
        "id": 5, "name": "corner", "shape": "trihedral:triangular,a=0.3", "xyz_m": [20, 1, 0.6],
        "ypr_deg": [180, 0, 0], "tag": "Other", "aim": 10_000,
    }  # fmt: skip
    frame = frame_of(scene_of([ROAD] if road else [], corner))
    found = frame.detections
    assert found.object_id[0] == 5
    assert found.chain[0] == "5>5>5"
    assert not found.ghost[found.object_id == 5].any()


def test_first_surfaces_alone_have_no_chains_but_their_objects() -> None:
    frame = frame_of(scene_of([RAIL], ball(14, 0)), max_bounces=1)
    assert frame.returns.chains is None
    found = frame.detections
    assert not found.ghost.any()
    assert not frame.returns.ghost.any()
    assert found.chain.tolist() == [str(i) if i >= 0 else "" for i in found.object_id]
    assert set(frame.returns.power_by_chain()) == {str(i) for i in frame.returns.power_by_object()}


# ---- sums
def test_contributions_of_the_chains_add_up_to_the_cube() -> None:
    profile = srt.load_profile("awrl1432boost")
    profile = profile.model_copy(update={"waveform": profile.waveform.model_copy(update={"chirps": 4, "samples": 32})})
    scene = scene_of([RAIL, ROAD], ball(14, 0) | {"aim": 1000})
    echoes = srt.illuminate(srt.trace(scene, profile, max_bounces=3, rays=500), profile)
    total = srt.synthesize(echoes, profile, noise=None, method="direct").data
    parts = [
        srt.synthesize(select(echoes, echoes.chain == name), profile, noise=None, method="direct").data
        for name in np.unique(echoes.chain)
    ]
    assert len(parts) > 8
    # rounding of sums in another order
    np.testing.assert_allclose(np.sum(parts, axis=0), total, rtol=0, atol=1e-12 * np.abs(total).max())


def test_the_power_of_a_chain_is_that_of_its_echoes_alone() -> None:
    echoes = ball_before_the_rail().returns
    by_chain = echoes.power_by_chain()
    for name in ("7", "40>7", "40>7>40"):
        alone = select(echoes, echoes.chain == name).power_by_object()[7]
        assert by_chain[name] == pytest.approx(alone, rel=1e-12)


def test_the_direction_shown_is_the_nearest_plane_wave_over_all_element_pairs() -> None:
    from shenron_rt.echo.ghosts import apparent_cosines

    profile = srt.load_profile("mmwcas")
    arrival, departure = np.array([[0.8, 0.6, 0.0]]), np.array([[0.96, 0.0, 0.28]])
    for axis in (1, 2):
        along = np.repeat(profile.tx_m[:, axis], profile.n_rx) * departure[0, axis]
        along += np.tile(profile.rx_m[:, axis], profile.n_tx) * arrival[0, axis]
        position = profile.positions_m[:, axis] - profile.positions_m[:, axis].mean()
        slope = position @ (along - along.mean()) / (position @ position)
        found = apparent_cosines(arrival, departure, profile)[0, axis - 1]
        assert found == pytest.approx(slope, abs=1e-12)


# ---- names and files
def two_paths() -> Paths:
    empty = {name: getattr(Paths.none(), name) for name in Paths.__dataclass_fields__}
    shapes = {name: np.zeros((2, *value.shape[1:]), dtype=value.dtype) for name, value in empty.items()}
    shapes["object_id"] = np.array([[40, 101], [0, 101]], dtype=np.uint32)
    shapes["count"] = np.array([2, 2], dtype=np.uint8)
    return Paths(**shapes)


def test_the_reverse_of_a_path_has_the_reverse_chain() -> None:
    paths = two_paths().select(np.array([0, 1, 0]))
    chains = Chains.of(np.array([7, 0]), paths, np.array([False, False, True]), np.array([True, False, False]))
    assert chains.names[chains.row].tolist() == ["7", "0", "40>101", "0>101", "101>40"]
    assert chains.ghost.tolist() == [False, False, True, False, False]
    assert "5 echoes over 5 chains, 1 ghosts" in repr(chains)


def test_a_ghost_belongs_to_the_object_that_radiates() -> None:
    paths = replace(two_paths(), radiates=np.array([1, 0], dtype=np.uint8))
    object_id, _ = paths.owner
    assert object_id.tolist() == [101, 101]
    mirrored = replace(two_paths(), object_id=np.array([[101, 40], [40, 0]], dtype=np.uint32))
    assert mirrored.owner[0].tolist() == [101, 40]


def test_chains_are_saved_and_loaded(tmp_path: Path) -> None:
    frame = ball_before_the_rail()
    runs.write_frame(tmp_path, frame)
    again = srt.Returns.load(tmp_path / "returns.npz")
    np.testing.assert_array_equal(again.chain, frame.returns.chain)
    np.testing.assert_array_equal(again.ghost, frame.returns.ghost)
    for name in ("departure", "departure_velocity"):
        np.testing.assert_array_equal(getattr(again, name), getattr(frame.returns, name))
    found = Detections.from_csv(tmp_path / "detections.csv")
    assert found.table.tobytes() == frame.detections.table.tobytes()
    assert found.chain.tolist() == frame.detections.chain.tolist()
    assert found.ghost.tolist() == frame.detections.ghost.tolist()
    assert (tmp_path / "detections.chains.csv").read_text().splitlines()[0] == "chain,ghost"


def test_chains_of_another_table_are_refused(tmp_path: Path) -> None:
    found = ball_before_the_rail().detections
    path = found.save_chains(found.to_csv(tmp_path / "detections.csv"))
    path.write_text("chain,ghost\n7,0\n")
    with pytest.raises(InputError, match=r"detections\.chains\.csv: \d+ rows of a chain and 0 or 1"):
        Detections.from_csv(tmp_path / "detections.csv")
    with pytest.raises(InputError, match=r"Detections\.ghost: \d+ rows"):
        Detections(found.table, ghost=np.zeros(99, dtype=bool))


def test_a_summary_counts_ghosts_beside_what_is_detected(capsys: pytest.CaptureFixture[str]) -> None:
    from shenron_rt.cli.report import show_run

    frame = ball_before_the_rail()
    record = runs.frame_summary(frame, {7: "ball", 40: "rail"})
    ball_record = next(o for o in record["objects"] if o["id"] == 7)
    assert ball_record["detected"] is True
    assert ball_record["ghosts"] == 3
    assert record["strongest"]["chain"] == "40"
    assert record["strongest"]["ghost"] is False
    record["strongest"] |= {"chain": "40>7>40", "ghost": True, "object_id": 7}
    show_run({"radars": [{"name": "r", "frames": [record]}]})
    shown = capsys.readouterr()
    text = shown.out + shown.err
    assert "yes, 3 ghosts" in text
    assert "ghost, 40>7>40" in text


def test_an_object_is_not_drawn_between_itself_and_its_ghosts() -> None:
    frame = ball_before_the_rail()
    shown = next(t for t in truth_of(frame.returns) if t.object_id == 7)
    assert shown.y == pytest.approx(0.0, abs=0.3)
    assert shown.range_m == pytest.approx(13.7, abs=0.3)


def test_pictures_put_squares_round_ghosts() -> None:
    from shenron_rt.plot import birds_eye, range_doppler

    frame = ball_before_the_rail()
    ghosts = int(frame.detections.ghost.sum())
    for draw in (range_doppler, birds_eye):
        figure = draw(frame.cube, frame.detections)
        marks = {line.get_marker(): len(line.get_xdata()) for line in figure.axes[0].lines if line.get_marker() in "os"}
        assert marks == {"o": len(frame.detections) - ghosts, "s": ghosts}
    texts = [t.get_text() for t in range_doppler(frame.cube, frame.detections).texts]
    assert any("\u25a1 3 ghosts" in t for t in texts)
    assert not any("ghost" in t.get_text() for t in range_doppler(frame.cube).texts)
