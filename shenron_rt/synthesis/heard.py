"""Which radars of a scene transmit into one that is simulated, and how strongly."""

from __future__ import annotations

import numpy as np

from ..config.interferer import Interferer
from ..config.profile import RadarProfile
from ..config.scene import RadarMount, Scene
from ..frames import spherical
from ..physics.link_budget import one_way_power
from ..randomness import frame_generator
from ..scene.motion import BodyState
from ..scene.motion_of import ego_state
from .interference import HeardRadar

__all__ = ["heard_radars"]


def heard_radars(
    scene: Scene, mount: RadarMount, profile: RadarProfile, *, time: float, seed: int = 0, frame: int = 0
) -> tuple[HeardRadar, ...]:
    """Return the frames of the scene's interferers that overlap one frame of a radar.

    Parameters
    ----------
    scene : Scene
    mount : RadarMount
        The radar that hears them.
    profile : RadarProfile
        Its profile.
    time : float
        Scene seconds at its first chirp's start [s].
    seed, frame : int
        The oscillators' phases derive from them.

    Notes
    -----
    One-way budget along the direct path, with both patterns, half of each radome's two-way loss in dB, and weather one
    way. Nothing shadows it, and polarisations are taken as matched. Where all transmitters send at once their powers
    add; they count as one antenna at its origin.
    """
    if not scene.interferers:
        return ()
    eye = ego_state(scene, time + profile.frame_mid_s).mounted(mount.pose)
    generator = frame_generator(seed, frame, mount.name, "interferers")
    found = []
    for item in scene.interferers:
        other = _profile_of(scene, item)
        phase = float(generator.uniform(0, 2 * np.pi))
        period = item.frame_period_s or scene.frame_period_s
        lasts, own = (float(p.raw_chirp_start_s[-1, -1]) + max(p.waveform.periods_s) for p in (other, profile))
        # frames that begin before this one ends, and end after it begins
        first = max(0, int(np.ceil((time - lasts - item.start_s) / period)))
        last = int(np.floor((time + own - item.start_s) / period))
        for number in range(first, last + 1):
            start = item.start_s + number * period - time
            found.append(_heard(scene, item, other, eye, profile, time + profile.frame_mid_s, start, phase))
    return tuple(found)


def _profile_of(scene: Scene, item: Interferer) -> RadarProfile:
    profile = scene.profile_of(item)
    if item.tx_power_dbm is None:
        return profile
    data = profile.model_dump()
    return RadarProfile.model_validate(data | {"receiver": data["receiver"] | {"tx_power_dbm": item.tx_power_dbm}})


def _heard(
    scene: Scene,
    item: Interferer,
    other: RadarProfile,
    eye: BodyState,
    profile: RadarProfile,
    mid_s: float,
    start_s: float,
    phase: float,
) -> HeardRadar:
    where = item.pose.translation + np.multiply(item.velocity_mps, mid_s)
    position = eye.rotation.T @ (where - eye.origin)
    moving, turning = np.asarray(item.velocity_mps) - eye.velocity, eye.spin
    velocity = eye.rotation.T @ moving - np.cross(eye.rotation.T @ turning, position)
    distance, azimuth, elevation = spherical(position)
    _, back_azimuth, back_elevation = spherical(item.pose.rotation.T @ (eye.origin - where))
    at_once = other.n_tx if other.array.multiplex in ("bpm", "ddm") else 1
    half_losses = (other.antenna.radome_loss_db + profile.antenna.radome_loss_db) / 2
    weather = None if scene.weather is None else scene.weather.plain()
    air = 1.0 if weather is None else weather.two_way_loss(distance, other.center_hz, other.antenna.polarization) ** 0.5
    power = one_way_power(
        distance,
        other.wavelength_m,
        other.tx_power_w * at_once,
        10 ** (other.antenna.gain_tx_dbi / 10) * other.pattern(back_azimuth, back_elevation),
        10 ** (profile.antenna.gain_rx_dbi / 10) * profile.pattern(azimuth, elevation),
        10 ** (half_losses / 10) * air,
    )
    return HeardRadar(other, position, velocity, float(power), start_s, phase)
