"""The mirror-like part of surfaces that come as points with normals, not as tubes with footprints.

Without footprints there is no phase to integrate. Geometric optics still gives the power: a surface whose slopes
spread by s reflects sigma0 = |Gamma|^2 sec^4(theta) exp(-tan^2(theta) / 2 s^2) / (2 s^2) per area. Summed over an
infinite plate at distance h that is pi h^2 |Gamma|^2 for every s, and over a sphere pi a^2 |Gamma|^2 (far away), as
physical optics has it. The spread only has to cover the angle between neighbouring points.

Interference between the mirrors of a body needs their phases and is missing: this is the mean over attitudes a few
degrees apart, which a single one departs from by several dB.

References
----------
F. T. Ulaby, R. K. Moore, A. K. Fung, Microwave Remote Sensing, vol. 2, Artech House 1982, chapter 12.
"""

from __future__ import annotations

import math

import numpy as np

from .._typing import ComplexArray, FloatArray, IntArray
from ..physics.fresnel import backscatter_reflection
from ..scatterers import Scatterers

__all__ = ["GLINT_SLOPE", "cone_sigma0", "glint_sigma0", "points_sigma0"]

#: Spread s of the slopes, as tan: 2 degrees, the specular mask the users of the LiDAR pipeline settled on. Four times
#: the angle between the points of a 64-channel LiDAR.
GLINT_SLOPE = math.tan(math.radians(2.0))
#: Beyond so many spreads the exponential is below 2e-8.
_REACH = 6.0
#: Turns of an unknown normal about the line of sight, over half a circle; at 30 degrees from it they lie 2 degrees
#: apart, a spread.
_TURNS = 48


def points_sigma0(
    scatterers: Scatterers,
    rows: IntArray,
    te: ComplexArray,
    tm: ComplexArray,
    height_phase: FloatArray,
    polarization: str,
) -> FloatArray:
    """Return sigma0 of the mirror-like part of some points of a LiDAR.

    Parameters
    ----------
    scatterers : Scatterers
        Where ``normal`` is None there is no mirror-like part. A row whose normal is 0 0 0 has the one that the cosine
        recorded from ``origin`` says, :func:`cone_sigma0`, where ``slope`` is above 0.
    rows : (k,) int
    te, tm : (k,) complex
        Reflection of the rows' materials.
    height_phase : (k,) float
    polarization : str

    Returns
    -------
    (k,) float
        m^2 per m^2.
    """
    if scatterers.normal is None:
        return np.zeros(len(rows))
    position, normal = scatterers.position[rows], scatterers.normal[rows]
    direction = position / np.maximum(np.linalg.norm(position, axis=1), 1e-12)[:, None]
    slope = None if scatterers.slope is None else scatterers.slope[rows]
    sigma0 = glint_sigma0(te, tm, normal, direction, height_phase, polarization, slope)
    if slope is None or scatterers.origin is None or polarization[0] != polarization[1]:
        return sigma0  # of cross-polarised reflection a surface that faces the radar has none
    bare = np.flatnonzero(~np.any(normal != 0.0, axis=1) & (slope > 0.0))
    line = position[bare] - np.asarray(scatterers.origin)
    line /= np.maximum(np.linalg.norm(line, axis=1), 1e-12)[:, None]
    cosine = scatterers.cos_incidence[rows[bare]]
    sigma0[bare] = cone_sigma0(te[bare], tm[bare], cosine, line, direction[bare], height_phase[bare], slope[bare])
    return sigma0


def glint_sigma0(
    te: ComplexArray,
    tm: ComplexArray,
    normal: FloatArray,
    direction: FloatArray,
    height_phase: FloatArray,
    polarization: str,
    slope: FloatArray | None = None,
) -> FloatArray:
    """Return sigma0 of the mirror-like part.

    Parameters
    ----------
    te, tm : (n,) complex
        Reflection of the material.
    normal : (n, 3) float
        Unit normals; 0 0 0 gives 0.
    direction : (n, 3) float
        From the radar.
    height_phase : (n,) float
        k times the RMS height of the roughness, which takes exp(-(2 k s cos)^2) of the power.
    polarization : str
        ``"VV"``, ``"HH"`` ...
    slope : (n,) float, optional
        Spread of each row where it is more than :data:`GLINT_SLOPE`: points of a curved surface that are far apart.

    Returns
    -------
    (n,) float
        m^2 per m^2.
    """
    sigma0 = np.zeros(len(normal))
    cos = -np.einsum("ij,ij->i", normal, direction)
    spread = np.maximum(GLINT_SLOPE, 0.0 if slope is None else slope)
    near = np.flatnonzero(cos > 1.0 / np.sqrt(1.0 + (_REACH * spread) ** 2))
    c = np.minimum(cos[near], 1.0)
    gamma = backscatter_reflection(te[near], tm[near], normal[near], direction[near], polarization)
    width = 2.0 * np.broadcast_to(spread, cos.shape)[near] ** 2
    lobe = _lobe(c, width)
    sigma0[near] = np.abs(gamma) ** 2 * np.exp(-((2.0 * height_phase[near] * c) ** 2)) * lobe
    return sigma0


def cone_sigma0(
    te: ComplexArray,
    tm: ComplexArray,
    cosine: FloatArray,
    line: FloatArray,
    direction: FloatArray,
    height_phase: FloatArray,
    slope: FloatArray,
) -> FloatArray:
    """Return sigma0 of the mirror-like part where a LiDAR's cosine is known and the normal is not.

    The normal lies on a cone about the LiDAR's line of sight, anywhere with equal probability: this is the mean over
    the cone. Seen from the LiDAR's own place the cosine is all there is to know.

    Parameters
    ----------
    te, tm : (n,) complex
    cosine : (n,) float
        As the LiDAR recorded it.
    line, direction : (n, 3) float
        Unit vectors to the point from the LiDAR, and from the radar.
    height_phase : (n,) float
    slope : (n,) float

    Returns
    -------
    (n,) float
        m^2 per m^2; see :func:`glint_sigma0`.
    """
    sigma0 = np.zeros(len(cosine))
    apart = np.arccos(np.clip(np.einsum("ij,ij->i", line, direction), -1.0, 1.0))
    tilt = np.arccos(np.clip(cosine, 0.0, 1.0))
    spread = np.maximum(GLINT_SLOPE, slope)
    near = np.flatnonzero(np.abs(tilt - apart) < np.arctan(_REACH * spread))
    tilt, apart, spread = tilt[near, None], apart[near, None], spread[near, None]
    turn = (np.arange(_TURNS) + 0.5) * (np.pi / _TURNS)
    c = np.cos(tilt) * np.cos(apart) + np.sin(tilt) * np.sin(apart) * np.cos(turn)
    facing = c > 1.0 / np.sqrt(1.0 + (_REACH * spread) ** 2)
    c = np.where(facing, c, 1.0)  # what is left out must not divide by zero
    power = _lobe(c, 2.0 * spread**2) * np.exp(-((2.0 * height_phase[near, None] * c) ** 2))
    reflect = 0.5 * (np.abs(te[near]) ** 2 + np.abs(tm[near]) ** 2)
    sigma0[near] = reflect * np.mean(np.where(facing, power, 0.0), axis=1)
    return sigma0


def _lobe(cos: FloatArray, width: FloatArray) -> FloatArray:
    """Return sec^4 exp(-tan^2 / w) / w at a cosine, w = 2 s^2."""
    lobe: FloatArray = np.exp(-(1.0 / cos**2 - 1.0) / width) / (width * cos**4)
    return lobe
