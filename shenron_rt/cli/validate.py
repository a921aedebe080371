"""``shenron-rt validate``: say what a file is and what is wrong with it, without running anything."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

from cyclopts import Parameter

from ..errors import InputError, NotFoundError, ShenronError
from .common import Json, print_json, say

__all__ = ["Verdict", "check_file", "validate"]

_YAML = (".yaml", ".yml")
_LIDAR = (".laz", ".las")
_TEXT = (".csv", ".txt")
#: Fewest columns of a table of LiDAR points.
_COLUMNS = 6
_SCENE_KEYS = {
    "static",
    "actors",
    "point_targets",
    "radars",
    "ego",
    "lidars",
    "frame_period_s",
    "weather",
    "interferers",
}


@dataclass(frozen=True)
class Verdict:
    """What a file is, in words, and its problems, each as ``file:line: key: what``."""

    path: str
    kind: str
    what: str = ""
    problems: tuple[str, ...] = ()


def validate(
    *files: Path,
    all_: Annotated[
        bool, Parameter(name="--all", negative=(), help="Check everything that ships with the package.")
    ] = False,
    profile: Annotated[str | None, Parameter(help="Radar that made .npy and .bin files of ADC samples.")] = None,
    json_: Json = False,
) -> int:
    """Check YAML, mesh, semantic LiDAR and ADC files and run folders.

    Parameters
    ----------
    files
        Any of them.
    """
    wanted = [*files, *(_packaged() if all_ else ())]
    if not wanted:
        raise InputError("validate: give files, or --all for what ships with the package")
    verdicts = [check_file(path, profile) for path in wanted]
    bad = sum(bool(v.problems) for v in verdicts)
    if json_:
        print_json([{"path": v.path, "kind": v.kind, "what": v.what, "problems": list(v.problems)} for v in verdicts])
        return 2 if bad else 0
    for verdict in verdicts:
        if not verdict.problems:
            say(f"ok  {verdict.path}: {verdict.kind}{f', {verdict.what}' if verdict.what else ''}")
    if bad:
        import sys

        for line in (p for v in verdicts for p in v.problems):
            sys.stderr.write(f"shenron-rt: {line}\n")
    return 2 if bad else 0


def _packaged() -> list[Path]:
    from ..resources import package_folder
    from ..scene.readers import MESH_SUFFIXES

    endings = (*_YAML, *MESH_SUFFIXES)
    found: list[Path] = []
    for kind in ("profiles", "materials", "scenes"):
        found += [p for p in sorted(package_folder(kind).rglob("*")) if p.suffix in endings]
    return found


def check_file(path: Path, profile: str | None = None) -> Verdict:
    """Find out what a file is and check it.

    Parameters
    ----------
    path : path
        YAML, mesh, semantic LiDAR, ADC data, or a run folder.
    profile : str, optional
        Radar of ``.npy`` and ``.bin`` files; without one they are taken for LiDAR, unless an array is complex.
    """
    kind = "unknown"
    try:
        kind, check = _checker(path, profile)
        return Verdict(str(path), kind, check(path))
    except ShenronError as error:
        lines = [line for line in str(error).splitlines() if line.strip()]
        return Verdict(str(path), kind, problems=tuple(_placed(path, line) for line in lines))


def _placed(path: Path, line: str) -> str:
    """Begin a message with its file where it does not say so itself."""
    return line if str(path) in line else f"{path}: {line}"


def _checker(path: Path, profile: str | None) -> tuple[str, Callable[[Path], str]]:
    if path.is_dir():
        return "run folder", _run_folder
    if not path.is_file():
        raise NotFoundError(f"{path}: no such file or folder")
    if path.suffix in _YAML:
        return _yaml_checker(path)
    if _is_lidar(path, profile):
        return "semantic LiDAR", _lidar
    if path.suffix == ".npz":
        return "ADC cube", _own_cube
    if path.suffix in (".npy", ".bin"):
        return ("ADC array" if path.suffix == ".npy" else "DCA1000 capture"), lambda p: _foreign_adc(p, profile)
    from ..scene.readers import MESH_SUFFIXES

    if path.suffix.lower() in MESH_SUFFIXES:
        return "mesh", _mesh
    endings = ", ".join((*_YAML, *MESH_SUFFIXES, *_LIDAR, *_TEXT, ".npz", ".npy", ".bin"))
    raise InputError(f"{path}: not a kind of file that is known here; endings: {endings}, or a run folder")


def _is_lidar(path: Path, profile: str | None) -> bool:
    """Tell a frame of points from a mesh and from ADC samples."""
    import numpy as np

    ending = path.suffix.lower()
    if ending == ".ply":
        with path.open("rb") as file:
            head = file.read(4096).partition(b"end_header")[0]
        return b"element face" not in head and b"element vertex" in head
    if ending in _TEXT:
        with path.open(encoding="utf-8", errors="replace") as text:
            return len(text.readline().replace(",", " ").split()) >= _COLUMNS
    if ending == ".npz":
        from ..io.npz import load_npz

        return "profile" not in load_npz(path, ())
    if ending == ".npy" and profile is None:
        try:
            array = np.load(path, mmap_mode="r", allow_pickle=False)
        except (ValueError, OSError):
            return False
        return array.ndim <= 2 and not np.iscomplexobj(array)
    return ending in _LIDAR or (ending == ".bin" and profile is None)


def _yaml_checker(path: Path) -> tuple[str, Callable[[Path], str]]:
    from ..config.loader import read_yaml

    data, _ = read_yaml(path)
    keys = set(data)
    if keys == {"process", "profile"}:
        return "record of shenron-rt process", lambda _: ""
    if keys == {"rcs"}:
        return "record of shenron-rt rcs", lambda _: ""
    if keys & {"waveform", "receiver", "antenna"}:
        return "profile", _profile
    if "materials" in keys and isinstance(data["materials"], dict):
        return "material table", _materials
    if "parts" in keys and not keys & {"actors", "radars", "static"}:
        return "tag manifest", _manifest
    if keys & {"sensor_transform", "ego_transform"} or {"axes", "actors"} <= keys:
        return "side file of a LiDAR frame", _side_file
    if "scenes" in keys:
        return "batch plan", _plan
    if keys & _SCENE_KEYS:
        return "scene", _scene
    raise InputError(
        f"{path}:1: neither a profile (waveform:), a material table (materials:), a scene, a tag manifest nor the side "
        "file of a LiDAR frame (axes: or sensor_transform:)"
    )


def _profile(path: Path) -> str:
    from ..config.profile import load_profile

    return repr(load_profile(path))


def _materials(path: Path) -> str:
    from ..config.materials import load_materials

    table = load_materials(path)
    return f"{len(table.materials)} materials, tag tables {', '.join(table.tags) or 'none'}"


def _manifest(path: Path) -> str:
    from ..scene.resolver_manifest import load_manifest

    return f"{len(load_manifest(path).parts)} rules"


def _plan(path: Path) -> str:
    from ..batch import load_plan
    from ..batch.expansion import expand

    planned = expand(load_plan(path))
    return f"{len(planned)} runs, {sum(len(r.frames) for r in planned)} frames"


def _scene(path: Path) -> str:
    """Load a scene with its profiles, meshes, tags, materials and recorded trajectories."""
    from ..config.scene import load_scene
    from ..scene.motion_of import trajectory_of
    from ..scene.world import load_bodies

    scene = load_scene(path)
    profiles = [scene.profile_of(r).name for r in scene.radars]
    bodies, _ = load_bodies(scene)
    triangles = sum(b.mesh.n_faces for b in bodies)
    for mover in (scene.ego, *scene.actors):
        if mover.has_trajectory:
            trajectory_of(mover, scene.folder)
    return (
        f"{len(scene.static)} static parts, {len(scene.actors)} actors, {len(scene.point_targets)} point targets, "
        f"{triangles} triangles, radars {', '.join(profiles)}"
    )


def _mesh(path: Path) -> str:
    from ..scene.mesh_hints import mesh_hints
    from ..scene.readers import read_mesh
    from ..scene.resolver import resolve_tags
    from ..scene.resolver_report import coverage

    mesh = resolve_tags(read_mesh(path), unlabelled="warn")
    total, hints = coverage(mesh), mesh_hints(mesh)
    text = f"{total.parts} parts, {total.triangles} triangles, {total.unlabelled_parts} parts without a tag"
    return "; ".join([text, *(f"hint: {hint}" for hint in hints)])


def _lidar(path: Path) -> str:
    from ..lidar.survey import survey_points

    try:
        return survey_points(path)
    except ShenronError as error:
        if path.suffix not in (".bin", ".npy"):
            raise
        raise InputError(f"{error}. If it holds ADC samples, name their radar by --profile") from None


def _side_file(path: Path) -> str:
    from ..lidar.side_file import read_side_file

    side = read_side_file(path)
    speed = (
        "no ego velocity" if side.ego_velocity is None else f"ego velocity {side.ego_velocity.round(3).tolist()} m/s"
    )
    pose = "no sensor pose" if side.sensor_pose is None else f"sensor at {side.sensor_pose.xyz} m in the ego frame"
    return f"{len(side.actors)} actors, {speed}, {pose}"


def _own_cube(path: Path) -> str:
    from .process import load_cube

    return repr(load_cube(path))


def _foreign_adc(path: Path, profile: str | None) -> str:
    from ..config.profile import load_profile
    from ..io.captures import read_dca1000, read_npy

    if profile is None:
        raise InputError(f"{path}: --profile is needed, the file does not say which radar made it")
    radar = load_profile(profile)
    cubes: list[Any] = read_npy(path, radar) if path.suffix == ".npy" else read_dca1000(path, radar, scale=1.0)
    return f"{len(cubes)} frames of {radar.name}"


def _run_folder(path: Path) -> str:
    from ..runs import load_run, verify_manifest

    run = load_run(path)
    problems = verify_manifest(path)
    if problems:
        raise InputError("\n".join(f"{path}: {p}" for p in problems))
    if not run.radars and "peak" in run.summary:
        return f"sweep of {run.summary['target']}"
    return f"radars {', '.join(run.radars)}, {sum(len(f) for f in run.frames.values())} frames"
