"""``shenron-rt profiles`` and ``shenron-rt materials``: what there is, with its numbers and their sources."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter

from .common import Json, Overrides, SetOptions, override_profile, print_json, say, show_table

if TYPE_CHECKING:
    from ..config.materials import Material
    from ..config.profile import RadarProfile

__all__ = ["materials", "profiles"]

_NOTHING_DB = -200.0
_SURFACE_KEYS = ("incidence_deg", "mirror_te_db", "mirror_tm_db", "sigma0_vv_db", "sigma0_hh_db")


def profiles(name: str | None = None, /, *, set_: SetOptions = None, json_: Json = False) -> int:
    """List the radar profiles, or show one: its numbers with their sources, and what derives from them.

    Parameters
    ----------
    name
        Name of a profile, or a YAML file.
    """
    from ..config.profile import load_profile
    from ..resources import available

    overrides = Overrides(set_)
    overrides.only_profile("profiles")
    if name is not None:
        _one_profile(override_profile(load_profile(name), overrides.profile), json_)
        return 0
    found = [load_profile(path) for path in available("profiles").values()]
    if json_:
        print_json([{"name": p.name, "description": p.description, "derived": p.derived()} for p in found])
        return 0
    rows = [
        (
            p.name, f"{p.waveform.carrier_hz / 1e9:g}", f"{p.waveform.bandwidth_hz / 1e6:g}",
            f"{p.range_resolution_m:.2f}", f"{p.max_range_m:.0f}", f"{p.max_velocity_mps:.2f}",
            f"{p.n_virtual}", p.array.multiplex,
        )
        for p in found
    ]  # fmt: skip
    columns = ("profile", "f0 [GHz]", "B [MHz]", "dR [m]", "R max [m]", "v max [m/s]", "channels", "multiplex")
    show_table("Radar profiles", columns, rows)
    return 0


def _one_profile(profile: RadarProfile, as_json: bool) -> None:
    from ..plot.antenna import loss_table

    losses = {
        f"loss_{cut}_{angle}_deg_db": value for cut, by in loss_table(profile).items() for angle, value in by.items()
    }
    if as_json:
        given = profile.model_dump(mode="json", exclude={"sources"}, exclude_none=True)
        print_json({"given": given, "derived": profile.derived() | losses, "sources": dict(profile.sources)})
        return
    say(f"{profile.name}: {profile.description}")
    given = profile.model_dump(mode="json", exclude={"name", "description", "sources"}, exclude_none=True)
    rows = [(key, _shown(value), _source(profile.sources, key)) for key, value in _leaves(given)]
    show_table("Given", ("key", "value", "source"), rows)
    derived = [(key, f"{value:.6g}") for key, value in profile.derived().items()]
    derived += [(key, f"{value:.2f} one way") for key, value in losses.items()]
    show_table("Derived", ("number", "value"), derived)
    say(f"Unconfirmed or assumed: {', '.join(profile.unconfirmed) or 'nothing'}")


def _leaves(data: Mapping[str, Any], prefix: str = "") -> list[tuple[str, Any]]:
    rows: list[tuple[str, Any]] = []
    for key, value in data.items():
        dotted = f"{prefix}.{key}" if prefix else key
        rows += _leaves(value, dotted) if isinstance(value, Mapping) else [(dotted, value)]
    return rows


def _shown(value: Any) -> str:
    if isinstance(value, float):
        return f"{value:.6g}"
    if isinstance(value, list | tuple) and len(str(value)) > 60:
        return f"{len(value)} entries"
    return str(value)


def _source(sources: Mapping[str, str], key: str) -> str:
    """Return the source of a dotted key, or of the group it stands in."""
    parts = key.split(".")
    return next((sources[k] for n in range(len(parts), 0, -1) if (k := ".".join(parts[:n])) in sources), "")


def materials(
    name: str | None = None,
    /,
    *,
    table: Annotated[str, Parameter(help="Material table, name or file.")] = "automotive",
    frequency_ghz: Annotated[float, Parameter(help="Frequency of the permittivity shown.")] = 77.0,
    json_: Json = False,
) -> int:
    """List the materials of a table, or show one with its sources.

    Parameters
    ----------
    name
        Name of a material.
    """
    from ..config.materials import load_materials

    loaded = load_materials(table)
    if name is not None:
        _one_material(name, loaded[name], frequency_ghz, json_)
        return 0
    rows = [
        (
            key,
            _permittivity(m, frequency_ghz),
            f"{m.roughness_rms_m * 1e3:g}",
            f"{len(m.unconfirmed)} of {len(m.sources)}",
        )
        for key, m in loaded.materials.items()
    ]
    if json_:
        made_of = {t: dict(entries) for t, entries in loaded.tags.items()}
        print_json({"materials": [r[0] for r in rows], "tags": made_of, "unconfirmed": loaded.unconfirmed})
        return 0
    columns = ("material", f"permittivity at {frequency_ghz:g} GHz", "roughness rms [mm]", "unconfirmed sources")
    show_table(f"Materials of {table}", columns, rows)
    return 0


def _permittivity(material: Material, frequency_ghz: float) -> str:
    from ..errors import InputError

    try:
        eps = complex(material.permittivity_at(frequency_ghz * 1e9))
    except InputError:
        return "not valid here"
    return "perfect conductor" if abs(eps) > 1e4 else f"{eps.real:.3g} - j {abs(eps.imag):.3g}"


def _one_material(name: str, material: Material, frequency_ghz: float, as_json: bool) -> None:
    """Print an entry with its sources, and what its surface does to a wave over the angle of incidence."""
    given = material.model_dump(mode="json", exclude={"sources"}, exclude_none=True)
    levels = _surface_levels(material, frequency_ghz * 1e9)
    if as_json:
        surface = [dict(zip(_SURFACE_KEYS, row, strict=True)) for row in levels]
        print_json(
            {"name": name, "given": given, "sources": dict(material.sources), "ghz": frequency_ghz, "surface": surface}
        )
        return
    say(f"{name}: permittivity {_permittivity(material, frequency_ghz)} at {frequency_ghz:g} GHz")
    # the values of a P.2040 entry stand in the recommendation itself
    standard = {"permittivity": "ITU-R P.2040-3, Table 3"} if material.permittivity.model == "p2040" else {}
    sources = standard | dict(material.sources)
    rows = [(key, _shown(value), _source(sources, key)) for key, value in _leaves(given)]
    show_table("Given", ("key", "value", "source"), rows)
    columns = ("incidence [deg]", "mirror TE [dB]", "mirror TM [dB]", "sigma0 VV [dB]", "sigma0 HH [dB]")
    shown = [(f"{row[0]:g}", *(f"{v:z.1f}" if v > _NOTHING_DB else "none" for v in row[1:])) for row in levels]
    show_table(f"Reflected power after roughness, and sigma0, at {frequency_ghz:g} GHz", columns, shown)


def _surface_levels(material: Material, frequency_hz: float) -> list[tuple[float, ...]]:
    """Return (angle [deg], mirror TE, mirror TM, sigma0 VV, sigma0 HH [dB]) of a few angles of incidence."""
    import numpy as np

    angle = np.array([0, 15, 30, 45, 60, 75, 85], dtype=np.float64)
    cos = np.cos(np.radians(angle))
    te, tm = material.reflection(frequency_hz, cos)
    rough = material.coherent_factor(frequency_hz, cos)
    powers = [np.abs(te * rough) ** 2, np.abs(tm * rough) ** 2]
    powers += [material.sigma0(frequency_hz, cos, pol) for pol in ("VV", "HH")]
    levels = [10 * np.log10(np.maximum(p, 10 ** (_NOTHING_DB / 10))) for p in powers]
    return [tuple(float(v) for v in row) for row in np.column_stack([angle, *levels])]
