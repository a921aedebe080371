"""The errors a caller may catch.

::

    ShenronError
    ├── InputError (ValueError)               a value, argument or file content that cannot be used
    │   └── ConfigError                       the same, in a YAML file: carries file, line and key
    ├── NotFoundError (FileNotFoundError)     a named profile, material, scene or file is not there
    └── BackendError (RuntimeError)           no usable Mitsuba variant for what was asked
"""

from __future__ import annotations

import difflib
from collections.abc import Iterable

__all__ = ["BackendError", "ConfigError", "InputError", "NotFoundError", "ShenronError", "did_you_mean"]


class ShenronError(Exception):
    """Base of every error raised on purpose by this package."""


class InputError(ShenronError, ValueError):
    """A value, argument or file content that cannot be used."""


class ConfigError(InputError):
    """A YAML file that cannot be used; the message starts with ``file:line: key:``."""


class NotFoundError(ShenronError, FileNotFoundError):
    """A named resource or a file that does not exist."""


class BackendError(ShenronError, RuntimeError):
    """No Mitsuba variant can do what was asked on this machine."""


def did_you_mean(word: str, known: Iterable[str]) -> str:
    """Return a phrase that helps with a misspelt name: a suggestion where one is close, and the known names.

    Parameters
    ----------
    word : str
        The name that was given.
    known : iterable of str
        The names that exist.

    Returns
    -------
    str
        For example ``"did you mean 'asphalt'? known: asphalt, concrete"``.
    """
    names = sorted(known)
    close = difflib.get_close_matches(word, names, n=1)
    hint = f"did you mean {close[0]!r}? " if close else ""
    return f"{hint}known: {', '.join(names) or '(none)'}"
