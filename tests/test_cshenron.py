"""Parity with the public C-Shenron code: its numbers, from its points to its images."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pytest

from shenron_rt import InputError, load_profile
from shenron_rt.cshenron import dsp
from shenron_rt.cshenron.layout import VIEWS_DEG, view_points
from shenron_rt.cshenron.radar import ReleasedRadar
from shenron_rt.cshenron.synthesis import direct_sum, synthesize_released
from shenron_rt.echo import _shenron_tables as tables
from shenron_rt.echo._shenron_loss import released_loss, released_terms

#: Double precision reaches 2e-15; asked is 1e-12. Below the second the human body's zero is rounding noise.
RELATIVE, ABSOLUTE = 1e-12, 1e-20
PROFILES = {"tic": "ti_cascade", "rb": "radarbook"}

Reference = Mapping[str, np.ndarray]


@pytest.fixture(scope="module")
def ref(shared_reference: Path) -> Reference:
    return np.load(shared_reference / "c_shenron_parity.npz")


def _radar(short: str) -> ReleasedRadar:
    return ReleasedRadar.of(load_profile(PROFILES[short]))


def _rms(values: np.ndarray, expected: np.ndarray) -> float:
    return float(np.sqrt(np.mean(np.abs(values - expected) ** 2) / np.mean(np.abs(expected) ** 2)))


def _of_peak(values: np.ndarray, expected: np.ndarray) -> float:
    return float(np.abs(values - expected).max() / np.abs(expected).max())


def test_tags_classes_and_materials_are_the_released_ones(ref: Reference) -> None:
    tags = ref["points"][:, 5].astype(int)
    np.testing.assert_array_equal(tables.released_class(tags), ref["internal_class"])
    np.testing.assert_array_equal(tables.material_of_class(ref["internal_class"]), ref["material"])
    np.testing.assert_array_equal(tables.RELEASED_CLASS, ref["tag_table_upstream"])
    np.testing.assert_array_equal(tables.CLASS_TO_MATERIAL, ref["class_to_material"])
    np.testing.assert_array_equal(tables.PERMITTIVITY, ref["material_permittivity"])
    np.testing.assert_array_equal(tables.ROUGHNESS_M, ref["material_roughness_m"])


@pytest.mark.parametrize("view", VIEWS_DEG)
def test_the_crop_the_geometry_and_the_loss_of_every_view(ref: Reference, view: int) -> None:
    points = view_points(ref["points"], view)
    loss = released_loss(points.cosine, points.polar_angle, points.material, _radar("tic").start_hz)
    np.testing.assert_array_equal(points.rows, ref[f"tic_v{view:03d}_keep"])
    for name, value in (("rho", points.rho), ("theta", points.theta), ("loss", loss)):
        np.testing.assert_allclose(value, ref[f"tic_v{view:03d}_{name}"], rtol=RELATIVE, atol=ABSOLUTE, err_msg=name)


def test_the_polar_angle(ref: Reference) -> None:
    np.testing.assert_allclose(view_points(ref["points"], 0).polar_angle, ref["v000_polar_angle"], rtol=RELATIVE)


@pytest.mark.parametrize("short", PROFILES)
def test_the_parts_of_the_loss_and_their_switches(ref: Reference, short: str) -> None:
    points, frequency = view_points(ref["points"], 0), _radar(short).start_hz
    given = (points.cosine, points.polar_angle, points.material, frequency)
    scattered, specular = released_terms(*given)
    for name, value in (
        ("default_total", released_loss(*given)),
        ("both_total", released_loss(*given, specular=True)),
        ("both_scat", scattered),
        ("both_spec", specular),
        ("spec_only_total", released_loss(*given, specular=True, diffuse=False)),
    ):
        np.testing.assert_allclose(value, ref[f"{short}_loss_{name}"], rtol=RELATIVE, atol=ABSOLUTE, err_msg=name)


@pytest.mark.parametrize("short", PROFILES)
def test_the_loss_tables_over_the_true_angle(ref: Reference, short: str) -> None:
    angle, level = ref["table_angle_rad"], np.full(91, np.pi / 2)
    for material, expected in enumerate(ref[f"{short}_loss_table"]):
        terms = released_terms(angle, level, np.full(91, material), _radar(short).start_hz)
        for term, table in zip(terms, expected.T, strict=True):
            # toward grazing a term is what is left of numbers of the table's largest size, whose sines and cosines
            # differ in the last bit from processor to processor
            rounding = 10 * np.finfo(float).eps * np.abs(table).max()
            np.testing.assert_allclose(term, table, rtol=RELATIVE, atol=max(rounding, ABSOLUTE))


@pytest.mark.parametrize("case", ["tic_v000", "tic_moving", "rb_moving"])
def test_the_adc_cube(ref: Reference, case: str) -> None:
    short, moving = case.split("_")[0], case.endswith("moving")
    points, radar = view_points(ref["points"], 0), _radar(short)
    loss = released_loss(points.cosine, points.polar_angle, points.material, radar.start_hz)
    adc = synthesize_released(radar, points.rho, points.theta, loss, ref["v000_speed"] if moving else 0.0)
    # the reference of radarbook is stored in single precision, 3e-8
    assert _rms(adc, ref[f"{case}_adc_ref"]) < 1e-6
    # the public code computes phases in single precision; the reference's own distance is 1.6e-3 to 5.2e-3
    assert _rms(adc, ref[f"{case}_adc"]) < 1e-2


def test_processing_equals_the_public_code(ref: Reference) -> None:
    adc = ref["tic_v000_adc"]
    assert _of_peak(dsp.range_profile(adc), ref["tic_v000_range_profile"]) < 1e-6  # stored in single precision
    assert _of_peak(dsp.range_angle(adc), ref["tic_v000_range_angle"]) < 1e-12
    assert _of_peak(dsp.range_angle(ref["tic_v000_adc_ref"]), ref["tic_v000_range_angle_ref"]) < 1e-12
    assert _of_peak(dsp.doppler_slice(ref["tic_moving_adc"]), ref["tic_moving_doppler_ant0"]) < 1e-6
    np.testing.assert_array_equal(dsp.cartesian_image(ref["tic_v000_range_angle"]), ref["tic_v000_cart"])


def test_masks_and_the_composite(ref: Reference) -> None:
    np.testing.assert_allclose(dsp.view_mask(), ref["mask_35_110_0"], atol=6e-8)  # stored in single precision
    views = [ref[f"tic_v{v:03d}_cart"] for v in VIEWS_DEG]
    assert _of_peak(dsp.fblr(*views), ref["fblr"]) < 1e-6


@pytest.mark.parametrize("view", VIEWS_DEG)
def test_the_image_of_every_view_from_its_points(ref: Reference, view: int) -> None:
    points, radar = view_points(ref["points"], view), _radar("tic")
    loss = released_loss(points.cosine, points.polar_angle, points.material, radar.start_hz)
    adc = synthesize_released(radar, points.rho, points.theta, loss)
    assert _rms(adc[:1], direct_sum(radar, points.rho, points.theta, loss, chirps=slice(1))) < 1e-6
    image, expected = dsp.cartesian_image(dsp.range_angle(adc)), ref[f"tic_v{view:03d}_cart"]
    # Asked for is 1e-3 of the peak. The rear and left views hold so few points that the rounding of the public code's
    # phases stands above it, 2.2e-3 and 1.5e-3 where there is no point at all; the test below has it to the digit.
    assert _of_peak(image, expected) < (1e-3 if view in (0, 90) else 3e-3)
    peak = np.unravel_index(expected.argmax(), expected.shape)
    assert image[peak] == pytest.approx(expected[peak], rel=1e-3)


def _single_precision(radar: ReleasedRadar, rho: np.ndarray, theta: np.ndarray, loss: np.ndarray) -> np.ndarray:
    """Return one chirp (1, channels, samples) of ``direct_sum``, delay and phases rounded to single precision."""
    single, turn, slope = np.float32, np.float32(2 * np.pi), np.float32(radar.slope)
    carrier, half = single(radar.start_hz), single(radar.slope / 2)
    t = (np.arange(radar.samples) / radar.sample_rate_hz).astype(single)
    tau = 2 * rho.astype(single) / single(3e8)
    step = 0.5 / radar.start_hz * np.cos(theta)  # half a wavelength to the right, as a delay
    delta = (np.arange(radar.channels)[:, None] * step).astype(single)
    sweep = np.exp(1j * (turn * (carrier * tau + slope * tau * t[:, None] - half * tau * tau)).astype(np.complex64))
    total = np.zeros((1, radar.channels, radar.samples), dtype=np.complex128)
    for p, amplitude in enumerate((radar.scale * np.sqrt(loss) / rho).astype(single)):
        d = delta[:, p : p + 1]
        beam = turn * (carrier * d - half * d * d - slope * tau[p] * d + slope * d * t)
        total[0] += amplitude * sweep[:, p] * np.exp(1j * beam.astype(np.complex64))
    return total


@pytest.mark.parametrize("view", VIEWS_DEG)
def test_the_same_sum_in_single_precision_has_the_public_spurs_of_every_view(ref: Reference, view: int) -> None:
    points, radar = view_points(ref["points"], view), _radar("tic")
    loss = released_loss(points.cosine, points.polar_angle, points.material, radar.start_hz)
    adc = np.repeat(_single_precision(radar, points.rho, points.theta, loss), radar.chirps, axis=0)
    # 1e-3 is asked; measured are 2e-6 to 8e-6. A phase of 5e4 cycles has steps of 4e-3 cycles in single precision, so
    # one delay rounded the other way is another draw of the spurs: 3e-4 in a view of 24 points.
    assert _of_peak(dsp.cartesian_image(dsp.range_angle(adc)), ref[f"tic_v{view:03d}_cart"]) < 1e-4
    if view == 0:
        assert _rms(adc, ref["tic_v000_adc"]) < 1e-4  # measured 8e-6; double precision is 4.8e-3 away


def test_cfar_on_magnitude_and_on_squares(ref: Reference) -> None:
    np.testing.assert_array_equal(dsp.cfar(ref["cfar_in"]), ref["cfar_hits"])
    squared = np.abs(ref["cfar_in"]) ** 2
    np.testing.assert_array_equal(dsp.cfar(squared), ref["cfar_hits_presquared"])
    np.testing.assert_array_equal(dsp.cfar(squared, square=False), ref["cfar_hits"])  # as it was meant


def test_the_released_axes(ref: Reference) -> None:
    for value, name in zip(dsp.released_axes(), ("range_axis", "angle_axis", "vel_axis"), strict=True):
        np.testing.assert_allclose(value, ref[name], rtol=1e-14)


@pytest.mark.parametrize(
    ("short", "channels", "chirps", "speed"),
    [("tic", 86, 3, 0.0), ("tic", 1, 3, 5.0), ("tic", 16, 3, 40.0), ("tic", 2, 9, 90.0), ("rb", 2, 40, 60.0)],
)
def test_the_fast_sum_keeps_its_accuracy_for_any_array_and_speed(
    short: str, channels: int, chirps: int, speed: float, rng: np.random.Generator
) -> None:
    radar = ReleasedRadar.of(load_profile(PROFILES[short], {"waveform.chirps": chirps}), channels)
    n = 12
    rho, theta, loss = rng.uniform(0.9, 149, n), rng.uniform(0.01, np.pi - 0.01, n), rng.uniform(0.1, 9, n)
    velocity = speed * rng.uniform(-1, 1, n)
    exact = direct_sum(radar, rho, theta, loss, velocity)
    scale = np.sqrt(np.sum(radar.scale**2 * loss / rho**2))
    for accuracy in (1e-3, 1e-6, 1e-9):
        fast = synthesize_released(radar, rho, theta, loss, velocity, accuracy=accuracy)
        assert np.sqrt(np.mean(np.abs(fast - exact) ** 2)) < max(accuracy, 3e-9) * scale  # phases of 1e5 cycles


def test_signs_of_range_doppler_and_angle_are_all_positive_bins() -> None:
    radar = _radar("rb")
    speed, bins = 2.0, 2 * 2.0 * 24e9 / 3e8 * 0.75e-3 * 128
    adc = synthesize_released(radar, [30.0], [np.pi / 2 - np.radians(19.47)], [1.0], [speed])
    spectrum = np.abs(dsp.doppler_slice(adc))
    row, column = np.unravel_index(spectrum.argmax(), spectrum.shape)
    assert row == round(30.0 / 0.6)
    assert column - 64 == round(bins) == 31
    angle_bin = dsp.range_angle(adc)[row].argmax() - 128
    assert angle_bin == round(128 * np.sin(np.radians(19.47))) == 43


def test_points_of_the_wrong_form_are_refused() -> None:
    good = np.array([[10.0, 0.0, 0.5, 0.9, 0, 10]])
    assert len(view_points(good, 0).rows) == 1
    for bad, message in (
        (good[:, :5], "columns"),
        (np.where(good == 0.9, 1.5, good), "cosine"),
        (np.where(good == 10, np.nan, good), "finite"),
        (np.column_stack([good[:, :5], [10.5]]), "tag"),
        (np.column_stack([good[:, :5], [25]]), "released tag table"),
    ):
        with pytest.raises(InputError, match=message):
            view_points(bad, 0)


@pytest.mark.parametrize(("shape", "message"), [((3, 86), "dimensions"), ((2, 4, 64), "0, 0"), ((3, 4, 512), "256")])
def test_cubes_the_released_processing_cannot_take_are_refused(shape: tuple[int, ...], message: str) -> None:
    with pytest.raises(InputError, match=message):
        dsp.range_angle(np.ones(shape, dtype=complex))


def test_one_chirp_is_enough_for_an_image() -> None:
    assert dsp.range_angle(np.ones((1, 4, 256), dtype=complex)).max() == pytest.approx(4 * 127.5)  # sum of Hann(256)
