"""Published levels that the atlas draws in, with their sources; facts only.

3GPP TR 38.901 V19.4.0, clause 7.9.2.1: an RCS is sigma_M sigma_D sigma_S, a mean, a pattern over angle, and a
log-normal factor whose linear mean is 1. Tables 7.9.2.1-1 (human, model 1), -3 (human, model 2) and
-4 (vehicle, one point).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from shenron_rt._typing import ArrayLike, FloatArray


@dataclass(frozen=True)
class Lobe:
    """A lobe of TR 38.901's pattern, equation 7.9.2-3 for equal directions of incidence and scattering.

    Parameters
    ----------
    centre_deg, width_deg : float
        Azimuth, and 3 dB width in azimuth [deg].
    zenith_deg, zenith_width_deg : float
        The same in zenith angle [deg].
    peak_dbsm, depth_db : float
        G_max, and sigma_max: how far the pattern falls below it.
    """

    centre_deg: float
    width_deg: float
    zenith_deg: float
    zenith_width_deg: float
    peak_dbsm: float
    depth_db: float

    def level(self, azimuth_deg: ArrayLike, zenith_deg: float = 90.0) -> FloatArray:
        """Return sigma_M sigma_D [dBsm]; azimuth within half a turn of the lobe."""
        off = (np.asarray(azimuth_deg, dtype=np.float64) - self.centre_deg + 180.0) % 360.0 - 180.0
        across = np.minimum(12.0 * (off / self.width_deg) ** 2, self.depth_db)
        along = min(12.0 * ((zenith_deg - self.zenith_deg) / self.zenith_width_deg) ** 2, self.depth_db)
        return np.asarray(self.peak_dbsm - np.minimum(across + along, self.depth_db))


VEHICLE = {
    "front": Lobe(0.0, 40.54, 71.75, 29.13, 15.52, 8.45),
    "left": Lobe(90.0, 26.90, 79.70, 44.42, 20.75, 13.68),
    "back": Lobe(180.0, 36.32, 79.65, 36.73, 14.56, 7.50),
    "right": Lobe(270.0, 26.90, 79.70, 44.42, 20.75, 13.68),
}
HUMAN = {"front": Lobe(0.0, 216.65, 90.0, 55.7, 2.14, 7.7), "back": Lobe(180.0, 216.65, 90.0, 55.7, 2.14, 7.7)}
#: From above: no pattern over azimuth.
ROOF = Lobe(0.0, math.inf, 0.0, 18.13, 21.26, 14.19)
#: 10 lg sigma_M [dBsm], and the standard deviation of 10 lg sigma_S [dB].
MEAN_DBSM = {"vehicle": 11.25, "human": -1.37}
SIGMA_DB = {"vehicle": 3.41, "human": 3.94}

#: Mean RCS [dBsm] of a bicycle with its rider, 77 GHz, over sectors of the aspect off the nose, left and right alike:
#: Belgiovane and Chen, EuCAP 2016, as MathWorks' bicyclist model tabulates it.
BICYCLIST = {"0-30 deg": (0.0, 30.0, -11.57), "31-60 deg": (31.0, 60.0, -13.24), "61-120 deg": (61.0, 120.0, -8.1)}
#: Range of values from behind over distance, articulated bicyclist target, ACEA 2018.
BICYCLIST_REAR_DBSM = (-7.0, 5.0)
#: A human at 9.375 GHz, 0.495 to 1.22 m^2: Schultz et al., Proc. IRE 1958.
HUMAN_SCHULTZ_DBSM = (-3.05, 0.86)

#: Kind of pattern for each target.
KIND = {"car": "vehicle", "truck": "vehicle", "pedestrian": "human"}


def pattern_dbsm(kind: str, azimuth_deg: ArrayLike) -> FloatArray:
    """Return sigma_M sigma_D of a vehicle or a human for a level radar [dBsm]; every lobe rules its own sector."""
    azimuth = np.asarray(azimuth_deg, dtype=np.float64)
    lobes = list((VEHICLE if kind == "vehicle" else HUMAN).values())
    centres = np.array([lobe.centre_deg for lobe in lobes])
    off = np.abs((azimuth[..., None] - centres + 180.0) % 360.0 - 180.0)
    levels = np.stack([lobe.level(azimuth) for lobe in lobes], axis=-1)
    return np.asarray(np.take_along_axis(levels, off.argmin(axis=-1)[..., None], axis=-1)[..., 0])


def car_range_law(range_m: ArrayLike) -> FloatArray:
    """Return min(10 lg(R/m) + 5, 20) dBsm, in m^2: a car's front or back, Karnfelt et al. 2009, used by MathWorks."""
    level = np.minimum(10.0 * np.log10(np.asarray(range_m, dtype=np.float64)) + 5.0, 20.0)
    return np.asarray(10.0 ** (level / 10.0))
