"""What the verbs share: options, overrides, output, messages."""

from __future__ import annotations

import json
import logging
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal, TypeAlias

from cyclopts import Parameter

from ..errors import InputError
from ..run_setup import frame_range, override_profile

if TYPE_CHECKING:
    from rich.console import Console

__all__ = [
    "Json", "Output", "Overrides", "Overwrite", "ProfileNames", "SetOptions", "check_seed", "chosen_frames", "complain",
    "frame_range", "log_to_stderr", "override_profile", "print_json", "progress", "say", "show_table",
]  # fmt: skip

Output: TypeAlias = Annotated[
    Path | None, Parameter(name=["-o", "--output"], help="Run folder. Default: out/<name>-<profile>, numbered.")
]
Overwrite: TypeAlias = Annotated[bool, Parameter(negative=(), help="Replace the run in a given -o folder.")]
ProfileNames: TypeAlias = Annotated[
    list[str] | None, Parameter(name="--profile", negative=(), help="Radar profile, name or file; may be repeated.")
]
SetOptions: TypeAlias = Annotated[
    list[str] | None,
    Parameter(name="--set", negative=(), help="KEY=VALUE, KEY as profile.x.y, scene.x.y, processing.x. Repeatable."),
]
Json: TypeAlias = Annotated[
    bool, Parameter(name="--json", negative=(), help="Print JSON on stdout and nothing else there.")
]

_PREFIXES = ("profile", "scene", "processing")
#: Columns of a table that goes to a file or a pipe.
_PIPE_WIDTH = 200


class Overrides:
    """The ``--set`` options, sorted by what they change.

    Parameters
    ----------
    options : sequence of str
        ``profile.receiver.noise_figure_db=12``, ``scene.weather.rain_mm_h=25``, ``processing.pfa=1e-4``.

    Raises
    ------
    InputError
        No ``=``, or a key with another beginning.
    """

    def __init__(self, options: Sequence[str] | None) -> None:
        self.profile: dict[str, str] = {}
        self.scene: dict[str, str] = {}
        for option in options or ():
            key, equals, value = option.partition("=")
            prefix, dot, rest = key.strip().partition(".")
            if not (equals and dot and rest and value.strip()) or prefix not in _PREFIXES:
                raise InputError(
                    f"--set {option}: KEY=VALUE is needed, KEY starting with one of "
                    "profile. (profile.receiver.noise_figure_db=12), scene. (scene.weather.rain_mm_h=25), "
                    "processing. (processing.pfa=1e-4)"
                )
            if prefix == "scene":
                self.scene[rest] = value.strip()
            else:
                self.profile[rest if prefix == "profile" else f"processing.{rest}"] = value.strip()

    def only_profile(self, verb: str) -> None:
        """Refuse ``scene.`` keys where there is no scene."""
        if self.scene:
            raise InputError(
                f"--set scene.{next(iter(self.scene))}: {verb} has no scene; allowed: profile., processing."
            )


def check_seed(seed: int) -> int:
    """Return a seed that may be one."""
    if seed < 0:
        raise InputError(f"--seed {seed}: a whole number from 0 up is needed")
    return seed


def chosen_frames(text: str | None, count: int, there: str) -> range:
    """Return the frames ``A:B`` of as many as ``there`` says there are; all of them by default."""
    wanted = frame_range(text) if text else range(count)
    if wanted.stop > count:
        raise InputError(f"--frames {text}: {there}, 0:{count} is all of them")
    return wanted


# ---- output
def _console(*, stderr: bool = False) -> Console:
    from rich.console import Console

    console = Console(stderr=stderr, highlight=False)
    if not console.is_terminal:
        console.width = max(console.width, _PIPE_WIDTH)
    return console


def complain(message: str, *, hint: str = "", code: int = 2) -> int:
    """Print one line on stderr and return the exit code."""
    first, *rest = [line.strip() for line in message.strip().splitlines() if line.strip()] or ["unknown error"]
    if rest:
        first += f" (and {len(rest)} more; shenron-rt validate lists all)"
    sys.stderr.write(f"shenron-rt: {first}{f' ({hint})' if hint else ''}\n")
    return code


def log_to_stderr() -> None:
    """Send warnings of the library to stderr, one line each, the same one once."""

    class Once(logging.Filter):
        def __init__(self) -> None:
            super().__init__()
            self.seen: set[str] = set()

        def filter(self, record: logging.LogRecord) -> bool:
            text = record.getMessage()
            new = text not in self.seen
            self.seen.add(text)
            return new

    class Lines(logging.Handler):
        def emit(self, record: logging.LogRecord) -> None:
            sys.stderr.write(f"{record.levelname.lower()}: {record.getMessage()}\n")

    logger = logging.getLogger("shenron_rt")
    for handler in [h for h in logger.handlers if h.name == "cli"]:
        logger.removeHandler(handler)
    handler = Lines(logging.WARNING)
    handler.name = "cli"
    handler.addFilter(Once())
    logger.addHandler(handler)


def print_json(value: Any) -> None:
    """Write JSON, and nothing else, to stdout."""
    from ..runs import plain

    sys.stdout.write(json.dumps(plain(value), indent=2, allow_nan=False) + "\n")


def show_table(title: str, columns: Sequence[str], rows: Sequence[Sequence[Any]]) -> None:
    """Print a table to stdout; columns whose header ends in a [unit] are aligned right."""
    from rich import box
    from rich.table import Table
    from rich.text import Text

    console = _console()
    console.print(Text(title, style="bold"))  # apart: a table's own title is broken at the table's width
    table = Table(header_style="bold", box=box.SIMPLE_HEAD)
    for index, name in enumerate(columns):
        justify: Literal["left", "right"] = "right" if name.endswith("]") else "left"
        table.add_column(Text(name), justify=justify, overflow="fold", no_wrap=index == 0)
    for row in rows:
        table.add_row(*(Text("-" if cell is None else str(cell)) for cell in row))
    console.print(table)


def say(text: str) -> None:
    """Print a line to stdout."""
    sys.stdout.write(text + "\n")


@contextmanager
def progress(total: int, what: str, *, quiet: bool = False) -> Iterator[Any]:
    """Show a progress bar on stderr while it is a terminal; yields ``step(text)``."""
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn())
    console = _console(stderr=True)
    with Progress(*columns, console=console, transient=True, disable=quiet or not console.is_terminal) as bar:
        task = bar.add_task(what, total=total)

        def step(text: str | None = None, advance: int = 0) -> None:
            bar.update(task, advance=advance, description=text or what)

        yield step
