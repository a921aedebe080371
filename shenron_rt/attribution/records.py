"""What an explanation is made of: plain frozen values, ready for JSON."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from typing import Any, Literal

__all__ = [
    "VERDICTS",
    "Cell",
    "FrameExplanation",
    "ObjectExplanation",
    "Peak",
    "Share",
    "Stage",
    "Verdict",
    "Waterfall",
]

VerdictName = Literal[
    "detected", "below noise", "masked", "outside the beam", "ambiguous in Doppler", "occluded", "specular away",
    "blanked", "absent",
]  # fmt: skip

#: What each verdict says.
VERDICTS: dict[str, str] = {
    "detected": "a detection is the object's by the echoes in its cell",
    "below noise": "the object alone stays under the threshold that noise alone sets",
    "masked": "the object alone would be detected, beside another one it is not",
    "outside the beam": "on the antenna's axis the same echo would be over the threshold",
    "ambiguous in Doppler": "folding puts it into the Doppler cells of something that moves otherwise",
    "occluded": "something stands between; without it the echo would be over the threshold",
    "specular away": "its surface mirrors the wave elsewhere; an isotropic one of its area would be over the threshold",
    "blanked": "it is nearer than the processing looks",
    "absent": "no part of it was met by a ray, and no other cause was found",
}


@dataclass(frozen=True)
class Stage:
    """One line of a waterfall: what it adds [dB], and the level after it, in dBm or, once over noise, dB."""

    name: str
    gain_db: float
    level: float
    unit: Literal["dBm", "dB"]
    note: str = ""


@dataclass(frozen=True)
class Waterfall:
    """From transmit power to the signal-to-noise ratio of a cell; a stage's ``level`` is the sum of the gains up to it.

    Parameters
    ----------
    stages : tuple of Stage
    received_dbm : float
        Power a channel, mean over the object's noise-free samples.
    sample_snr_db : float
        Over the noise of one sample.
    object_snr_db : float
        The object alone in the cell, beamformed, over the expected noise there.
    measured_snr_db : float
        The same of the frame's own cube.
    rest_db : float
        Power of what neither object nor others explain, over the expected noise in the beamformed cell [dB].
    closes : bool
        Whether that rest is what noise may be: below ``limit_db``, which exponential noise passes once in 1e4 cells.
    limit_db : float
    """

    stages: tuple[Stage, ...]
    received_dbm: float
    sample_snr_db: float
    object_snr_db: float
    measured_snr_db: float
    rest_db: float
    closes: bool
    limit_db: float


@dataclass(frozen=True)
class Cell:
    """The cell an object is looked for in: indices, and what the beam points at (angles [deg])."""

    row: int
    column: int
    range_m: float
    velocity_mps: float
    azimuth_deg: float
    elevation_deg: float | None


@dataclass(frozen=True)
class Share:
    """What one object (or noise, id -1) puts into a cell, mean over the channels, and into its threshold [dBm]."""

    object_id: int
    name: str
    cell_dbm: float
    threshold_dbm: float


@dataclass(frozen=True)
class Verdict:
    """Why an object is seen or not.

    Parameters
    ----------
    name : str
        One of :data:`VERDICTS`.
    by : str
        What masks or hides it; empty otherwise.
    text : str
        The verdict as a phrase.
    numbers : mapping
        What proves it; units in the names.
    change : str
        The one change that would make it visible; empty where it is.
    """

    name: VerdictName
    text: str
    numbers: Mapping[str, Any] = field(default_factory=dict)
    change: str = ""
    by: str = ""


@dataclass(frozen=True)
class ObjectExplanation:
    """One object in one frame.

    Parameters
    ----------
    object_id, name, tag
    rows : int
        Scatterers of it: rays that met it, LiDAR points, or 1 of a visible point target.
    visible_area_m2, projected_area_m2 : float
        Surface those rows stand for, and what of it faces the radar.
    range_m, azimuth_deg, elevation_deg, velocity_mps : float or None
        Where it is: mean over its echoes by power, else over its unhidden surface by area.
    power_dbm : float or None
        Received power at mid-frame, as ``Returns.power_by_object``, of the echoes that show the object where it is.
    detections : tuple of int
        Rows of the frame's detections that are its.
    labels : tuple of str
        Of those: ``direct``, ``ghost`` with its chain of objects, ``folded``.
    cell, threshold_dbm, noise_threshold_dbm, cell_dbm
        The cell, the CFAR threshold there, the one that noise alone would set, the measured power, channel mean.
    shares : tuple of Share
        Who else is in the cell, strongest first.
    waterfall : Waterfall or None
        ``None`` without an echo.
    verdict : Verdict
    """

    object_id: int
    name: str
    tag: str | None
    rows: int
    visible_area_m2: float | None
    projected_area_m2: float | None
    range_m: float | None
    azimuth_deg: float | None
    elevation_deg: float | None
    velocity_mps: float | None
    power_dbm: float | None
    detections: tuple[int, ...]
    labels: tuple[str, ...]
    cell: Cell | None
    cell_dbm: float | None
    threshold_dbm: float | None
    noise_threshold_dbm: float | None
    shares: tuple[Share, ...]
    waterfall: Waterfall | None
    verdict: Verdict


@dataclass(frozen=True)
class Peak:
    """The strongest cell of the range-azimuth map, and whose it is: the object that leaves most in it."""

    range_m: float
    azimuth_deg: float
    level_dbm: float
    object_id: int
    name: str


@dataclass(frozen=True)
class FrameExplanation:
    """All objects of one frame of one radar; ``detection_labels`` tells of every detection what it is."""

    radar: str
    frame: int
    time_s: float
    objects: tuple[ObjectExplanation, ...]
    detection_labels: tuple[str, ...]
    strongest: Peak | None = None

    def __repr__(self) -> str:
        seen = sum(o.verdict.name == "detected" for o in self.objects)
        return f"FrameExplanation(frame {self.frame} of {self.radar!r}: {seen} of {len(self.objects)} objects detected)"

    def of(self, object_id: int) -> ObjectExplanation:
        """Return one object's explanation; KeyError where the frame has no such object."""
        found = {o.object_id: o for o in self.objects}
        return found[object_id]

    def to_dict(self) -> dict[str, Any]:
        """Return everything as plain values."""
        return asdict(self)
