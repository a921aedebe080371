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

#: Seconds of work after which a part is written: what an interruption may cost.
_PART_SECONDS = 20.0


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
    wanted, solver = np.asarray(case.x, dtype=np.float64), solver_state()
    done: dict[float, float] = {}
    seconds = 0.0
    old = load(file).get(case.name)
    if old is not None and not fresh and old.settings == case.settings() and old.solver == solver:
        done, seconds = dict(zip(old.x.tolist(), old.rcs_dbsm.tolist(), strict=True)), old.seconds
    count = 4
    while missing := [x for x in np.round(wanted, 6).tolist() if x not in done]:
        part = np.array(missing[:count])
        begun = time.perf_counter()
        level = 10.0 * np.log10(np.maximum(case.sweep(part), 1e-12))
        spent = time.perf_counter() - begun
        done |= dict(zip(part.tolist(), np.round(level, 2).tolist(), strict=True))
        seconds += spent
        count = int(np.clip(count * _PART_SECONDS / max(spent, 0.1), 1, 4 * count))
        x = np.array(sorted(done))
        save(file, {case.name: Curve(case.settings(), x, np.array([done[v] for v in x.tolist()]), seconds, solver)})
    x = np.round(wanted, 6)
    return Curve(case.settings(), x, np.array([done[v] for v in x.tolist()]), seconds, solver)
