"""What commands and plans say in words: frames ``A:B`` and dotted keys."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from ..errors import InputError

__all__ = ["frame_range", "split_overrides"]

_PREFIXES = ("profile", "scene", "processing")


def frame_range(text: str) -> range:
    """Return the frames of ``A:B`` (half open), or of one number.

    Raises
    ------
    InputError
    """
    first, colon, last = text.partition(":")
    try:
        start = int(first or 0)
        stop = int(last) if colon else start + 1
    except ValueError:
        start, stop = 0, -1
    if start < 0 or stop <= start:
        raise InputError(f"--frames {text}: A:B with 0 <= A < B is needed, B is not included (0:10 is ten frames)")
    return range(start, stop)


def split_overrides(values: Mapping[str, Any]) -> tuple[dict[str, Any], dict[str, Any]]:
    """Return what ``scene.`` keys change, and what ``profile.`` and ``processing.`` keys change in a profile.

    Raises
    ------
    InputError
        A key with another beginning.
    """
    scene: dict[str, Any] = {}
    profile: dict[str, Any] = {}
    for key, value in values.items():
        prefix, dot, rest = key.partition(".")
        if not (dot and rest) or prefix not in _PREFIXES:
            raise InputError(
                f"{key}: a key starts with one of profile. (profile.receiver.noise_figure_db), "
                "scene. (scene.weather.rain_mm_h), processing. (processing.pfa)"
            )
        if prefix == "scene":
            scene[rest] = value
        else:
            profile[rest if prefix == "profile" else f"processing.{rest}"] = value
    return scene, profile
