"""Reflection and transmission at flat interfaces: half-space, slab, layer stack, and the backscatter of a facet.

Time factor e^{+jwt}, relative permittivity eps = eps' - j eps''. TE: E perpendicular to the plane of incidence; TM: E
in it. A perfect conductor gives TE -1 and TM +1, and TE = -TM at normal incidence.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..constants import SPEED_OF_LIGHT
from ..errors import InputError, did_you_mean

__all__ = ["POLARIZATIONS", "SlabCoefficients", "backscatter_reflection", "fresnel", "fresnel_cos", "layered", "slab"]

#: Receive letter first: "HV" receives H, transmits V.
POLARIZATIONS = ("VV", "HH", "HV", "VH")

ComplexArray = NDArray[np.complex128]


class SlabCoefficients(NamedTuple):
    """Complex amplitudes of a slab in air; transmission is referred to the two faces."""

    r_te: ComplexArray
    r_tm: ComplexArray
    t_te: ComplexArray
    t_tm: ComplexArray


def _normal_wavenumber(eps: ArrayLike, sin2: NDArray[np.float64]) -> ComplexArray:
    """Return sqrt(eps - sin^2) on the branch that decays into the medium (imaginary part <= 0)."""
    q: ComplexArray = np.sqrt(np.asarray(eps, dtype=np.complex128) - sin2)
    return np.where(q.imag > 0.0, -q, q)


def fresnel_cos(eps: ArrayLike, cos_incidence: ArrayLike) -> tuple[ComplexArray, ComplexArray]:
    """Return the half-space coefficients from the cosine of the angle of incidence.

    The same as :func:`fresnel` without trigonometry; for tracers, which have the cosine.

    Parameters
    ----------
    eps : complex array_like
        Relative permittivity eps' - j eps''. [-]
    cos_incidence : array_like
        Cosine of the angle from the normal, 0 to 1. [-]

    Returns
    -------
    te, tm : complex arrays of the broadcast shape
    """
    cos = np.asarray(cos_incidence, dtype=np.float64)
    eps = np.asarray(eps, dtype=np.complex128)
    q = _normal_wavenumber(eps, 1.0 - cos * cos)
    # At eps = 1 and grazing both numerator and denominator vanish; the tiny term makes that limit 0 / tiny.
    tiny = np.finfo(np.float64).tiny
    return (cos - q) / (cos + q + tiny), (eps * cos - q) / (eps * cos + q + tiny)


def fresnel(eps: ArrayLike, theta: ArrayLike) -> tuple[ComplexArray, ComplexArray]:
    """Return the Fresnel reflection coefficients of a half-space in air.

    Parameters
    ----------
    eps : complex array_like
        Relative permittivity eps' - j eps''. [-]
    theta : array_like
        Angle of incidence from the normal, 0 to pi/2. [rad]

    Returns
    -------
    te, tm : complex arrays of the broadcast shape
        Ratios of the reflected to the incident field.

    Notes
    -----
    R_TE = (cos - s)/(cos + s), R_TM = (eps cos - s)/(eps cos + s), s = sqrt(eps - sin^2). Both tend to -1 at grazing.

    References
    ----------
    .. [1] Recommendation ITU-R P.2040-3 (2023), section 2.2.2.1.

    Examples
    --------
    >>> te, tm = fresnel(4.0, 0.0)
    >>> float(te.real), float(tm.real)
    (-0.3333333333333333, 0.3333333333333333)
    """
    return fresnel_cos(eps, np.cos(np.asarray(theta, dtype=np.float64)))


def _interface(
    eps_above: ArrayLike, q_above: ComplexArray, eps_below: ArrayLike, q_below: ComplexArray
) -> tuple[ComplexArray, ComplexArray]:
    """Return (TE, TM) of one interface between two media from their normal wavenumbers over k0."""
    tiny = np.finfo(np.float64).tiny
    te = (q_above - q_below) / (q_above + q_below + tiny)
    up, down = np.asarray(eps_below) * q_above, np.asarray(eps_above) * q_below
    return te, (up - down) / (up + down + tiny)


def layered(
    layers: Sequence[tuple[ArrayLike, float]], eps_base: ArrayLike, theta: ArrayLike, frequency_hz: ArrayLike
) -> tuple[ComplexArray, ComplexArray]:
    """Return the reflection of a stack of flat layers on a half-space, seen from air.

    Parameters
    ----------
    layers : sequence of (eps, thickness)
        Relative permittivity and thickness [m, >= 0] of each layer, the outermost first. Empty: the bare half-space.
    eps_base : complex array_like
        Relative permittivity of the half-space under the stack; 1 is air, so that one layer is a slab. [-]
    theta : array_like
        Angle of incidence from the normal, 0 to pi/2. [rad]
    frequency_hz : array_like
        Frequency. [Hz]

    Returns
    -------
    te, tm : complex arrays of the broadcast shape, phase referred to the outer face

    Raises
    ------
    InputError
        A negative or non-finite thickness.

    Notes
    -----
    Exact recursion from the base upwards, R = (r + R_below e^{-2jq})/(1 + r R_below e^{-2jq}),
    q = k0 d sqrt(eps - sin^2); only decaying exponentials occur, so thick absorbing layers do not overflow.

    References
    ----------
    .. [1] M. Born, E. Wolf, Principles of Optics, section 1.6.
    """
    sin2 = np.sin(np.asarray(theta, dtype=np.float64)) ** 2
    wavenumber = 2.0 * math.pi * np.asarray(frequency_hz, dtype=np.float64) / SPEED_OF_LIGHT
    for _, thickness in layers:
        if not (math.isfinite(thickness) and thickness >= 0.0):
            raise InputError(f"layer thickness is {thickness} m; allowed: finite, >= 0")
    media: list[ArrayLike] = [1.0, *(eps for eps, _ in layers), eps_base]
    q = [_normal_wavenumber(eps, sin2) for eps in media]
    te, tm = _interface(media[-2], q[-2], media[-1], q[-1])
    for i in range(len(layers) - 1, -1, -1):
        round_trip = np.exp(-2j * wavenumber * layers[i][1] * q[i + 1])
        r_te, r_tm = _interface(media[i], q[i], media[i + 1], q[i + 1])
        te = (r_te + te * round_trip) / (1.0 + r_te * te * round_trip)
        tm = (r_tm + tm * round_trip) / (1.0 + r_tm * tm * round_trip)
    return te, tm


def slab(eps: ArrayLike, thickness_m: ArrayLike, theta: ArrayLike, frequency_hz: ArrayLike) -> SlabCoefficients:
    """Return reflection and transmission of a homogeneous slab in air.

    Parameters
    ----------
    eps : complex array_like
        Relative permittivity eps' - j eps''. [-]
    thickness_m : array_like
        Thickness, >= 0. [m]
    theta : array_like
        Angle of incidence from the normal, 0 to pi/2. [rad]
    frequency_hz : array_like
        Frequency. [Hz]

    Returns
    -------
    SlabCoefficients
        ``(r_te, r_tm, t_te, t_tm)``, complex amplitudes of the broadcast shape.

    Raises
    ------
    InputError
        A negative thickness.

    Notes
    -----
    R = R'(1 - e^{-2jq})/(1 - R'^2 e^{-2jq}), T = (1 - R'^2) e^{-jq}/(1 - R'^2 e^{-2jq}),
    q = 2 pi d sqrt(eps - sin^2)/lambda, R' the half-space coefficient.

    References
    ----------
    .. [1] Recommendation ITU-R P.2040-3 (2023), section 2.2.2.2.
    """
    thickness = np.asarray(thickness_m, dtype=np.float64)
    if np.any(~(thickness >= 0.0)):
        raise InputError(f"slab thickness {thickness_m!r} m; allowed: >= 0")
    sin2 = np.sin(np.asarray(theta, dtype=np.float64)) ** 2
    wavenumber = 2.0 * math.pi * np.asarray(frequency_hz, dtype=np.float64) / SPEED_OF_LIGHT
    one_way = np.exp(-1j * wavenumber * thickness * _normal_wavenumber(eps, sin2))
    te, tm = fresnel(eps, theta)

    def both(r: ComplexArray) -> tuple[ComplexArray, ComplexArray]:
        denominator = 1.0 - r * r * one_way**2
        return r * (1.0 - one_way**2) / denominator, (1.0 - r * r) * one_way / denominator

    (r_te, t_te), (r_tm, t_tm) = both(te), both(tm)
    return SlabCoefficients(r_te, r_tm, t_te, t_tm)


def backscatter_reflection(
    te: ArrayLike, tm: ArrayLike, normal: ArrayLike, direction: ArrayLike, polarization: str
) -> ComplexArray:
    """Return the reflection coefficient of a facet towards the radar that lights it.

    Parameters
    ----------
    te, tm : (n,) complex array_like
        Coefficients at the facet's angle of incidence.
    normal : (n, 3) array_like
        Facet normals, either side, in the frame in which z is up; need not be unit vectors.
    direction : (n, 3) array_like
        Directions from the radar to the facet, same frame; need not be unit vectors.
    polarization : {"VV", "HH", "HV", "VH"}
        Receive letter first. V is the unit vector of increasing elevation, H of increasing azimuth.

    Returns
    -------
    (n,) complex array
        -1 for a perfect conductor in VV and HH, 0 in the cross channels.

    Raises
    ------
    InputError
        Another polarisation.

    Notes
    -----
    With alpha between V and the plane of incidence, Gamma_VV = TE sin^2 - TM cos^2, Gamma_HH = TE cos^2 - TM sin^2 and
    |Gamma_HV| = |(TE + TM) sin cos|. sin(alpha) : cos(alpha) = n.H : -n.V, so no angle is ever computed. At normal
    incidence, where alpha has no meaning, TE + TM = 0 and every alpha gives the same.
    """
    if polarization not in POLARIZATIONS:
        raise InputError(f"unknown polarization {polarization!r}; {did_you_mean(polarization, POLARIZATIONS)}")
    te, tm = np.asarray(te, dtype=np.complex128), np.asarray(tm, dtype=np.complex128)
    n, u = np.asarray(normal, dtype=np.float64), np.asarray(direction, dtype=np.float64)
    ux, uy, uz = u[..., 0], u[..., 1], u[..., 2]
    horizontal = np.hypot(ux, uy)
    flat = horizontal > 0.0  # straight up or down the azimuth is taken as zero, as atan2(0, 0) is
    length = np.where(flat, horizontal, 1.0)
    cos_az, sin_az = np.where(flat, ux / length, 1.0), uy / length
    n_h = n[..., 1] * cos_az - n[..., 0] * sin_az
    n_v = horizontal * n[..., 2] - uz * (n[..., 0] * cos_az + n[..., 1] * sin_az)
    n_v = n_v / np.hypot(horizontal, uz)
    total = n_h * n_h + n_v * n_v
    defined = total > 0.0
    scale = (te + tm) / np.where(defined, total, 1.0)
    if polarization == "VV":
        return np.asarray(scale * (n_h * n_h) - tm)
    if polarization == "HH":
        return np.asarray(te - scale * (n_h * n_h))
    return np.asarray(-scale * (n_h * n_v))
