"""One call from C-Shenron's point list to its ADC samples and images."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from .._typing import ArrayLike, ComplexArray, FloatArray
from ..config.profile import RadarProfile, load_profile
from ..echo._shenron_loss import released_loss
from ..echo._shenron_tables import released_material_of_tag
from ..echo.shenron import ShenronModel
from ..errors import InputError
from ..frames import Pose
from ..lidar.grid import LidarGrid
from ..randomness import frame_generator
from ..returns import illuminate
from ..scatterers import Scatterers
from ..synthesis import synthesize
from ..tags import tag_table
from . import dsp
from .layout import VIEWS_DEG, check_points, view_points
from .place import DEFAULT_GRID, DEFAULT_LIDAR, DEFAULT_MOUNTS, place_points
from .radar import ReleasedRadar
from .synthesis import synthesize_released

__all__ = ["NOISE_COUNTS", "ShenronRadarModel"]

#: Noise of one ADC sample of a measured TI cascade at the released gain, RMS in counts.
NOISE_COUNTS = 67.2


class ShenronRadarModel:
    """The radar of C-Shenron: points in, ADC samples, images and the four-view composite out.

    Parameters
    ----------
    profile : str, path or RadarProfile
        ``"ti_cascade"``, ``"radarbook"`` or any other.
    preset : str or ShenronModel
        ``"as_released"``: the numbers of the public code. ``"corrected"``, or any mixture that
        :meth:`~shenron_rt.echo.shenron.ShenronModel.parse` reads: the formulas corrected, through the synthesis of
        this package.
    tags : str
        Numbering of the tags in the points. The released table is written for ``"0.9.13"``; others come to it by what
        they mean.
    mounts : mapping of int to Pose, optional
        The radar of each view in the ego frame (x forward, y left), by view [deg]; default: two bumpers and two sides.
    grid : LidarGrid
        The LiDAR behind the points, which gives each its surface; default: that of C-Shenron.
    lidar : Pose
        It in the ego frame.
    seed : int
        Of noise and phases.

    Raises
    ------
    InputError, NotFoundError
        Unknown profile, preset or numbering; antennas that are no uniform line, but for ``as_released``, which takes
        any number of channels for one.

    Examples
    --------
    >>> model = ShenronRadarModel("ti_cascade")
    >>> model([[20.0, 1.0, 0.5, 0.9, 7, 10]]).shape
    (3, 86, 256)
    """

    def __init__(
        self,
        profile: str | RadarProfile = "ti_cascade",
        preset: str | ShenronModel = "as_released",
        *,
        tags: str = "0.9.13",
        mounts: Mapping[int, Pose] | None = None,
        grid: LidarGrid = DEFAULT_GRID,
        lidar: Pose = DEFAULT_LIDAR,
        seed: int = 0,
    ) -> None:
        self.profile = profile if isinstance(profile, RadarProfile) else load_profile(profile)
        self.model = preset if isinstance(preset, ShenronModel) else ShenronModel.parse(preset)
        tag_table(tags)  # refuses an unknown name
        if not self.released and not _is_line(self.profile):
            raise InputError(
                f"profile {self.profile.name!r}: images need antennas in one horizontal line, half a wavelength apart; "
                "take a profile with array.line, or shenron_rt.process for the map of any array"
            )
        self.tags, self.grid, self.lidar, self.seed = tags, grid, lidar, seed
        self.mounts = dict(DEFAULT_MOUNTS if mounts is None else mounts)

    @property
    def released(self) -> bool:
        """Whether the numbers are those of the public code."""
        return self.model == ShenronModel.as_released()

    def scatterers(self, points: ArrayLike, *, view: int = 0, frame: int = 0) -> Scatterers:
        """Return the points before the radar of a view, in its frame; without crop."""
        if self.model.mount and view not in self.mounts:
            raise InputError(f"no mount for view {view}; mounts are given for {sorted(self.mounts)}")
        mount = self.mounts[view] if self.model.mount else Pose(ypr_deg=(-float(view), 0.0, 0.0))
        placed = place_points(points, mount, tags=self.tags, grid=self.grid, lidar=self.lidar, own_car=self.model.mount)
        return replace(placed, seed=self.seed, frame=frame, radar=f"view{view}")

    def __call__(self, points: ArrayLike, *, view: int = 0, frame: int = 0) -> ComplexArray:
        """Return the ADC samples of one view.

        Parameters
        ----------
        points : (n, 6) or (n, 7) array_like
            ``[x, y, z, cos, id, tag]``, or with the radial speed last (positive = receding, relative to the radar);
            x forward, y right, z up from the ground under the vehicle [m].
        view : int
            0 front, 90 right, 180 rear, 270 left [deg].
        frame : int
            What noise and phases derive from beside the seed.

        Returns
        -------
        (chirps, antennas, samples) complex128
            Counts of the released code, or sqrt(W) where the model is calibrated. Antennas run to the left, as in the
            released code, so that angles to the right are positive; :class:`~shenron_rt.AdcCube` has them the other
            way.

        Raises
        ------
        InputError
            Points of the wrong form, unknown tags, a view without mount.
        """
        if self.released:
            return self._released(points, view)
        noise = self.model.noise_per_chirp
        echoes = illuminate(self.scatterers(points, view=view, frame=frame), self.profile, model=self.model)
        thermal = "thermal" if noise and self.model.calibrated else None
        adc = synthesize(echoes, self.profile, noise=thermal, seed=self.seed, frame=frame, radar=f"view{view}").data
        adc = adc[:, ::-1]
        if noise and not self.model.calibrated:
            adc = adc + _counts(adc.shape, frame_generator(self.seed, frame, f"view{view}", "noise"))
        return adc

    def _released(self, points: ArrayLike, view: int) -> ComplexArray:
        material = None
        if tag_table(self.tags) is not tag_table("0.9.13"):  # the released table, by what the tags mean
            numbers = check_points(points)[:, 5].astype(np.int64)
            material = released_material_of_tag(tag_table(self.tags).translate(numbers))
        kept, radar = view_points(points, view, material), ReleasedRadar.of(self.profile)
        loss = released_loss(kept.cosine, kept.polar_angle, kept.material, radar.start_hz)
        return synthesize_released(radar, kept.rho, kept.theta, loss)  # the released code sets the speed to zero

    def image(self, points: ArrayLike, *, view: int = 0, frame: int = 0) -> FloatArray:
        """Return the Cartesian image of one view, (256, 256): row 0 is 37.5 m ahead, the last column 37.5 m right.

        The released preset has the released range bin of 150/256 m; the others that of the profile.
        """
        polar = dsp.range_angle(self(points, view=view, frame=frame))
        if self.released:
            return dsp.cartesian_image(polar)
        samples = self.profile.waveform.samples
        return dsp.cartesian_image(polar, range_bin_m=self.profile.range_resolution_m * samples / dsp.N_RANGE)

    def fblr(self, points: ArrayLike, *, frame: int = 0) -> FloatArray:
        """Return the composite of the four views, (256, 256): ahead is up, the vehicle in the middle."""
        return dsp.fblr(*(self.image(points, view=v, frame=frame) for v in VIEWS_DEG))


def _is_line(profile: RadarProfile) -> bool:
    """Whether the virtual channels step half a wavelength to the right, as C-Shenron's do."""
    expected = np.zeros((profile.n_virtual, 3))
    expected[:, 1] = -profile.half_wavelength_m * np.arange(profile.n_virtual)
    return bool(np.allclose(profile.positions_m, expected, atol=0.01 * profile.half_wavelength_m))


def _counts(shape: tuple[int, ...], generator: np.random.Generator) -> ComplexArray:
    """Return circular complex noise of :data:`NOISE_COUNTS`, new for every sample, antenna and chirp."""
    draw = generator.standard_normal((*shape, 2)).view(np.complex128)[..., 0]
    noise: ComplexArray = draw * (NOISE_COUNTS / np.sqrt(2))
    return noise
