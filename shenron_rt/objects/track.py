"""Tracks of a run: detections to objects, objects to tracks, tracks against the truth."""

from __future__ import annotations

import csv
import io
import os
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import IO, TYPE_CHECKING, Any

import numpy as np

from .._typing import FloatArray
from ..config.scene import Scene
from ..dsp import Detections, RadarCube
from ..errors import InputError
from ..io.npz import atomic_write
from ..returns import Returns
from ..run_source import RunSource, open_run
from ..runs import Run
from .clusters import ClusterSettings
from .metrics import Identity, Ospa, identity_metrics, ospa
from .observe import Observation, measurements, radar_state, truths_of
from .tracker import Track, Tracker, TrackerSettings

if TYPE_CHECKING:
    from ..pipeline import Frame

__all__ = ["TRACK_COLUMNS", "TrackRow", "Tracking", "observe_frame", "observe_run", "track"]

#: Detections slower than this over ground are not tracked unless asked for [m/s].
MIN_SPEED_MPS = 1.0
#: Integrated signal-to-noise ratio from which a true object is expected to be tracked [dB]: 3 dB over the 13 dB that
#: a steady echo needs for Pd = 0.9 at Pfa = 1e-3 in one cell.
EXPECTED_SNR_DB = 16.0


@dataclass(frozen=True)
class TrackRow:
    """A confirmed track in one frame; world axes, in the plane [m], [m/s].

    ``coasting``: predicted only, nothing was assigned. ``range_m``, ``azimuth_deg``: from the radar. ``object_id``:
    truth behind the last measurement, -1 none.
    """

    frame: int
    time_s: float
    track: int
    coasting: int
    x_m: float
    y_m: float
    vx_mps: float
    vy_mps: float
    std_x_m: float
    std_y_m: float
    length_m: float
    width_m: float
    range_m: float
    azimuth_deg: float
    detections: int
    object_id: int


TRACK_COLUMNS = tuple(TrackRow.__dataclass_fields__)


@dataclass(frozen=True)
class Tracking:
    """Tracks of one radar over a run, with what they are worth.

    Parameters
    ----------
    radar : str
    rows : tuple of TrackRow
    ospa : tuple of Ospa
        Frame by frame.
    identity : Identity
    frames : tuple of int
    tracks_of : mapping of int to tuple of int
        The tracks that follow each true object most, by its id; empty for one that none follows.
    cutoff_m, gate_m : float
        Of the metrics.
    """

    radar: str
    rows: tuple[TrackRow, ...]
    ospa: tuple[Ospa, ...]
    identity: Identity
    frames: tuple[int, ...]
    tracks_of: Mapping[int, tuple[int, ...]]
    cutoff_m: float
    gate_m: float

    def __repr__(self) -> str:
        numbers = {r.track for r in self.rows}
        return (
            f"Tracking({len(numbers)} tracks in {len(self.frames)} frames of {self.radar!r}, "
            f"OSPA {self.mean_ospa_m:.2f} m, {self.identity.switches} switches)"
        )

    @property
    def mean_ospa_m(self) -> float:
        """Mean OSPA distance over the frames [m]."""
        return float(np.mean([o.total for o in self.ospa])) if self.ospa else float("nan")

    def summary(self) -> dict[str, Any]:
        """Return the metrics as plain values."""
        return {
            "radar": self.radar,
            "frames": len(self.frames),
            "tracks": len({r.track for r in self.rows}),
            "ospa_m": self.mean_ospa_m,
            "ospa_place_m": float(np.mean([o.place for o in self.ospa])) if self.ospa else None,
            "ospa_number_m": float(np.mean([o.number for o in self.ospa])) if self.ospa else None,
            "ospa_cutoff_m": self.cutoff_m,
            "gate_m": self.gate_m,
            "tracks_of": {str(k): list(v) for k, v in self.tracks_of.items()},
        } | self.identity._asdict()

    def to_csv(self, path: str | os.PathLike[str]) -> Path:
        """Write the rows with their column names as header; numbers in full precision."""
        text = io.StringIO(newline="")
        writer = csv.writer(text, lineterminator="\n")
        writer.writerow(TRACK_COLUMNS)
        writer.writerows([repr(getattr(row, name)) for name in TRACK_COLUMNS] for row in self.rows)

        def write(file: IO[bytes]) -> None:
            file.write(text.getvalue().encode())

        return atomic_write(path, write)


def observe_frame(frame: Frame, scene: Scene) -> Observation:
    """Return a frame of the chain as the tracker takes it."""
    return _observation(scene, frame.radar, frame.frame, frame.time, frame.detections, frame.cube, frame.returns)


def observe_run(run: RunSource | Run | str | os.PathLike[str], *, radar: str | None = None) -> Iterator[Observation]:
    """Yield the frames of a run folder.

    Raises
    ------
    NotFoundError
        No such folder, or not a run.
    InputError
        No such radar; a run without a scene, whose ego motion is not known.
    """
    source = open_run(run, radars=None if radar is None else [radar])
    if source.scene is None:
        raise InputError(f"{source.root}: not rendered from a scene, so that the motion of the radar is not known")
    used = source.radars[0]
    for frame in used.frames:
        cube, returns = frame.cube(used.profile), frame.returns()
        if cube is None or returns is None:
            lost = "returns.npz, which has the truth" if returns is None else "cube.npz or maps.npz"
            raise InputError(
                f"{frame.folder}: the run kept no {lost}; run it with --write detections,returns,maps, or all parts"
            )
        yield _observation(source.scene, used.name, frame.index, frame.start_s, frame.detections(), cube, returns)


def _observation(
    scene: Scene, radar: str, frame: int, time: float, detections: Detections, cube: RadarCube, returns: Returns
) -> Observation:
    middle = time + cube.profile.frame_mid_s
    eye = radar_state(scene, radar, middle)
    moving = [item.id for group in (scene.actors, scene.point_targets) for item in group]
    return Observation(frame, middle, detections, eye, cube.profile, truths_of(returns, cube, eye, moving))


def track(
    observations: Iterable[Observation],
    *,
    radar: str = "",
    settings: TrackerSettings | None = None,
    grouping: ClusterSettings | None = None,
    min_speed_mps: float = MIN_SPEED_MPS,
    expected_snr_db: float = EXPECTED_SNR_DB,
    cutoff_m: float = 5.0,
    gate_m: float = 4.0,
) -> Tracking:
    """Track what the detections of a sequence show.

    Parameters
    ----------
    observations : iterable of Observation
        In ascending time, from :func:`observe_run` or :func:`observe_frame`.
    radar : str
        Its name.
    settings : TrackerSettings, optional
    grouping : ClusterSettings, optional
    min_speed_mps : float
        Detections slower than this over ground are left out, and so are true objects; 0 tracks what stands, too [m/s].
    expected_snr_db : float
        True objects below this are neither expected nor, where tracked, held against the tracker [dB].
    cutoff_m : float
        Of the OSPA distance [m].
    gate_m : float
        Farthest that a track may be from what it follows [m].

    Returns
    -------
    Tracking

    Examples
    --------
    >>> import shenron_rt as srt
    >>> scene = srt.load_scene("braking")
    >>> frames = [srt.simulate(scene, frame=k, time=0.1 * k) for k in range(9)]  # doctest: +SKIP
    >>> track(observe_frame(f, scene) for f in frames).identity.switches  # doctest: +SKIP
    0
    """
    chosen = settings or TrackerSettings()
    groups = grouping or ClusterSettings()
    tracker = Tracker(chosen)
    rows: list[TrackRow] = []
    truths: list[dict[int, FloatArray]] = []
    tracks: list[dict[int, FloatArray]] = []
    frames = []
    for seen in observations:
        found = measurements(seen, chosen, groups, min_speed_mps=min_speed_mps)
        alive = tracker.step(seen.time_s, found)
        frames.append(seen.frame)
        rows += [_row(seen, t) for t in alive]
        there, excused = _expected(seen, min_speed_mps, expected_snr_db)
        truths.append(there)
        tracks.append({t.number: t.state[:2] for t in alive if not _near(t.state[:2], excused, there, gate_m)})
    return Tracking(
        radar=radar,
        rows=tuple(rows),
        ospa=tuple(
            ospa(_array(found), _array(true), cutoff_m=cutoff_m) for found, true in zip(tracks, truths, strict=True)
        ),
        identity=identity_metrics(truths, tracks, gate_m=gate_m),
        frames=tuple(frames),
        tracks_of=_followers(truths, tracks, gate_m),
        cutoff_m=cutoff_m,
        gate_m=gate_m,
    )


def _expected(
    seen: Observation, min_speed_mps: float, snr_db: float
) -> tuple[dict[int, FloatArray], dict[int, FloatArray]]:
    """Return where the objects are that must be tracked, and those that need not but may be."""
    there: dict[int, FloatArray] = {}
    excused: dict[int, FloatArray] = {}
    for number, truth in seen.truths.items():
        strong = truth.snr_db >= snr_db and np.linalg.norm(truth.velocity) >= min_speed_mps
        (there if strong else excused)[number] = truth.position[:2]
    return there, excused


def _near(place: FloatArray, excused: Mapping[int, FloatArray], there: Mapping[int, FloatArray], gate_m: float) -> bool:
    """Tell whether a track belongs to an object that need not be tracked, and to none that must."""

    def close(places: Mapping[int, FloatArray]) -> bool:
        return any(np.linalg.norm(place - p) <= gate_m for p in places.values())

    return close(excused) and not close(there)


def _array(places: Mapping[int, FloatArray]) -> FloatArray:
    return np.array(list(places.values()), dtype=np.float64).reshape(-1, 2)


def _followers(
    truths: Sequence[Mapping[int, FloatArray]], tracks: Sequence[Mapping[int, FloatArray]], gate_m: float
) -> dict[int, tuple[int, ...]]:
    """Return the tracks within the gate of each object, the most faithful first."""
    count: dict[int, dict[int, int]] = {}
    for true, found in zip(truths, tracks, strict=True):
        for thing, place in true.items():
            mine = count.setdefault(thing, {})
            for number, where in found.items():
                if np.linalg.norm(place - where) <= gate_m:
                    mine[number] = mine.get(number, 0) + 1
    return {thing: tuple(sorted(mine, key=lambda k: -mine[k])) for thing, mine in count.items()}


def _row(seen: Observation, t: Track) -> TrackRow:
    arm = seen.radar.rotation.T @ np.append(t.state[:2] - seen.radar.origin[:2], 0.0)
    return TrackRow(
        frame=seen.frame,
        time_s=seen.time_s,
        track=t.number,
        coasting=int(t.misses > 0),
        x_m=float(t.state[0]),
        y_m=float(t.state[1]),
        vx_mps=float(t.state[2]),
        vy_mps=float(t.state[3]),
        std_x_m=float(np.sqrt(t.covariance[0, 0])),
        std_y_m=float(np.sqrt(t.covariance[1, 1])),
        length_m=t.last.size_m[0],
        width_m=t.last.size_m[1],
        range_m=float(np.linalg.norm(arm)),
        azimuth_deg=float(np.degrees(np.arctan2(arm[1], arm[0]))),
        detections=0 if t.misses else t.last.detections,
        object_id=t.last.object_id,
    )
