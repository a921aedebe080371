"""What a run is made of before it starts: its options, its radars, and the configuration that makes it again."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from .config.settings import frame_range, split_overrides
from .errors import InputError

if TYPE_CHECKING:
    from .config.profile import RadarProfile
    from .config.scene import Scene

__all__ = [
    "RunOptions", "config_text", "frame_range", "merge_options", "override_profile", "package_version",
    "profile_label", "refuse_repeated", "split_overrides", "summary_of", "with_profiles",
]  # fmt: skip

#: Keys of meshes that may name a file.
_FILE_KEYS = ("mesh", "resolve", "carla_tags", "trajectory_file")


@dataclass(frozen=True)
class RunOptions:
    """How frames of a scene are rendered; kept in the run's ``config.yaml`` under ``run``.

    Parameters
    ----------
    frames : str
        ``A:B``, B not included.
    rays, max_bounces, backend, accuracy, model, retrace
        As for :func:`shenron_rt.simulate`.
    """

    frames: str = "0:1"
    rays: int = 300_000
    max_bounces: int = 1
    backend: str = "auto"
    accuracy: float = 1e-5
    model: str = "physical"
    retrace: int = 1

    def record(self) -> dict[str, Any]:
        """Return what the config keeps; ``retrace`` only where it is asked for, as older versions do not know it."""
        return {k: v for k, v in asdict(self).items() if k != "retrace" or v != 1}

    def arguments(self) -> dict[str, Any]:
        """Return those that :func:`shenron_rt.simulate` takes."""
        return {k: v for k, v in asdict(self).items() if k != "frames"}


def merge_options(earlier: Mapping[str, Any], given: Mapping[str, Any]) -> RunOptions:
    """Merge the options of an earlier run's config with those given now; None stands for not given.

    Raises
    ------
    InputError
        An unknown option, fewer rays than 1, frames that cannot be read.
    """
    known = asdict(RunOptions())
    unknown = sorted(set(earlier) - set(known))
    if unknown:
        raise InputError(f"run: unknown option {unknown[0]!r} in the config; known: {', '.join(known)}")
    merged = (
        known | {k: type(known[k])(v) for k, v in earlier.items()} | {k: v for k, v in given.items() if v is not None}
    )
    if merged["rays"] < 1:
        raise InputError(f"--rays {merged['rays']}: at least 1 is needed")
    frame_range(merged["frames"])
    return RunOptions(**merged)


def override_profile(profile: RadarProfile, overrides: Mapping[str, Any]) -> RadarProfile:
    """Return the profile with dotted keys replaced, checked as a file would be."""
    from .config.loader import apply_overrides, validate_model
    from .config.profile import RadarProfile

    if not overrides:
        return profile
    data = apply_overrides(profile.model_dump(), overrides)
    return validate_model(RadarProfile, data, f"profile {profile.name} with --set")


def refuse_repeated(profiles: Sequence[RadarProfile]) -> None:
    """Raise an InputError where two profiles have one name."""
    names = [p.name for p in profiles]
    repeated = sorted({name for name in names if names.count(name) > 1})
    if repeated:
        raise InputError(f"--profile {repeated[0]}: given twice")


def with_profiles(scene: Scene, names: list[str], overrides: Mapping[str, Any]) -> Scene:
    """Put profiles into the radars: one replaces them all, several make a copy of each radar for each."""
    from .config.profile import load_profile

    if not names:
        mounts = [(r.name, r, scene.profile_of(r)) for r in scene.radars]
    else:
        loaded = [load_profile(n) for n in names]
        refuse_repeated(loaded)
        mounts = [(r.name if len(loaded) == 1 else f"{r.name}_{p.name}", r, p) for r in scene.radars for p in loaded]
    radars = [
        mount.model_copy(update={"name": name, "profile": override_profile(used, overrides)})
        for name, mount, used in mounts
    ]
    return scene.model_copy(update={"radars": tuple(radars)})


def profile_label(scene: Scene) -> str:
    """Return the names of the profiles in use, joined."""
    return "+".join(dict.fromkeys(scene.profile_of(r).name for r in scene.radars))


def summary_of(
    scene: str, seed: int, options: RunOptions, backend: str, radars: list[dict[str, Any]]
) -> dict[str, Any]:
    """Return ``summary.json``; ``radars`` holds ``name, profile, frames`` of each."""
    return {
        "version": package_version(),
        "scene": scene,
        "backend": backend,
        "seed": seed,
        "rays": options.rays,
        "max_bounces": options.max_bounces,
        "model": options.model,
        "radars": radars,
    }


def package_version() -> str:
    """Return the version of what is installed."""
    from importlib.metadata import PackageNotFoundError, version

    try:
        return version("shenron-rt")
    except PackageNotFoundError:  # a checkout on the path, not installed
        return "0+unknown"


def config_text(scene: Scene) -> str:
    """Return a scene as YAML with its profiles inside and its files by absolute path, so that it runs anywhere."""
    import yaml

    data: dict[str, Any] = scene.model_dump(mode="json", exclude_none=True, exclude_defaults=True)
    always = scene.model_dump(mode="json", include={"version", "name", "seed", "frame_period_s", "weather"})
    data = always | data
    data["radars"] = [
        r.model_dump(mode="json", exclude_none=True)
        | {"profile": scene.profile_of(r).model_dump(mode="json", exclude_none=True)}
        for r in scene.radars
    ]
    if scene.interferers:
        data["interferers"] = [
            i.model_dump(mode="json", exclude_none=True)
            | {"profile": scene.profile_of(i).model_dump(mode="json", exclude_none=True)}
            for i in scene.interferers
        ]
    located = _locator(scene.folder)
    for part in (data.get("ego", {}), *data.get("static", ()), *data.get("actors", ())):
        for key in _FILE_KEYS:
            if key in part:
                part[key] = located(part[key])
    data["materials"] = located(str(scene.materials))
    text = yaml.safe_dump(data, sort_keys=False, allow_unicode=True, width=120)
    return f"# Written by shenron-rt run; shenron-rt run config.yaml does it again.\n{text}"


def _locator(folder: Path) -> Callable[[str], str]:
    def located(text: str) -> str:
        file = folder / text
        return str(file.resolve()) if file.is_file() or any(file.glob("*.meta.yaml")) else text

    return located
