"""The small language of shape texts: ``name:form,AxBxC,key=value``."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

from ...errors import InputError, did_you_mean
from ._piece import Piece

__all__ = ["Recipe", "parse"]


@dataclass(frozen=True)
class Recipe:
    """How one shape is written and built.

    Parameters
    ----------
    build : callable
        Takes the parameters by name, returns the pieces.
    required : tuple of str
        Parameters without a default, in the order in which ``AxBxC`` gives them.
    optional : mapping of str to float
        Parameters with the default that ``build`` has for them; NaN where the default follows from the others.
    forms : tuple of str
        Words of which exactly one must be given (as parameter ``form``).
    dims : tuple of str
        Parameters that ``AxBxC`` sets, when not the required ones.
    """

    build: Callable[..., list[Piece]]
    required: tuple[str, ...] = ()
    optional: Mapping[str, float] = field(default_factory=dict)
    forms: tuple[str, ...] = ()
    dims: tuple[str, ...] = ()

    def usage(self, name: str) -> str:
        """Return how the shape is written, for messages."""
        words = ["|".join(self.forms)] if self.forms else []
        words += [f"{key}=" for key in self.required]
        words += [f"[{key}={'' if math.isnan(v) else f'{v:g}'}]" for key, v in self.optional.items()]
        return f"{name}:{','.join(words)}" if words else name


def parse(text: str, recipes: Mapping[str, Recipe]) -> tuple[str, dict[str, float | str]]:
    """Split a shape text into its name and its parameters [m].

    Raises
    ------
    InputError
        An unknown name or parameter, a missing one, one given twice, or a value that is not a positive number.
    """
    name, _, rest = str(text).strip().partition(":")
    name = name.strip()
    if name not in recipes:
        raise InputError(f"shape {text!r}: unknown shape {name!r}; {did_you_mean(name, recipes)}")
    recipe = recipes[name]
    found: dict[str, float | str] = {}
    for item in (word.strip() for word in rest.split(",") if word.strip()):
        for key, value in _item(text, name, recipe, item):
            if key in found:
                raise InputError(f"shape {text!r}: {key} is given twice; write {recipe.usage(name)}")
            found[key] = value
    missing = [key for key in (*(["form"] if recipe.forms else []), *recipe.required) if key not in found]
    if missing:
        raise InputError(f"shape {text!r}: {', '.join(missing)} missing; write {recipe.usage(name)} (metres)")
    return name, found


def _item(text: str, name: str, recipe: Recipe, item: str) -> list[tuple[str, float | str]]:
    if item in recipe.forms:
        return [("form", item)]
    key, equals, value = (part.strip() for part in item.partition("="))
    if equals:
        if key not in recipe.required and key not in recipe.optional:
            known = did_you_mean(key, [*recipe.required, *recipe.optional])
            raise InputError(f"shape {text!r}: unknown parameter {key!r} of {name}; {known}")
        return [(key, _length(text, key, value))]
    if recipe.forms and not item[:1].isdigit():
        raise InputError(f"shape {text!r}: cannot read {item!r}; {name} is one of {', '.join(recipe.forms)}")
    dims = recipe.dims or recipe.required
    numbers = item.split("x")
    if not dims or len(numbers) != len(dims):
        raise InputError(f"shape {text!r}: cannot read {item!r}; write {recipe.usage(name)} (metres)")
    return [(dim, _length(text, dim, number)) for dim, number in zip(dims, numbers, strict=True)]


def _length(text: str, key: str, value: str) -> float:
    try:
        number = float(value)
    except ValueError:
        number = math.nan
    if not (math.isfinite(number) and number > 0.0):
        raise InputError(f"shape {text!r}: {key} must be a positive number of metres, got {value!r}")
    return number
