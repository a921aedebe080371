"""What the tables say of a circle: its levels, its spread, and its lobes, beside what is published."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy.stats import norm

from shenron_rt._typing import ArrayLike, FloatArray
from shenron_rt.turntable import angular_statistics

from .cases import full_circle
from .published import KIND, MEAN_DBSM, SIGMA_DB, pattern_dbsm
from .store import Curve

#: Window of the medians, the bands and the local mean [deg].
WINDOW_DEG = 20.0
#: Half widths of the sectors about front, sides and back: of a maximum, and of a mean [deg].
SECTOR_DEG, LOBE_DEG = 15.0, 10.0
DIRECTIONS = {"front": (0.0,), "side": (90.0, -90.0), "back": (180.0,)}


def dbsm(rcs_m2: ArrayLike) -> FloatArray:
    """Return square metres in dBsm, at least -120."""
    return np.asarray(10.0 * np.log10(np.maximum(np.asarray(rcs_m2, dtype=np.float64), 1e-12)))


def mean_dbsm(level_dbsm: FloatArray) -> float:
    """Return the mean of the linear power [dBsm]."""
    return float(dbsm(np.mean(10.0 ** (level_dbsm / 10.0))))


@dataclass(frozen=True, eq=False)
class Circle:
    """A target's RCS over the full circle.

    Parameters
    ----------
    azimuth_deg : (n,) float, in [-180, 180), ascending
    rcs_m2 : (n,) float
    """

    azimuth_deg: FloatArray
    rcs_m2: FloatArray

    @classmethod
    def of(cls, curve: Curve) -> Circle:
        """Return the circle of a curve over azimuth, mirrored where the target mirrors."""
        return cls(*full_circle(curve.settings["shape"], curve.x, curve.rcs_m2))

    @property
    def median(self) -> float:
        """Of all aspects [dBsm]."""
        return float(np.median(dbsm(self.rcs_m2)))

    @property
    def mean(self) -> float:
        """Of the linear power over all aspects [dBsm]."""
        return float(dbsm(self.rcs_m2.mean()))

    @property
    def sigma(self) -> float:
        """Standard deviation of the level about the mean power in the sliding window [dB]: TR 38.901's sigma_S."""
        local = angular_statistics(self.azimuth_deg, self.rcs_m2, WINDOW_DEG).mean_m2
        return float(np.std(dbsm(self.rcs_m2) - dbsm(local)))

    def within(self, centres_deg: tuple[float, ...], half_deg: float) -> FloatArray:
        """Return the RCS at the aspects within a half width of a direction, or of one of several [m^2]."""
        off = np.abs((self.azimuth_deg[:, None] - np.array(centres_deg) + 180.0) % 360.0 - 180.0).min(axis=1)
        return np.asarray(self.rcs_m2[off <= half_deg + 1e-9])

    def highest(self, direction: str) -> float:
        """Return the largest value within 15 deg of a direction [dBsm]."""
        return float(dbsm(self.within(DIRECTIONS[direction], SECTOR_DEG).max()))

    def lobe(self, direction: str) -> float:
        """Return the mean power within 10 deg of a direction [dBsm]."""
        return float(dbsm(self.within(DIRECTIONS[direction], LOBE_DEG).mean()))

    def sector(self, low_deg: float, high_deg: float) -> float:
        """Return the mean power at aspects that lie so far off the nose, left and right [dBsm]."""
        off = np.abs(self.azimuth_deg)
        return float(dbsm(self.rcs_m2[(off >= low_deg - 1e-9) & (off <= high_deg + 1e-9)].mean()))


def published_lobe(kind: str, direction: str) -> float:
    """Return TR 38.901's mean power within 10 deg of a direction, for a level radar [dBsm]."""
    off = np.linspace(-LOBE_DEG, LOBE_DEG, 81)
    return mean_dbsm(pattern_dbsm(kind, np.concatenate([off + centre for centre in DIRECTIONS[direction]])))


def level_circle(kind: str) -> tuple[float, float]:
    """Return median and mean of TR 38.901's RCS, pattern and log-normal factor, over a level radar's circle [dBsm].

    10 lg sigma_S has the mean -ln(10)/20 sigma^2 (equation 7.9.2-1), which makes the mean of sigma_S one.
    """
    pattern, sigma = pattern_dbsm(kind, np.arange(-180.0, 180.0)), SIGMA_DB[kind]
    quantiles = norm.ppf((np.arange(400) + 0.5) / 400.0)
    level = pattern[:, None] - math.log(10.0) / 20.0 * sigma**2 + sigma * quantiles
    return float(np.median(level)), mean_dbsm(pattern)


def published_levels(shape: str) -> dict[str, tuple[float, float]]:
    """Return name: (level [dBsm] or spread [dB], how far off counts as outside [dB]) of a vehicle or a human."""
    kind = KIND[shape]
    sigma = SIGMA_DB[kind]
    lobes = ("front", "side", "back") if kind == "vehicle" else ("front", "back")
    median, mean = level_circle(kind)
    found = {"mean, sigma_M": (MEAN_DBSM[kind], sigma), "mean, level circle": (mean, sigma)}
    found |= {"median, level circle": (median, sigma), "sigma": (sigma, 0.5 * sigma)}
    return found | {f"{name} lobe": (published_lobe(kind, name), sigma) for name in lobes}


def measured_levels(shape: str, circle: Circle) -> dict[str, float]:
    """Return the same names as :func:`published_levels`, of a circle."""
    found = {"mean, sigma_M": circle.mean, "mean, level circle": circle.mean}
    found |= {"median, level circle": circle.median, "sigma": circle.sigma}
    lobes = {k: circle.lobe(k.removesuffix(" lobe")) for k in published_levels(shape) if k.endswith(" lobe")}
    return found | lobes
