"""Run folders: layout, summary, manifest, atomicity."""

from __future__ import annotations

import hashlib
import json
import math
from pathlib import Path

import numpy as np
import pytest
from run_tools import NAMES, hand_made_frame

from shenron_rt import runs
from shenron_rt.dsp import Detections, RadarCube
from shenron_rt.errors import InputError, NotFoundError
from shenron_rt.returns import Returns
from shenron_rt.scatterers import Scatterers
from shenron_rt.synthesis import AdcCube


def _tree(folder: Path) -> dict[str, bytes]:
    return {p.relative_to(folder).as_posix(): p.read_bytes() for p in sorted(folder.rglob("*")) if p.is_file()}


def _write(folder: Path, text: str, *, overwrite: bool = False) -> None:
    with runs.write_run(folder, overwrite=overwrite) as place:
        runs.write_json(place.partial / "summary.json", {"version": "1", "radars": [], "text": text})


def _crash(folder: Path, error: type[BaseException]) -> None:
    with runs.write_run(folder, overwrite=True) as place:
        (place.partial / "summary.json").write_text("half")
        raise error


def test_a_frame_is_written_under_the_names_of_its_attributes(tmp_path: Path) -> None:
    frame = hand_made_frame(index=12)
    folder = runs.frame_folder(tmp_path, "front", 12)
    assert folder == tmp_path / "radars" / "front" / "frame_000012"
    runs.write_frame(folder, frame)
    assert {p.name for p in folder.iterdir()} == {
        "scatterers.npz", "returns.npz", "adc.npz", "cube.npz", "detections.csv",
    }  # fmt: skip
    np.testing.assert_array_equal(Scatterers.load(folder / "scatterers.npz").table(), frame.scatterers.table())
    np.testing.assert_array_equal(Returns.load(folder / "returns.npz").amplitude, frame.returns.amplitude)
    adc = AdcCube.load(folder / "adc.npz")
    np.testing.assert_array_equal(adc.data, frame.adc.data)
    assert adc.profile == frame.profile
    np.testing.assert_array_equal(RadarCube.load(folder / "cube.npz").data, frame.cube.data)
    np.testing.assert_array_equal(Detections.from_csv(folder / "detections.csv").range, frame.detections.range)
    with np.load(folder / "adc.npz") as arrays:
        assert {"data", "dims", "chirp_start_s", "positions_m", "profile"} <= set(arrays.files)
        assert [str(d) for d in arrays["dims"]] == ["chirp", "antenna", "sample"]


def test_summary_of_a_frame_names_the_strongest_return_and_every_object() -> None:
    frame = hand_made_frame()
    record = runs.frame_summary(frame, NAMES)
    best = record["strongest"]
    assert set(best) == {"range_m", "azimuth_deg", "velocity_mps", "snr_db", "object_id"}
    assert best["object_id"] == 7
    # a 30 dB target over 128 x 32 samples: far better than a tenth of a bin
    assert best["range_m"] == pytest.approx(math.hypot(20, 4), abs=0.1 * frame.profile.range_resolution_m)
    assert best["azimuth_deg"] == pytest.approx(math.degrees(math.atan2(4, 20)), abs=0.5)
    assert best["velocity_mps"] == pytest.approx(0, abs=0.1 * frame.profile.velocity_resolution_mps)
    objects = {o["id"]: o for o in record["objects"]}
    assert set(objects) == {0, 7, 8, 9}
    assert [o["id"] for o in record["objects"]][:2] == [7, 8], "by falling power"
    assert objects[7]["tag"] == "Poles"
    assert objects[8] | {"power_dbw": 0, "snr_db": 0} == {
        "id": 8, "name": "car", "tag": "Car", "power_dbw": 0, "snr_db": 0, "detected": True,
    }  # fmt: skip
    noise_dbw = 10 * math.log10(frame.profile.noise_power_w)
    assert objects[8]["power_dbw"] == pytest.approx(noise_dbw + 20, abs=1e-9)
    # the two static echoes are incoherent: their powers add
    assert objects[0]["power_dbw"] == pytest.approx(noise_dbw + 10 + 10 * math.log10(2), abs=1e-9)
    assert objects[9]["power_dbw"] is None
    assert objects[9]["snr_db"] is None
    assert objects[9]["detected"] is False


def test_snr_of_a_point_object_is_that_of_its_detection() -> None:
    frame = hand_made_frame()
    record = runs.frame_summary(frame, NAMES)
    of_object = next(o for o in record["objects"] if o["id"] == 7)["snr_db"]
    # scalloping of the two Hann windows takes 0 to 2.8 dB (1.42 dB each); noise on 60 dB moves it by 0.01 dB
    assert -2.9 <= record["strongest"]["snr_db"] - of_object <= 0.1


def test_json_has_no_word_for_nan(tmp_path: Path) -> None:
    runs.write_json(tmp_path / "a.json", {"a": float("nan"), "b": np.float64(np.inf), "c": np.arange(2), "d": np.True_})
    assert json.loads((tmp_path / "a.json").read_text()) == {"a": None, "b": None, "c": [0, 1], "d": True}


def test_manifest_lists_size_and_sha256_of_every_other_file(tmp_path: Path) -> None:
    _write(tmp_path / "run", "x")
    manifest = json.loads((tmp_path / "run" / "manifest.json").read_text())
    data = (tmp_path / "run" / "summary.json").read_bytes()
    assert manifest["files"] == {"summary.json": {"size": len(data), "sha256": hashlib.sha256(data).hexdigest()}}
    assert runs.verify_manifest(tmp_path / "run") == []


def test_a_changed_or_missing_file_is_told(tmp_path: Path) -> None:
    with runs.write_run(tmp_path / "run") as place:
        (place.partial / "a").write_text("a")
        (place.partial / "b").write_text("b")
    (tmp_path / "run" / "a").write_text("c")
    (tmp_path / "run" / "b").unlink()
    assert runs.verify_manifest(tmp_path / "run") == ["a: changed since the run", "b: missing"]


def test_default_folders_are_numbered(tmp_path: Path) -> None:
    for wanted in ("braking-awrl1432", "braking-awrl1432-2", "braking-awrl1432-3"):
        folder = runs.default_folder("braking", "awrl1432", tmp_path / "out")
        assert folder == tmp_path / "out" / wanted
        _write(folder, wanted)
    assert sorted(p.name for p in (tmp_path / "out").iterdir()) == [
        "braking-awrl1432", "braking-awrl1432-2", "braking-awrl1432-3",
    ]  # fmt: skip


def test_a_folder_with_content_is_refused_and_left_alone(tmp_path: Path) -> None:
    folder = tmp_path / "run"
    _write(folder, "old")
    before = _tree(folder)
    with pytest.raises(InputError, match="not empty"), runs.write_run(folder):
        pytest.fail("nothing may be computed for a place that is taken")
    assert _tree(folder) == before
    _write(folder, "new", overwrite=True)
    assert json.loads((folder / "summary.json").read_text())["text"] == "new"
    assert [p.name for p in tmp_path.iterdir()] == ["run"], "no temporary folder stays behind"


def test_overwrite_never_replaces_what_is_no_run(tmp_path: Path) -> None:
    (tmp_path / "home").mkdir()
    (tmp_path / "home" / "letter.txt").write_text("mine")
    with pytest.raises(InputError, match="no manifest"), runs.write_run(tmp_path / "home", overwrite=True):
        pytest.fail("unreachable")
    with pytest.raises(InputError, match="is a file"), runs.write_run(tmp_path / "home" / "letter.txt", overwrite=True):
        pytest.fail("unreachable")
    assert (tmp_path / "home" / "letter.txt").read_text() == "mine"


def test_a_run_that_ends_in_the_same_place_first_costs_no_work(tmp_path: Path) -> None:
    def default() -> Path:
        return runs.default_folder("braking", "awrl1432", tmp_path)

    with runs.write_run(default(), another=default) as place:
        runs.write_json(place.partial / "summary.json", {"text": "slow"})
        _write(default(), "fast")
    assert place.folder.name == "braking-awrl1432-2"
    texts = {p.name: json.loads((p / "summary.json").read_text())["text"] for p in tmp_path.iterdir()}
    assert texts == {"braking-awrl1432": "fast", "braking-awrl1432-2": "slow"}


def test_a_given_place_taken_meanwhile_is_not_replaced(tmp_path: Path) -> None:
    folder = tmp_path / "run"

    def race() -> None:
        with runs.write_run(folder) as place:
            runs.write_json(place.partial / "summary.json", {"text": "slow"})
            _write(folder, "fast")

    with pytest.raises(InputError, match="not empty"):
        race()
    assert json.loads((folder / "summary.json").read_text())["text"] == "fast"
    assert [p.name for p in tmp_path.iterdir()] == ["run"]


def test_an_empty_folder_is_taken(tmp_path: Path) -> None:
    (tmp_path / "run").mkdir()
    _write(tmp_path / "run", "x")
    assert runs.verify_manifest(tmp_path / "run") == []


@pytest.mark.parametrize("error", [RuntimeError, KeyboardInterrupt])
def test_a_crash_in_the_middle_leaves_the_old_run_intact(error: type[BaseException], tmp_path: Path) -> None:
    folder = tmp_path / "run"
    _write(folder, "old")
    before = _tree(folder)
    with pytest.raises(error):
        _crash(folder, error)
    assert _tree(folder) == before
    assert [p.name for p in tmp_path.iterdir()] == ["run"]
    with pytest.raises(error):
        _crash(tmp_path / "new", error)
    assert [p.name for p in tmp_path.iterdir()] == ["run"]


def test_a_failed_move_puts_the_old_run_back(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    folder = tmp_path / "run"
    _write(folder, "old")
    before = _tree(folder)
    replace = Path.replace

    def fails_for_the_new_run(self: Path, target: Path) -> Path:
        if ".partial-" in self.name:
            raise OSError(28, "No space left on device", str(target))
        return replace(self, target)

    monkeypatch.setattr(Path, "replace", fails_for_the_new_run)
    with pytest.raises(OSError, match="No space left"):
        _write(folder, "new", overwrite=True)
    assert _tree(folder) == before


def test_a_run_reads_back(tmp_path: Path) -> None:
    frames = [hand_made_frame(index=i) for i in (0, 1)]
    with runs.write_run(tmp_path / "run") as place:
        for frame in frames:
            runs.write_frame(runs.frame_folder(place.partial, "front", frame.frame), frame)
        records = [runs.frame_summary(f, NAMES) for f in frames]
        runs.write_json(place.partial / "summary.json", {"radars": [{"name": "front", "frames": records}]})
    run = runs.load_run(tmp_path / "run")
    assert run.radars == ["front"]
    assert [f.name for f in run.frames["front"]] == ["frame_000000", "frame_000001"]
    assert run.summary["radars"][0]["frames"][1]["time_s"] == pytest.approx(0.1)
    assert oct((tmp_path / "run").stat().st_mode & 0o077) != oct(0), "readable by others, as far as the umask allows"


def test_what_is_no_run_is_refused(tmp_path: Path) -> None:
    with pytest.raises(NotFoundError, match=r"summary\.json"):
        runs.load_run(tmp_path)
    with pytest.raises(NotFoundError, match="not a run folder"):
        runs.verify_manifest(tmp_path)
    (tmp_path / "manifest.json").write_text("[]")
    with pytest.raises(InputError, match="not a manifest"):
        runs.verify_manifest(tmp_path)
    (tmp_path / "summary.json").write_text("{")
    with pytest.raises(InputError, match="not valid JSON"):
        runs.load_run(tmp_path)
    for text in ("[]", '{"radars": [{}]}', '{"radars": [{"name": "front", "frames": 3}]}', '{"radars": 7}'):
        (tmp_path / "summary.json").write_text(text)
        with pytest.raises(InputError, match=r"summary\.json: not the summary of a run"):
            runs.load_run(tmp_path)
    (tmp_path / "summary.json").write_text('{"radars": [{"name": "front", "frames": [{"frame": 3}]}]}')
    with pytest.raises(InputError, match="frame_000003"):
        runs.load_run(tmp_path)
