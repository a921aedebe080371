"""Parts that move by themselves: wheels, limbs, and a rotating rod against its closed form."""

from __future__ import annotations

import numpy as np
import pytest

import shenron_rt as srt
from shenron_rt.config.scene import Actor
from shenron_rt.errors import InputError
from shenron_rt.scene.gait import leg_length, pace, walker_limbs
from shenron_rt.scene.odometer import ride_of
from shenron_rt.scene.world import build_world, load_bodies

SPEED, RIM = 10.0, 0.33
#: Far off the front left: the radar looks along the car's side.
RADAR = {"name": "r", "xyz_m": (0, 0, 0.5)}


def profile(**waveform):
    keys = {"antenna.pattern": "isotropic"} | {f"waveform.{k}": v for k, v in waveform.items()}
    return srt.load_profile("awrl1432", keys)


def rolling(**car):
    given = {
        "id": 5,
        "shape": "car",
        "xyz_m": (25, 2.5, 0),
        "velocity_mps": (SPEED, 0, 0),
        "articulation": "auto",
        "aim": 20_000,
    }
    return srt.Scene(actors=[given | car], radars=[RADAR])


def world_at(scene, time):
    bodies, materials = load_bodies(scene)
    return build_world(scene, scene.radars[0], time, bodies, materials)


@pytest.mark.parametrize("shape", ["car", "truck", "bicycle", "pedestrian", "pedestrian:h=1.6"])
@pytest.mark.parametrize(
    "motion",
    [
        {"velocity_mps": (1.4, 0, 0)},
        {"velocity_mps": (3, 1, 0), "ypr_deg": (18.43494882292201, 0, 0), "yaw_rate_deg_s": 30},
        {"trajectory": [{"t_s": k, "xyz_m": (1.4 * k, 0.3 * k * k, 0), "ypr_deg": (20 * k, 0, 0)} for k in range(4)]},
    ],
)
def test_every_vertex_moves_as_the_velocity_of_its_part_says(shape, motion):
    scene = srt.Scene(actors=[{"id": 5, "shape": shape, "articulation": "auto"} | motion], radars=[RADAR])
    dt = 1e-4
    before, now, after = (world_at(scene, 1.3 + k * dt) for k in (-1, 0, 1))
    first = np.zeros(len(now.vertices), dtype=int)
    first[now.faces.ravel()] = np.repeat(np.arange(len(now.faces)), 3)
    velocity = now.velocity_of(first, now.vertices)
    # central difference: dt^2 / 6 of a third derivative below 0.33 m (30 rad/s)^3 is 1.5e-5; a walker on a curved path
    # also changes its pace, which is left out: d(angle)/d(RV) dRV/dt stays below 0.3 rad/s of 0.8 m
    changing = shape.startswith("pedestrian") and "trajectory" in motion
    np.testing.assert_allclose((after.vertices - before.vertices) / (2 * dt), velocity, atol=0.25 if changing else 1e-4)
    assert len(now.bodies[0].links) > 2


def test_rolling_wheel_stands_still_on_the_road_and_doubles_the_speed_at_its_top():
    scene = rolling(xyz_m=(0, 0, 0))
    world = world_at(scene, 0.37)
    link = next(k for k, ln in enumerate(world.bodies[0].links) if ln.name.startswith("front left"))
    vertex = np.unique(world.faces[world.face_link == link])
    points = world.vertices[vertex] + [0, 0, 0.5]
    face = np.flatnonzero(world.face_link == link)[0]
    velocity = world.velocity_of(np.full(len(vertex), face), world.vertices[vertex])
    # the 48-gon of equal area has its corners 0.07 % outside the circle and its edges 0.14 % inside
    assert velocity[np.argmin(points[:, 2]), 0] == pytest.approx(0.0, abs=0.002 * SPEED)
    assert velocity[np.argmax(points[:, 2]), 0] == pytest.approx(2 * SPEED, abs=0.002 * SPEED)


def doppler_span(scene, used, below_db=25.0):
    """Return lowest and highest velocity whose cell stands within ``below_db`` of the strongest, and the bin [m/s]."""
    frame = srt.simulate(scene, used, rays=2_000, noise=None, seed=1)
    line = frame.cube.range_doppler.sum(axis=0)
    seen = np.flatnonzero(line > line.max() * 10 ** (-below_db / 10))
    v = frame.cube.velocity_mps
    return v[seen[0]], v[seen[-1]], frame.cube.velocity_step_mps, frame


def test_wheel_spectrum_spans_twice_the_speed_of_the_hub():
    """A bare tyre rolling away: its rim moves at 0 to 2 v along the line of sight, seen from behind and level with it.

    The tyre alone, as an actor of its own. From 25 m behind and half a metre high the line of sight leans by half a
    degree. The chirps are 25 us apart, so that v_max = 38 m/s holds all of it.
    """
    from shenron_rt.scene.mesh import Part, TaggedMesh
    from shenron_rt.scene.shapes import make_shape
    from shenron_rt.tags import SemanticTag

    ring = make_shape(f"cylinder:r={RIM},l=0.2,edge=0.02")
    lying = ring.vertices @ np.array([[1.0, 0, 0], [0, 0, 1.0], [0, -1.0, 0]]).T + [0, 0, RIM]
    part = Part(group="tyre", tag=SemanticTag.Car, em_material="rubber")
    tyre = TaggedMesh(lying, ring.faces, np.zeros(len(ring.faces), dtype=np.int32), (part,))
    wheel = {"part": "tyre", "center_m": (0, 0, RIM), "axis": (0, 1, 0), "radius_m": RIM}
    actor = {
        "id": 5, "mesh": tyre, "xyz_m": (4, 0, 0), "velocity_mps": (SPEED, 0, 0), "spinning_parts": [wheel],
        "aim": 40_000, "material": "rubber",
    }  # fmt: skip
    scene = srt.Scene(actors=[actor], radars=[RADAR | {"xyz_m": (0, 0, RIM)}])
    used = profile(chirp_period_s=25e-6, chirps=128)
    low, high, step, frame = doppler_span(scene, used, below_db=45.0)
    mine = frame.scatterers
    # level with the hub the visible half of the rim faces the radar: it moves up and down along the line of sight only
    # as much as its height over the hub: v (1 + z / r), from 0 at the road to 2 v at the top
    assert mine.range_rate.min() == pytest.approx(0.0, abs=0.6)
    assert mine.range_rate.max() == pytest.approx(2 * SPEED, abs=0.6)
    assert low == pytest.approx(0.0, abs=1.001 * step)
    assert high == pytest.approx(2 * SPEED, abs=1.001 * step)
    still = scene.model_copy(update={"actors": (scene.actors[0].model_copy(update={"spinning_parts": ()}),)})
    low, high, _, _ = doppler_span(still, used, below_db=45.0)
    # without: the hub's speed alone, as wide as the window's main lobe
    assert high - low < 8 * step


def test_wheels_of_the_car_reach_twice_its_speed_and_its_body_keeps_it():
    scat = srt.trace(rolling(), profile(), rays=60_000)
    wheel = np.abs(scat.range_rate - SPEED * scat.position[:, 0] / scat.range) > 0.5
    assert wheel.sum() > 20
    assert scat.range_rate.min() < 0.2 * SPEED
    assert scat.range_rate.max() > 1.7 * SPEED
    rigid = srt.trace(rolling(articulation="off"), profile(), rays=60_000)
    np.testing.assert_allclose(rigid.range_rate, SPEED * rigid.position[:, 0] / rigid.range, atol=1e-9)


def test_outer_wheel_turns_faster_in_a_bend():
    scene = rolling(yaw_rate_deg_s=30)
    ride = ride_of(scene.actors[0], None, 1.0)
    body = load_bodies(scene)[0][0]
    rate = {ln.name[:11].strip(): ln.motion.at(ride).spin[1] for ln in body.links if ln.motion}
    outer = (SPEED + 0.76 * np.radians(30)) / RIM
    assert max(rate.values()) == pytest.approx(outer, rel=1e-9)


# ---- the walker
@pytest.mark.parametrize("speed", [0.5, 1.4, 2.0])
def test_pace_is_boulics(speed):
    actor = Actor(id=1, shape="pedestrian", velocity_mps=(speed, 0, 0))
    cycles, rate, rv = pace(ride_of(actor, None, 2.0), 1.75)
    assert rv == pytest.approx(speed / leg_length(1.75))
    # a cycle is 1.346 sqrt(RV) legs long
    assert rate == pytest.approx(speed / (1.346 * np.sqrt(rv) * leg_length(1.75)))
    assert cycles == pytest.approx(2.0 * rate)


def test_limbs_swing_forth_and_back_over_a_cycle_and_sides_are_half_a_cycle_apart():
    actor = Actor(id=1, shape="pedestrian", velocity_mps=(1.4, 0, 0))
    limbs = walker_limbs(1.75)
    period = 1 / pace(ride_of(actor, None, 0.0), 1.75)[1]

    def foot(side, time):
        state = limbs[f"{side} shoe"].at(ride_of(actor, None, time))
        return state.rotation @ [0, 0, 0.05] + state.origin

    track = np.array([foot("right", t) for t in np.linspace(0, period, 41)])
    np.testing.assert_allclose(foot("left", 0.5 * period + 0.1), foot("right", 0.1), atol=1e-9)
    np.testing.assert_allclose(track[0], track[-1], atol=1e-9)
    stride = np.ptp(track[:, 0])
    # thigh and lower leg, 0.89 m, through 25 + 15 degrees: 0.6 m of step
    assert 0.5 < stride < 0.9
    assert track[:, 2].max() > 0.1


def test_walker_spectrum_reaches_from_the_standing_to_the_swinging_foot():
    walker = {"id": 7, "shape": "pedestrian", "xyz_m": (8, 0, 0), "velocity_mps": (1.4, 0, 0), "aim": 20_000}
    used = profile(chirp_period_s=100e-6, chirps=128)
    span = {}
    for articulation in ("off", "auto"):
        scene = srt.Scene(actors=[walker | {"articulation": articulation}], radars=[RADAR])
        frame = srt.simulate(scene, used, rays=2000, noise=None, seed=1, time=0.88)
        line, velocity = frame.cube.range_doppler.sum(axis=0), frame.cube.velocity_mps
        seen = velocity[line > 1e-4 * line.max()]
        span[articulation] = seen.min(), seen.max(), frame.scatterers.range_rate
    step = frame.cube.velocity_step_mps
    # the main lobe of Hann ends two bins off; one more for where the velocity lies in its bin
    low, high, _ = span["off"]
    assert 1.4 - 3 * step <= low <= high <= 1.4 + 3 * step
    low, high, rate = span["auto"]
    assert rate.min() - 3 * step <= low < 0.5
    # the tip of the shoe alone is as fast as the fastest point; within 40 dB of the trunk there is a bit more of it
    assert 0.85 * rate.max() <= high <= rate.max() + 3 * step
    assert high > 3 * 1.4


def test_walker_points_move_from_not_at_all_to_three_times_its_speed():
    walker = {"id": 7, "shape": "pedestrian", "xyz_m": (8, 0, 0), "velocity_mps": (1.4, 0, 0), "aim": 20_000}
    span = {}
    for articulation in ("off", "auto"):
        scene = srt.Scene(actors=[walker | {"articulation": articulation}], radars=[RADAR])
        rates = [srt.trace(scene, profile(), rays=2_000, time=t).range_rate for t in np.linspace(0, 1.1, 12)]
        span[articulation] = min(r.min() for r in rates), max(r.max() for r in rates)
    assert span["off"][1] - span["off"][0] < 0.1
    # a swinging foot reaches about three times the walking speed, a standing one none of it (Chen 2011, sec. 4.2)
    assert 2.5 < span["auto"][1] / 1.4 < 4.5
    assert span["auto"][0] < 0.3


# ---- the rotating rod
ROD, RATE, DISTANCE = 0.5, 720.0, 20.0


def rod(**extra):
    """Two points at the ends of a rod of 1 m that turns twice a second, its middle 20 m ahead."""
    hub = {
        "id": 9,
        "shape": "box:0.001x0.001x0.001",
        "xyz_m": (DISTANCE, 0, 0.5),
        "yaw_rate_deg_s": RATE,
        "name": "hub",
    }
    ends = [{"id": k + 1, "actor": 9, "xyz_m": (0, side * ROD, 0), "rcs_dbsm": 10} for k, side in enumerate((1, -1))]
    return srt.Scene(actors=[hub], point_targets=ends, radars=[RADAR | extra])


def closed_form(used, time):
    """Return the (chirps, samples) sum of the two points at every sample's own instant, and its amplitude unit."""
    w, c = used.waveform, 299_792_458.0
    fast = w.adc_start_s + np.arange(w.samples) / w.sample_rate_hz
    at = time + used.raw_chirp_start_s[:, :1] + fast[None]
    total = 0
    for side in (1, -1):
        angle = np.radians(RATE) * at
        x, y = DISTANCE - side * ROD * np.sin(angle), side * ROD * np.cos(angle)
        tau = 2 * np.hypot(x, y) / c
        slope = w.slope_hz_per_s
        total = (
            total
            + np.exp(2j * np.pi * (w.carrier_hz * tau + slope * tau * fast - slope * tau**2 / 2)) / np.hypot(x, y) ** 2
        )
    return total


def misfit(found, wanted):
    scale = np.vdot(wanted, found) / np.vdot(wanted, wanted)
    return float(np.linalg.norm(found - scale * wanted) / np.linalg.norm(found))


@pytest.mark.parametrize(("retrace", "low", "high"), [(1, 0.05, 0.2), (64, 0.0, 1e-4)])
def test_rotating_rod_has_the_phase_of_its_closed_form_when_traced_at_every_chirp(retrace, low, high):
    """Straight lines err by a t^2 / 2, a = r w^2 = 79 m/s^2 along the line of sight, at which the rod points: 53 um and
    a phase of 0.17 rad at the frame's ends, 0.06 rad rms after the best common phase.

    With a pose for each chirp what is left is the curve within a chirp, a (36 us / 2)^2 / 2 = 13 nm or 4e-5 rad.
    """
    used = profile(chirps=64)
    time = 0.12
    frame = srt.simulate(rod(), used, time=time, noise=None, rays=200, accuracy=1e-6, retrace=retrace)
    error = misfit(frame.adc.data[:, 0], closed_form(used, time))
    assert low <= error < high


def test_error_of_straight_lines_falls_with_the_square_of_the_segments():
    used, time = profile(chirps=64), 0.12
    wanted = closed_form(used, time)
    error = [
        misfit(
            srt.simulate(rod(), used, time=time, noise=None, rays=200, accuracy=1e-6, retrace=n).adc.data[:, 0], wanted
        )
        for n in (2, 4, 8)
    ]
    # each halving of the segments quarters the sagitta of the curve
    assert error[0] / error[1] == pytest.approx(4.0, rel=0.25)
    assert error[1] / error[2] == pytest.approx(4.0, rel=0.35)


def test_retracing_leaves_straight_motion_as_it_is():
    scene = srt.Scene(
        ego={"velocity_mps": (12, 0, 0)},
        actors=[{"id": 5, "shape": "box:2x1.8x1.5", "xyz_m": (20, 1, 0.75), "velocity_mps": (7, 0, 0), "aim": 2000}],
        point_targets=[{"id": 6, "xyz_m": (30, -3, 1), "rcs_dbsm": 5}],
        radars=[RADAR],
    )
    one, four = (srt.simulate(scene, profile(), rays=500, noise=None, seed=2, retrace=n) for n in (1, 4))
    # the coherent echo of the box is that of other rays a millimetre further on; powers agree
    a, b = (np.sum(np.abs(f.adc.data) ** 2) for f in (one, four))
    assert 10 * np.log10(b / a) == pytest.approx(0.0, abs=0.5)
    assert len(four.detections) == len(one.detections)


@pytest.mark.parametrize("retrace", [0, 65])
def test_impossible_segments_are_refused(retrace):
    with pytest.raises(InputError, match=r"retrace: .*allowed: 1"):
        srt.simulate(rod(), profile(chirps=64), rays=200, retrace=retrace)


def test_point_on_an_unknown_actor_is_refused():
    with pytest.raises(ValueError, match="point target 1: no actor 4"):
        srt.Scene(point_targets=[{"id": 1, "actor": 4, "xyz_m": (0, 0, 0), "rcs_dbsm": 0}])


def test_unknown_spinning_part_lists_the_parts():
    scene = rolling(spinning_parts=[{"part": "rotor", "center_m": (0, 0, 1), "rate_deg_s": 90}])
    with pytest.raises(ValueError, match=r"no part is named 'rotor'; the mesh has: .*front left tyre"):
        load_bodies(scene)


def test_retracing_takes_paths_over_several_surfaces_along():
    scene = srt.Scene(
        static=[{"shape": "ground:40x20", "xyz_m": (21, 0, 0), "tag": "Roads", "material": "asphalt"}],
        actors=[{"id": 5, "shape": "box:2x1.8x1.5", "xyz_m": (20, 1, 0.75), "velocity_mps": (7, 0, 0), "aim": 2000}],
        radars=[RADAR],
    )
    frames = [srt.simulate(scene, profile(), rays=2000, max_bounces=2, noise=None, seed=2, retrace=n) for n in (1, 2)]
    assert np.any(frames[0].returns.bounces > 1)
    power = [np.sum(np.abs(f.adc.data) ** 2) for f in frames]
    assert 10 * np.log10(power[1] / power[0]) == pytest.approx(0.0, abs=0.5)
