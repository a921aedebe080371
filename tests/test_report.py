"""The page of a run: one file, nothing from outside, and the numbers of the run in it."""

from __future__ import annotations

import json
import re
import shutil
from pathlib import Path

import numpy as np
import pytest
from report_tools import FRAMES, NASTY, Page, street_run

import shenron_rt as srt
from shenron_rt.plot._style import dbm
from shenron_rt.plot.truth import truth_of
from shenron_rt.report.arrays import Arrays, script_json
from shenron_rt.report.geometry import SceneMeshes, _largest
from shenron_rt.report.maps import MapPools, pooled
from shenron_rt.report.palette import diverging, sequential
from shenron_rt.scene.bodies import load_bodies
from shenron_rt.scene.mesh import Part, build_mesh
from shenron_rt.scene.world import build_world

#: Digits of float32: half an ulp is 6e-8 of a value.
FLOAT32 = 1.2e-7


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return street_run(tmp_path_factory.mktemp("street"))


@pytest.fixture(scope="module")
def page(run: Path) -> Page:
    return Page(srt.write_report(run))


# ---- one file
def test_the_page_stands_beside_the_run_and_refers_to_nothing_outside(run: Path, page: Page) -> None:
    assert run.with_name("run.html").is_file()
    targets = [
        v for _, attributes in page.tags for k, v in attributes.items() if k in ("src", "href", "data", "action")
    ]
    assert targets == ["#play"]
    assert re.findall(r"@import|url\(|fetch\(|XMLHttpRequest|WebSocket|import\(", page.text) == []
    (policy,) = (a["content"] for t, a in page.tags if t == "meta" and "http-equiv" in a)
    assert "default-src 'none'" in str(policy)


def test_names_stay_text(page: Page) -> None:
    names = {o["id"]: o["name"] for o in page.about["radars"][0]["objects"]}
    assert names[101] == NASTY
    assert NASTY not in page.text
    # one script of the page's own; all other script elements are data
    assert [a for t, a in page.tags if t == "script" and "type" not in a] == [{}]
    assert script_json({"a": "</script>\u2028"}) == '{"a":"\\u003c/script\\u003e\\u2028"}'
    assert script_json([float("nan"), np.float64(1.5)]) == "[null,1.5]"


def test_titles_are_escaped(run: Path, tmp_path: Path) -> None:
    copy = tmp_path / "run"
    shutil.copytree(run, copy)
    config = (copy / "config.yaml").read_text(encoding="utf-8")
    (copy / "config.yaml").write_text(config.replace("name: street", "name: '<b>&street</b>'", 1), encoding="utf-8")
    made = Page(srt.write_report(copy))
    assert "<title>&lt;b&gt;&amp;street&lt;/b&gt; – shenron_rt report</title>" in made.text
    assert made.about["title"] == "<b>&street</b>"


# ---- the numbers of the run
@pytest.mark.parametrize("prefix", ["r0", "r1"])
def test_detections_are_those_of_the_run(run: Path, page: Page, prefix: str) -> None:
    radar = next(r for r in page.about["radars"] if r["prefix"] == prefix)
    assert [f["frame"] for f in radar["frames"]] == list(range(FRAMES))
    total = 0
    for k in range(FRAMES):
        table = srt.Detections.from_csv(run / f"radars/{radar['name']}/frame_{k:06d}/detections.csv").table
        total += len(table)
        for name, column in page.detections(prefix, k).items():
            np.testing.assert_allclose(column, table[name].astype(np.float64), rtol=FLOAT32, err_msg=name)
    assert total > 0


def test_chains_and_ghosts_are_those_of_the_run(run: Path, page: Page, tmp_path: Path) -> None:
    chains, ghosts = page.chains("r0", 1)
    found = srt.Detections.from_csv(run / "radars/front/frame_000001/detections.csv")
    assert chains == found.chain.tolist()
    assert not any(ghosts)
    copy = tmp_path / "run"
    shutil.copytree(run, copy)
    rows = ["40>101,1", *(["101,0"] * (len(found) - 1))]
    text = "\n".join(["chain,ghost", *rows])
    (copy / "radars/front/frame_000001/detections.chains.csv").write_text(text + "\n", encoding="utf-8")
    made = Page(srt.write_report(copy))
    chains, ghosts = made.chains("r0", 1)
    assert chains == ["40>101", *(["101"] * (len(found) - 1))]
    assert ghosts == [True, *([False] * (len(found) - 1))]
    assert not any(made.chains("r0", 0)[1])


@pytest.mark.parametrize(("short", "name"), [("rd", "range_doppler"), ("ra", "range_azimuth")])
def test_maps_are_those_of_the_run_within_half_a_step(run: Path, page: Page, short: str, name: str) -> None:
    radar = page.about["radars"][0]
    coding = radar["maps"][short]
    assert coding["pool"] == [1, 1]
    assert coding["step_db"] <= 120 / 255
    for k in range(FRAMES):
        cube = srt.RadarCube.load(run / f"radars/front/frame_{k:06d}/cube.npz")
        codes = page.arrays[f"r0.{short}.{k}"]
        level = dbm(getattr(cube, name))
        shown = coding["low_dbm"] + codes.astype(np.float64) * coding["step_db"]
        inside = level >= coding["low_dbm"]
        assert inside.mean() > 0.9
        # half a step, and float32 of levels near -130 dBm: 1e-5 dB
        assert np.abs(shown - level)[inside].max() <= coding["step_db"] / 2 + 1e-5
        assert np.all(codes[~inside] == 0)
    np.testing.assert_allclose(radar["maps"]["velocity_mps"], cube.velocity_mps)
    np.testing.assert_allclose(np.arange(radar["maps"]["n_range"]) * radar["maps"]["range_step_m"], cube.range_m)
    np.testing.assert_allclose(radar["maps"]["azimuth_sine"], cube.azimuth_sine, atol=1e-12)
    assert coding["noise_dbm"] == pytest.approx(float(dbm(cube.noise_power_w)), abs=12)


def test_noise_of_the_range_doppler_map_is_the_cubes(run: Path, page: Page) -> None:
    cube = srt.RadarCube.load(run / "radars/front/frame_000000/cube.npz")
    assert page.about["radars"][0]["maps"]["rd"]["noise_dbm"] == pytest.approx(float(dbm(cube.noise_power_w)), abs=1e-9)


def test_truth_is_that_of_the_echoes_and_of_the_summary(run: Path, page: Page) -> None:
    radar = page.about["radars"][0]
    columns = {n: i for i, n in enumerate(page.about["columns"]["truth"])}
    table = page.arrays["r0.truth"]
    rows = {o["id"]: i for i, o in enumerate(radar["objects"])}
    summary = json.loads((run / "summary.json").read_text(encoding="utf-8"))
    for k in range(FRAMES):
        returns = srt.Returns.load(run / f"radars/front/frame_{k:06d}/returns.npz")
        found = truth_of(returns)
        assert {t.object_id for t in found} >= {40, 101, 900}
        for t in found:
            values = table[rows[t.object_id], :, k]
            assert values[columns["range_m"]] == pytest.approx(t.range_m, rel=FLOAT32)
            assert values[columns["azimuth_deg"]] == pytest.approx(np.degrees(t.azimuth_rad), rel=FLOAT32)
            assert values[columns["velocity_mps"]] == pytest.approx(t.velocity_mps, rel=FLOAT32)
            assert values[columns["echoes"]] == 1
        for record in summary["radars"][0]["frames"][k]["objects"]:
            values = table[rows[record["id"]], :, k]
            assert values[columns["detected"]] == record["detected"]
            if record["snr_db"] is not None:
                assert values[columns["snr_db"]] == pytest.approx(record["snr_db"], rel=1e-6)
                assert values[columns["power_dbm"]] == pytest.approx(record["power_dbw"] + 30, rel=1e-6)


def test_an_object_without_an_echo_stands_where_its_body_is(run: Path, page: Page) -> None:
    rows = {o["id"]: i for i, o in enumerate(page.about["radars"][0]["objects"])}
    columns = {n: i for i, n in enumerate(page.about["columns"]["truth"])}
    values = page.arrays["r0.truth"][rows[102]]
    assert np.all(values[columns["echoes"]] == 0)
    # 102 stands at (-20, -10, 1.5), inside another; the radar drives from (10, 5) + R30 (2, 0), 1 m up
    scene = srt.load_scene(run / "config.yaml")
    mid = scene.profile_of(scene.radars[0]).frame_mid_s
    heading = np.array([np.cos(np.pi / 6), np.sin(np.pi / 6)])
    for k in range(FRAMES):
        radar = np.array([10.0, 5.0]) + 2 * heading + np.array([8.66, 5.0]) * (0.1 * k + mid)
        x, y = np.array([[1.0, 1.0], [-1.0, 1.0]]) * heading[[[0, 1], [1, 0]]] @ (np.array([-20.0, -10.0]) - radar)
        assert values[columns["x_m"], k] == pytest.approx(x, rel=1e-5)
        assert values[columns["y_m"], k] == pytest.approx(y, rel=1e-5)
        assert values[columns["range_m"], k] == pytest.approx(np.hypot(np.hypot(x, y), 0.5), rel=1e-5)


def test_meshes_stand_where_the_world_has_them(run: Path, page: Page) -> None:
    scene = srt.load_scene(run / "config.yaml")
    bodies, materials = load_bodies(scene)
    for prefix, mount in zip(("r0", "r1"), scene.radars, strict=True):
        radar = next(r for r in page.about["radars"] if r["prefix"] == prefix)
        assert [b["id"] for b in radar["bodies"]] == [b.object_id for b in bodies]
        assert [b["moves"] for b in radar["bodies"]] == [b.object_id in (101, 104) for b in bodies]
        assert len(bodies[-1].links) > 1  # wheels turn
        for k, frame in enumerate(radar["frames"]):
            world = build_world(scene, mount, frame["mid_s"], bodies, materials)
            eye = page.arrays[f"{prefix}.radar"][k].astype(np.float64)
            for b, body in enumerate(radar["bodies"]):
                mesh = f"m{body['mesh']}"
                corners = page.arrays[f"{mesh}.vertices"].astype(np.float64)[page.arrays[f"{mesh}.faces"]]
                seen = np.zeros((len(corners), 3))
                for link, _, first, count in page.about["meshes"][body["mesh"]]["runs"]:
                    pose = page.arrays[f"{prefix}.poses"][body["pose"] + link, k].astype(np.float64)
                    rows = slice(first, first + count)
                    there = corners[rows].mean(axis=1) @ pose[:9].reshape(3, 3).T + pose[9:]
                    seen[rows] = (there - eye[9:12]) @ eye[:9].reshape(3, 3)
                mine = world.face_body == b
                order = np.lexsort((world.face_tag[mine], world.face_link[mine]))
                placed = world.vertices[world.faces[mine]].mean(axis=1)[order]
                # rotations are good to 6e-8 over 50 m, and origins to half an ulp of 50 m: 2 um each
                np.testing.assert_allclose(seen, placed, atol=2e-5)


def test_faces_of_every_mesh_are_all_there(page: Page) -> None:
    for k, mesh in enumerate(page.about["meshes"]):
        assert len(page.arrays[f"m{k}.faces"]) == mesh["faces"] == mesh["all_faces"] == sum(r[3] for r in mesh["runs"])
        assert len(page.arrays[f"m{k}.edges"]) == sum(r[2] for r in mesh["edge_runs"])
        assert page.arrays[f"m{k}.faces"].max() < len(page.arrays[f"m{k}.vertices"])
        assert page.arrays[f"m{k}.edges"].max() < len(page.arrays[f"m{k}.vertices"])


def test_echoes_are_returns_of_their_frame(run: Path, page: Page) -> None:
    known = page.about["radars"][0]["echoes"]
    for k in range(FRAMES):
        rows = slice(known["start"][k], known["start"][k + 1])
        shown = page.arrays["r0.echoes"][rows] * known["step_m"]
        code = page.arrays["r0.echo_level"][rows].astype(np.float64)
        returns = srt.Returns.load(run / f"radars/front/frame_{k:06d}/returns.npz")
        lit = np.flatnonzero(np.abs(returns.amplitude) > 0)[:: known["every"]]
        assert np.abs(shown - returns.position[lit]).max() <= known["step_m"] / 2 * (1 + 1e-9)
        level = dbm(np.abs(returns.amplitude[lit]) ** 2)
        near = level > known["top_dbm"] - known["span_db"]
        said = known["top_dbm"] + (code / 255 - 1) * known["span_db"]
        assert np.abs(said - level)[near].max() <= known["span_db"] / 255 / 2 + 1e-9


def test_settings_are_the_profiles_and_the_config_is_whole(run: Path, page: Page) -> None:
    profile = srt.load_scene(run / "config.yaml").profile_of(srt.load_scene(run / "config.yaml").radars[0])
    shown = {name: value for name, value, _ in page.about["radars"][0]["profile"]["derived"]}
    assert shown["range resolution c/2B"] == profile.range_resolution_m
    assert shown["unambiguous velocity ±"] == profile.max_velocity_mps
    assert len(shown) == len(profile.derived())
    given = {key: value for key, value, _ in page.about["radars"][0]["profile"]["given"]}
    assert given["waveform.samples"] == "64"
    assert page.about["config"] == (run / "config.yaml").read_text(encoding="utf-8")


# ---- parts
def test_pooled_cells_keep_their_strongest(rng: np.random.Generator) -> None:
    power = rng.exponential(size=(37, 22))
    small = pooled(power, (4, 8))
    assert small.shape == (10, 3)
    assert small[9, 2] == power[36:, 16:].max()
    assert small.max() == power.max()


def test_large_maps_are_pooled_until_they_fit(rng: np.random.Generator) -> None:
    maps = {"range_doppler": rng.exponential(size=(512, 128)), "range_azimuth": rng.exponential(size=(512, 16))}
    maps |= {"range_m": np.arange(512.0), "velocity_mps": np.arange(128.0), "azimuth_rad": np.linspace(-1, 1, 16)}
    pools = MapPools(4096)
    levels = pools.levels(maps)
    assert all(level.size <= 4096 for level in levels.values())
    assert pools.pools == {"rd": (8, 2), "ra": (2, 1)}
    assert levels["rd"].max() == pytest.approx(float(dbm(maps["range_doppler"].max())), rel=1e-6)


def test_the_smallest_faces_go_first_and_no_vertex_stays_without_one() -> None:
    plates = [
        {"shape": f"plate:{size}x{size}", "xyz_m": (20, 5 * k, 1), "tag": "Other", "material": "metal"}
        for k, size in enumerate((1.0, 2.0, 3.0))
    ]
    arrays = Arrays()
    n = srt.make_shape("plate:1x1").n_faces
    meshes = SceneMeshes.add_to(arrays, srt.Scene(static=plates), most_faces=2 * n)
    assert [m["all_faces"] for m in meshes.records] == [n, n, n]
    assert [m["faces"] for m in meshes.records] == [0, n, n]
    assert meshes.records[0]["runs"] == []
    assert 'id="m0.edges"' in arrays.html()


def test_of_equal_faces_as_many_as_fit_are_drawn_from_everywhere() -> None:
    side = 30
    y, x = np.meshgrid(np.arange(side + 1.0), np.arange(side + 1.0))
    corner = (np.arange(side)[:, None] * (side + 1) + np.arange(side)).ravel()
    faces = np.concatenate([corner[:, None] + [0, side + 1, side + 2], corner[:, None] + [0, side + 2, 1]])
    ground = build_mesh(np.column_stack([x.ravel(), y.ravel(), 0 * x.ravel()]), faces, Part(tag=srt.SemanticTag.Roads))
    arrays = Arrays()
    meshes = SceneMeshes.add_to(arrays, srt.Scene(static=[{"mesh": ground}]), most_faces=300)
    (record,) = meshes.records
    assert (record["faces"], record["all_faces"]) == (300, 2 * side**2)
    shown = np.sort(_largest([ground.face_area], 300)[0])
    # a sixth of 1800; every row of 60 triangles has 10, golden steps miss that by less than two
    assert np.abs(np.histogram(shown, bins=30, range=(0, 1800))[0] - 10).max() <= 2


def test_standing_is_white_and_power_gets_lighter() -> None:
    assert diverging()[127].tolist() == [255, 255, 255]
    assert diverging().shape == (255, 3)
    blue, red = diverging()[0].astype(int), diverging()[-1].astype(int)
    assert blue[2] > blue[0]
    assert red[0] > red[2]
    luma = sequential().astype(float) @ [0.2126, 0.7152, 0.0722]
    assert np.all(np.diff(luma) > -0.5)  # rounding to 8 bits
    assert luma[-1] - luma[0] > 150
