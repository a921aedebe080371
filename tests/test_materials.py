"""The material table: citations, energy, ranges, tags, weather."""

from __future__ import annotations

import logging
from pathlib import Path

import numpy as np
import pytest

from shenron_rt.config.materials import Material, MaterialTable, load_materials
from shenron_rt.errors import ConfigError, InputError, NotFoundError
from shenron_rt.physics import coherent_factor, fresnel, layered, slab, water_permittivity
from shenron_rt.tags import SemanticTag

BANDS_HZ = (24.125e9, 76.0e9, 77e9, 81e9)
TABLE = load_materials()


def write(folder: Path, text: str) -> Path:
    path = folder / "table.yaml"
    path.write_text(text)
    return path


ENTRY = "materials:\n  rock:\n    permittivity: {model: constant, real: 4.0, imag: 0.1}\n"


def test_the_issue_s_materials_exist() -> None:
    wanted = "metal car_paint glass plastic rubber asphalt asphalt_wet concrete brick wood"
    wanted += " vegetation grass soil skin clothing"
    assert set(wanted.split()) <= set(TABLE.materials)


@pytest.mark.parametrize("name", list(TABLE.materials))
def test_coherent_plus_incoherent_is_at_most_the_incident_power(name: str) -> None:
    material = TABLE[name]
    cos = np.cos(np.radians(np.linspace(0.0, 89.9, 120)))
    for frequency in BANDS_HZ:
        for polarization in ("VV", "HH"):
            assert np.max(material.energy(frequency, cos, polarization)) <= 1.0 + 1e-6


@pytest.mark.parametrize("name", list(TABLE.materials))
def test_without_volume_scattering_the_incoherent_part_is_at_most_what_roughness_took(name: str) -> None:
    given = TABLE[name].model_dump(exclude_unset=True)
    material = Material.model_validate({k: v for k, v in given.items() if k != "volume_albedo"})
    cos = np.cos(np.radians(np.linspace(0.0, 85.0, 60)))
    for frequency in (24.125e9, 77e9):
        power = np.maximum(*(np.abs(r) ** 2 for r in material.reflection(frequency, cos)))
        kept = material.coherent_factor(frequency, cos) ** 2
        coherent = power * kept
        diffuse = material.energy(frequency, cos) - coherent
        assert np.all(diffuse <= power * (1.0 - kept) * (1.0 + 1e-4) + 1e-9)


def test_levels_are_where_a_radar_engineer_expects_them_at_77_ghz() -> None:
    def level(name: str, incidence_deg: float) -> float:
        return float(10 * np.log10(TABLE[name].sigma0(77e9, np.cos(np.radians(incidence_deg)))))

    for grazing in (2, 5, 10):
        assert -45 < level("asphalt", 90 - grazing) < -25
        assert level("asphalt_wet", 90 - grazing) < level("asphalt", 90 - grazing) - 2
    for grazing in (5, 10, 15):
        assert -50 < level("concrete", 90 - grazing) < -30
        assert -22 < level("grass", 90 - grazing) < -10
        assert -25 < level("gravel", 90 - grazing) < -12
    for grazing in (10, 30):
        assert -18 < level("vegetation", 90 - grazing) < -8
    assert 0 < level("concrete", 0) < 6
    assert level("car_paint", 0) < -35
    assert np.all(TABLE["metal"].sigma0(77e9, np.linspace(0, 1, 5)) == 0.0)


def test_table_lookup_follows_the_models() -> None:
    grass = TABLE["grass"]
    cos = np.cos(np.radians([0.0, 33.3, 70.0, 85.0]))
    want = 10 ** (-0.9) * cos  # constant gamma of -9 dB at 77 GHz, far from its energy limit here
    assert np.allclose(grass.sigma0(77e9, cos), want, rtol=1e-5)
    assert np.allclose(grass.sigma0(77e9, cos, "HV"), want * 10 ** (-0.7), rtol=1e-5)
    # between the two given frequencies the level is linear in the logarithm of the frequency
    middle = np.sqrt(24e9 * 77e9)
    assert float(10 * np.log10(grass.sigma0(middle, 1.0))) == pytest.approx(-11.0, abs=1e-6)


def test_reflection_of_bulk_sheet_and_coating() -> None:
    theta = np.radians([0.0, 30.0, 80.0])
    cos = np.cos(theta)
    for got, want in zip(
        TABLE["concrete"].reflection(77e9, cos), fresnel(TABLE["concrete"].permittivity_at(77e9), theta), strict=True
    ):
        assert np.allclose(got, want, atol=1e-12)
    glass = TABLE["glass"]
    sheet = slab(glass.permittivity_at(77e9), 0.004, theta, 77e9)
    for got, want in zip(glass.reflection(77e9, cos), (sheet.r_te, sheet.r_tm), strict=True):
        assert np.allclose(got, want, atol=1e-9)
    film = layered([(water_permittivity(77e9, 15.0), 2e-4)], 5.2 - 0.21j, theta, 77e9)
    for got, want in zip(TABLE["asphalt_wet"].reflection(77e9, cos), film, strict=True):
        assert np.allclose(got, want, atol=1e-9)
    assert np.all(np.abs(TABLE["car_paint"].reflection(77e9, cos)[0]) > 0.97)  # thin lossy paint over metal
    assert np.all(np.abs(TABLE["air"].reflection(77e9, cos)[0]) < 1e-12)


def test_wet_asphalt_mirrors_more_than_dry() -> None:
    cos = np.cos(np.radians(np.arange(0.0, 89.0, 5.0)))
    wet, dry = (np.abs(TABLE[n].reflection(77e9, cos)[0]) for n in ("asphalt_wet", "asphalt"))
    assert np.all(wet > dry)


def test_surface_scatter_of_a_coated_material_uses_the_coated_reflectivity() -> None:
    # the same rough surface with and without its water film, surface term alone, far from the energy limit
    given = TABLE["asphalt_wet"].model_dump(exclude_unset=True) | {
        "backscatter": {"model": "kirchhoff", "correlation_m": 0.001},
        "volume_albedo": 1.0,
    }
    wet = Material.model_validate(given)
    bare = Material.model_validate({k: v for k, v in given.items() if k != "coating"})
    for polarization, index in (("HH", 0), ("VV", 1)):
        cos = np.cos(np.radians([0.0, 30.0, 50.0]))
        power = [np.abs(m.reflection(77e9, cos)[index]) ** 2 for m in (wet, bare)]
        ratio = wet.sigma0(77e9, cos, polarization) / bare.sigma0(77e9, cos, polarization)
        assert np.allclose(ratio, power[0] / power[1], rtol=1e-4)


def test_roughness_of_a_material_reduces_its_coherent_part() -> None:
    k = 2 * np.pi * 77e9 / 299_792_458.0
    assert TABLE["concrete"].coherent_factor(77e9, 1.0) == pytest.approx(float(coherent_factor(k, 0.00012, 1.0)))


def test_skin_is_gabriel_s_dry_skin() -> None:
    # the values every dosimetry table quotes from that model: 7.98 - j10.9 at 60 GHz
    assert TABLE["skin"].permittivity_at(60e9) == pytest.approx(7.98 - 10.9j, abs=0.03)


def test_every_carla_tag_has_a_material_in_its_table() -> None:
    for tag in SemanticTag:
        if tag is not SemanticTag.Rock:
            assert TABLE.for_tag(tag.name) in TABLE.materials
        assert TABLE.for_tag(int(tag), "ue5") in TABLE.materials
    assert TABLE.for_tag("None") == TABLE.for_tag("Unlabeled")
    assert TABLE.for_tag("Vehicles", "0.9.13") == "car_paint"
    assert TABLE.for_tag("Car", "0.9.13") == "car_paint"
    assert TABLE.for_tag("Sky") == "air"
    with pytest.raises(InputError, match=r"Truck has no material in tag table '0\.9\.13'"):
        TABLE.for_tag("Truck", "0.9.13")
    with pytest.raises(InputError, match=r"unknown tag table '0\.9\.12'"):
        TABLE.for_tag("Roads", "0.9.12")


def test_rain_wets_the_road_only() -> None:
    assert TABLE.in_weather("asphalt", 0.0) == "asphalt"
    assert TABLE.in_weather("asphalt", 4.0) == "asphalt_wet"
    assert TABLE.in_weather("grass", 4.0) == "grass"


def test_unconfirmed_numbers_are_listed() -> None:
    notes = TABLE.unconfirmed
    assert "asphalt.backscatter" in notes
    assert "metal.permittivity" not in notes
    assert all(text.startswith("unconfirmed") for text in notes.values())


def test_a_number_without_a_source_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=r"table\.yaml:2.*sources lacks permittivity\.real, permittivity\.imag"):
        load_materials(write(tmp_path, ENTRY))
    cited = ENTRY + "    sources: {permittivity: 'a handbook'}\n"
    assert load_materials(write(tmp_path, cited))["rock"].permittivity_at(77e9) == 4.0 - 0.1j
    rough = ENTRY + "    roughness_rms_m: 1e-3\n    sources: {permittivity: 'a handbook'}\n"
    with pytest.raises(ConfigError, match="sources lacks roughness_rms_m"):
        load_materials(write(tmp_path, rough))
    layer = ENTRY + (
        "    coating: [{permittivity: {model: constant, real: 2.0}, thickness_m: 1e-3}]\n"
        "    sources: {permittivity: 'a handbook', coating.thickness_m: 'measured'}\n"
    )
    with pytest.raises(ConfigError, match=r"sources lacks coating\.permittivity\.real"):
        load_materials(write(tmp_path, layer))


def test_a_changed_file_is_read_again(tmp_path: Path) -> None:
    cited = ENTRY + "    sources: {permittivity: 'a handbook'}\n"
    first = load_materials(write(tmp_path, cited))
    assert load_materials(tmp_path / "table.yaml") is first
    second = load_materials(write(tmp_path, cited.replace("4.0", "5.25")))
    assert second["rock"].permittivity_at(77e9).real == 5.25


def test_leaving_the_range_is_refused_or_allowed_and_logged_once(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    plain = "materials:\n  wall: {permittivity: {model: p2040, name: marble}}\n"
    with pytest.raises(InputError, match=r"1 to 60 GHz, asked for 77 GHz.*extrapolate: true"):
        load_materials(write(tmp_path, plain))["wall"].permittivity_at(77e9)
    allowed = plain.replace("marble", "marble, extrapolate: true")
    wall = load_materials(write(tmp_path, allowed))["wall"]
    with caplog.at_level(logging.INFO, logger="shenron_rt"):
        for _ in range(3):
            assert wall.permittivity_at(78.9e9).real == pytest.approx(7.074)
    assert len([r for r in caplog.records if "marble" in r.message and "78.9 GHz" in r.message]) == 1


def test_mistakes_name_file_line_key_and_what_is_known(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=r"table\.yaml:2: .*did you mean 'concrete'"):
        load_materials(write(tmp_path, "materials:\n  a: {permittivity: {model: p2040, name: concret}}\n"))
    with pytest.raises(ConfigError, match="unknown material 'asfalt'"):
        load_materials(write(tmp_path, ENTRY + "    sources: {permittivity: x}\ntags: {'0.9.14': {Roads: asfalt}}\n"))
    with pytest.raises(ConfigError, match="rougness"):
        load_materials(write(tmp_path, ENTRY + "    rougness_rms_m: 1\n    sources: {permittivity: x}\n"))
    with pytest.raises(NotFoundError, match="did you mean 'automotive'"):
        load_materials("automotiv")
    with pytest.raises(InputError, match="did you mean 'asphalt'"):
        TABLE["asfalt"]
    with pytest.raises(InputError, match="known: HH"):
        TABLE["asphalt"].sigma0(77e9, 0.5, "RR")


def test_tables_can_be_built_in_python() -> None:
    table = MaterialTable.model_validate(
        {
            "materials": {"wall": {"permittivity": {"model": "p2040", "name": "concrete"}}},
            "tags": {"mine": {"walls": "wall"}},
        }
    )
    assert table.for_tag("Walls", "mine") == "wall"
