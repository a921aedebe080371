"""What ``sweep_rcs`` gives back, and what it refuses: one line that says what, the value and what is allowed."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import shenron_rt as srt
from shenron_rt.errors import InputError, ShenronError

PLATE = "plate:0.1x0.1"


def sweep(target: object = PLATE, **options: object) -> srt.RcsSweep:
    return srt.sweep_rcs(target, **({"frequency_hz": 24e9, "azimuth_deg": 0.0, "max_bounces": 1} | options))


def test_the_result_keeps_every_axis_and_order() -> None:
    found = sweep(
        frequency_hz=[24e9, 25e9], azimuth_deg=[0.0, 1.0, 2.0], elevation_deg=[-3.0, 0.0, 2.0, 5.0],
        polarization=("HH", "VV", "VH"),
    )  # fmt: skip
    assert found.amplitude.shape == found.rcs_dbsm.shape == found.rcs_m2.shape == (2, 4, 3, 3)
    assert np.array_equal(found.frequency_hz, [24e9, 25e9])
    assert np.array_equal(found.elevation_deg, [-3.0, 0.0, 2.0, 5.0])
    assert np.array_equal(found.azimuth_deg, [0.0, 1.0, 2.0])
    assert found.polarization == ("HH", "VV", "VH")
    # the peak is where the plate faces the radar, and no plate depolarises
    assert np.unravel_index(found.rcs_m2[0, :, :, 0].argmax(), (4, 3)) == (1, 0)
    assert (found.rcs_dbsm[..., 2] < found.rcs_dbsm[..., 0].max() - 100.0).all()


def test_numbers_become_axes_of_one_and_nothing_is_squeezed() -> None:
    found = sweep(polarization="VV")
    assert found.amplitude.shape == (1, 1, 1, 1)
    assert found.distance_m is None
    assert found.bistatic_deg is None
    assert "far field" in repr(found)


def test_the_floor_is_minus_120_dbsm_and_no_nan() -> None:
    found = sweep(azimuth_deg=[90.0, 180.0], polarization=("VV", "HV"))  # edge on, and from behind: a thin plate
    assert np.isfinite(found.rcs_dbsm).all()
    assert found.rcs_dbsm.min() == -120.0
    # 4 pi A^2/lambda^2 on either side
    assert found.rcs_dbsm[0, 0, 1, 0] == pytest.approx(sweep().rcs_dbsm.item(), abs=0.01)


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"polarization": "XX"}, r"polarization.*XX.*VV.*HH.*HV.*VH"),
        ({"polarization": ("VV", "LR")}, r"LR"),
        ({"polarization": ()}, r"polarization"),
        ({"material": "mettal"}, r"mettal.*did you mean 'metal'"),
        ({"azimuth_deg": []}, r"azimuth_deg.*\[\]"),
        ({"elevation_deg": []}, r"elevation_deg"),
        ({"frequency_hz": []}, r"frequency_hz"),
        ({"azimuth_deg": [0.0, float("nan")]}, r"azimuth_deg.*finite"),
        ({"azimuth_deg": [[0.0, 1.0]]}, r"azimuth_deg"),
        ({"frequency_hz": 0.0}, r"frequency_hz: 0.*> 0"),
        ({"frequency_hz": -24e9}, r"frequency_hz"),
        ({"azimuth_deg": 90.0, "distance_m": 0.04}, r"distance_m: 0\.04.*0\.05 m towards the radar"),
        ({"distance_m": -1.0}, r"distance_m: -1"),
        ({"distance_m": float("nan")}, r"distance_m: nan"),
        ({"max_bounces": 0}, r"max_bounces: 0.*1 to 10"),
        ({"max_bounces": 11}, r"max_bounces: 11"),
        ({"rays_per_wavelength": 0.0}, r"rays_per_wavelength: 0"),
        ({"rays_per_wavelength": float("inf")}, r"rays_per_wavelength: inf"),
        ({"permittivity": 4.0 + 1.0j}, r"permittivity.*eps' - j eps''"),
        ({"permittivity": float("nan")}, r"permittivity: nan"),
        ({"bistatic": (0.0, float("nan"))}, r"bistatic"),
        ({"bistatic": (0.0, float("inf"))}, r"bistatic"),
    ],
)  # fmt: skip
def test_impossible_wishes_are_refused_in_one_line(options: dict[str, object], said: str) -> None:
    with pytest.raises(InputError, match=said) as refused:
        sweep(**options)
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize("target", ["plat:1x1", "plate:1x", "plate:-1x1", "sphere:r=0", "", "trihedral:round,a=1"])
def test_shapes_that_do_not_exist_are_refused(target: str) -> None:
    with pytest.raises(InputError):
        sweep(target)


def test_files_that_are_missing_broken_or_empty_are_refused_by_name(tmp_path: Path) -> None:
    with pytest.raises(ShenronError, match=r"nothing\.obj"):
        sweep(str(tmp_path / "nothing.obj"))
    for name, content in (("noise.ply", b"\x00\x01\x02"), ("empty.obj", b""), ("points.obj", b"v 0 0 0\nv 1 0 0\n")):
        file = tmp_path / name
        file.write_bytes(content)
        with pytest.raises(ShenronError, match=name.replace(".", r"\.")):
            sweep(file)


def test_an_unknown_frame_or_unit_of_a_file_is_refused(tmp_path: Path) -> None:
    file = tmp_path / "plate.obj"
    file.write_text("v 0 0 0\nv 0 0.1 0\nv 0 0 0.1\nf 1 2 3\n")
    with pytest.raises(InputError, match="furlong"):
        sweep(file, units="furlong")
    with pytest.raises(InputError, match="sideways"):
        sweep(file, mesh_frame="sideways")
    assert sweep(file).target == "plate.obj"


def test_a_wall_before_the_radar_is_not_around_it() -> None:
    # 5 m of wall 2 m ahead: its ends lie farther from its middle than the radar does, and hide nothing
    found = sweep("plate:5x5", distance_m=2.0)
    assert 9.0 < found.rcs_dbsm.item() < 13.0  # pi R^2 is 11.0 dBsm; the rim ripples by a dB or so


@pytest.mark.parametrize("options", [{"material": "mettal"}, {"backend": "metal"}])
def test_errors_are_the_package_s_own(options: dict[str, object]) -> None:
    with pytest.raises(ShenronError):
        sweep(**options)
