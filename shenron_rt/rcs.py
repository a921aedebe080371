"""One target on a turntable: radar cross section over frequency, elevation, azimuth and polarisation."""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any, Self

import numpy as np

from ._typing import ArrayLike, ComplexArray, FloatArray, IntArray
from .constants import SPEED_OF_LIGHT
from .errors import InputError, did_you_mean
from .io.npz import load_npz, save_npz
from .physics.fresnel import POLARIZATIONS, fresnel_cos
from .sbr.solver import Settings, scattered
from .sbr.surface import Reflector, Surface
from .sbr.views import Views
from .scene.mesh import TaggedMesh

__all__ = ["RcsSweep", "sweep_rcs"]

#: Least RCS reported [dBsm].
FLOOR_DBSM = -120.0
#: Rays per wavelength of the coarsest cells.
DEFAULT_RAYS_PER_WAVELENGTH = 1.0
#: How often cells that no tube and no clean cut fills may be quartered, by the widest target in cells of the lattice:
#: a corner is worth it, and costs little; a car has so many that the rest of their cells average out.
_LEVELS = ((160.0, 5), (450.0, 2), (700.0, 1), (math.inf, 0))
MOST_BOUNCES = 10
#: Near the radar cells are no wider than sqrt(lambda R / 512): at an edge the front within half a cell counts as flat,
#: and bends by lambda / 4096. A null of a trihedral at 1 m, 20 dB down, is off by 0.5 dB with cells of 24 GHz's lambda.
_FRONT = 512.0
#: Fields of a sweep that stay arrays when they are loaded.
_ARRAYS = ("amplitude", "frequency_hz", "elevation_deg", "azimuth_deg")


@dataclass(frozen=True, eq=False)
class RcsSweep:
    """Result of :func:`sweep_rcs`.

    Parameters
    ----------
    amplitude : (n_freq, n_el, n_az, n_pol) complex
        Scattering amplitude [m]; its modulus squared is the RCS. e^{+jwt}; a metal plate at the origin that faces the
        radar is positive real.
    frequency_hz : (n_freq,) float
    elevation_deg : (n_el,) float
    azimuth_deg : (n_az,) float
        Direction of the radar seen from the target; in a bistatic sweep that of the receiver.
    polarization : tuple of str
        Receive letter first.
    distance_m : float or None
        From the radar to the target's origin; None is the far field.
    bistatic_deg : (azimuth, elevation) or None
        Direction of the transmitter.
    max_bounces : int
    rays_per_wavelength : float
        Of the coarsest cells, at the highest frequency.
    target : str
        What was asked for, in words.
    seed : int
    """

    amplitude: ComplexArray
    frequency_hz: FloatArray
    elevation_deg: FloatArray
    azimuth_deg: FloatArray
    polarization: tuple[str, ...]
    distance_m: float | None = None
    bistatic_deg: tuple[float, float] | None = None
    max_bounces: int = 3
    rays_per_wavelength: float = DEFAULT_RAYS_PER_WAVELENGTH
    target: str = ""
    seed: int = 0

    def __post_init__(self) -> None:
        shape = (len(self.frequency_hz), len(self.elevation_deg), len(self.azimuth_deg), len(self.polarization))
        if self.amplitude.shape != shape:
            raise InputError(
                f"RcsSweep.amplitude: shape {shape} is needed (freq, el, az, pol), got {self.amplitude.shape}"
            )

    @property
    def rcs_m2(self) -> FloatArray:
        """(n_freq, n_el, n_az, n_pol) RCS [m^2]."""
        return np.asarray(np.abs(self.amplitude) ** 2)

    @property
    def rcs_dbsm(self) -> FloatArray:
        """(n_freq, n_el, n_az, n_pol) RCS [dBsm], at least -120."""
        return np.asarray(10.0 * np.log10(np.maximum(self.rcs_m2, 10.0 ** (FLOOR_DBSM / 10.0))))

    def save(self, path: str | os.PathLike[str]) -> Path:
        """Save every field, and ``rcs_dbsm``, to an ``.npz`` file; keys are the attribute names."""
        return save_npz(path, {f.name: getattr(self, f.name) for f in fields(self)} | {"rcs_dbsm": self.rcs_dbsm})

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> Self:
        """Load what :meth:`save` wrote.

        Raises
        ------
        NotFoundError, InputError
        """
        optional = {"distance_m": None, "bistatic_deg": None}  # left out of the file where they are None
        values: dict[str, Any] = optional | load_npz(path, [f.name for f in fields(cls) if f.name not in optional])
        plain = {k: v.tolist() for k, v in values.items() if v is not None and k not in _ARRAYS}
        plain |= {k: tuple(plain[k]) for k in ("polarization", "bistatic_deg") if k in plain}
        return cls(**{f.name: plain.get(f.name, values[f.name]) for f in fields(cls)})

    def to_csv(self, path: str | os.PathLike[str]) -> Path:
        """Write one row for each frequency, elevation and azimuth: RCS and phase of every polarisation."""
        from .io.rcs_table import write_rcs_table

        return write_rcs_table(
            path, self.frequency_hz, self.elevation_deg, self.azimuth_deg, self.polarization, self.amplitude, FLOOR_DBSM
        )

    def __repr__(self) -> str:
        where = "far field" if self.distance_m is None else f"{self.distance_m:g} m"
        n_f, n_el, n_az, _ = self.amplitude.shape
        dbsm = self.rcs_dbsm
        return (
            f"RcsSweep({self.target!r}, {n_f} frequencies x {n_el} elevations x {n_az} azimuths, "
            f"{'/'.join(self.polarization)}, {where}, {dbsm.min():.1f} to {dbsm.max():.1f} dBsm)"
        )


def sweep_rcs(
    target: TaggedMesh | str | os.PathLike[str],
    *,
    frequency_hz: ArrayLike,
    azimuth_deg: ArrayLike,
    elevation_deg: ArrayLike = 0.0,
    polarization: str | Sequence[str] = ("VV",),
    distance_m: float | None = None,
    max_bounces: int = 3,
    rays_per_wavelength: float | None = None,
    bistatic: tuple[float, float] | None = None,
    material: str | None = "metal",
    permittivity: complex | None = None,
    mesh_frame: str | ArrayLike = "ros_z_up",
    units: str | float = "m",
    seed: int = 0,
    backend: str = "auto",
    progress: Callable[[float], None] | None = None,
) -> RcsSweep:
    """Compute the radar cross section of one target by shooting and bouncing rays with physical optics.

    Parameters
    ----------
    target : TaggedMesh, shape text or mesh file
        Shapes as in :func:`~shenron_rt.scene.shapes.make_shape`: ``"sphere:r=0.1"``.
    frequency_hz : float or (n_freq,)
        [Hz].
    azimuth_deg, elevation_deg : float or (n,)
        Direction of the radar seen from the target's origin; 0 is +x, positive toward +y (left) and +z. Every pair of
        the two is computed.
    polarization : str or sequence of {"VV", "HH", "HV", "VH"}
        Receive letter first. V is the unit vector of increasing elevation, H of increasing azimuth, on both legs.
    distance_m : float, optional
        From the radar to the target's origin: spherical waves, apparent RCS. Default: plane waves.
    max_bounces : int
        Surfaces along a path, 1 to 10.
    rays_per_wavelength : float, optional
        Of the coarsest cells, at the highest frequency; cells at edges are cut finer. With a ``distance_m`` D below 512
        wavelengths, cells for each sqrt(wavelength D / 512) in place of each wavelength. Default 1.
    bistatic : (azimuth_deg, elevation_deg), optional
        Direction of a transmitter that stays; the sweep is then the receiver's.
    material : str or None
        Name in the material table ``automotive``; ``"metal"`` is a perfect conductor. None: every part as its own
        material, or that of its tag, says.
    permittivity : complex, optional
        eps' - j eps'' of an opaque half-space, in place of the material.
    mesh_frame, units
        For mesh files; see :func:`~shenron_rt.scene.readers.read_mesh`.
    seed : int
        Of the shift of the lattice of rays.
    backend : str
        ``"auto"``, ``"cuda"``, ``"llvm"`` or ``"scalar"``.
    progress : callable, optional
        Is told the share of the rays that is done, in [0, 1].

    Returns
    -------
    RcsSweep

    Raises
    ------
    InputError
        An unknown polarisation or material, an axis that is empty or not finite, a radar inside the target, and what
        shapes and mesh readers raise.
    BackendError
        The backend asked for is not usable here.

    Notes
    -----
    amplitude = (2 sqrt(pi)/lambda) sum over bounces of the integral of (-Gamma cos) exp(-jk(path)) dA, prefactor j
    dropped, phase referred to the target's origin. Not in the model: diffraction at edges, creeping waves, penetration.

    References
    ----------
    .. [1] H. Ling, R.-C. Chou, S.-W. Lee, "Shooting and bouncing rays: calculating the RCS of an arbitrarily shaped
       cavity", IEEE Trans. Antennas Propag. 37(2), 1989.

    Examples
    --------
    >>> sweep = sweep_rcs("plate:0.1x0.1", frequency_hz=77e9, azimuth_deg=[0.0, 5.0], max_bounces=1)
    >>> round(float(sweep.rcs_dbsm[0, 0, 0, 0]), 1)
    19.2
    """
    from .tracing.backend import choose_backend

    frequency, azimuth, elevation = (
        _axis(name, values)
        for name, values in (
            ("frequency_hz", frequency_hz), ("azimuth_deg", azimuth_deg), ("elevation_deg", elevation_deg)
        )
    )  # fmt: skip
    if frequency.min() <= 0.0:
        raise InputError(f"frequency_hz: {frequency.min():g}; allowed: > 0")
    wanted = _polarizations(polarization)
    if not 1 <= max_bounces <= MOST_BOUNCES:
        raise InputError(f"max_bounces: {max_bounces}; allowed: 1 to {MOST_BOUNCES}")
    density = DEFAULT_RAYS_PER_WAVELENGTH if rays_per_wavelength is None else float(rays_per_wavelength)
    if not (math.isfinite(density) and density > 0.0):
        raise InputError(f"rays_per_wavelength: {rays_per_wavelength}; allowed: > 0")
    name, surface = _surface(target, material, permittivity, mesh_frame, units, choose_backend(backend))
    el, az = (a.ravel() for a in np.meshgrid(np.radians(elevation), np.radians(azimuth), indexing="ij"))
    views = Views(az, el, distance_m)
    _check_distance(views, surface)
    step = cell_side(float(frequency.max()), density, distance_m)
    levels = next(n for width, n in _LEVELS if 2.0 * surface.radius <= width * step)
    settings = Settings(step, levels, max_bounces, seed)
    lit, receivers = (views, None) if bistatic is None else (_transmitter(bistatic, distance_m), views)
    _check_distance(lit, surface)
    matrix = scattered(surface, lit, frequency, settings, receivers, progress)
    pick = [("VH".index(p[0]), "VH".index(p[1])) for p in wanted]
    amplitude = np.stack([matrix[:, :, r, t] for r, t in pick], axis=2)
    return RcsSweep(
        amplitude.reshape(len(frequency), len(elevation), len(azimuth), len(wanted)),
        frequency,
        elevation,
        azimuth,
        wanted,
        distance_m,
        None if bistatic is None else (float(bistatic[0]), float(bistatic[1])),
        max_bounces,
        density,
        name,
        seed,
    )


def cell_side(frequency_hz: float, rays_per_wavelength: float, distance_m: float | None) -> float:
    """Return the side of the coarsest cells [m] for the highest frequency and the distance of the radar, if any."""
    wavelength = SPEED_OF_LIGHT / frequency_hz
    bent = math.inf if distance_m is None else math.sqrt(wavelength * max(distance_m, wavelength) / _FRONT)
    return min(wavelength, bent) / rays_per_wavelength


def _axis(name: str, values: ArrayLike) -> FloatArray:
    axis = np.atleast_1d(np.asarray(values, dtype=np.float64))
    if axis.ndim != 1 or not len(axis) or not np.isfinite(axis).all():
        raise InputError(f"{name}: a finite number or a list of them is needed, got {values!r}")
    return axis


def _transmitter(bistatic: tuple[float, float], distance: float | None) -> Views:
    place = np.radians(_axis("bistatic", bistatic))
    if len(place) != 2:
        raise InputError(f"bistatic: (azimuth_deg, elevation_deg) is needed, got {bistatic!r}")
    return Views(place[:1], place[1:], distance)


def _polarizations(wanted: str | Sequence[str]) -> tuple[str, ...]:
    names = (wanted,) if isinstance(wanted, str) else tuple(wanted)
    unknown = [p for p in names if p not in POLARIZATIONS]
    if unknown or not names:
        raise InputError(f"unknown polarization {unknown or names!r}; allowed: {', '.join(POLARIZATIONS)}")
    return names


def _surface(
    target: TaggedMesh | str | os.PathLike[str],
    material: str | None,
    permittivity: complex | None,
    mesh_frame: str | ArrayLike,
    units: str | float,
    backend: Any,
) -> tuple[str, Surface]:
    name, mesh = _mesh(target, mesh_frame, units)
    if permittivity is not None:
        eps = complex(permittivity)
        if not (math.isfinite(eps.real) and math.isfinite(eps.imag)) or eps.imag > 0.0:
            raise InputError(f"permittivity: {permittivity}; allowed: finite, eps' - j eps'' with eps'' >= 0")
        reflectors, kind = [Reflector(lambda _f, cos: fresnel_cos(eps, cos))], np.zeros(mesh.n_faces, dtype=np.int64)
    else:
        reflectors, kind = _reflectors(mesh, material)
    return name, Surface(mesh, tuple(reflectors), kind, backend)


def _mesh(
    target: TaggedMesh | str | os.PathLike[str], frame: str | ArrayLike, units: str | float
) -> tuple[str, TaggedMesh]:
    from .scene.readers import MESH_SUFFIXES, read_mesh
    from .scene.shapes import make_shape

    if isinstance(target, TaggedMesh):
        return target.parts[0].file or target.parts[0].label, target
    if not isinstance(target, str) or Path(target).suffix.lower() in MESH_SUFFIXES:
        return Path(target).name, read_mesh(target, mesh_frame=frame, units=units)
    return target.strip(), make_shape(target)


def _reflectors(mesh: TaggedMesh, material: str | None) -> tuple[list[Reflector], IntArray]:
    """Return the reflectors of a mesh, and the row of each face in them."""
    from .config.materials import load_materials

    table = load_materials()
    if material is not None:
        if material not in table.materials:
            raise InputError(f"unknown material {material!r}; {did_you_mean(material, table.materials)}")
        names = [material] * len(mesh.parts)
    else:
        names = [part.em_material or table.for_tag(part.tag.name) for part in mesh.parts]
    known = sorted(set(names))
    reflectors = [
        Reflector() if name == "metal" else Reflector(table[name].reflection, table[name].roughness_rms_m)
        for name in known
    ]
    return reflectors, np.array([known.index(n) for n in names], dtype=np.int64)[mesh.part]


def _check_distance(views: Views, surface: Surface) -> None:
    """Refuse a radar that has part of the target beside or behind it."""
    if views.distance is None:
        return
    used = surface.mesh.vertices[np.unique(surface.mesh.faces)]
    needed = float((used @ views.toward.T).max())
    if not (math.isfinite(views.distance) and views.distance > max(needed, 0.0)):
        raise InputError(
            f"distance_m: {views.distance}; the target reaches {needed:.3g} m towards the radar: allowed: more than "
            "that, or None for the far field"
        )
