"""``shenron-rt doctor``: what this machine can run."""

from __future__ import annotations

import os
import platform
from importlib.metadata import PackageNotFoundError, version
from typing import Any, get_args

from .common import Json, print_json, say, show_table

__all__ = ["doctor"]

_PACKAGES = (
    "mitsuba", "drjit", "numpy", "scipy", "finufft", "trimesh", "pydantic", "PyYAML", "matplotlib", "cyclopts", "rich",
)  # fmt: skip


def doctor(*, json_: Json = False) -> int:
    """Show versions, ray-tracing backends and packaged data, and how to fix what does not work."""
    facts = _facts()
    if json_:
        print_json(facts)
        return 0 if facts["chosen"] else 1
    say(f"shenron-rt {facts['version']}, Python {facts['python']}, {facts['platform']}, {facts['cpus']} CPU cores")
    show_table("Packages", ("package", "version"), [(k, v or "missing") for k, v in facts["packages"].items()])
    rows = [(b["backend"], "yes" if b["usable"] else "no", b["detail"]) for b in facts["backends"]]
    show_table("Ray tracing", ("backend", "usable", "detail"), rows)
    say(f"backend auto is {facts['chosen'] or 'none: nothing can trace rays here'}")
    say(", ".join(f"{count} {kind}" for kind, count in facts["data"].items()) + " found")
    return 0 if facts["chosen"] else 1


def _facts() -> dict[str, Any]:
    from ..errors import BackendError
    from ..resources import available
    from ..tracing.backend import Backend, backend_status, choose_backend
    from . import _version

    packages: dict[str, str | None] = {}
    for name in _PACKAGES:
        try:
            packages[name] = version(name)
        except PackageNotFoundError:
            packages[name] = None
    statuses = [backend_status(b) for b in get_args(Backend)]
    chosen: str | None = None
    if any(s.usable for s in statuses):
        try:
            chosen = choose_backend("auto")
        except BackendError:
            chosen = None
    return {
        "version": _version(),
        "python": platform.python_version(),
        "platform": f"{platform.system()} {platform.machine()}",
        "cpus": os.cpu_count(),
        "packages": packages,
        "backends": [{"backend": s.backend, "usable": s.usable, "detail": s.detail} for s in statuses],
        "chosen": chosen,
        "data": {kind: len(available(kind)) for kind in ("profiles", "materials", "scenes")},
    }
