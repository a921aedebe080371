"""Transmitters that send at once: binary phase modulation and Doppler division.

Binary phase modulation: all transmitters send in every chirp of a loop, chirp b with the signs H[b, i]. The cube's
channels are decoded as if nothing moved meanwhile; a Doppler frequency f turns chirp b by 2 pi f o_b about the loop's
mean time and leaks one transmitter into the others. In the Doppler domain f is known bin by bin and the decoding can be
put right.

Doppler division: transmitter i is shifted by i sub-bands of the Doppler spectrum. Each channel is turned back by its
own shift, so that a target shows in all channels at its velocity; s sub-bands away it shows only in those whose
transmitter another one takes the place of. As some sub-bands are empty, those are fewer.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .._typing import BoolArray, ComplexArray, FloatArray

__all__ = ["LoopCode", "strongest_alias"]


@dataclass(frozen=True)
class LoopCode:
    """Signs of the chirps of a loop and their times.

    Parameters
    ----------
    signs : (n_chirps, n_tx) float
        Orthogonal code: signs.T @ signs = n_chirps * identity.
    offset_s : (n_chirps,) float
        Start of each chirp from the mean of the loop [s].
    bin_hz : float
        Doppler frequency of a bin [Hz].
    """

    signs: FloatArray
    offset_s: FloatArray
    bin_hz: float

    def matrices(self, bins: FloatArray) -> ComplexArray:
        """Return (..., n_tx, n_tx): (1/n) H^T diag(e^{-j 2 pi f o}) H takes channels decoded for 0 to those for f."""
        turn = np.exp(-2j * np.pi * self.bin_hz * np.asarray(bins)[..., None] * self.offset_s)
        mixed = np.einsum("bi,...b,bk->...ik", self.signs, turn, self.signs, optimize=True)
        return np.asarray(mixed / len(self.signs), dtype=np.complex128)

    def decode_anew(self, channels: ComplexArray, bins: FloatArray) -> ComplexArray:
        """Decode (..., n_virtual) channels for a Doppler ``bins`` (...) farther than the one they are decoded for."""
        n_tx = self.signs.shape[1]
        by_tx = channels.reshape(*channels.shape[:-1], n_tx, channels.shape[-1] // n_tx)  # -1 fails on no peaks
        return np.asarray(np.matmul(self.matrices(bins), by_tx).reshape(channels.shape), dtype=np.complex128)


def strongest_alias(power: FloatArray, n_subbands: int) -> BoolArray:
    """Mark the cells that are the strongest of those whole sub-bands apart.

    Parameters
    ----------
    power : (n_range, n_velocity) float
        Sum over all channels, whose transmitters are all there at a target's own velocity only.
    n_subbands : int
        Divides n_velocity; 1 marks every cell.

    Returns
    -------
    (n_range, n_velocity) bool
        One cell of each ``n_subbands``: two targets of one range, whole sub-bands apart, count as the stronger one.
    """
    n_range, n_velocity = power.shape
    aliases = power.reshape(n_range, n_subbands, n_velocity // n_subbands)
    best = np.arange(n_subbands)[:, None] == np.argmax(aliases, axis=1)[:, None]
    return np.asarray(best.reshape(n_range, n_velocity))
