"""What is shipped: the wheel holds code and data, and works away from the checkout."""

from __future__ import annotations

import os
import re
import subprocess
import sys
import tomllib
import zipfile
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
KINDS = ("scenes", "materials", "profiles")


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Wheel of the checkout, built in this process: no network, no isolated environment."""
    builder = pytest.importorskip(
        "hatchling.builders.wheel", reason="hatchling is not installed: pip install '.[test]'"
    )
    folder = tmp_path_factory.mktemp("dist")
    (built,) = builder.WheelBuilder(str(ROOT)).build(directory=str(folder), versions=["standard"])
    return Path(built)


def _names(wheel: Path) -> set[str]:
    with zipfile.ZipFile(wheel) as archive:
        return set(archive.namelist())


def test_configuration_ships_the_data_folders() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    included = project["tool"]["hatch"]["build"]["targets"]["wheel"]["force-include"]
    assert included == {kind: f"shenron_rt/_data/{kind}" for kind in KINDS}
    assert project["project"]["scripts"] == {"shenron-rt": "shenron_rt.cli:main"}


def test_wheel_holds_all_code_and_data_and_nothing_else(wheel: Path) -> None:
    code = {p.relative_to(ROOT).as_posix() for p in (ROOT / "shenron_rt").rglob("*.py")}
    data = {
        f"shenron_rt/_data/{p.relative_to(ROOT).as_posix()}"
        for k in KINDS
        for p in (ROOT / k).rglob("*")
        if p.is_file()
    }
    held = {n for n in _names(wheel) if ".dist-info/" not in n}
    assert len(data) >= 15  # eight profiles, six scenes, a material table
    page = {p.relative_to(ROOT).as_posix() for p in (ROOT / "shenron_rt/report/page").iterdir()}
    assert len(page) >= 3  # the page of a report, its style, its scripts
    assert held == code | data | page | {"shenron_rt/py.typed"}


def test_wheel_has_licence_and_entry_point(wheel: Path) -> None:
    with zipfile.ZipFile(wheel) as archive:
        info = {n.rsplit(".dist-info/", 1)[1]: n for n in archive.namelist() if ".dist-info/" in n}
        assert "licenses/LICENSE" in info
        assert "shenron-rt = shenron_rt.cli:main" in archive.read(info["entry_points.txt"]).decode()
        assert "License-Expression: Apache-2.0" in archive.read(info["METADATA"]).decode()


def test_unpacked_wheel_finds_its_own_data_elsewhere(wheel: Path, tmp_path: Path) -> None:
    site = tmp_path / "site"
    with zipfile.ZipFile(wheel) as archive:
        archive.extractall(site)
    code = (
        "import sys; sys.path.insert(0, sys.argv[1])\n"
        "import shenron_rt as srt; from shenron_rt.resources import available\n"
        "for kind in sys.argv[2:]: print(*available(kind).values(), sep='\\n')\n"
        "print(srt.load_scene('braking').radars[0].name, srt.load_materials().for_tag('Roads'))"
    )
    command = [sys.executable, "-c", code, str(site), *KINDS]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=True)
    *files, last = done.stdout.splitlines()
    assert last == "front asphalt"
    assert len(files) >= 13
    assert all(Path(file).is_relative_to(site / "shenron_rt" / "_data") for file in files)


def test_installed_command_starts() -> None:
    done = subprocess.run(
        [sys.executable, "-m", "shenron_rt.cli", "--version"], capture_output=True, text=True, check=True
    )
    assert done.stdout.strip()[0].isdigit()


def test_ci_runs_the_two_commands_of_the_readme() -> None:
    script, readme = ROOT / ".ci" / "run", (ROOT / "README.md").read_text(encoding="utf-8")
    blocks = re.findall(r"^```bash\n(.*?)^```$", readme, flags=re.MULTILINE | re.DOTALL)
    assert len(blocks) == 2
    assert all(len(block.strip().splitlines()) == 1 for block in blocks)
    assert blocks[0].strip().endswith("shenron-rt run braking")
    assert blocks[1].strip().endswith("pytest")
    assert os.access(script, os.X_OK)
    assert subprocess.run(["bash", "-n", str(script)], check=False).returncode == 0
    steps = re.findall(r'^ *step "([^"]+)"', script.read_text(encoding="utf-8"), flags=re.MULTILINE)
    assert steps[-1] == "README: install and test"  # pytest's closing line is what one sees last
