"""The documentation says what is true: examples run, snippets validate, links resolve, names exist."""

from __future__ import annotations

import dataclasses
import doctest
import importlib
import re
import shlex
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
import yaml
from pydantic import BaseModel

import shenron_rt as srt

ROOT = Path(__file__).resolve().parents[1]
PAGES = [ROOT / name for name in ("README.md", "CONTRIBUTING.md", "CHANGELOG.md")] + sorted(
    (ROOT / "docs").glob("*.md")
)
MODULES = sorted(p for p in (ROOT / "shenron_rt").rglob("*.py") if ">>>" in p.read_text(encoding="utf-8"))


def _blocks(page: Path, language: str) -> list[str]:
    return re.findall(rf"^```{language}\n(.*?)^```$", page.read_text(encoding="utf-8"), flags=re.MULTILINE | re.DOTALL)


def _snippets() -> Iterator[tuple[str, str]]:
    for page in PAGES:
        for number, text in enumerate(_blocks(page, "yaml")):
            yield f"{page.name}-{number}", text


def test_python_example_of_the_readme_runs(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    (example,) = _blocks(ROOT / "README.md", "python")
    assert len([line for line in example.splitlines() if line.strip()]) == 6
    monkeypatch.chdir(tmp_path)
    exec(compile(example, "README.md", "exec"), {})
    said = re.match(r"([\d.]+) m, ([-+][\d.]+) m/s, SNR ([\d.]+) dB", capsys.readouterr().out)
    assert said
    distance, velocity, snr = map(float, said.groups())
    profile = srt.load_profile("awrl1432")
    # the rear of a 4.5 m car whose middle is 27.25 m ahead of the radar; it closes at 5 m/s
    assert 24.5 < distance < 27.25
    assert velocity == pytest.approx(-5, abs=profile.velocity_resolution_mps)
    assert snr > 15
    assert srt.AdcCube.load("adc.npz").data.shape == (64, 6, 256)


@pytest.mark.parametrize(("name", "text"), list(_snippets()))
def test_yaml_snippets_of_the_docs_validate(name: str, text: str, tmp_path: Path) -> None:
    first = text.splitlines()[0]
    title = re.fullmatch(r"# (?:(profiles|scenes|materials|plans)/)?([\w.]+\.yaml)", first)
    assert title, f"{name}: the first line says which file it is, got {first!r}"
    file = tmp_path / title[2]
    file.write_text(text, encoding="utf-8")
    if title[1] is None:
        from shenron_rt.scene.resolver_manifest import load_manifest

        assert load_manifest(file).parts
        return
    loader = {
        "profiles": srt.load_profile,
        "scenes": srt.load_scene,
        "materials": srt.load_materials,
        "plans": srt.load_plan,
    }[title[1]]
    given = yaml.safe_load(text)
    assert set(given) <= set(loader(file).model_dump(exclude_unset=True))


def test_override_examples_of_the_docs_apply() -> None:
    said = re.findall(r"--set (scene|profile|processing)\.([\w.]+)=([\w.+-]+)", (ROOT / "docs/formats.md").read_text())
    assert {kind for kind, _, _ in said} == {"scene", "profile", "processing"}
    for kind, key, value in said:
        if kind == "scene":
            srt.load_scene("braking", {key: value})
        else:
            srt.load_profile("awrl1432", {key if kind == "profile" else f"processing.{key}": value})


def _slug(heading: str) -> str:
    return re.sub(r"[^\w\- ]", "", heading.strip().lower()).replace(" ", "-")


@pytest.mark.parametrize("page", PAGES, ids=lambda p: p.name)
def test_links_resolve(page: Path) -> None:
    text = re.sub(r"```.*?```", "", page.read_text(encoding="utf-8"), flags=re.DOTALL)
    for target in re.findall(r"\]\(([^)\s]+)\)|<img src=\"([^\"]+)\"", text):
        target = "".join(target)
        if re.match(r"https?://", target):
            continue
        path, _, anchor = target.partition("#")
        file = (page.parent / path) if path else page
        assert file.is_file(), f"{page.name}: {target}"
        if anchor:
            headings = re.findall(r"^#+ (.*)$", file.read_text(encoding="utf-8"), flags=re.MULTILINE)
            assert anchor in {_slug(h) for h in headings}, f"{page.name}: {target}"
    lines = page.read_text(encoding="utf-8").splitlines()
    assert [n for n, line in enumerate(lines, 1) if line != line.rstrip()] == []


def test_every_page_is_listed_and_every_picture_is_shown_and_small() -> None:
    index = (ROOT / "docs/index.md").read_text(encoding="utf-8")
    shown = "".join(p.read_text(encoding="utf-8") for p in PAGES)
    assert [p.name for p in (ROOT / "docs").glob("*.md") if p.name != "index.md" and f"({p.name})" not in index] == []
    for picture in (ROOT / "docs/images").iterdir():
        assert re.search(rf"images/{picture.name}[)\"]", shown)
        assert picture.stat().st_size < 300_000


def test_commands_in_the_docs_exist() -> None:
    from shenron_rt.cli import build_app

    text = "".join(p.read_text(encoding="utf-8") for p in PAGES)
    verbs = set(re.findall(r"shenron-rt ([a-z]+(?:-[a-z]+)*)\b", text))
    assert {"run", "doctor", "resolve", "validate", "profiles", "materials", "process"} <= verbs
    assert verbs <= {name for name in build_app() if not name.startswith("-")}


def _field_names() -> set[str]:
    from shenron_rt.config import profile, scene
    from shenron_rt.config.materials import Material
    from shenron_rt.dsp import DETECTION_DTYPE
    from shenron_rt.scatterers import Weather

    models: list[type[BaseModel]] = [profile.Waveform, profile.Array, profile.Antenna, profile.Receiver, Material]
    models += [scene.WeatherModel, scene.Ego]
    classes = [srt.Scatterers, srt.Returns, Weather]
    names = {name for model in models for name in model.model_fields}
    names |= {f.name for c in classes for f in dataclasses.fields(c)} | set(DETECTION_DTYPE.names or ())
    # identity of the record, explained where it is written; not quantities
    return names - {
        "sources",
        "radar",
        "seed",
        "frame",
        "backend",
        "model",
        "weather",
        "table_az",
        "table_el",
        "backscatter",
    }


def test_nomenclature_has_every_field_and_no_quantity_twice() -> None:
    lines = (ROOT / "docs/nomenclature.md").read_text(encoding="utf-8").splitlines()
    first = [line.split("|")[1] for line in lines if line.startswith("| ")]
    defined = {name.split(".")[-1].removesuffix("()") for cell in first for name in re.findall(r"`([^`]+)`", cell)}
    assert _field_names() - defined == set()


def test_formats_list_every_shape_and_mesh_frame() -> None:
    from shenron_rt.scene.mesh_frames import MESH_FRAMES
    from shenron_rt.scene.shapes import SHAPES

    text = (ROOT / "docs/formats.md").read_text(encoding="utf-8")
    said = {name.split(":")[0] for name in re.findall(r"`([a-z_]+(?::[^`]*)?)`", text)}
    assert set(SHAPES) | set(MESH_FRAMES) <= said


@pytest.mark.parametrize("file", MODULES, ids=lambda p: p.relative_to(ROOT / "shenron_rt").with_suffix("").as_posix())
def test_doctests_hold(file: Path) -> None:
    name = file.relative_to(ROOT).with_suffix("").as_posix().replace("/", ".").removesuffix(".__init__")
    with np.printoptions():
        result = doctest.testmod(importlib.import_module(name))
    assert result.attempted > 0
    assert result.failed == 0


def test_the_picture_of_the_data_flow_is_made_by_its_script(tmp_path: Path) -> None:
    script, picture = ROOT / "examples/data_flow.py", tmp_path / "flow.png"
    subprocess.run([sys.executable, str(script), str(picture)], check=True, capture_output=True)
    assert picture.read_bytes().startswith(b"\x89PNG")
    source = script.read_text(encoding="utf-8")
    for value in ("Scatterers", "Returns", "AdcCube", "RadarCube", "Detections"):
        assert f'("{value}"' in source
        assert hasattr(srt, value)


@pytest.mark.parametrize("number", range(len(_blocks(ROOT / "docs/guide.md", "python"))))
def test_python_of_the_guide_runs(number: int) -> None:
    exec(compile(_blocks(ROOT / "docs/guide.md", "python")[number], f"guide.md-{number}", "exec"), {})


def test_python_of_the_explain_page_runs(capsys: pytest.CaptureFixture[str]) -> None:
    (example,) = _blocks(ROOT / "docs/explain.md", "python")
    exec(compile(example, "explain.md", "exec"), {})
    assert capsys.readouterr().out.startswith("detected ")


def test_python_of_the_tracking_page_runs(capsys: pytest.CaptureFixture[str]) -> None:
    (example,) = _blocks(ROOT / "docs/tracking.md", "python")
    exec(compile(example, "tracking.md", "exec"), {})
    assert capsys.readouterr().out == "(1,) 0\n"


def test_python_of_the_turntable_page_runs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    (example,) = _blocks(ROOT / "docs/rcs.md", "python")
    exec(compile(example, "rcs.md", "exec"), {})
    assert (tmp_path / "plate.npz").is_file()


def _commands() -> list[str]:
    text = "\n".join(block for page in PAGES for block in _blocks(page, "bash"))
    return re.findall(r"(?:^|&& )(?:\.venv/bin/)?(shenron-rt [^#&\n]*)", text, flags=re.MULTILINE)


@pytest.mark.parametrize("line", _commands())
def test_command_lines_of_the_docs_parse(line: str) -> None:
    from shenron_rt.cli import build_app

    command, bound, *_ = build_app().parse_args(shlex.split(line)[1:], exit_on_error=False, print_error=False)
    assert command.__name__ == line.split()[1].replace("-", "_")
    assert isinstance(bound.arguments, dict)
