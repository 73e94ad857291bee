"""Standard streams of the process that fail alike for files, pipes and devices."""

from __future__ import annotations

import codecs
import io
import logging
import os
import shutil
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, TextIO

from iprt.errors import OutputError
from iprt.files.message_text import printable

if TYPE_CHECKING:
    from _typeshed import ReadableBuffer

STDOUT, STDERR = 1, 2
LEAST_COLUMNS = 40
"""Width below which help and tables cannot be laid out; tyro hangs at very small widths."""
UNENCODABLE = "iprt.unencodable"
LONGEST = 10000
"""Most characters of a message; names in it may be as long as file systems allow."""


def prepare_streams() -> None:
    """Replace stdout and stderr by streams that accept any text.

    If a reader of stdout closes its pipe, as `head` does, further output is dropped. Output to a
    closed or full stderr is dropped, too.

    Raises
    ------
    OutputError
        stdout is closed or takes no data. It is raised before anything else is done.
    """
    if "COLUMNS" in os.environ or shutil.get_terminal_size().columns < LEAST_COLUMNS:
        os.environ["COLUMNS"] = str(max(shutil.get_terminal_size().columns, LEAST_COLUMNS))
    closed = sys.stdout is None  # true at run time, although typeshed excludes it
    _occupy_closed()
    codecs.register_error(UNENCODABLE, _encodable)
    sys.stderr = _stream(sys.stderr, STDERR)
    sys.stdout = _stream(sys.stdout, STDOUT)
    if closed:
        raise OutputError("stdout: cannot be written: it is closed")
    _Stream(STDOUT, "wb", closefd=False).write(b"")  # a full device refuses even an empty write


@contextmanager
def reporting(done: str) -> Iterator[None]:
    """Print a result in the block; if that fails, add the note `done` to the error.

    Raises
    ------
    OutputError
        stdout cannot be written.
    """
    try:
        yield
        sys.stdout.flush()
    except OutputError as error:
        error.add_note(done)
        raise


def one_line(text: str) -> str:
    """Return a message with line breaks and control characters in names escaped."""
    return printable(text, LONGEST)


class OneLine(logging.Formatter):
    """Log formatter that applies `one_line` to messages, but not to tracebacks."""

    def formatMessage(self, record: logging.LogRecord) -> str:  # noqa: N802 - logging's name
        """Return the message in one line."""
        return one_line(super().formatMessage(record))


def _occupy_closed() -> None:
    """Connect closed standard streams to the null device.

    Otherwise the next opened file would get the descriptor of a closed stream, and the output that
    libraries print to it.
    """
    while (handle := os.open(os.devnull, os.O_RDWR)) <= STDERR:
        os.set_inheritable(handle, True)
    os.close(handle)


def _stream(old: TextIO | None, handle: int) -> TextIO:
    raw = _Stream(handle, "wb", closefd=False)
    unbuffered = isinstance(old, io.TextIOWrapper) and old.write_through  # set by `python -u`
    return io.TextIOWrapper(
        io.BufferedWriter(raw),
        encoding="utf-8" if old is None else old.encoding,
        errors=UNENCODABLE if handle == STDOUT else "backslashreplace",
        line_buffering=handle == STDERR or raw.isatty() or unbuffered,
    )


class _Stream(io.FileIO):
    """Standard stream that fails at most once."""

    def write(self, data: ReadableBuffer, /) -> int:
        try:
            return super().write(data)
        except OSError as error:
            # Buffered data must not fail again when Python ends.
            nowhere = os.open(os.devnull, os.O_WRONLY)
            os.dup2(nowhere, self.fileno())
            os.close(nowhere)
            if self.fileno() == STDOUT and not isinstance(error, BrokenPipeError):
                raise OutputError(f"stdout: cannot be written: {error.strerror}") from error
            return memoryview(data).nbytes


def _encodable(error: UnicodeError) -> tuple[str | bytes, int]:
    """Encode surrogates of file names as their bytes, and characters without an encoding as `?`."""
    try:
        return codecs.lookup_error("surrogateescape")(error)
    except UnicodeError:
        return codecs.lookup_error("replace")(error)
