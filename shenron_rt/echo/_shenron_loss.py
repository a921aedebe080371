"""The scattered power of one LiDAR point in the public C-Shenron code, term by term.

Functions of arrays, in double precision. The term names are physical; the constants and the way the released code
multiplies them are its own. Formulas: Shenron (IEEE RA-L 9(2), 2024) and the released implementation.
"""

from __future__ import annotations

import math

import numpy as np

from .._typing import ArrayLike, FloatArray, IntArray
from ._shenron_tables import PERMITTIVITY, ROUGHNESS_M

__all__ = [
    "GAIN", "K_SQUARED", "LIGHT_SPEED", "LOBE_EXPONENT", "LOBE_SHARE", "SCATTER_GAIN", "SPECULAR_GAIN",
    "SPECULAR_HALF_ANGLE", "VOXEL", "coherent_share", "incident_power", "lobe", "reflectance", "released_loss",
    "released_terms",
]  # fmt: skip

#: Speed of light of the public code [m/s].
LIGHT_SPEED = 3.0e8
#: System gain of both released profiles, 105 dB.
GAIN = 10**10.5
#: Density constant of the incident power.
K_SQUARED = 3282.0
#: Surfel of a point in azimuth and in polar angle, whatever the LiDAR's grid is [rad].
VOXEL = math.radians(2.0)
#: Half-angle of the specular mask [rad].
SPECULAR_HALF_ANGLE = math.radians(2.0)
#: Share of the forward lobe and the exponent of its cosine.
LOBE_SHARE, LOBE_EXPONENT = 0.9, 8
#: Unexplained factors of the released code on the scattered and on the specular power.
SCATTER_GAIN, SPECULAR_GAIN = 100.0 * 25.0 / 9.0, 4.0 * 100.0 * 25.0 / 9.0


def incident_power(polar_angle: ArrayLike) -> FloatArray:
    """Return the incident power of a point: K^2 sin(el) dphi dtheta; the surfel's rho^2 and the spreading cancel.

    Parameters
    ----------
    polar_angle : array_like
        Angle from the upward vertical [rad].
    """
    power: FloatArray = K_SQUARED * VOXEL * VOXEL * np.sin(np.asarray(polar_angle, dtype=np.float64))
    return power


def reflectance(permittivity: ArrayLike, angle: ArrayLike) -> tuple[FloatArray, FloatArray]:
    """Return Fresnel power reflectances of a lossless half-space.

    Parameters
    ----------
    permittivity : array_like
        Real relative permittivity, >= 1.
    angle : array_like
        Angle of incidence [rad].

    Returns
    -------
    te, tm : arrays of the broadcast shape, 0 to 1
    """
    eps, a = np.asarray(permittivity, dtype=np.float64), np.asarray(angle, dtype=np.float64)
    cos = np.abs(np.cos(a))
    root = np.sqrt(eps - np.sin(a) ** 2)
    te = ((cos - root) / (cos + root)) ** 2
    tm = ((eps * cos - root) / (eps * cos + root)) ** 2
    return te, tm


def coherent_share(roughness_m: ArrayLike, angle: ArrayLike, frequency_hz: float) -> FloatArray:
    """Return exp(-(4 pi s cos(a) f/c)^2 / 2), the factor of the coherent *amplitude*; the released code's power share.

    Parameters
    ----------
    roughness_m : array_like
        RMS height [m].
    angle : array_like
        Angle of incidence [rad].
    frequency_hz : float
    """
    phase = 4 * math.pi * np.asarray(roughness_m) * np.abs(np.cos(angle)) * frequency_hz / LIGHT_SPEED
    share: FloatArray = np.exp(-0.5 * phase**2)
    return share


def lobe(angle: ArrayLike) -> FloatArray:
    """Return the scattering lobe towards the radar, (0.9 cos^8(a) + 0.1) / 1.09; 1/1.09 at normal incidence."""
    value: FloatArray = (LOBE_SHARE * np.abs(np.cos(angle)) ** LOBE_EXPONENT + (1 - LOBE_SHARE)) / 1.09
    return value


def released_terms(
    angle: ArrayLike, polar_angle: ArrayLike, material: IntArray, frequency_hz: float
) -> tuple[FloatArray, FloatArray]:
    """Return the scattered and the specular power of points.

    Parameters
    ----------
    angle : (n,) array_like
        What is taken for the angle of incidence [rad]. The released pipeline passes the *cosine* of it.
    polar_angle : (n,) array_like
        Angle from the upward vertical [rad].
    material : (n,) integer array
        0 to 4, see :data:`~shenron_rt.echo._shenron_tables.MATERIALS`.
    frequency_hz : float
        Start frequency of the chirp.

    Returns
    -------
    scattered, specular : (n,) float
        Before the 1/rho^2 of the way back; units of the public code.
    """
    a = np.asarray(angle, dtype=np.float64)
    reflected = incident_power(polar_angle) * reflectance(PERMITTIVITY[material], a)[0]
    coherent = coherent_share(ROUGHNESS_M[material], a, frequency_hz)
    scattered = reflected * (1 - coherent) * lobe(a) ** 2 * SCATTER_GAIN
    specular = reflected * coherent * (np.abs(a) < SPECULAR_HALF_ANGLE) * SPECULAR_GAIN
    return scattered, specular


def released_loss(
    angle: ArrayLike,
    polar_angle: ArrayLike,
    material: IntArray,
    frequency_hz: float,
    *,
    specular: bool = False,
    diffuse: bool = True,
) -> FloatArray:
    """Return the power factor of points as the released pipeline has it: the scattered part alone, unless told.

    Parameters
    ----------
    angle, polar_angle, material, frequency_hz
        As for :func:`released_terms`.
    specular, diffuse : bool
        Which parts to add.

    Returns
    -------
    (n,) float
    """
    scattered, mirrored = released_terms(angle, polar_angle, material, frequency_hz)
    return np.asarray(mirrored * specular + scattered * diffuse)
