"""Readers of exports that are not ours, and what the tests of exports share."""

from __future__ import annotations

import json
import resource
from collections import defaultdict
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import shenron_rt as srt
from shenron_rt.cli import main

#: Two vehicles at 15 and 10 m/s between walls: where everything is at any time is known in closed form.
STREET = """
version: 1
name: street
seed: 7
ego: {velocity_mps: [15, 0, 0]}
static:
  - {name: road, shape: "ground:220x40", xyz_m: [116, 0, 0], tag: Roads, material: asphalt}
  - {name: left_wall, shape: "box:80x0.3x3", xyz_m: [43, 4.15, 1.5], tag: Walls, material: concrete, id: 40}
  - {name: right_wall, shape: "box:80x0.3x3", xyz_m: [43, -4.15, 1.5], tag: Walls, material: concrete, id: 41}
actors:
  - {id: 101, name: lead, shape: car, xyz_m: [29.25, 0, 0], velocity_mps: [10, 0, 0], aim: 20000}
radars:
  - {name: front, profile: awrl1432}
"""
EPOCH_NS = 1_000_000_000 * 10**9


@contextmanager
def files_up_to(size: int) -> Iterator[None]:
    """Let no file of this process grow beyond ``size`` bytes, as on a disk that is full."""
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))


def run_scene(folder: Path, scene: str, *options: str, rays: int = 20_000) -> Path:
    """Render a scene with few rays and without pictures; return the run folder."""
    words = ["run", scene, "-o", str(folder), "--rays", str(rays), "--no-pictures", "--json", *options]
    assert main(words) == 0
    return folder


def columns_of(file: Path) -> dict[str, np.ndarray]:
    """Return the columns of a run's ``detections.csv``, with the flag of ghosts."""
    found = srt.Detections.from_csv(file)
    return {name: found.table[name] for name in found.table.dtype.names or ()} | {"ghost": found.ghost}


class Json:
    """Decodes the JSON channels, as the protobuf decoder does its own; a channel without a schema is refused."""

    def decoder_for(self, encoding: str, schema: Any) -> Callable[[bytes], Any] | None:
        if encoding != "json":
            return None
        assert schema is not None
        assert schema.encoding == "jsonschema"
        names = set(json.loads(schema.data)["properties"])

        def decode(data: bytes) -> Any:
            message = json.loads(data)
            assert set(message) == names
            return message

        return decode


def read_mcap(path: Path) -> dict[str, list[Any]]:
    """Return the messages by topic, decoded, each with its ``log_time`` [ns]."""
    reader = pytest.importorskip("mcap.reader", reason="mcap-protobuf-support is not installed (extra test)")
    protobuf = pytest.importorskip(
        "mcap_protobuf.decoder", reason="mcap-protobuf-support is not installed (extra test)"
    )
    found: dict[str, list[Any]] = defaultdict(list)
    with path.open("rb") as file:
        for item in reader.make_reader(
            file, decoder_factories=[protobuf.DecoderFactory(), Json()]
        ).iter_decoded_messages():
            entry = SimpleNamespace(time=item.message.log_time, schema=item.schema.name, message=item.decoded_message)
            found[item.channel.topic].append(entry)
    return dict(found)


def export_mcap_and_read(run: Path, target: Path, *options: str) -> dict[str, list[Any]]:
    """Export a run by the command and return its messages by topic."""
    assert main(["export", str(run), "--to", "mcap", "-o", str(target), *options]) == 0
    return read_mcap(target)


def unpack(message: Any) -> dict[str, np.ndarray]:
    """Return the columns of a foxglove.PointCloud by its own description of its fields."""
    kinds = {1: "u1", 2: "i1", 3: "<u2", 4: "<i2", 5: "<u4", 6: "<i4", 7: "<f4", 8: "<f8"}
    layout = np.dtype(
        {
            "names": [f.name for f in message.fields],
            "formats": [kinds[f.type] for f in message.fields],
            "offsets": [f.offset for f in message.fields],
            "itemsize": message.point_stride,
        }
    )
    table = np.frombuffer(message.data, dtype=layout)
    return {name: table[name] for name in layout.names or ()}


def matrices(message: Any) -> dict[str, tuple[str, np.ndarray]]:
    """Return child -> (parent, (4, 4) matrix) of a foxglove.FrameTransforms."""
    return {t.child_frame_id: (t.parent_frame_id, _matrix(t.translation, t.rotation)) for t in message.transforms}


def _matrix(translation: Any, q: Any) -> np.ndarray:
    from scipy.spatial.transform import Rotation

    matrix = np.eye(4)
    matrix[:3, :3] = Rotation.from_quat([q.x, q.y, q.z, q.w]).as_matrix()
    matrix[:3, 3] = translation.x, translation.y, translation.z
    return matrix


def in_world(tree: dict[str, tuple[str, np.ndarray]], frame: str) -> np.ndarray:
    """Return the (4, 4) pose of a frame in the world, by walking the tree."""
    matrix = np.eye(4)
    while frame != "world":
        frame, step = tree[frame]
        matrix = step @ matrix
    return matrix


def moved(matrix: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Map (n, 3) points by a (4, 4) matrix."""
    return points @ matrix[:3, :3].T + matrix[:3, 3]


def distance_to_mesh(entity: Any, points: np.ndarray) -> np.ndarray:
    """Return the distance of (n, 3) points, entity frame, to the triangles of a foxglove.SceneEntity [m]."""
    import trimesh

    meshes = []
    for triangles in entity.triangles:
        vertices = np.array([(p.x, p.y, p.z) for p in triangles.points])
        vertices = moved(_matrix(triangles.pose.position, triangles.pose.orientation), vertices)
        faces = np.array(triangles.indices).reshape(-1, 3)
        meshes.append(trimesh.Trimesh(vertices, faces, process=False))
    whole = trimesh.util.concatenate(meshes)
    return trimesh.proximity.closest_point_naive(whole, points)[1]
