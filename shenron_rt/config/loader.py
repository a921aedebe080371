"""Read YAML safely and report every problem as ``file:line: key: what (got value); hint``."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, TypeVar

import yaml
from pydantic import BaseModel, ValidationError

from ..errors import ConfigError, NotFoundError, did_you_mean

__all__ = ["apply_overrides", "parse_model", "read_yaml", "resolve_path", "validate_model"]

Model = TypeVar("Model", bound=BaseModel)


class _SafeLoader(yaml.CSafeLoader if hasattr(yaml, "CSafeLoader") else yaml.SafeLoader):  # type: ignore[misc]
    """Safe loader that refuses a key given twice, which PyYAML silently overwrites, and says where a value fails."""

    def construct_object(self, node: yaml.Node, deep: bool = False) -> Any:
        try:
            return super().construct_object(node, deep=deep)
        except (ValueError, TypeError, LookupError, AttributeError) as error:  # 2020-13-45, !!int x, a list as a key
            raise yaml.constructor.ConstructorError(
                None, None, f"a value that cannot be read ({error})", node.start_mark
            ) from None


def _mapping_without_duplicates(loader: Any, node: yaml.MappingNode) -> dict[Any, Any]:
    seen: set[Any] = set()
    for key_node, _ in node.value:
        if key_node.tag == "tag:yaml.org,2002:merge":
            continue
        key = loader.construct_object(key_node, deep=True)
        if key in seen:
            raise yaml.constructor.ConstructorError(None, None, f"key {key!r} is given twice", key_node.start_mark)
        seen.add(key)
    loader.flatten_mapping(node)
    return {loader.construct_object(k, deep=True): loader.construct_object(v, deep=True) for k, v in node.value}


_SafeLoader.add_constructor(yaml.resolver.BaseResolver.DEFAULT_MAPPING_TAG, _mapping_without_duplicates)


def read_yaml(path: str | os.PathLike[str]) -> tuple[dict[str, Any], yaml.Node | None]:
    """Read one YAML mapping.

    Parameters
    ----------
    path : path
        The file.

    Returns
    -------
    data : dict
        Plain Python values; nothing is executed.
    node : yaml.Node or None
        The parse tree, which knows the line of every key.

    Raises
    ------
    NotFoundError
        The file does not exist.
    ConfigError
        It is not YAML, or not a mapping.
    """
    file = Path(path)
    try:
        text = file.read_text(encoding="utf-8")
    except (FileNotFoundError, IsADirectoryError):
        raise NotFoundError(f"{file}: no such file") from None
    except UnicodeDecodeError as error:
        raise ConfigError(f"{file}: not a UTF-8 text file ({error.reason} at byte {error.start})") from None
    try:
        data, node = _parsed(text)
    except yaml.YAMLError as error:
        mark = getattr(error, "problem_mark", None)
        line = f":{mark.line + 1}" if mark else ""
        problem = getattr(error, "problem", None) or str(error).splitlines()[0]
        raise ConfigError(f"{file}{line}: not valid YAML: {problem}") from None
    except RecursionError:
        raise ConfigError(f"{file}: not a config: its lists or mappings are nested too deep") from None
    if data is None:
        data = {}
    if not isinstance(data, dict):
        raise ConfigError(f"{file}:1: a mapping of keys is needed, got a {type(data).__name__}")
    return data, node


def _parsed(text: str) -> tuple[Any, yaml.Node | None]:
    """Return the values of a text and its parse tree, read once: a scene of ten thousand actors takes seconds."""
    loader = _SafeLoader(text)
    try:
        node = loader.get_single_node()
        return (None if node is None else loader.construct_document(node)), node
    finally:
        loader.dispose()


def _line_of(node: yaml.Node | None, location: Sequence[str | int]) -> int | None:
    """Return the line of the deepest part of ``location`` that stands in the file."""
    line = None
    for part in location:
        if isinstance(node, yaml.MappingNode):
            # from the end: keys of the mapping itself come after those that it merges in
            match = next(((k, v) for k, v in reversed(node.value) if k.value == str(part)), None)
            if match is None:
                break
            line, node = match[0].start_mark.line + 1, match[1]
        elif isinstance(node, yaml.SequenceNode) and isinstance(part, int) and part < len(node.value):
            node = node.value[part]
            line = node.start_mark.line + 1
        else:
            break
    return line


def _fields_at(model: type[BaseModel], location: Sequence[str | int]) -> list[str]:
    """Return the keys allowed at the parent of ``location``, where they can be told."""
    current: Any = model
    for part in location[:-1]:
        fields = getattr(current, "model_fields", None)
        if isinstance(part, str) and fields and part in fields:
            current = fields[part].annotation
        # unwrap tuple[X, ...] and X | None
        while not hasattr(current, "model_fields"):
            arguments = [a for a in getattr(current, "__args__", ()) if a not in (type(None), Ellipsis)]
            if not arguments:
                return []
            current = arguments[0]
    return list(getattr(current, "model_fields", {}))


def _message(model: type[BaseModel], source: str, node: yaml.Node | None, error: Any) -> str:
    location = [p for p in error["loc"] if not (isinstance(p, str) and p[:1].isupper())]  # drop union member names
    line = _line_of(node, location)
    where = f"{source}:{line}" if line else source
    key = ".".join(str(p) for p in location) or "(top level)"
    got = error.get("input")
    shown = f" (got {got!r})" if error["type"] != "missing" and not isinstance(got, Mapping) else ""
    hint = ""
    if error["type"] == "extra_forbidden" and location:
        hint = "; " + did_you_mean(str(location[-1]), _fields_at(model, location))
    what = error["msg"].removeprefix("Value error, ")
    return f"{where}: {key}: {what}{shown}{hint}"


def validate_model(model: type[Model], data: Mapping[str, Any], source: str, node: yaml.Node | None = None) -> Model:
    """Build a model from plain data, or raise one :class:`ConfigError` that lists every problem, one a line."""
    try:
        return model.model_validate(data)
    except ValidationError as error:
        raise ConfigError("\n".join(_message(model, source, node, e) for e in error.errors())) from None


def parse_model(model: type[Model], path: str | os.PathLike[str], overrides: Mapping[str, Any] | None = None) -> Model:
    """Read a YAML file into a model.

    Parameters
    ----------
    model : type
        A :class:`~shenron_rt.config._base.ConfigModel`.
    path : path
        The file.
    overrides : mapping, optional
        Dotted keys and the values that replace those of the file.

    Raises
    ------
    ConfigError, NotFoundError
    """
    data, node = read_yaml(path)
    return validate_model(model, apply_overrides(data, overrides or {}), str(path), node)


def apply_overrides(data: Mapping[str, Any], overrides: Mapping[str, Any]) -> dict[str, Any]:
    """Return a copy of ``data`` with dotted keys replaced, for example ``{"receiver.noise_figure_db": 12}``.

    Numbers index lists: ``actors.0.velocity_mps``. Strings are read as YAML scalars, so that ``"12"`` is a number.
    """
    result: dict[str, Any] = _copy(data)
    for dotted, value in overrides.items():
        parts = dotted.split(".")
        target: Any = result
        for part in parts[:-1]:
            target = _item(target, part, dotted) if isinstance(target, list) else target.setdefault(part, {})
            if not isinstance(target, dict | list):
                raise ConfigError(f"--set {dotted}: {part!r} is a value, not a group of keys")
        parsed = yaml.load(value, Loader=_SafeLoader) if isinstance(value, str) else value
        if isinstance(target, list):
            _item(target, parts[-1], dotted)
            target[int(parts[-1])] = parsed
        else:
            target[parts[-1]] = parsed
    return result


def _item(items: list[Any], part: str, dotted: str) -> Any:
    if not part.isdigit() or int(part) >= len(items):
        raise ConfigError(f"--set {dotted}: {part!r} is not an index into a list of {len(items)}")
    return items[int(part)]


def _copy(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {k: _copy(v) for k, v in value.items()}
    if isinstance(value, list | tuple):
        return [_copy(v) for v in value]
    return value


def resolve_path(text: str, base: Path, what: str) -> Path:
    """Return the file a config names, relative to the folder of the config.

    Raises
    ------
    ConfigError
        A relative path that climbs out of the config's folder; an absolute path says what it means and is taken.
    NotFoundError
        The file does not exist.
    """
    given = Path(text)
    file = given if given.is_absolute() else base / given
    if not given.is_absolute() and not file.resolve().is_relative_to(base.resolve()):
        raise ConfigError(
            f"{what}: {text!r} leaves the folder {str(base)!r}; put the file below it or give an absolute path"
        )
    if not file.is_file():
        raise NotFoundError(f"{what}: {str(file)!r} does not exist")
    return file
