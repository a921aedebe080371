"""What ``shenron-rt rcs`` reads from its command line: axes, polarisations, the target."""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..errors import InputError

if TYPE_CHECKING:
    from ..scene.mesh import TaggedMesh

__all__ = ["RcsOptions", "load_target", "read_axis", "read_pair", "read_permittivity"]

#: Most values along an axis: beyond, a step was mistyped.
_MOST = 100_000
#: ``--material parts``: every part as its own material, or that of its tag, says.
PARTS = "parts"


def read_axis(option: str, text: str) -> list[float]:
    """Return the numbers of ``START:STOP:STEP`` (STOP included), of a list, or of lists of such ranges.

    Raises
    ------
    InputError
        Anything else, a step of 0 or away from STOP, or more than 100000 values.
    """
    values: list[float] = []
    for word in text.split(","):
        try:
            numbers = [float(part) for part in word.split(":")]
        except ValueError:
            numbers = []
        if len(numbers) not in (1, 3) or not all(map(math.isfinite, numbers)):
            raise InputError(
                f"--{option} {text}: START:STOP:STEP (STOP included), a number or a list a,b,c is needed, "
                f"as in --{option} {'-40:40:0.5' if option != 'freq-ghz' else '76:78:0.01'}"
            )
        values += numbers if len(numbers) == 1 else _steps(option, text, *numbers)
    return values


def _steps(option: str, text: str, start: float, stop: float, step: float) -> list[float]:
    if step == 0.0 or (stop - start) / step < 0.0:
        raise InputError(f"--{option} {text}: the step must lead from START to STOP, and not be 0")
    count = math.floor((stop - start) / step + 1e-6) + 1
    if count > _MOST:
        raise InputError(f"--{option} {text}: {count} values; at most {_MOST} are allowed, take a coarser step")
    # rounded to what the user can have meant: 0.1 + 2 * 0.1 is 0.3
    return [round(start + i * step, 12) for i in range(count)]


def read_pair(option: str, text: str) -> tuple[float, float]:
    """Return the two numbers of ``a,b``."""
    try:
        first, second = (float(word) for word in text.split(","))
    except ValueError:
        raise InputError(f"--{option} {text}: two numbers separated by a comma are needed") from None
    if not (math.isfinite(first) and math.isfinite(second)):
        raise InputError(f"--{option} {text}: finite numbers are needed")
    return first, second


def read_permittivity(text: str) -> complex:
    """Return eps' - j eps'' of ``3.2-0.05j``, or of ``3.2,0.05`` (the loss as a positive number)."""
    try:
        if "," in text:
            real, loss = (float(word) for word in text.split(","))
            return complex(real, -loss)
        return complex(text.replace(" ", "").replace("i", "j"))
    except ValueError:
        raise InputError(f"--permittivity {text}: eps'-eps''j as in 3.2-0.05j, or eps',eps'' is needed") from None


def load_target(
    text: str, *, mesh_frame: str, units: str, parts: bool, manifest: Path | None = None
) -> tuple[str, TaggedMesh]:
    """Return the name and the mesh of a shape text or a mesh file.

    Parameters
    ----------
    text : str
    mesh_frame, units : str
        Of a mesh file.
    parts : bool
        Whether the parts' tags and materials count: then a file's are resolved.
    manifest : path, optional
        Sidecar of a mesh file.
    """
    from ..scene.readers import MESH_SUFFIXES, read_mesh
    from ..scene.resolver import resolve_tags
    from ..scene.shapes import make_shape

    path = Path(text)
    if path.suffix.lower() not in MESH_SUFFIXES and not path.is_file():
        return text.strip(), make_shape(text)
    try:
        scale: str | float = float(units)
    except ValueError:
        scale = units
    mesh = read_mesh(path, mesh_frame=mesh_frame, units=scale)
    if parts:
        mesh = resolve_tags(mesh, manifest=manifest, unlabelled="warn")
    return path.name, mesh


@dataclass(frozen=True)
class RcsOptions:
    """The options of a sweep, axes as they were written, as config.yaml records them."""

    freq_ghz: str
    az: str
    el: str
    polarization: tuple[str, ...]
    distance_m: float | None
    max_bounces: int
    rays_per_wavelength: float | None
    bistatic: tuple[float, float] | None
    material: str | None
    permittivity: complex | None
    seed: int
    backend: str

    def arguments(self) -> dict[str, Any]:
        """Return the keyword arguments of ``sweep_rcs``.

        Raises
        ------
        InputError
            An axis that cannot be read.
        """
        values = asdict(self)
        texts = {name: values.pop(name) for name in ("freq_ghz", "az", "el")}
        return values | {
            "frequency_hz": [round(f * 1e9, 3) for f in read_axis("freq-ghz", texts["freq_ghz"])],
            "azimuth_deg": read_axis("az", texts["az"]),
            "elevation_deg": read_axis("el", texts["el"]),
        }

    def doubled(self) -> RcsOptions:
        """Return the same with rays twice as dense."""
        from ..rcs import DEFAULT_RAYS_PER_WAVELENGTH

        density = DEFAULT_RAYS_PER_WAVELENGTH if self.rays_per_wavelength is None else self.rays_per_wavelength
        return replace(self, rays_per_wavelength=2.0 * density)

    def record(self) -> dict[str, Any]:
        """Return what YAML and JSON can hold."""
        values = asdict(self)
        values["polarization"] = list(self.polarization)
        values["bistatic"] = None if self.bistatic is None else list(self.bistatic)
        values["material"] = PARTS if self.material is None else self.material
        if self.permittivity is not None:
            values["material"] = None
            values["permittivity"] = f"{self.permittivity.real:g}{self.permittivity.imag:+g}j"
        return values
