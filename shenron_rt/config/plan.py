"""Batch plans: which scenes, profiles, seeds and parameters are rendered against each other."""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import Field, field_validator

from ..errors import InputError
from ._base import ConfigModel
from .loader import read_yaml, validate_model
from .settings import frame_range, split_overrides

__all__ = ["BatchPlan", "PlanOptions", "load_plan"]


class PlanOptions(ConfigModel):
    """Options of every run, as those of ``shenron-rt run``; what is left out is as there."""

    rays: Annotated[int, Field(ge=1)] | None = None
    max_bounces: Annotated[int, Field(ge=1, le=5)] | None = None
    backend: Literal["auto", "cuda", "llvm", "scalar"] | None = None
    accuracy: Annotated[float, Field(gt=0)] | None = None
    model: str | None = None
    retrace: Annotated[int, Field(ge=1)] | None = None


class BatchPlan(ConfigModel):
    """Everything against everything: a run for each scene, profile, seed and combination of ``set`` values.

    Parameters
    ----------
    name : str
        Default: the file's name without its ending.
    scenes : tuple of str
        Names of bundled scenes, or YAML files; relative paths start at the plan's folder.
    profiles : tuple of str or tuple of str
        A profile for all radars of the scene; several in brackets are several radars of one run. Default: the scene's.
    seeds : tuple of int
        Default: the scene's.
    frames : str
        ``"A:B"``, B not included.
    block : int
        Frames that are one piece of work. Results do not depend on it.
    retries : int
        How often a piece of work that failed by no fault of its input is tried again.
    write : str, optional
        What to keep of every frame, with commas, as ``--write`` of ``shenron-rt run``; default: all of it.
    set : mapping
        Dotted keys as for ``--set``, each with a value or a list of values.
    options : PlanOptions
    """

    version: Literal[1] = 1
    name: str = "batch"
    description: str = ""
    scenes: Annotated[tuple[str, ...], Field(min_length=1)]
    profiles: tuple[str | tuple[str, ...], ...] = ()
    seeds: tuple[Annotated[int, Field(ge=0)], ...] = ()
    frames: str = "0:1"
    block: Annotated[int, Field(ge=1)] = 10
    retries: Annotated[int, Field(ge=0, le=100)] = 2
    write: str | None = None
    set: Mapping[str, Any] = Field(default_factory=dict)
    options: PlanOptions = PlanOptions()
    folder: Path = Field(default_factory=Path.cwd, exclude=True, repr=False)

    @field_validator("frames", mode="before")
    @classmethod
    def _frames_are_text(cls, value: object) -> object:
        if isinstance(value, int):
            raise ValueError('a text in quotes is needed, "0:10": YAML 1.1 reads 1:10 without quotes as the number 70')
        return value

    @field_validator("frames")
    @classmethod
    def _frames_are_a_range(cls, value: str) -> str:
        frame_range(value)
        return value

    @field_validator("set")
    @classmethod
    def _keys_begin_as_those_of_set(cls, value: Mapping[str, Any]) -> Mapping[str, Any]:
        split_overrides(value)
        empty = [k for k, v in value.items() if isinstance(v, list) and not v]
        if empty:
            raise ValueError(f"{empty[0]} has no values")
        return value


def load_plan(path: str | os.PathLike[str]) -> BatchPlan:
    """Load a batch plan.

    Raises
    ------
    NotFoundError, ConfigError
        The latter lists every problem as ``file:line: key: what``.
    """
    file = Path(path)
    if file.suffix not in (".yaml", ".yml"):
        raise InputError(f"{file}: a plan is a YAML file; its name ends in .yaml")
    data, node = read_yaml(file)
    return validate_model(BatchPlan, {"name": file.stem, **data, "folder": file.parent}, str(file), node)
