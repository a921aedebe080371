"""Doppler ambiguity by the phases of transmitters that take turns.

Compensated with a velocity q 2 v_max off, the m-th of n transmitters is left turned by 2 pi q m / n, and the channels
no longer fit one direction. The fold whose best beam is the strongest is taken. It is known modulo n only: velocities
up to n v_max, those that one chirp interval tells apart.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from .._typing import ComplexArray, FloatArray, IntArray
from ..errors import InputError
from . import angle
from .ambiguity import Unfolding
from .directions import coarse_direction

if TYPE_CHECKING:
    from .cube import RadarCube

__all__ = ["unfold_by_phase"]

#: The best beam must be stronger than that of any other fold by this factor (0.25 dB: targets are no points), and by so
#: many times the noise of a beam: with white noise the logarithm of the ratio of their likelihoods.
_MARGIN, _LIKELIHOOD = 10**0.025, 9.0


def unfold_by_phase(
    cube: RadarCube, velocity: FloatArray, cells: ComplexArray, turned: Callable[[ComplexArray, IntArray], ComplexArray]
) -> Unfolding:
    """Find the fold of every detection by the phases of its channels.

    Parameters
    ----------
    cube : RadarCube
    velocity : (n,) float
        Folded range rates [m/s].
    cells : (n, n_virtual) complex
        Peak cells, compensated for those.
    turned : callable
        Takes cells and folds (n,), and compensates them for the unfolded velocities.

    Returns
    -------
    Unfolding

    Raises
    ------
    InputError
        The profile has one transmitter, or its transmitters do not take turns.
    """
    p = cube.profile
    if p.array.multiplex != "tdm" or p.n_tx < 2:
        raise InputError(
            f"detect: ambiguity 'tdm_phase' needs multiplex tdm with several transmitters; profile {p.name!r} has "
            f"{p.n_tx} and {p.array.multiplex}"
        )
    folds = np.arange(p.n_tx)
    power = np.stack([_best_beam(cube, turned(cells, np.full(len(cells), q))) for q in folds], axis=1)
    ordered = np.sort(power, axis=1)
    resolved = ordered[:, -1] > _MARGIN * ordered[:, -2]
    resolved &= ordered[:, -1] - ordered[:, -2] > _LIKELIHOOD * cube.noise_power_w / p.n_virtual
    fold = folds[np.argmax(power, axis=1)]
    # of q and q - n the slower one
    span = 2 * p.max_velocity_mps
    slower = np.abs(velocity + (fold - p.n_tx) * span) < np.abs(velocity + fold * span)
    return Unfolding(np.where(resolved, fold - p.n_tx * slower, 0), resolved)


def _best_beam(cube: RadarCube, cells: ComplexArray) -> FloatArray:
    """Return the power of the strongest beam of all channels, (n,) [W]."""
    sine, elevation = coarse_direction(cube, cells)
    vectors = angle.steering(cube.profile.positions_m, cube.profile.wavelength_m, sine, elevation)
    return np.asarray(np.abs(np.einsum("pc,pc->p", vectors.conj(), cells) / cells.shape[1]) ** 2, dtype=np.float64)
