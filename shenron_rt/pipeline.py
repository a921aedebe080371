"""The whole chain in one call: a scene, or a LiDAR frame, to detections."""

from __future__ import annotations

import functools
import logging
import os
from collections.abc import Callable, Iterable, Iterator
from dataclasses import KW_ONLY, dataclass, replace
from typing import TYPE_CHECKING, TypedDict

from .config.profile import RadarProfile
from .config.scene import RadarMount, Scene
from .dsp import Detections, RadarCube, detect, process
from .errors import InputError
from .frames import Pose
from .lidar.door import lidar_scatterers
from .lidar.frame import LidarFrame
from .retrace import segments
from .returns import Returns, illuminate
from .scatterers import Scatterers
from .synthesis import AdcCube, synthesize
from .synthesis.heard import heard_radars
from .synthesis.synthesize import synthesize_segments
from .tracing import trace

if TYPE_CHECKING:
    from collections.abc import Sequence

    from .echo.shenron import ShenronModel
    from .synthesis.interference import HeardRadar

__all__ = ["Frame", "SceneChain", "from_scatterers", "simulate", "simulate_all"]

_log = logging.getLogger(__name__)


class _Synthesis(TypedDict):
    noise: str | None
    seed: int
    frame: int
    accuracy: float
    radar: str
    interference: Sequence[HeardRadar]


@dataclass(frozen=True)
class Frame:
    """One frame of one radar, stage by stage.

    Parameters
    ----------
    scatterers, returns, adc, cube, detections
        What each stage made.
    profile : RadarProfile
        The profile that was used.
    seed : int
    backend : str
        What traced the rays.
    radar : str
        Name of the radar.
    time : float
        Scene seconds at the first chirp's start [s].
    frame : int
        Frame index.
    """

    scatterers: Scatterers
    returns: Returns
    adc: AdcCube
    cube: RadarCube
    detections: Detections
    profile: RadarProfile
    seed: int
    backend: str
    radar: str
    time: float
    frame: int

    def __repr__(self) -> str:
        return (
            f"Frame({self.frame} of radar {self.radar!r} at {self.time:g} s: {len(self.scatterers)} scatterers, "
            f"{len(self.returns)} returns, {len(self.detections)} detections)"
        )


def simulate(
    source: Scene | LidarFrame,
    profile: RadarProfile | None = None,
    *,
    radar: str | None = None,
    time: float = 0.0,
    seed: int | None = None,
    frame: int = 0,
    rays: int = 300_000,
    max_bounces: int | None = None,
    model: str | ShenronModel = "physical",
    noise: str | None = "thermal",
    mount: Pose | None = None,
    backend: str = "auto",
    accuracy: float = 1e-5,
    previous: Frame | None = None,
    retrace: int = 1,
) -> Frame:
    """Render one frame of one radar.

    Parameters
    ----------
    source : Scene or LidarFrame
        Of a LiDAR frame the points are the scatterers; nothing is traced. The ``physical`` model estimates
        normals unless the frame has some (:meth:`LidarFrame.without_normals` keeps the recorded cosines).
    profile : RadarProfile, optional
        Replaces the radar's profile and keeps its mount. A LiDAR frame needs one.
    radar : str, optional
        Which radar; needed where the scene has several. With a LiDAR frame: a name for it, by default the profile's.
    time : float
        Scene seconds at the first chirp's start [s].
    seed : int, optional
        Default: the scene's; 0 for a LiDAR frame.
    frame : int
        Frame index; random numbers derive from (seed, frame, radar).
    rays, max_bounces, backend
        As for :func:`shenron_rt.trace`.
    model : str or ShenronModel
        Echo model, as for :func:`shenron_rt.illuminate`.
    noise : str or None
        ``"thermal"``, or ``None`` for none.
    mount : Pose, optional
        Replaces the radar's pose in the ego frame. With a LiDAR frame: default (2, 0, 1) m; needs its ``sensor_pose``.
    accuracy : float
        Of the ADC synthesis, relative to the RMS of the noise-free cube.
    previous : Frame, optional
        An earlier frame of the same radar, from which ``processing.ambiguity: two_frame`` unfolds velocities.
    retrace : int
        Segments of the frame at whose middles the scene is traced again, up to the number of loops; 1 is mid-frame
        only, from where everything moves in straight lines. A LiDAR frame has one instant only.

    Returns
    -------
    Frame

    Raises
    ------
    InputError
        Several radars and none named, a LiDAR frame without a profile, or what the stages raise.

    Examples
    --------
    >>> import shenron_rt as srt
    >>> scene = srt.Scene(point_targets=[{"id": 1, "xyz_m": (30, 0, 1), "rcs_dbsm": 10}])
    >>> frame = srt.simulate(scene)  # doctest: +SKIP
    """
    if isinstance(source, LidarFrame):
        if profile is None:
            raise InputError(
                "simulate: a LiDAR frame has no radar; give a profile, load_profile('awrl1432') for example"
            )
        name = radar or profile.name
        if source.normal is None and model == "physical":  # metal is nothing but its mirror points
            source = source.with_normals()
        scatterers = lidar_scatterers(source, profile, mount, radar=name, seed=seed or 0, index=frame)
        return from_scatterers(
            scatterers, profile, "automotive", time=time, model=model, noise=noise, accuracy=accuracy, previous=previous
        )
    if not isinstance(source, Scene):
        raise InputError(f"simulate: a Scene is needed, got {type(source).__name__}; a LidarFrame is taken too")
    place = source.radar(radar)
    if mount is not None:
        place = place.model_copy(update={"xyz_m": mount.xyz, "ypr_deg": mount.ypr_deg})
        source = source.model_copy(update={"radars": (place,)})
    chain = SceneChain(
        source, place, profile or source.profile_of(place), seed=seed, rays=rays, max_bounces=max_bounces,
        backend=backend, model=model, noise=noise, accuracy=accuracy, retrace=retrace,
    )  # fmt: skip
    return chain.frame(frame, time, previous)


@dataclass(frozen=True)
class SceneChain:
    """One radar of a scene, and how its frames are made: single ones, sequences and those that share their rays.

    Parameters
    ----------
    scene : Scene
    mount : RadarMount
        The radar; one of the scene's.
    profile : RadarProfile
        Used in place of the mount's own.
    seed, rays, max_bounces, backend, model, noise, accuracy, retrace
        As for :func:`simulate`.
    """

    scene: Scene
    mount: RadarMount
    profile: RadarProfile
    _: KW_ONLY
    seed: int | None
    rays: int
    max_bounces: int | None
    backend: str
    model: str | ShenronModel
    noise: str | None
    accuracy: float
    retrace: int

    def frame(self, index: int, time: float, previous: Frame | None = None) -> Frame:
        """Render the frame of an index that begins at scene seconds ``time``; the rest is as for :func:`simulate`."""
        scatterers = self.trace(index, time)
        if self.retrace == 1:
            return self.finish(scatterers, time, previous)
        light = functools.partial(illuminate, model=self.model, materials=self.scene.materials)

        def several(returns: Returns) -> Iterator[tuple[RadarProfile, Returns]]:
            def look(part: RadarProfile, start: float) -> Scatterers:
                return replace(self, profile=part).trace(index, time + start)

            return segments(self.profile, returns, self.retrace, look, light)

        return self.finish(scatterers, time, previous, several)

    def trace(self, index: int, time: float) -> Scatterers:
        """Cast the rays of a frame."""
        return trace(
            self.scene, self.profile, radar=self.mount.name, time=time, seed=self.seed, frame=index, rays=self.rays,
            max_bounces=self.max_bounces, backend=self.backend,
        )  # fmt: skip

    def finish(
        self,
        scatterers: Scatterers,
        time: float,
        previous: Frame | None = None,
        segments_of: Callable[[Returns], Iterable[tuple[RadarProfile, Returns]]] | None = None,
    ) -> Frame:
        """Return the frame of scatterers that this radar's rays met; the rest is as for :func:`from_scatterers`."""
        heard = heard_radars(
            self.scene, self.mount, self.profile, time=time, seed=scatterers.seed, frame=scatterers.frame
        )
        return from_scatterers(
            scatterers, self.profile, self.scene.materials, time=time, model=self.model, noise=self.noise,
            accuracy=self.accuracy, previous=previous, interference=heard, segments_of=segments_of,
        )  # fmt: skip


def from_scatterers(
    scatterers: Scatterers,
    used: RadarProfile,
    materials: str | os.PathLike[str],
    *,
    time: float,
    model: str | ShenronModel,
    noise: str | None,
    accuracy: float,
    previous: Frame | None = None,
    interference: Sequence[HeardRadar] = (),
    segments_of: Callable[[Returns], Iterable[tuple[RadarProfile, Returns]]] | None = None,
) -> Frame:
    """Return the frame that scatterers give: the chain from there on is the same behind both doors.

    Parameters
    ----------
    scatterers : Scatterers
        Of one frame and radar; they carry its seed, number and name.
    used : RadarProfile
    materials : str or path
        Material table of the scene.
    time : float
        Scene seconds at the first chirp's start [s].
    model, noise, accuracy, previous
        As for :func:`simulate`.
    interference : sequence of HeardRadar
        Other radars that this one hears.
    segments_of : callable, optional
        Gives the echoes of parts of the frame from those of mid-frame; see :mod:`shenron_rt.retrace`.
    """
    seed, frame, radar = scatterers.seed, scatterers.frame, scatterers.radar
    returns = illuminate(scatterers, used, model=model, materials=materials)
    if not returns.calibrated:
        _log.warning(
            "echo model %s gives the counts of the released code, not watts: levels in dBm, SNR and RCS mean nothing",
            returns.model,
        )
    options = _Synthesis(noise=noise, seed=seed, frame=frame, accuracy=accuracy, radar=radar, interference=interference)
    if segments_of is None:
        adc = synthesize(returns, used, **options)
    else:
        adc = synthesize_segments(segments_of(returns), used, returns, **options)
    settings = used.processing
    cube = process(adc, range_window=settings.range_window, doppler_window=settings.doppler_window)
    detections = detect(
        cube,
        pfa=settings.pfa,
        blanking_m=settings.blanking_m,
        ambiguity=settings.ambiguity,
        previous=None if previous is None else previous.detections,
        interval_s=None if previous is None else time - previous.time,
    )
    return Frame(
        scatterers=scatterers,
        returns=returns,
        adc=adc,
        cube=cube,
        detections=detections,
        profile=used,
        seed=seed,
        backend=scatterers.backend,
        radar=radar,
        time=time,
        frame=frame,
    )


def simulate_all(source: Scene, **options: object) -> dict[str, Frame]:
    """Render one frame of every radar of a scene; the options are those of :func:`simulate`.

    Returns
    -------
    dict of str to Frame
        By radar name, in the scene's order.
    """
    render = functools.partial(simulate, source, **options)  # type: ignore[arg-type]
    return {mount.name: render(radar=mount.name) for mount in source.radars}
