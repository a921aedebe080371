"""Why an object is seen or not: each cause is tried by taking it away, and the first that suffices is the verdict."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np

from .._typing import FloatArray
from ..dsp import RadarCube, noise_threshold
from ..synthesis import synthesize
from .cells import Look
from .contributions import Contributions
from .masking import masked
from .records import Verdict
from .sources import Case
from .unhidden import Surroundings, Unhidden, unhidden
from .waterfall import Link, db, link_of

__all__ = ["Judge"]

#: Less of an object hidden, or a pattern less below its axis [dB, both ways], is no cause.
_HIDDEN, _PATTERN_DB = 0.1, -3.0
#: Hidden by more than this, and met by no ray, an object is occluded whatever else it lacks.
_MOSTLY = 0.5
#: Apparent cross section this far below the projected area is the mirror's doing [dB].
_MIRROR_DB = 6.0
#: An isotropic surface of the area may stand this far below the threshold where a face turned here would not [dB].
_NEARLY_DB = 10.0


@dataclass(frozen=True)
class Judge:
    """Gives the verdicts of one frame.

    Parameters
    ----------
    case : Case
    contributions : Contributions
    noise_threshold_w : (n_range, n_velocity) float
        The CFAR threshold that noise alone would set [W].
    first_row : int
        Rows before are blanked.
    """

    case: Case
    contributions: Contributions
    noise_threshold_w: FloatArray
    first_row: int

    @classmethod
    def of(cls, case: Case, contributions: Contributions) -> Judge:
        """Return the judge of a frame."""
        cube = case.cube
        level = np.full(cube.range_doppler.shape, cube.noise_power_w)
        settings = cube.profile.processing
        threshold = noise_threshold(cube, pfa=settings.pfa, power=level)
        return cls(case, contributions, threshold, int(np.searchsorted(cube.range_m, settings.blanking_m)))

    @cached_property
    def surroundings(self) -> Surroundings | None:
        """The whole scene, made once a frame; None where there is none."""
        case = self.case
        if case.scene is None:
            return None
        return Surroundings(case.scene, case.cube.profile, case.radar, case.time)

    def margin_db(self, own: RadarCube, first_row: int | None = None) -> float:
        """Return by how much a noise-free cube stands over the threshold of noise at best, mean of channels [dB]."""
        start = self.first_row if first_row is None else first_row
        return db(float((own.range_doppler / self.noise_threshold_w)[start:].max(initial=0.0)))

    def verdict(self, object_id: int, look: Look | None, others: list[int], labels: tuple[str, ...]) -> Verdict:
        """Return the verdict on one object.

        Parameters
        ----------
        object_id : int
        look : Look or None
            Its cell; ``None`` without an echo.
        others : list of int
            Objects with echoes beside it.
        labels : tuple of str
            Of its detections, if any.
        """
        if any(not label.startswith("ghost") for label in labels):
            return self._detected(labels)
        found = self._unseen(object_id, look, others)
        if labels:
            kinds = ", ".join(sorted(set(labels)))
            found = replace(found, text=f"{found.text}; seen only elsewhere, as {kinds}")
        return found

    def _unseen(self, object_id: int, look: Look | None, others: list[int]) -> Verdict:
        margin = -math.inf
        if look is not None:
            own = self.contributions.of(object_id)
            margin = self.margin_db(own)
            if margin < 0 <= self.margin_db(own, 0):
                return self._blanked()
            if margin >= 0:
                found = masked(self.case, self.contributions, object_id, look, others)
                return found or self._fluctuation(object_id, look, margin)
        view = self._view(object_id)
        if view is None:
            return self._weak_or_absent(look, margin)
        return self._lacking(view, margin)

    def _view(self, object_id: int) -> Unhidden | None:
        around = self.surroundings
        if around is None or object_id == 0:
            return None
        case = self.case
        return unhidden(around, object_id, seed=case.seed, frame=case.frame, model=case.returns.model)

    def _detected(self, labels: tuple[str, ...]) -> Verdict:
        kinds = sorted(set(labels))
        text = f"detected ({', '.join(kinds)})" if kinds != ["direct"] else "detected"
        return Verdict("detected", text, {"detections": len(labels)})

    def _blanked(self) -> Verdict:
        edge = self.case.cube.profile.processing.blanking_m
        text = f"nearer than the {edge:g} m that are blanked"
        return Verdict("blanked", text, {"blanking_m": edge}, "--set processing.blanking_m=0")

    def _fluctuation(self, object_id: int, look: Look, margin: float) -> Verdict:
        """Return the verdict on an object over the noise's threshold that is not found alone either."""
        own = self.contributions.map_of(object_id)
        cube = self.case.cube
        level = noise_threshold(cube, pfa=cube.profile.processing.pfa, power=own + cube.noise_power_w)
        over = db(float(((own + cube.noise_power_w) / level)[self.first_row :].max()))
        name = self.case.names.get(object_id, f"object {object_id}")
        numbers = {"margin_db": margin, "margin_over_own_threshold_db": over}
        if over < 0:
            text = f"masked by its own extent, which sets a threshold {-over:.1f} dB over it"
            change = f"a finer cell or a wider guard: {-over:.1f} dB are lacking"
            return Verdict("masked", text, numbers, change, name)
        text = f"below noise: {margin:.1f} dB over the threshold of noise are lost in this frame's draw"
        return Verdict("below noise", text, numbers, _stronger(look.distance_m, 3.0 - min(margin, 0.0)))

    def _weak_or_absent(self, look: Look | None, margin: float) -> Verdict:
        if look is None or not math.isfinite(margin):
            where = "no scene to ask why" if self.case.scene is None else "nothing of it is turned towards the radar"
            return Verdict("absent", f"not met by any ray: {where}", {}, "")
        text = f"below noise: {-margin:.1f} dB under the threshold that noise alone sets"
        return Verdict("below noise", text, {"margin_db": margin}, _stronger(look.distance_m, -margin))

    def _lacking(self, view: Unhidden, now: float) -> Verdict:
        """Return the verdict on an object whose echo is too weak, or is not there."""
        tried = self._tried(view, now)
        chosen = _choose(tried, now, view)
        by = view.blockers.first
        if chosen == "occluded":
            text = f"occluded by {by}: {view.blockers.by[0][1]:.0%} of its surface lies behind it"
            return Verdict("occluded", text, tried.numbers, _without(by, tried.alone), by)
        if chosen == "outside the beam":
            text = f"outside the beam: the pattern takes {-tried.link.pattern_db:.1f} dB both ways there"
            return Verdict("outside the beam", text, tried.numbers, _turn_radar(view.centre, tried.on_axis))
        if chosen == "specular away":
            text = (
                f"specular away: {view.projected_m2:.3g} m^2 face the radar, and echo like {tried.apparent_dbsm:.1f} "
                f"dBsm, {tried.mirror_db(view):.0f} dB less than an isotropic surface of that area"
            )
            turn = view.turn_deg()
            change = "" if turn is None else f"turn it by {turn:.0f} deg, so that it faces the radar"
            return Verdict("specular away", text, tried.numbers, change)
        best = max(now, tried.alone)
        text = f"below noise: {-best:.1f} dB under the threshold that noise alone sets"
        return Verdict("below noise", text, tried.numbers, _stronger(tried.link.distance_m, -best))

    def _tried(self, view: Unhidden, now: float) -> _Tried:
        """Return what the object would be worth without each thing that may hide it."""
        link = link_of(self.case.cube.profile, view.centre, self.case.cube.weather)
        isotropic, apparent = self._isotropic(view, link)
        facing_m2 = view.facing_m2(self.case.cube.profile.wavelength_m)
        tried = _Tried(
            link=link,
            alone=self._margin_of(view, on_axis=False),
            on_axis=self._margin_of(view, on_axis=True),
            isotropic=isotropic,
            facing=link.unit_dbm + db(facing_m2) - self._threshold_dbm(link),
            apparent_dbsm=apparent,
        )
        tried.numbers.update(
            {
                "margin_db": now,
                "margin_alone_db": tried.alone,
                "margin_on_axis_db": tried.on_axis,
                "margin_isotropic_db": tried.isotropic,
                "margin_facing_db": tried.facing,
                "pattern_db": link.pattern_db,
                "hidden_share": view.blockers.hidden_share,
                "hidden_by": dict(view.blockers.by),
                "unhidden_area_m2": view.area_m2,
                "projected_area_m2": view.projected_m2,
                "apparent_rcs_dbsm": apparent,
            }
        )
        return tried

    def _margin_of(self, view: Unhidden, *, on_axis: bool) -> float:
        """Return the margin of an object that is looked at alone."""
        returns = view.on_axis if on_axis else view.returns
        if not len(returns):
            return -math.inf
        samples = synthesize(returns, self.case.cube.profile, noise=None, accuracy=self.contributions.accuracy)
        return self.margin_db(self.contributions.processed(samples))

    def _threshold_dbm(self, link: Link) -> float:
        """Return the threshold that noise alone sets at a range [dBm]."""
        row = int(np.clip(round(link.distance_m / self.case.cube.range_step_m), 0, len(self.noise_threshold_w) - 1))
        return db(float(self.noise_threshold_w[row, 0])) + 30

    def _isotropic(self, view: Unhidden, link: Link) -> tuple[float, float]:
        """Return the margin of an isotropic scatterer of the projected area, and the apparent cross section [dBsm]."""
        margin = link.unit_dbm + db(view.projected_m2) - self._threshold_dbm(link)
        power = db(sum(view.returns.power_by_object().values())) + 30 if len(view.returns) else -math.inf
        return margin, power - link.unit_dbm


@dataclass(frozen=True)
class _Tried:
    """Margins over the threshold of noise [dB]: alone in the scene, on the beam's axis, isotropic, facing the radar."""

    link: Link
    alone: float
    on_axis: float
    isotropic: float
    facing: float
    apparent_dbsm: float
    numbers: dict[str, Any] = field(default_factory=dict)

    @property
    def mirrored(self) -> float:
        """What it would be worth if its surface did not mirror the wave elsewhere."""
        return max(self.isotropic, self.facing) if self.isotropic >= -_NEARLY_DB else self.isotropic

    def mirror_db(self, view: Unhidden) -> float:
        """By how much the echo is weaker than that of an isotropic surface of its projected area."""
        return db(view.projected_m2) - self.apparent_dbsm if view.projected_m2 > 0 else -math.inf


def _choose(tried: _Tried, now: float, view: Unhidden) -> str:
    """Return the cause whose removal suffices, upstream first; else the largest of several that do together."""
    pattern, mirror, hidden = tried.link.pattern_db, tried.mirror_db(view), view.blockers.hidden_share
    if hidden > _MOSTLY and not math.isfinite(now):
        return "occluded"  # nothing of it was met; whatever else it lacks comes after
    causes = {
        "occluded": (tried.alone - now if hidden >= _HIDDEN else -math.inf, tried.alone),
        "outside the beam": (-pattern if pattern <= _PATTERN_DB else -math.inf, tried.on_axis),
        "specular away": (mirror if mirror >= _MIRROR_DB else -math.inf, tried.mirrored),
    }
    for name, (loss, margin) in causes.items():
        if loss > 0 and margin >= 0:
            return name
    losses = {name: loss for name, (loss, _) in causes.items() if loss > 0 and name != "occluded"}
    if losses and tried.mirrored - pattern >= 0 > tried.alone:
        return max(losses, key=lambda name: losses[name])
    return "below noise"


def _stronger(distance_m: float, lacking_db: float) -> str:
    """Say what makes up for so many dB: power, time, or distance by R^-4."""
    nearer = distance_m * 10 ** (-lacking_db / 40)
    return (
        f"{lacking_db:.1f} dB more: the same aspect within {nearer:.1f} m (now {distance_m:.1f} m), or "
        f"{10 ** (lacking_db / 10):.2g} times the power or the chirps"
    )


def _without(name: str, margin_db: float) -> str:
    if margin_db >= 0:
        return f"take {name} away: it is then {margin_db:.1f} dB over the threshold of noise"
    return f"take {name} away, and find {-margin_db:.1f} dB more"


def _turn_radar(centre: FloatArray, margin_db: float) -> str:
    azimuth = math.degrees(math.atan2(centre[1], centre[0]))
    elevation = math.degrees(math.atan2(centre[2], math.hypot(centre[0], centre[1])))
    ways: list[tuple[float, str]] = [
        (abs(azimuth), f"{abs(azimuth):.0f} deg to the {'left' if azimuth > 0 else 'right'}"),
        (abs(elevation), f"{abs(elevation):.0f} deg {'up' if elevation > 0 else 'down'}"),
    ]
    told = [text for size, text in ways if size >= 1.0]
    over: Any = f"{margin_db:.1f} dB over the threshold of noise"
    return f"turn the radar {' and '.join(told) or 'towards it'}: on its axis the echo is {over}"
