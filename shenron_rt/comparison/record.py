"""Records of a comparison: ready for JSON, and readable by attribute."""

from __future__ import annotations

from typing import Any

__all__ = ["Record"]


class Record(dict[str, Any]):
    """A mapping whose keys are attributes too: ``record["delta_db"]`` is ``record.delta_db``."""

    def __getattr__(self, name: str) -> Any:  # what a value is depends on its name
        try:
            return self[name]
        except KeyError:
            raise AttributeError(f"no {name!r} in this record; it has {', '.join(self)}") from None
