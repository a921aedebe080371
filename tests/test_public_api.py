"""The public names: what ``__all__`` promises, what is importable and what type checkers see are one list."""

from __future__ import annotations

import ast
from pathlib import Path

import pytest

import shenron_rt


def _names_for_type_checkers() -> set[str]:
    tree = ast.parse(Path(shenron_rt.__file__).read_text(encoding="utf-8"))
    blocks = [node for node in tree.body if isinstance(node, ast.If) and ast.unparse(node.test) == "TYPE_CHECKING"]
    aliases = [a for block in blocks for line in block.body if isinstance(line, ast.ImportFrom) for a in line.names]
    assert all(a.asname == a.name for a in aliases)  # "import X as X" is what marks a re-export
    return {a.name for a in aliases}


def test_all_is_sorted_and_equals_what_type_checkers_see() -> None:
    names = [n for n in shenron_rt.__all__ if n != "__version__"]
    assert names == sorted(set(names))
    assert set(names) == _names_for_type_checkers()


@pytest.mark.parametrize("name", shenron_rt.__all__)
def test_every_public_name_is_importable_and_documented(name: str) -> None:
    value = getattr(shenron_rt, name)
    assert name in dir(shenron_rt)
    if name != "__version__":
        assert value.__name__ == name
        assert value.__doc__


@pytest.mark.parametrize("module", ["physics", "dsp"])
def test_public_lists_of_subpackages_hold(module: str) -> None:
    package = getattr(shenron_rt, module)
    assert package.__all__
    missing = [name for name in package.__all__ if not hasattr(package, name)]
    assert missing == []


def test_an_unknown_name_is_an_attribute_error() -> None:
    with pytest.raises(AttributeError, match="no attribute 'simulat'"):
        shenron_rt.simulat  # noqa: B018


def test_the_version_is_that_of_the_installed_package() -> None:
    assert shenron_rt.__version__.split(".")[0].isdigit()
