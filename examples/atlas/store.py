"""Results that survive an interruption: every case is kept part by part, and written whole or not at all."""

from __future__ import annotations

import hashlib
import json
import time
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Any

import numpy as np

import shenron_rt
from shenron_rt._typing import FloatArray
from shenron_rt.io.npz import atomic_write

from .cases import Case

#: Values swept in one call and then written: what an interruption may cost. The lattice of rays is shifted anew for
#: every aspect of a call, so that fixed parts give the same numbers again, whenever a run was interrupted.
PART = 10


@dataclass(frozen=True, eq=False)
class Curve:
    """A finished case: its settings, where it was computed, and the RCS there.

    Parameters
    ----------
    settings : dict
        :meth:`Case.settings`.
    x : (n,) float
    rcs_dbsm : (n,) float
        Rounded to 0.01 dB.
    seconds : float
        Wall time, the parts added up.
    solver : str
        :func:`solver_state` of the code that computed it.
    """

    settings: dict[str, Any]
    x: FloatArray
    rcs_dbsm: FloatArray
    seconds: float
    solver: str

    @property
    def rcs_m2(self) -> FloatArray:
        """(n,) RCS [m^2]."""
        return np.asarray(10.0 ** (self.rcs_dbsm / 10.0))

    def to_json(self) -> str:
        """Return one line."""
        rcs = [round(float(v), 2) for v in self.rcs_dbsm]
        fields = {"solver": self.solver, "seconds": round(self.seconds, 1), "settings": self.settings}
        return json.dumps(fields | {"x": [round(float(v), 6) for v in self.x], "rcs_dbsm": rcs})

    @classmethod
    def from_json(cls, fields: dict[str, Any]) -> Curve:
        """Return what :meth:`to_json` wrote."""
        x, rcs = (np.array(fields[k], dtype=np.float64) for k in ("x", "rcs_dbsm"))
        return cls(fields["settings"], x, rcs, fields["seconds"], fields["solver"])


def solver_state() -> str:
    """Return a digest of the code that decides the numbers: solver, sweep, shapes, materials."""
    root = Path(shenron_rt.__file__).parent
    files = [*(root / "sbr").glob("*.py"), root / "rcs.py", *(root / "scene/shapes").glob("*.py")]
    digest = hashlib.sha256()
    for file in sorted(files):
        digest.update(file.read_bytes())
    return digest.hexdigest()[:10]


def load(path: Path) -> dict[str, Curve]:
    """Return the curves of a file by name; none where there is no file."""
    if not path.exists():
        return {}
    return {name: Curve.from_json(fields) for name, fields in json.loads(path.read_text(encoding="utf-8")).items()}


def save(path: Path, curves: dict[str, Curve]) -> None:
    """Write curves, one a line, by name."""
    lines = ",\n".join(f"{json.dumps(name)}: {curves[name].to_json()}" for name in sorted(curves))

    def write(file: IO[bytes]) -> None:
        file.write(f"{{\n{lines}\n}}\n".encode())

    atomic_write(path, write)


def compute(case: Case, folder: Path, *, fresh: bool = False) -> Curve:
    """Compute a case, or what is missing of it.

    Parameters
    ----------
    case : Case
    folder : Path
        Of the parts, one file a case. Parts by other settings or by another state of the solver do not count.
    fresh : bool
        Begin anew.
    """
    file = folder / f"{case.name}.json"
    wanted = np.array([round(v, 6) for v in case.x], dtype=np.float64)
    solver = solver_state()
    kept = Curve(case.settings(), wanted[:0], wanted[:0], 0.0, solver)
    old = load(file).get(case.name)
    fits = old is not None and old.settings == kept.settings and old.solver == solver
    if old is not None and fits and not fresh and np.array_equal(old.x, wanted[: len(old.x)]):
        kept = old
    while len(kept.x) < len(wanted):
        part = wanted[len(kept.x) : len(kept.x) + PART]
        begun = time.perf_counter()
        level = np.round(10.0 * np.log10(np.maximum(case.sweep(part), 1e-12)), 2)
        seconds = kept.seconds + time.perf_counter() - begun
        x, level = np.concatenate([kept.x, part]), np.concatenate([kept.rcs_dbsm, level])
        kept = Curve(kept.settings, x, level, seconds, solver)
        save(file, {case.name: kept})
    return kept
