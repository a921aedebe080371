"""Physical constants and conventions used everywhere [SI]."""

from __future__ import annotations

import math

#: Speed of light in vacuum [m/s], exact by the definition of the metre.
SPEED_OF_LIGHT = 299_792_458.0
#: Boltzmann constant [J/K], exact since the 2019 SI.
BOLTZMANN = 1.380_649e-23
#: Standard noise temperature T0 [K] (IEEE definition of the noise figure).
T0 = 290.0
#: RCS shown where there is none [dBsm].
RCS_FLOOR_DBSM = -120.0
#: Ego-frame position of a radar that a caller did not place [m].
DEFAULT_MOUNT_XYZ = (2.0, 0.0, 1.0)
#: Two-way antenna level relative to the peak down to which rays are launched [dB].
PATTERN_FLOOR_TWO_WAY_DB = -40.0
#: Most surfaces along a path through a scene: two over a road, three of a corner reflector.
MOST_SCENE_BOUNCES = 5
#: (4 pi)^3 of the radar equation.
FOUR_PI_CUBED = (4.0 * math.pi) ** 3
