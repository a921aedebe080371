"""``shenron-rt rcs``: one target on a turntable, its radar cross section over frequency and aspect."""

from __future__ import annotations

import functools
import re
from pathlib import Path
from typing import Annotated, Literal

from cyclopts import Parameter

from .common import Json, Output, Overwrite, check_seed, print_json, say
from .rcs_job import RcsJob, check_positive
from .rcs_options import PARTS, RcsOptions, read_pair, read_permittivity

__all__ = ["rcs"]

#: Longest run that is begun without being asked twice [s].
_MAX_SECONDS = 6 * 3600.0
_TEXT = Parameter(allow_leading_hyphen=True)


def rcs(
    target: str,
    /,
    *,
    freq_ghz: str,
    az: Annotated[str, _TEXT] = "0",
    el: Annotated[str, _TEXT] = "0",
    pol: str = "VV",
    distance_m: float | None = None,
    max_bounces: int = 3,
    rays_per_wavelength: float | None = None,
    bistatic: Annotated[str | None, _TEXT] = None,
    material: str = "metal",
    permittivity: str | None = None,
    mesh_frame: str = "ros_z_up",
    units: str = "m",
    round_below_deg: float | None = None,
    manifest: Annotated[Path | None, Parameter(name=["--manifest", "--resolve"])] = None,
    converge: Annotated[bool, Parameter(negative=())] = False,
    target_error_db: float | None = None,
    window_deg: float | None = None,
    plan: Annotated[bool, Parameter(negative=())] = False,
    yes: Annotated[bool, Parameter(negative=())] = False,
    max_seconds: float = _MAX_SECONDS,
    output: Output = None,
    overwrite: Overwrite = False,
    seed: int = 0,
    backend: Literal["auto", "cuda", "llvm", "scalar"] = "auto",
    pictures: Annotated[bool, Parameter(help="Draw the pictures.")] = True,
    json_: Json = False,
) -> int:
    """Compute the radar cross section of one target over frequency, elevation and azimuth.

    Parameters
    ----------
    target
        A shape (plate:0.1x0.1, sphere:r=0.1, trihedral:triangular,a=0.1, car ...) or a mesh file.
    freq_ghz
        Frequencies, as a list 24,77 or START:STOP:STEP with STOP included.
    az
        Azimuth of the radar seen from the target in deg, 0 = +x (nose), positive to the left: -40:40:0.5.
    el
        Elevation of the radar in deg, positive up.
    pol
        Polarisations, receive letter first: VV,HH,HV,VH.
    distance_m
        Distance of the radar from the target's origin: apparent RCS by spherical waves. Default: far field.
    max_bounces
        Surfaces along a path, 1 to 10.
    rays_per_wavelength
        Of the coarsest cells. Default: as sweep_rcs.
    bistatic
        AZ,EL of a transmitter that stays; az and el are then the receiver's.
    material
        Name in the material table, or parts: as the parts of the mesh say.
    permittivity
        eps'-eps''j of an opaque body, as 3.2-0.05j or 3.2,0.05, in place of the material.
    mesh_frame
        Axes of a mesh file, for example carla_exporter.
    units
        Of a mesh file: m, cm, mm, inch, or metres per unit.
    round_below_deg
        Round what facets meeting at less than this stand for, say 30, to wavelength / 256. Default: facets are facets.
    manifest
        Sidecar YAML of tags and materials, for --material parts.
    converge
        Sweep again at twice the density of rays, and say what the difference is.
    target_error_db
        Double the density until the median change is at most this, or a limit is reached.
    window_deg
        Angular window of median and 10-90 % band. Default: 5, less in a narrow sweep.
    plan
        Try a few aspects, print cells, rays, time and memory, and stop.
    yes
        Begin however long it takes.
    max_seconds
        Longest run that is begun without --yes.
    seed
        Of the shift of the lattice of rays.
    backend
        Ray tracing backend: auto is cuda, then llvm, then scalar.
    """
    from .. import runs
    from .rcs_output import show_summary

    options = _options(
        freq_ghz, az, el, pol, distance_m, max_bounces, rays_per_wavelength, bistatic, material, permittivity, seed,
        backend,
    )  # fmt: skip
    check_positive(max_seconds=max_seconds)
    job = RcsJob(
        target, mesh_frame, units, manifest, options, converge=converge, target_error_db=target_error_db,
        max_seconds=None if yes else max_seconds, window_deg=window_deg, round_below_deg=round_below_deg,
        pictures=pictures, quiet=json_,
    )  # fmt: skip
    if output is not None and not plan:
        runs.check_target(output, overwrite)
    if plan:
        print_json(job.cost.to_dict()) if json_ else say(f"{job.name}: {job.cost}")
        return 0
    job.check()
    default = functools.partial(runs.default_folder, _label(job.name), f"rcs-{_band(options)}ghz")
    with runs.write_run(output or default(), overwrite=overwrite, another=None if output else default) as place:
        summary = job.run(place.partial)
    if json_:
        print_json(summary)
    else:
        show_summary(summary)
        say(f"{place.folder}: written, swept in {summary['seconds']:.1f} s, {summary['backend']} backend")
    return 0


def _options(
    freq_ghz: str,
    az: str,
    el: str,
    pol: str,
    distance_m: float | None,
    max_bounces: int,
    rays_per_wavelength: float | None,
    bistatic: str | None,
    material: str,
    permittivity: str | None,
    seed: int,
    backend: str,
) -> RcsOptions:
    return RcsOptions(
        freq_ghz=freq_ghz,
        az=az,
        el=el,
        polarization=tuple(word.strip().upper() for word in pol.split(",")),
        distance_m=distance_m,
        max_bounces=max_bounces,
        rays_per_wavelength=rays_per_wavelength,
        bistatic=None if bistatic is None else read_pair("bistatic", bistatic),
        material=None if material == PARTS else material,
        permittivity=None if permittivity is None else read_permittivity(permittivity),
        seed=check_seed(seed),
        backend=backend,
    )


def _label(name: str) -> str:
    """Return a name for a folder: ``plate-0.05x0.05`` of ``plate:0.05x0.05``."""
    return re.sub(r"[^\w.]+", "-", Path(name).stem if "/" in name else name).strip("-")


def _band(options: RcsOptions) -> str:
    frequency_hz = options.arguments()["frequency_hz"]
    ends = sorted({f"{f / 1e9:g}" for f in (min(frequency_hz), max(frequency_hz))}, key=float)
    return "-".join(ends)
