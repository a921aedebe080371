"""``shenron-rt explain``: for every object and frame of a run, what became of its echo and why."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter

from .common import Json, Output, Overwrite, print_json, progress, say, show_table

if TYPE_CHECKING:
    from ..attribution import Explanation, FrameExplanation, ObjectExplanation

__all__ = ["explain"]

_MAX_ROWS = 40
#: Detections of a frame that are listed with their labels.
_MAX_SHARES = 6


def explain(
    run: Path,
    /,
    *,
    object_: Annotated[int | None, Parameter(name="--object", help="Id of one object. Default: all.")] = None,
    frame: int | None = None,
    radar: str | None = None,
    output: Output = None,
    overwrite: Overwrite = False,
    json_: Json = False,
) -> int:
    """Tell for every object and frame of a run whether it is seen, and why not.

    Parameters
    ----------
    run
        Run folder.
    frame
        One frame. Default: all of the run.
    radar
        One radar. Default: all of the run.
    output
        Folder for explain.json, evidence and a waterfall picture of each object. Default: nothing is written.
    """
    from .. import runs
    from ..attribution import explain as explain_run

    loaded = runs.load_run(run)
    if output is not None:
        runs.check_target(output, overwrite)
    with progress(sum(len(f) for f in loaded.frames.values()), "explaining", quiet=json_) as step:
        found = explain_run(
            loaded, object_id=object_, frame=frame, radar=radar, progress=lambda text: step(text, advance=1)
        )
    if json_:
        print_json(found.to_dict() | {"evidence": found.evidence()})
    else:
        _show(found, object_)
    if output is not None:
        with runs.write_run(output, overwrite=overwrite) as place:
            _save(found, place.partial, loaded.root.name)
        if not json_:
            say(f"{place.folder}: written")
    return 0


def _save(found: Explanation, folder: Path, name: str) -> None:
    from ..plot import explain_waterfall
    from ..plot._style import save
    from ..runs import write_json

    write_json(folder / "explain.json", found.to_dict() | {"evidence": found.evidence()})
    for frame in found:
        for item in frame.objects:
            if item.waterfall is not None:
                title = f"{name}, {frame.radar}, frame {frame.frame}"
                file = f"explain_{frame.radar}_{frame.frame:06d}_{item.object_id}.png"
                save(explain_waterfall(item, title=title), folder / file)


def _show(found: Explanation, wanted: int | None) -> None:
    for radar in dict.fromkeys(f.radar for f in found):
        frames = [f for f in found if f.radar == radar]
        if wanted is not None:
            _one_object(radar, frames)
        elif len(frames) == 1:
            _one_frame(frames[0])
        else:
            _many_frames(radar, frames)
    peaks = [
        (p["frame"], p["radar"], f"{p['range_m']:.2f}", f"{p['azimuth_deg']:.1f}", f"{p['level_dbm']:.1f}", p["name"])
        for p in found.evidence()
    ]
    columns = ("frame", "radar", "range [m]", "azimuth [deg]", "level [dBm]", "whose")
    show_table("Strongest peak", columns, peaks[:_MAX_ROWS])


def _one_frame(frame: FrameExplanation) -> None:
    rows = [(o.object_id, o.name, *_line(o)) for o in frame.objects]
    title = f"{frame.radar}, frame {frame.frame}, {frame.time_s:g} s"
    show_table(title, ("id", "object", *_LINE), rows[:_MAX_ROWS])
    if len(rows) > _MAX_ROWS:
        say(f"... and {len(rows) - _MAX_ROWS} more objects; --json lists all")
    changes = [(o.object_id, o.name, o.verdict.change) for o in frame.objects if o.verdict.change]
    if changes:
        show_table("What would make them visible", ("id", "object", "change"), changes[:_MAX_ROWS])
    kinds = Counter(frame.detection_labels)
    say(f"Detections: {', '.join(f'{n} {kind}' for kind, n in kinds.most_common()) or 'none'}\n")


_LINE = (
    "range [m]", "azimuth [deg]", "velocity [m/s]", "area [m^2]", "rows [1]", "power [dBm]", "sample SNR [dB]",
    "cell SNR [dB]", "verdict",
)  # fmt: skip


def _line(o: ObjectExplanation) -> tuple[Any, ...]:
    budget = o.waterfall
    return (
        _text(o.range_m), _text(o.azimuth_deg, 1), _text(o.velocity_mps), _text(o.visible_area_m2), o.rows,
        _text(o.power_dbm, 1), None if budget is None else f"{budget.sample_snr_db:.1f}",
        None if budget is None else f"{budget.object_snr_db:.1f}", o.verdict.text,
    )  # fmt: skip


def _many_frames(radar: str, frames: Sequence[FrameExplanation]) -> None:
    """Print how often each object got each verdict."""
    verdicts: dict[int, Counter[str]] = {}
    names: dict[int, str] = {}
    for frame in frames:
        for o in frame.objects:
            by = f" by {o.verdict.by}" if o.verdict.by else ""
            verdicts.setdefault(o.object_id, Counter())[f"{o.verdict.name}{by}"] += 1
            names[o.object_id] = o.name
    rows = [
        (number, names[number], count["detected"], ", ".join(f"{n} x {k}" for k, n in count.most_common()))
        for number, count in verdicts.items()
    ]
    title = f"{radar}, {len(frames)} frames; --frame K or --object ID tells more"
    show_table(title, ("id", "object", "detected [frames]", "verdicts"), rows[:_MAX_ROWS])


def _one_object(radar: str, frames: Sequence[FrameExplanation]) -> None:
    items = [(f, o) for f in frames for o in f.objects]
    name = items[0][1].name if items else "object"
    show_table(f"{name} as {radar} sees it", ("frame", *_LINE), [(f.frame, *_line(o)) for f, o in items])
    if len(items) == 1:
        _card(items[0][1])


def _card(o: ObjectExplanation) -> None:
    """Print all that is known of one object in one frame."""
    if o.waterfall is not None:
        rows = [(s.name, f"{s.gain_db:+z.2f}", f"{s.level:z.2f} {s.unit}", s.note) for s in o.waterfall.stages]
        show_table("Waterfall", ("step", "gain [dB]", "level [dBm, dB]", "note"), rows)
        sound = "closes" if o.waterfall.closes else "DOES NOT CLOSE"
        say(
            f"{sound}: what objects do not explain is {o.waterfall.rest_db:+.1f} dB over the noise of the cell "
            f"(limit {o.waterfall.limit_db:.1f} dB)\n"
        )
    if o.cell is not None:
        at = f"row {o.cell.row}, column {o.cell.column}: {o.cell.range_m:.2f} m, {o.cell.velocity_mps:+.2f} m/s"
        shares = [(s.name, f"{s.cell_dbm:.1f}", f"{s.threshold_dbm:.1f}") for s in o.shares[:_MAX_SHARES]]
        shares.append(("together, measured", f"{o.cell_dbm:.1f}", f"{o.threshold_dbm:.1f}"))
        show_table(f"Its cell: {at}", ("who", "in the cell [dBm]", "in the threshold [dBm]"), shares)
    say(f"Verdict: {o.verdict.text}")
    if o.verdict.numbers:
        show_table("Proof", ("number", "value"), [(k, _text(v)) for k, v in o.verdict.numbers.items()])
    if o.verdict.change:
        say(f"To see it: {o.verdict.change}")


def _text(value: Any, digits: int = 2) -> str | None:
    if isinstance(value, dict):
        return ", ".join(f"{k} {_text(v)}" for k, v in value.items()) or "none"
    return None if value is None else f"{value:z.{digits}f}" if isinstance(value, float) else str(value)
