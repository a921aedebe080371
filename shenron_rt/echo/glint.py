"""The mirror-like part of surfaces that come as points with normals, not as tubes with footprints.

Without footprints there is no phase to integrate. Geometric optics still gives the power: a surface whose slopes
spread by s reflects sigma0 = |Gamma|^2 sec^4(theta) exp(-tan^2(theta) / 2 s^2) / (2 s^2) per area. Summed over an
infinite plate at distance h that is pi h^2 |Gamma|^2 for every s, and over a sphere pi a^2 |Gamma|^2 (far away), as
physical optics has it. The spread only has to cover the angle between neighbouring points.

References
----------
F. T. Ulaby, R. K. Moore, A. K. Fung, Microwave Remote Sensing, vol. 2, Artech House 1982, chapter 12.
"""

from __future__ import annotations

import math

import numpy as np

from .._typing import ComplexArray, FloatArray
from ..physics.fresnel import backscatter_reflection

__all__ = ["GLINT_SLOPE", "glint_sigma0"]

#: Spread s of the slopes, as tan: 2 degrees, the specular mask the users of the LiDAR pipeline settled on. Four times
#: the angle between the points of a 64-channel LiDAR.
GLINT_SLOPE = math.tan(math.radians(2.0))


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
    # beyond 6 s the exponential is below 2e-8
    near = np.flatnonzero(cos > 1.0 / np.sqrt(1.0 + (6.0 * spread) ** 2))
    c = np.minimum(cos[near], 1.0)
    gamma = backscatter_reflection(te[near], tm[near], normal[near], direction[near], polarization)
    width = 2.0 * np.broadcast_to(spread, cos.shape)[near] ** 2
    lobe = np.exp(-(1.0 / c**2 - 1.0) / width) / (width * c**4)
    sigma0[near] = np.abs(gamma) ** 2 * np.exp(-((2.0 * height_phase[near] * c) ** 2)) * lobe
    return sigma0
