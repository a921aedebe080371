"""Vector fields along a chain of bounces, and what the surface currents they drive radiate.

Physical optics of an impedance surface: J = n x (H_i + H_r), M = -n x (E_i + E_r), of which the part seen along the
unit vector s is J - s (s . J) + M x s. A perfect conductor has J = 2 n x H_i and no M. Fields in units of the incident
one, wave impedance 1, time factor e^{+jwt}; the phase of the path is kept apart.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from .._typing import ComplexArray, FloatArray, NDArray
from .chain import Bounce, Chain
from .surface import Reflector, Surface
from .vectors import dot
from .views import Views

__all__ = ["Fields", "fields_along", "radiated", "reflected_field"]


class Fields(NamedTuple):
    """Electric fields at the hits of one bounce, (m, 2, 3) each: transmitted V, then H.

    What leaves a smooth perfect conductor is the mirror image of what arrives and need not be kept: None.
    """

    arriving: NDArray[np.inexact]
    leaving: NDArray[np.inexact] | None


def fields_along(surface: Surface, views: Views, chain: Chain, frequency_hz: float) -> list[Fields]:
    """Return the fields at every bounce; real ones where every surface is a smooth perfect conductor."""
    view, d = chain.rays.view, chain.rays.direction
    basis = np.stack([views.vertical, views.horizontal], axis=1)[view]
    if views.distance is not None:  # transverse to each ray, not to the axis
        basis = basis - np.einsum("npi,ni->np", basis, d)[:, :, None] * d[:, None, :]
        basis /= np.linalg.norm(basis, axis=2, keepdims=True)
    field: NDArray[np.inexact] = basis if surface.conducts else basis.astype(np.complex128)
    along = []
    for order, bounce in enumerate(chain.bounces):
        arriving = field[bounce.parent]
        if surface.conducts and order + 1 == len(chain.bounces):
            along.append(Fields(arriving, None))
            break
        field = _reflected(surface, bounce, arriving, frequency_hz)
        along.append(Fields(arriving, None if surface.conducts else field))
    return along


def _reflected(
    surface: Surface, bounce: Bounce, field: NDArray[np.inexact], frequency_hz: float
) -> NDArray[np.inexact]:
    """Return the field of the reflected wave."""
    n = bounce.normal[:, None, :]
    mirrored: NDArray[np.inexact] = 2.0 * np.einsum("npi,ni->np", field, bounce.normal)[:, :, None] * n - field
    if surface.conducts:
        return mirrored
    kind = surface.reflector[bounce.face]
    for number, reflector in enumerate(surface.reflectors):
        rows = np.flatnonzero(kind == number)
        if len(rows) and (reflector.coefficients is not None or reflector.roughness_m > 0.0):
            d, normal = bounce.direction[rows], bounce.normal[rows]
            te, tm = _coefficients(reflector, frequency_hz, np.clip(-dot(d, normal), 0.0, 1.0))
            mirrored[rows] = reflected_field(field[rows], d, normal, te, tm)
    return mirrored


def reflected_field(
    field: NDArray[np.inexact], direction: FloatArray, normal: FloatArray, te: ComplexArray, tm: ComplexArray
) -> ComplexArray:
    """Return the field of a reflected wave, by its parts across the plane of incidence and in it.

    Parameters
    ----------
    field : (n, p, 3)
        Transverse to the direction of arrival.
    direction, normal : (n, 3) float
        Of arrival, and of the surface on the side that is lit; unit vectors.
    te, tm : (n,) complex
        Reflection coefficients.

    Returns
    -------
    (n, p, 3) complex

    Notes
    -----
    With e the unit vector across the plane of incidence both waves have TM along e x d, so that their H is along e:
    TM = +1 and TE = -1 make a conductor.
    """
    across = np.cross(normal, direction)
    length = np.linalg.norm(across, axis=1, keepdims=True)
    any_tangent = np.cross(normal, np.where(np.abs(normal[:, :1]) < 0.9, [[1.0, 0.0, 0.0]], [[0.0, 1.0, 0.0]]))
    across = np.where(length > 1e-9, across, any_tangent)
    across /= np.linalg.norm(across, axis=1, keepdims=True)
    out = direction - 2.0 * dot(direction, normal)[:, None] * normal
    tm_in, tm_out = np.cross(across, direction), np.cross(across, out)
    along_te = np.einsum("npi,ni->np", field, across) * te[:, None]
    along_tm = np.einsum("npi,ni->np", field, tm_in) * tm[:, None]
    reflected: ComplexArray = along_te[:, :, None] * across[:, None, :] + along_tm[:, :, None] * tm_out[:, None, :]
    return reflected


def _coefficients(reflector: Reflector, frequency_hz: float, cos: FloatArray) -> tuple[ComplexArray, ComplexArray]:
    from ..constants import SPEED_OF_LIGHT
    from ..physics.roughness import coherent_factor

    rough = coherent_factor(2.0 * np.pi * frequency_hz / SPEED_OF_LIGHT, reflector.roughness_m, cos)
    if reflector.coefficients is None:
        return -rough.astype(np.complex128), rough.astype(np.complex128)
    te, tm = reflector.coefficients(frequency_hz, cos)
    return te * rough, tm * rough


def radiated(
    arriving: NDArray[np.inexact],
    leaving: NDArray[np.inexact] | None,
    direction: FloatArray,
    normal: FloatArray,
    area: FloatArray,
    toward: FloatArray,
    receive: NDArray[np.inexact],
) -> NDArray[np.inexact]:
    """Return what the currents on flat pieces send to a receiver, without their phase.

    Parameters
    ----------
    arriving, leaving : (n, 2, 3)
        Fields for transmitted V and H; ``leaving`` is None on a perfect conductor.
    direction, normal : (n, 3) float
        Of arrival; the normal on the lit side.
    area : (n, 3) float
        Vector area of each piece on the side that is lit [m^2].
    toward : (n, 3) float
        Unit vector to the receiver.
    receive : (n, 2, 3)
        Unit vectors p, V and H of the receiver, transverse to ``toward``.

    Returns
    -------
    (n, 2, 2)
        Receive V, H by transmit V, H: p . [S x (H_i + H_r) - (S x (E_i + E_r)) x s] [m^2]; 2 |S| where a metal plate
        faces a radar.
    """
    if leaving is None:
        return 2.0 * _electric(arriving, direction, area, receive)
    out = direction - 2.0 * dot(direction, normal)[:, None] * normal
    result = _electric(arriving, direction, area, receive) + _electric(leaving, out, area, receive)
    facing = dot(area, toward)
    for t in range(2):
        total = arriving[:, t] + leaving[:, t]
        ahead = dot(total, toward)
        for r in range(2):
            p = receive[:, r]
            result[:, r, t] += dot(p, area) * ahead - dot(p, total) * facing
    return result


def _electric(
    field: NDArray[np.inexact], direction: FloatArray, area: FloatArray, receive: NDArray[np.inexact]
) -> NDArray[np.inexact]:
    """Return p . (S x (d x E)) = (p . d)(S . E) - (p . E)(S . d), (n, 2, 2)."""
    result = np.empty((len(field), 2, 2), dtype=field.dtype)
    facing = dot(area, direction)
    along = [dot(receive[:, r], direction) for r in range(2)]
    for t in range(2):
        e = field[:, t]
        through = dot(area, e)
        for r in range(2):
            result[:, r, t] = along[r] * through - dot(receive[:, r], e) * facing
    return result
