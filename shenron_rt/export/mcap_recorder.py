"""An MCAP file being written with Foxglove's schemas."""

from __future__ import annotations

from collections.abc import Mapping
from typing import IO, Any

from ..run_source import RunSource
from ..runs import plain
from .timeline import stamp_ns

__all__ = ["Recorder"]


class Recorder:
    """An MCAP file being written, with a channel for every topic that came up; a context manager.

    Errors of the disk reach the caller as what they are: the library's writer turns them into RuntimeErrors.

    Parameters
    ----------
    file : binary file
        Open for writing.
    epoch_s : int
        Seconds since 1970 of scene second 0.
    """

    def __init__(self, file: IO[bytes], epoch_s: int) -> None:
        import foxglove
        from foxglove.mcap import MCAPWriteOptions

        self.epoch_s = epoch_s
        self._file = _Sink(file)
        self._context = foxglove.Context()  # of its own: the global one may have other listeners
        options = MCAPWriteOptions(compression_threads=0)
        self._writer = foxglove.open_mcap(self._file, context=self._context, writer_options=options)
        self._channels: dict[str, Any] = {}

    def __enter__(self) -> Recorder:
        return self

    def __exit__(self, *exception: object) -> None:
        try:
            self._writer.close()
        except RuntimeError as error:
            if exception[0] is None:
                raise self._file.error or error from None
        if self._file.error is not None:
            raise self._file.error

    @property
    def topics(self) -> list[str]:
        """Topics in the order they came up."""
        return list(self._channels)

    def stamp(self, time_s: float) -> int:
        """Return the time stamp of a scene time [ns]."""
        return stamp_ns(time_s, self.epoch_s)

    def log(self, topic: str, kind: str, message: Any, stamp: int) -> None:
        """Log a message of Foxglove's schema ``kind``."""
        from foxglove import channels

        if topic not in self._channels:
            self._channels[topic] = getattr(channels, f"{kind}Channel")(topic, context=self._context)
        self._send(topic, message, stamp)

    def log_json(self, topic: str, schema: dict[str, Any], message: Mapping[str, Any], stamp: int) -> None:
        """Log a JSON message with its schema."""
        import foxglove

        if topic not in self._channels:
            self._channels[topic] = foxglove.Channel(topic, schema=schema, context=self._context)
        self._send(topic, plain(message), stamp)

    def describe(self, source: RunSource) -> None:
        """Write what the file was made from."""
        self._writer.write_metadata(
            "shenron_rt",
            {
                "run": source.name,
                "made_from": source.kind,
                "version": source.version,
                "epoch_s": str(self.epoch_s),
                "time_stamps": "epoch_s + scene seconds of mid-frame",
            },
        )

    def _send(self, topic: str, message: Any, stamp: int) -> None:
        self._channels[topic].log(message, log_time=stamp)
        if self._file.error is not None:
            raise self._file.error


class _Sink:
    """A file that remembers the error the library hides."""

    def __init__(self, file: IO[bytes]) -> None:
        self._file = file
        self.error: OSError | None = None

    def write(self, data: bytes | bytearray) -> int:
        try:
            return self._file.write(data)
        except OSError as error:
            self.error = error
            raise

    def seek(self, offset: int, whence: int = 0) -> int:
        return self._file.seek(offset, whence)

    def flush(self) -> None:
        try:
            self._file.flush()
        except OSError as error:
            self.error = error
            raise
