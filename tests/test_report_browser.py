"""The page of a run in a browser: it starts without a complaint, moves, and shows the numbers of the run."""

from __future__ import annotations

import re
import shutil
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from chromium_tools import Browser, find_chromium
from report_tools import FRAMES, NASTY, street_run

import shenron_rt as srt
from shenron_rt.cli import main
from shenron_rt.plot._style import dbm

PROGRAM = find_chromium()
pytestmark = pytest.mark.skipif(PROGRAM is None, reason="no Chromium on this machine: apt-get install chromium")


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = street_run(tmp_path_factory.mktemp("street"))
    srt.write_report(folder)
    return folder


@pytest.fixture(scope="module")
def browser(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Browser]:
    assert PROGRAM is not None
    with Browser(PROGRAM, tmp_path_factory.mktemp("profile")) as started:
        yield started


@pytest.fixture
def page(run: Path, browser: Browser) -> Iterator[Browser]:
    """The page, just opened at its first frame; at the end nothing has complained."""
    browser.open(run.with_name("run.html"), "#frame=0")
    yield browser
    assert browser.errors == []


def _frame(page: Browser) -> int:
    return int(page.evaluate("report.state.frame"))


def _cells(page: Browser, table: str) -> list[list[str]]:
    rows = f"[...document.querySelectorAll('#{table} tbody tr')].map((r) => [...r.cells].map((c) => c.textContent))"
    return [[str(c).replace("−", "-") for c in row] for row in page.evaluate(rows)]


def _ink(page: Browser, canvas: str) -> int:
    """Return how many different colours a canvas shows."""
    return int(
        page.evaluate(
            f"(() => {{ const c = document.getElementById('{canvas}');"
            "const d = new Uint32Array(c.getContext('2d').getImageData(0, 0, c.width, c.height).data.buffer);"
            "return new Set(d).size; })()"
        )
    )


def test_the_page_loads_nothing_but_itself_and_draws_every_panel(run: Path, page: Browser) -> None:
    assert page.requests() == [run.with_name("run.html").as_uri()]
    assert page.evaluate("document.title") == "street – shenron_rt report"
    for canvas in ("scene", "rd", "ra", "strips", "charts"):
        assert _ink(page, canvas) > 10, canvas


def test_left_is_left_and_forward_is_up(page: Browser) -> None:
    for call in ("sceneAt(20, {y}, 0)", "fanAt(15, {a})"):
        left, right = (page.evaluate(f"report.{call.format(y=y, a=y / 20)}") for y in (4, -4))
        assert left[0] < right[0]
        assert left[1] == pytest.approx(right[1], abs=1e-6)
    for call in ("sceneAt({x}, 0, 0)", "fanAt({x}, 0)", "rdAt(0, {x})"):
        near, far = (page.evaluate(f"report.{call.format(x=x)}") for x in (5, 15))
        assert far[1] < near[1]
    away, closing = (page.evaluate(f"report.rdAt({v}, 10)") for v in (3, -3))
    assert away[0] > closing[0]
    page.evaluate("report.set({view: 'orbit'})")
    page.settle()
    left, right, near, far, high = (
        page.evaluate(f"report.sceneAt({p})") for p in ("20, 4, 0", "20, -4, 0", "10, 0, 0", "30, 0, 0", "10, 0, 3")
    )
    assert left[0] < right[0]
    assert far[1] < near[1]
    assert high[1] < near[1]


@pytest.mark.parametrize("view", ["top", "orbit"])
def test_meshes_are_drawn_where_the_points_are(view: str, run: Path, page: Browser) -> None:
    page.evaluate(f"report.set({{view: '{view}', frame: 1}})")
    page.settle()
    opaque = (
        "(([x, y]) => {{ const c = document.getElementById('scene-mesh'), d = document.createElement('canvas');"
        "d.width = c.width; d.height = c.height; const p = d.getContext('2d'); p.drawImage(c, 0, 0);"
        "return p.getImageData(x * c.width / c.clientWidth, y * c.height / c.clientHeight, 1, 1).data[3]; }})"
        "(report.sceneAt({0}, {1}, {2}))"
    )
    returns = srt.Returns.load(run / "radars/front/frame_000001/returns.npz")
    mine = returns.object_id == 101
    rear = returns.position[mine].mean(axis=0)
    assert page.evaluate(opaque.format(rear[0] + 0.5, rear[1], rear[2])) == 255  # half a metre into the car
    assert page.evaluate(opaque.format(rear[0], rear[1] - 3.0, rear[2])) == 0  # to its right: there is no ground


def test_numbers_of_the_tables_are_those_of_the_run(run: Path, page: Browser) -> None:
    for k in (0, FRAMES - 1):
        page.evaluate(f"report.set({{frame: {k}}})")
        page.settle()
        table = srt.Detections.from_csv(run / f"radars/front/frame_{k:06d}/detections.csv").table
        shown = _cells(page, "detections")
        assert len(shown) == len(table)
        for row, d in zip(shown, table, strict=True):
            values = (d["range"], np.degrees(d["azimuth"]), d["velocity"], d["snr_db"], d["rcs_dbsm"])
            digits = (2, 2, 2, 1, 1)
            said = [float(row[i]) for i in (2, 3, 5, 6, 7)]
            for a, b, n in zip(said, values, digits, strict=True):
                assert a == pytest.approx(b, abs=0.5 * 10.0**-n + 1e-5)  # printed with n digits
        assert f"frame {k} · " in page.evaluate("document.getElementById('clock').textContent")


def test_levels_of_the_maps_are_those_of_the_cube(run: Path, page: Browser) -> None:
    cube = srt.RadarCube.load(run / "radars/front/frame_000001/cube.npz")
    coding = page.evaluate("report.about.radars[0].maps")
    level = dbm(cube.range_doppler)
    i, j = np.unravel_index(int(level.argmax()), level.shape)
    said = page.evaluate(f"report.rdLevel(report.about.radars[0], 1, {cube.range_m[i]}, {cube.velocity_mps[j]})")
    assert said == pytest.approx(level[i, j], abs=coding["rd"]["step_db"] / 2 + 1e-4)
    level = dbm(cube.range_azimuth)
    i, j = np.unravel_index(int(level.argmax()), level.shape)
    said = page.evaluate(f"report.raLevel(report.about.radars[0], 1, {cube.range_m[i]}, {cube.azimuth_rad[j]})")
    assert said == pytest.approx(level[i, j], abs=coding["ra"]["step_db"] / 2 + 1e-4)


def test_the_object_table_shows_names_as_text_and_the_truth(run: Path, page: Browser) -> None:
    rows = {row[0]: row for row in _cells(page, "objects")}
    assert NASTY in rows
    assert page.evaluate("document.querySelectorAll('#objects b').length") == 0
    returns = srt.Returns.load(run / "radars/front/frame_000000/returns.npz")
    mine = returns.object_id == 101
    power = np.abs(returns.amplitude[mine]) ** 2
    distance = np.average(np.linalg.norm(returns.position[mine], axis=1), weights=power)
    assert float(rows[NASTY][2]) == pytest.approx(distance, abs=0.00501)


def test_keys_move_the_slider(page: Browser) -> None:
    slider = "document.getElementById('slider').value"
    page.evaluate("document.getElementById('slider').focus()")
    page.press("ArrowRight")
    assert (_frame(page), page.evaluate(slider)) == (1, "1")
    page.press("End")
    assert (_frame(page), page.evaluate(slider)) == (FRAMES - 1, str(FRAMES - 1))
    page.press("ArrowRight")
    assert _frame(page) == FRAMES - 1
    page.press("Home")
    assert _frame(page) == 0
    page.evaluate("document.activeElement.blur()")  # keys work wherever one is
    page.press("ArrowRight")
    assert _frame(page) == 1


@pytest.mark.slow
def test_two_hundred_frames_open_and_every_one_is_reached(browser: Browser, tmp_path: Path) -> None:
    many = 200
    (tmp_path / "drone.yaml").write_text(
        "point_targets: [{id: 9, name: drone, xyz_m: [90, 2, 1], velocity_mps: [-4, 0, 0], rcs_dbsm: 30}]\n"
    )
    options = ["--frames", f"0:{many}", "--rays", "100", "--backend", "scalar", "--no-pictures"]
    run = tmp_path / "drive"
    assert (
        main(["run", str(tmp_path / "drone.yaml"), *options, "-o", str(run), "--write", "detections,returns,maps"]) == 0
    )
    page = srt.write_report(run)
    assert page.stat().st_size < 30e6
    browser.open(page, "#frame=0")
    before = browser.evaluate("report.stats.redraws")
    for key, frame in (("End", many - 1), ("ArrowLeft", many - 2), ("Home", 0)):
        browser.press(key)
        assert _frame(browser) == frame
        found = srt.Detections.from_csv(run / f"radars/radar/frame_{frame:06d}/detections.csv")
        assert len(_cells(browser, "detections")) == len(found)
    # a press draws a few times at most, however many frames there are
    assert browser.evaluate("report.stats.redraws") - before <= 3 * 3
    assert browser.errors == []


def test_dragging_the_slider_changes_the_frame_and_the_pictures(page: Browser) -> None:
    picture = "document.getElementById('rd').toDataURL()"
    before = page.evaluate(picture)
    box = page.evaluate("JSON.parse(JSON.stringify(document.getElementById('slider').getBoundingClientRect()))")
    y = box["y"] + box["height"] / 2
    page.drag((box["x"] + 8, y), (box["x"] + box["width"] - 4, y))
    assert _frame(page) == FRAMES - 1
    assert page.evaluate(picture) != before
    assert f"frame={FRAMES - 1}" in page.evaluate("new Promise((r) => setTimeout(() => r(location.hash), 600))")


def test_space_plays_to_the_end_and_stops(page: Browser) -> None:
    page.evaluate("document.activeElement.blur()")
    page.press(" ", "Space")
    assert page.evaluate("report.state.playing")
    stopped = (
        "new Promise((done) => { const t = setInterval(() => { if (!report.state.playing) "
        "{ clearInterval(t); done(report.state.frame); } }, 50); })"
    )
    assert page.evaluate(stopped) == FRAMES - 1


def test_focus_is_visible_and_everything_has_a_name(page: Browser) -> None:
    page.press("Tab")
    reached = []
    for _ in range(12):
        page.press("Tab")
        what = page.evaluate(
            "(() => { const e = document.activeElement, s = getComputedStyle(e);"
            "return [e.id || e.tagName, s.outlineStyle, parseFloat(s.outlineWidth)]; })()"
        )
        reached.append(what[0])
        assert what[1] != "none", what
        assert what[2] >= 1, what
    assert {"radar", "view-top", "colour", "scene"} <= set(reached)
    nameless = page.evaluate(
        "[...document.querySelectorAll('button, select, input, canvas:not([aria-hidden])')].filter((e) =>"
        "!(e.getAttribute('aria-label') || e.textContent.trim() || e.closest('label'))).map((e) => e.id)"
    )
    assert nameless == []


def test_the_other_radar_has_its_own_numbers(run: Path, page: Browser) -> None:
    select = "document.getElementById('radar')"
    page.evaluate(f"{select}.value = '1'; {select}.dispatchEvent(new Event('change'))")
    page.settle()
    table = srt.Detections.from_csv(run / "radars/left/frame_000000/detections.csv").table
    assert [float(row[2]) for row in _cells(page, "detections")] == pytest.approx(table["range"], abs=0.00501)


@pytest.mark.parametrize("colour", ["velocity", "ground", "snr_db", "rcs_dbsm", "object"])
def test_points_take_every_colouring_in_both_schemes_and_views(colour: str, page: Browser) -> None:
    seen = set()
    for view in ("top", "orbit"):
        page.evaluate(f"report.set({{colour: '{colour}', view: '{view}', trail: 5, echoes: true}})")
        for _ in range(2):
            page.evaluate("document.getElementById('theme').click()")
            page.settle()
            assert _ink(page, "scene") > 10
            seen.add(page.evaluate("document.documentElement.dataset.theme"))
    assert seen == {"light", "dark"}


def test_a_row_of_the_tables_is_chosen_by_mouse_and_by_key(page: Browser) -> None:
    page.evaluate("document.querySelectorAll('#objects tbody tr')[0].click()")
    page.settle()
    assert page.evaluate("report.state.object") == page.evaluate("report.about.radars[0].objects[0].id")
    page.evaluate("document.querySelectorAll('#detections tbody tr')[1].focus()")
    page.press("Enter")
    assert page.evaluate("report.state.pick") == 1
    assert page.evaluate("document.querySelectorAll('#detections tr[aria-selected=true]').length") == 1


def test_without_webgl_edges_are_drawn_on_a_plain_canvas(run: Path, page: Browser) -> None:
    script = page.send(
        "Page.addScriptToEvaluateOnNewDocument",
        source="const own = HTMLCanvasElement.prototype.getContext; HTMLCanvasElement.prototype.getContext ="
        "function (kind, ...rest) { return kind === 'webgl2' ? null : own.call(this, kind, ...rest); };",
    )
    page.open(run.with_name("run.html"))
    page.send("Page.removeScriptToEvaluateOnNewDocument", **script)
    assert _ink(page, "scene-mesh") > 2


def test_a_page_without_maps_says_so(run: Path, page: Browser, tmp_path: Path) -> None:
    shutil.copytree(run, tmp_path / "run", ignore=shutil.ignore_patterns("*.npz"))
    page.open(srt.write_report(tmp_path / "run"))
    assert page.evaluate("report.about.radars[0].maps") is None
    assert not re.search(r"\d", page.evaluate("document.getElementById('rd-readout').textContent"))
