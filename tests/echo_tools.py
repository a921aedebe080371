"""What the tests of tracer and echo model share: an isotropic radar, the inverted radar equation, physical optics by
brute force."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

import shenron_rt as srt
from shenron_rt.config.profile import RadarProfile

FOUR_PI_CUBED = (4 * math.pi) ** 3


def isotropic_profile(**antenna: Any) -> RadarProfile:
    """Return awrl1432 with an isotropic antenna of 0 dBi, so that the radar equation has no pattern in it."""
    profile = srt.load_profile("awrl1432")
    changed = {"pattern": "isotropic", "gain_tx_dbi": 0.0, "gain_rx_dbi": 0.0, **antenna}
    return profile.model_copy(update={"antenna": profile.antenna.model_copy(update=changed)})


ISO = isotropic_profile()
WAVELENGTH = ISO.wavelength_m
WAVENUMBER = 2 * math.pi / WAVELENGTH


def scene_of(*actors: dict[str, Any], profile: RadarProfile = ISO, **more: Any) -> srt.Scene:
    """Return a scene with one radar at the origin that looks along +x."""
    return srt.Scene(actors=actors, radars=[{"name": "r", "xyz_m": (0, 0, 0), "profile": profile}], **more)


def unit_power(range_m: float, profile: RadarProfile = ISO) -> float:
    """Return the received power of 1 m^2 at a range, no pattern [W]."""
    return profile.tx_power_w * profile.wavelength_m**2 / (FOUR_PI_CUBED * range_m**4)


def apparent_rcs(returns: srt.Returns, object_id: int, range_m: float, profile: RadarProfile = ISO) -> float:
    """Return the RCS [m^2] that the power of an object stands for at a range."""
    return returns.power_by_object()[object_id] / unit_power(range_m, profile)


def echo_sum(returns: srt.Returns, object_id: int) -> complex:
    """Return the coherent sum of an object's echoes with the carrier phase of their delay, de-chirped [sqrt(W)]."""
    own = returns.coherent & (returns.object_id == object_id)
    carrier = np.exp(2j * np.pi * returns.center_hz * returns.delay_s[own])
    return complex(np.sum(returns.amplitude[own] * carrier))


def plate_po(
    center: np.ndarray, side_y: np.ndarray, side_z: np.ndarray, gamma: Any = -1.0, nodes: int = 400
) -> complex:
    """Return (2 sqrt(pi)/lambda) R^2 x integral of Gamma cos e^{-2jkr}/r^2 dA over a flat plate, by Gauss-Legendre.

    Spherical waves from the origin; the factor R^2, R to the centre, makes its squared modulus the apparent RCS there.
    ``gamma`` is a number, or a function of cos(theta). Sides are the full edge vectors [m].
    """
    x, w = np.polynomial.legendre.leggauss(nodes)
    u, v = np.meshgrid(x / 2, x / 2, indexing="ij")
    p = center + u[..., None] * side_y + v[..., None] * side_z
    area = np.cross(side_y, side_z)
    r = np.linalg.norm(p, axis=-1)
    cos = np.abs(p @ area) / (r * np.linalg.norm(area))
    reflect = gamma(cos) if callable(gamma) else gamma
    field = reflect * cos / r**2 * np.exp(-2j * WAVENUMBER * r)
    integral = np.einsum("i,j,ij->", w / 2, w / 2, field) * np.linalg.norm(area)
    return complex(2 * math.sqrt(math.pi) / WAVELENGTH * float(center @ center) * integral)


def db(ratio: Any) -> Any:
    return 10 * np.log10(ratio)
