"""``shenron-rt process``: ADC data in, a run folder out."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from cyclopts import Parameter

from ..errors import InputError, NotFoundError, ShenronError
from .common import (
    Json,
    Output,
    Overrides,
    Overwrite,
    SetOptions,
    chosen_frames,
    override_profile,
    print_json,
    progress,
    say,
)

if TYPE_CHECKING:
    from ..config.profile import RadarProfile
    from ..dsp import Detections, RadarCube
    from ..returns import Returns
    from ..synthesis.adc import AdcCube

__all__ = ["load_cube", "process"]

LayoutName = Literal["two_lane", "four_lane"]
LevelName = Literal["watts", "counts", "noise"]


@dataclass(frozen=True)
class _Format:
    """What the caller says of a file that does not say it itself."""

    layout: LayoutName
    level: LevelName | None
    swap_iq: bool


@dataclass(frozen=True)
class ProcessedFrame:
    """A frame that began as ADC data."""

    adc: AdcCube
    cube: RadarCube
    detections: Detections
    frame: int
    time: float = 0.0
    returns: Returns | None = None


def process(
    adc: Path,
    /,
    *,
    output: Output = None,
    overwrite: Overwrite = False,
    profile: str | None = None,
    set_: SetOptions = None,
    frames: str | None = None,
    layout: Annotated[
        LayoutName,
        Parameter(help="Byte layout of a .bin capture: two_lane (xWR16/18/68xx), four_lane (xWR12/14/22xx)."),
    ] = "two_lane",
    level: Annotated[
        LevelName | None,
        Parameter(
            help="Unit of the file: watts (its square root), counts (of full_scale_dbm), noise (floor set nominal)."
        ),
    ] = None,
    swap_iq: Annotated[bool, Parameter(negative=(), help="The .bin capture has Q before I.")] = False,
    frame_period_s: Annotated[
        float | None, Parameter(help="Interval of the frames [s]; for processing.ambiguity=two_frame.")
    ] = None,
    pictures: Annotated[bool, Parameter(help="Draw the pictures of every frame.")] = True,
    json_: Json = False,
) -> int:
    """Process ADC data to maps and detections.

    Parameters
    ----------
    adc
        An adc.npz of a run, a plain .npy array (chirp, antenna, sample) or (frame, chirp, antenna, sample), or a raw
        DCA1000 capture (.bin).
    profile
        Radar that made the data; an adc.npz carries its own.
    frames
        Frames A:B of the file, B not included. Default: all.
    """
    from .. import runs

    overrides = Overrides(set_)
    overrides.only_profile("process")
    form = _Format(layout, level, swap_iq)
    cubes = _read(adc, profile, overrides, form)
    wanted = chosen_frames(frames, len(cubes), f"{adc} has {len(cubes)} frames")
    used = cubes[0].profile
    default = partial(runs.default_folder, adc.stem, used.name)
    with runs.write_run(output or default(), overwrite=overwrite, another=None if output else default) as place:
        summary = _render(adc, cubes, wanted, frame_period_s, place.partial, pictures=pictures, quiet=json_)
        runs.write_json(place.partial / "summary.json", summary)
        _write_config(place.partial / "config.yaml", adc, used, form)
    if json_:
        print_json(summary)
    else:
        from .report import show_run

        show_run(summary)
        say(f"{place.folder}: written")
    return 0


def _render(
    adc: Path,
    cubes: Sequence[AdcCube],
    wanted: range,
    period_s: float | None,
    root: Path,
    *,
    pictures: bool,
    quiet: bool,
) -> dict[str, Any]:
    """Write every frame and return the summary."""
    from .. import runs
    from . import _version

    used = cubes[0].profile
    records, last = [], None
    with progress(len(wanted), "processing", quiet=quiet) as step:
        for index in wanted:
            frame = last = _frame(cubes[index], index, period_s, last)
            folder = runs.frame_folder(root, used.name, index)
            runs.write_frame(folder, frame)
            if pictures:
                from ..plot import write_pictures

                write_pictures(folder, frame, title=f"{adc.name} ({used.name}), frame {index}")
            records.append(runs.frame_summary(frame))
            step(advance=1)
    radar = {"name": used.name, "profile": used.name, "frames": records}
    return {"version": _version(), "source": str(adc), "backend": None, "seed": None, "radars": [radar]}


def _frame(cube: AdcCube, index: int, period_s: float | None, last: ProcessedFrame | None) -> ProcessedFrame:
    from ..dsp import detect
    from ..dsp import process as transform

    settings = cube.profile.processing
    spectrum = transform(cube, range_window=settings.range_window, doppler_window=settings.doppler_window)
    found = detect(
        spectrum,
        pfa=settings.pfa,
        blanking_m=settings.blanking_m,
        ambiguity=settings.ambiguity,
        previous=None if last is None else last.detections,
        interval_s=period_s,
    )
    return ProcessedFrame(cube, spectrum, found, index, time=index * (period_s or 0.0), returns=cube.returns)


def _read(path: Path, name: str | None, overrides: Overrides, form: _Format) -> list[AdcCube]:
    """Return the frames of a file of any of the three kinds."""
    if not path.is_file():
        raise NotFoundError(f"{path}: no such file")
    if path.suffix == ".npz":
        return [_own_cube(path, name, overrides)]
    if path.suffix not in (".npy", ".bin"):
        raise InputError(f"{path}: ADC data end in .npz (own), .npy (plain array) or .bin (DCA1000 capture)")
    from ..config.profile import load_profile
    from ..io.captures import count_scale, noise_floor_scale, read_dca1000, read_npy

    if name is None:
        raise InputError(f"{path}: --profile is needed, the file does not say which radar made it")
    used = override_profile(load_profile(name), overrides.profile)
    level = form.level
    if level is None:
        counts = path.suffix == ".bin" and used.receiver.full_scale_dbm is not None
        level = "counts" if counts else "noise" if path.suffix == ".bin" else "watts"
    scale = count_scale(used) if level == "counts" else 1.0
    if path.suffix == ".npy":
        cubes = read_npy(path, used, scale=scale)
    else:
        cubes = read_dca1000(path, used, layout=form.layout, scale=scale, swap_iq=form.swap_iq)
    if level != "noise":
        return cubes
    factor = noise_floor_scale(cubes[0].data, used)
    return [dataclasses.replace(c, data=c.data * factor) for c in cubes]


def load_cube(path: Path) -> AdcCube:
    """Load an ``adc.npz``; a profile inside that is not one of this version is bad input, not an internal error."""
    from ..synthesis.adc import AdcCube

    try:
        return AdcCube.load(path)
    except ShenronError:
        raise
    except (ValueError, TypeError) as error:  # pydantic's and json's errors are ValueErrors
        first = str(error).strip().splitlines()[0]
        raise InputError(f"{path}: not an ADC cube that this version can read ({first})") from None


def _own_cube(path: Path, name: str | None, overrides: Overrides) -> AdcCube:
    """Read an ``adc.npz``, with the echoes beside it where they are, for the truth of the detections."""
    from ..returns import Returns

    cube = load_cube(path)
    if name is not None and name != cube.profile.name:
        raise InputError(
            f"--profile {name}: {path} was made by {cube.profile.name!r}, whose axes it keeps; leave it out"
        )
    beside = path.with_name("returns.npz")
    returns = Returns.load(beside) if path.name == "adc.npz" and beside.is_file() else None
    return dataclasses.replace(cube, profile=override_profile(cube.profile, overrides.profile), returns=returns)


def _write_config(path: Path, adc: Path, used: RadarProfile, form: _Format) -> None:
    import yaml

    source = {"adc": str(adc.resolve())} | dataclasses.asdict(form)
    data = {"process": source, "profile": used.model_dump(mode="json", exclude_none=True)}
    text = yaml.safe_dump(data, sort_keys=False, allow_unicode=True, width=120)
    path.write_text(f"# Written by shenron-rt process.\n{text}", encoding="utf-8")
