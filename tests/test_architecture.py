"""Imports run one way, along the data flow, and heavy libraries load only where they are used."""

from __future__ import annotations

import ast
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import pytest

PACKAGE = Path(__file__).resolve().parents[1] / "shenron_rt"

#: Bottom to top. A module may import its own layer and those above it in this list; the longest name that fits counts.
LAYERS = (
    ("errors", "constants", "_typing"),
    ("frames", "randomness", "resources", "_parallel", "io.npz", "config._base", "config.loader"),
    ("physics", "tags"),
    ("paths", "chains", "scatterers", "scene.mesh", "scene.mesh_frames"),  # plain values that the scene's models hold
    ("config",),
    ("scene", "lidar"),
    ("tracing.backend", "tracing.caster"),
    ("sbr",),
    ("tracing",),
    ("returns", "echo"),
    ("retrace",),
    ("synthesis",),
    ("dsp",),
    ("io", "pipeline", "cshenron", "rcs"),
    ("turntable", "sequence"),
    ("runs", "run_frames", "run_source", "run_manifest", "run_setup", "run_summary", "rendering"),
    ("batch",),
    ("attribution", "objects"),  # read run folders
    ("plot", "report"),
    ("comparison", "export"),  # a comparison saves its figure page, an export draws maps that the run did not
    ("cli",),
)
#: library -> packages that may import it at all
ONLY_IN = {
    "mitsuba": {"tracing"},
    "drjit": {"tracing", "synthesis"},
    "pydantic": {"config", "scene", "lidar"},
    "trimesh": {"scene", "tracing"},
    "matplotlib": {"plot", "report"},
    "cyclopts": {"cli"},
    "foxglove": {"export"},
    "rosbags": {"export"},
    "xarray": {"export"},
    "zarr": {"export"},
    "rich": {"cli"},
    "distributed": {"batch"},
}
#: libraries of extras, which need not be there
OPTIONAL = {"distributed", "foxglove", "rosbags", "xarray", "zarr"}
#: libraries that cost start-up time: inside functions only
LAZY = {
    "mitsuba",
    "drjit",
    "trimesh",
    "matplotlib",
    "finufft",
    "scipy.signal",
    "scipy.spatial",
    "scipy.optimize",
    *OPTIONAL,
}


class Import(NamedTuple):
    importer: str  # "physics.fresnel"
    target: str  # "numpy.linalg", or ".errors" inside the package
    lazy: bool
    where: str


def _imports(file: Path) -> Iterator[Import]:
    name = file.relative_to(PACKAGE).with_suffix("").as_posix().replace("/", ".").removesuffix("__init__").rstrip(".")
    package = file.relative_to(PACKAGE).parent.parts

    def walk(node: ast.AST, lazy: bool) -> Iterator[Import]:
        if isinstance(node, ast.If) and "TYPE_CHECKING" in ast.unparse(node.test):
            return  # for type checkers, never executed
        lazy = lazy or isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef)
        targets: list[str] = []
        if isinstance(node, ast.Import):
            targets = [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom) and not node.level:
            targets = [f"{node.module}.{alias.name}" for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            base = [*package[: len(package) - node.level + 1], *filter(None, [node.module])]
            targets = ["." + ".".join([*base, alias.name]) for alias in node.names]
        for target in targets:
            yield Import(name, target, lazy, f"{file.relative_to(PACKAGE.parent)}:{node.lineno} imports {target}")
        for child in ast.iter_child_nodes(node):
            yield from walk(child, lazy)

    yield from walk(ast.parse(file.read_text(encoding="utf-8")), lazy=False)


@pytest.fixture(scope="module")
def imports() -> list[Import]:
    found = [i for file in sorted(PACKAGE.rglob("*.py")) if file.parent != PACKAGE / "_data" for i in _imports(file)]
    assert {i.target.split(".")[0] for i in found} >= {"mitsuba", "numpy", ""}  # the walk sees what is there
    return found


def _within(name: str, prefix: str) -> bool:
    return name == prefix or name.startswith(prefix + ".")


def _layer(name: str) -> int:
    fits = [(len(p), rank) for rank, names in enumerate(LAYERS) for p in names if _within(name, p)]
    assert fits, f"module {name!r} has no layer; add it to LAYERS where the data flow has it"
    return max(fits)[1]


def test_imports_follow_the_data_flow(imports: list[Import]) -> None:
    inside = [i for i in imports if i.target.startswith(".") and i.importer]
    assert [i.where for i in inside if _layer(i.target[1:]) > _layer(i.importer)] == []


def test_nothing_but_the_command_line_imports_plots_reports_or_the_command_line(imports: list[Import]) -> None:
    top = ("plot", "report", "comparison", "export", "cli")
    outside = [i for i in imports if i.importer.split(".")[0] not in top]
    assert [i.where for i in outside if i.target[1:].split(".")[0] in top and i.target.startswith(".")] == []


@pytest.mark.parametrize("library", sorted(ONLY_IN))
def test_a_library_is_imported_only_where_it_belongs(library: str, imports: list[Import]) -> None:
    users = [i for i in imports if _within(i.target, library)]
    assert [i.where for i in users if i.importer.split(".")[0] not in ONLY_IN[library]] == []


def test_heavy_libraries_are_imported_inside_functions(imports: list[Import]) -> None:
    eager = [i for i in imports if not i.lazy and any(_within(i.target, heavy) for heavy in LAZY)]
    assert [i.where for i in eager] == []


@pytest.mark.parametrize(
    ("module", "absent"),
    [
        ("shenron_rt", {"numpy", "scipy", "yaml", "pydantic", *ONLY_IN}),
        ("shenron_rt.frames", {"scipy", "yaml", *ONLY_IN}),
        ("shenron_rt.physics", {"yaml", *ONLY_IN}),
        ("shenron_rt.dsp", {"yaml", *ONLY_IN}),
        ("shenron_rt.cli", {"numpy", "scipy", "mitsuba", "trimesh", "matplotlib"}),
    ],
)
def test_importing_a_module_loads_no_heavy_library(module: str, absent: set[str]) -> None:
    code = f"import sys, {module}; print(*sys.modules)"
    loaded = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout.split()
    assert module in loaded
    assert absent.isdisjoint(loaded)
