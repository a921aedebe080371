"""The command line: parses, calls, prints. Each verb stands in a module of its own, imported when it is called."""

from __future__ import annotations

import errno
import os
import sys
from collections.abc import Sequence
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from cyclopts import App

__all__ = ["build_app", "main"]

_VERBS = {
    "run": ("run:run", "Render a mesh scene: scatterers, ADC cube, maps, detections, pictures."),
    "batch": ("batch:batch", "Render a plan of scenes, profiles, seeds and parameters; local or on a Dask cluster."),
    "lidar": ("lidar:lidar", "Simulate a radar from frames of a semantic LiDAR: CARLA's PLY, .bin, .npy, LAZ ..."),
    "process": ("process:process", "Process ADC data: own cubes, plain .npy arrays, DCA1000 captures."),
    "rcs": ("rcs:rcs", "Sweep one target on a turntable: radar cross section over frequency and aspect."),
    "cast-lidar": ("cast:cast_lidar", "Cast a semantic LiDAR over a mesh scene and write CARLA's files."),
    "compare": ("compare:compare", "Compare two runs, or a run and a recording, and say what makes them differ."),
    "explain": ("explain:explain", "Tell for every object and frame of a run whether it is seen, and why not."),
    "track": ("track:track", "Gather a run's detections to objects, track them, and compare with the truth."),
    "export": ("export:export", "Export a run: MCAP for Foxglove, ROS 2 bag, PCD, PLY, CSV, Zarr."),
    "report": ("report_page:report", "Write one HTML page about a run: scene, maps, points, objects, settings."),
    "resolve": ("resolve:resolve", "Show which tag every part of a mesh gets, by which rule."),
    "validate": ("validate:validate", "Check YAML, mesh and ADC files and run folders."),
    "profiles": ("tables:profiles", "List the radar profiles, or show one with its derived numbers and sources."),
    "materials": ("tables:materials", "List the materials, or show one with its sources."),
    "doctor": ("doctor:doctor", "Show what this machine can run, and how to fix what it cannot."),
}


def _version() -> str:
    from ..run_setup import package_version

    return package_version()


def build_app() -> App:
    """Return the cyclopts application."""
    from cyclopts import App

    app = App(
        name="shenron-rt",
        help="Ray-traced FMCW radar simulation: mesh scene in, ADC cube, maps, detections and pictures out.",
        version=_version,
        help_format="plaintext",
        result_action="return_value",
    )
    for name, (where, summary) in _VERBS.items():
        app.command(f"{__name__}.{where}", name=name, help=summary)
    return app


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command line.

    Parameters
    ----------
    argv : sequence of str, optional
        Arguments; those of the process by default.

    Returns
    -------
    int
        0 ok; 2 bad input or usage, with one line on stderr; 1 internal error.
    """
    from cyclopts import CycloptsError

    from ..errors import ShenronError
    from .common import complain, log_to_stderr

    log_to_stderr()
    tokens = list(sys.argv[1:] if argv is None else argv)
    try:
        result = build_app()(tokens, exit_on_error=False, print_error=False)
    except CycloptsError as error:
        return complain(str(error), hint="shenron-rt --help shows the verbs, shenron-rt VERB --help their options")
    except ShenronError as error:
        return complain(str(error))
    except BrokenPipeError:  # the reader of our output has gone, for example "| head"
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 0
    except OSError as error:
        if not error.strerror:  # raised by a library, not by the system
            return _internal(error)
        full = error.errno in (errno.ENOSPC, errno.EDQUOT)
        what = "no space left on the disk" if full else error.strerror
        gone = "; what was being written has been removed" if full or error.errno in (errno.EFBIG, errno.EIO) else ""
        return complain(f"{error.filename}: {what}{gone}" if error.filename else f"{what}{gone}")
    except KeyboardInterrupt:
        return complain("interrupted", code=130)
    except Exception as error:
        return _internal(error)
    return result if isinstance(result, int) else 0


def _internal(error: Exception) -> int:
    """Print the line of an error that is ours, or raise it again for who looks for it."""
    from .common import complain

    if os.environ.get("SHENRON_RT_DEBUG"):
        raise error
    text = f"internal error: {type(error).__name__}: {error}"
    return complain(text, hint="SHENRON_RT_DEBUG=1 shows where; please report it", code=1)
