"""Several instants in a frame: for what turns too fast for a straight line from its first chirp to its last."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import fields, replace
from typing import Any

import numpy as np

from ._typing import BoolArray
from .config.profile import RadarProfile
from .errors import InputError
from .returns import Returns
from .scatterers import Scatterers

__all__ = ["segments"]

#: How loops of these are sent does not depend on which loop of the frame they are.
_MULTIPLEX = ("simultaneous", "tdm", "bpm")


def segments(
    profile: RadarProfile,
    returns: Returns,
    count: int,
    trace_at: Callable[[RadarProfile, float], Scatterers],
    illuminate: Callable[[Scatterers, RadarProfile], Returns],
) -> Iterator[tuple[RadarProfile, Returns]]:
    """Yield consecutive loops of a frame as frames of their own, with the echoes at the middle of each.

    Parameters
    ----------
    profile : RadarProfile
        Of the whole frame.
    returns : Returns
        Of the whole frame, at its middle.
    count : int
        How many; as many as there are loops evaluates every pose at each loop's own time.
    trace_at : callable
        Takes a segment's profile and its start after that of the frame [s]; gives its scatterers.
    illuminate : callable
        Scatterers to returns.

    Raises
    ------
    InputError
        More segments than loops, fewer than 1, or a multiplex whose code runs over the whole frame.

    Notes
    -----
    Coherent echoes, whose phase is that of the geometry, are those of the segment's own instant. Speckle stays that of
    mid-frame, moving in straight lines: drawn anew it would lose its phase from one segment to the next, and with it
    its Doppler.
    """
    loops = profile.waveform.chirps
    if not 1 <= count <= loops:
        raise InputError(f"retrace: {count}; allowed: 1 (mid-frame only) to {loops}, the loops of {profile.name!r}")
    if profile.array.multiplex not in _MULTIPLEX:
        allowed = ", ".join(_MULTIPLEX)
        raise InputError(f"retrace: multiplex {profile.array.multiplex!r} runs over the frame; allowed: {allowed}")
    edges = np.round(np.linspace(0, loops, count + 1)).astype(int)
    starts = profile.raw_chirp_start_s
    speckle = _rows(returns, ~returns.coherent)
    for first, last in zip(edges[:-1].tolist(), edges[1:].tolist(), strict=True):
        part = _loops(profile, first, last)
        start = float(starts[first, 0])
        own = illuminate(trace_at(part, start), part)
        ahead = start + part.frame_mid_s - profile.frame_mid_s
        yield part, _joined(_rows(own, own.coherent), _ahead(speckle, ahead))


def _loops(profile: RadarProfile, first: int, last: int) -> RadarProfile:
    """Return the profile of some of the loops of a frame; a pattern of periods goes on where it was."""
    wave = profile.waveform
    periods = wave.periods_s
    begin = first * profile.n_chirps_per_loop % len(periods)
    turned = (*periods[begin:], *periods[:begin])
    update = {"chirps": last - first, "chirp_period_s": turned if len(turned) > 1 else turned[0]}
    # built anew: a copy would take along what the whole frame's profile has worked out of its own loops
    return RadarProfile.model_validate(profile.model_dump() | {"waveform": wave.model_dump() | update})


def _rows(returns: Returns, keep: BoolArray) -> Returns:
    # the chains of objects are told of mid-frame's echoes; samples need none
    kept: dict[str, Any] = {name: getattr(returns, name)[keep] for name in _columns(returns)}
    return replace(returns, chains=None, **kept)


def _columns(returns: Returns) -> list[str]:
    n = len(returns.amplitude)
    values = {f.name: getattr(returns, f.name) for f in fields(returns)}
    return [name for name, v in values.items() if isinstance(v, np.ndarray) and v.shape[:1] == (n,)]


def _ahead(returns: Returns, seconds: float) -> Returns:
    shift = returns.velocity * seconds
    if returns.departure is None:
        return replace(returns, position=returns.position + shift)
    leaving = returns.velocity if returns.departure_velocity is None else returns.departure_velocity
    departure = returns.departure + leaving * seconds
    return replace(returns, position=returns.position + shift, departure=departure)


def _joined(a: Returns, b: Returns) -> Returns:
    """Return the echoes of both; where only one tells departure from arrival, the other says they are the same."""
    if (a.departure is None) != (b.departure is None):
        a, b = (
            r if r.departure is not None else replace(r, departure=r.position, departure_velocity=r.velocity)
            for r in (a, b)
        )
    both: dict[str, Any] = {name: np.concatenate([getattr(a, name), getattr(b, name)]) for name in _columns(a)}
    return replace(a, **both)
