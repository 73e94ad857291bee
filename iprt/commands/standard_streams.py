"""Standard streams of the process that fail in one way, whatever they lead to."""

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
from iprt.files.toml_text import printable

if TYPE_CHECKING:
    from _typeshed import ReadableBuffer

STDOUT, STDERR = 1, 2
LEAST_COLUMNS = 40
"""Width below which help and tables cannot be laid out; tyro never ends with less than a few."""
UNENCODABLE = "iprt.unencodable"
LONGEST = 10000
"""Characters of a line about something; names in it are as long as file systems allow."""


def prepare_streams() -> None:
    """Replace stdout and stderr by streams that any text can be printed to.

    A reader of stdout that leaves, as `head` does, has seen enough: what follows is dropped. A
    stderr that is closed or full takes nothing, and nothing can be said about it.

    Raises
    ------
    OutputError
        stdout is closed or takes no data. Said before anything else is done.
    """
    if "COLUMNS" in os.environ or shutil.get_terminal_size().columns < LEAST_COLUMNS:
        os.environ["COLUMNS"] = str(max(shutil.get_terminal_size().columns, LEAST_COLUMNS))
    closed = sys.stdout is None  # as Python has it, whatever typeshed says
    _occupy_closed()
    codecs.register_error(UNENCODABLE, _encodable)
    sys.stderr = _stream(sys.stderr, STDERR)
    sys.stdout = _stream(sys.stdout, STDOUT)
    if closed:
        raise OutputError("stdout: cannot be written: it is closed")
    _Stream(STDOUT, "wb", closefd=False).write(b"")  # a full device refuses even that


@contextmanager
def reporting(done: str) -> Iterator[None]:
    """Print about something in the block; if that fails, the error says that it is `done`.

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
    """A line about something, whose names neither end it nor steer the terminal."""
    return printable(text, LONGEST)


class OneLine(logging.Formatter):
    """Messages as `one_line`; a traceback below has lines of its own."""

    def formatMessage(self, record: logging.LogRecord) -> str:  # noqa: N802 - logging's name
        return one_line(super().formatMessage(record))


def _occupy_closed() -> None:
    """Lead closed standard streams nowhere.

    The next file to be opened would get the number of a closed one, and then what libraries print
    to that.
    """
    while (handle := os.open(os.devnull, os.O_RDWR)) <= STDERR:
        os.set_inheritable(handle, True)
    os.close(handle)


def _stream(old: TextIO | None, handle: int) -> TextIO:
    raw = _Stream(handle, "wb", closefd=False)
    unbuffered = isinstance(old, io.TextIOWrapper) and old.write_through  # as `python -u` has it
    return io.TextIOWrapper(
        io.BufferedWriter(raw),
        encoding="utf-8" if old is None else old.encoding,
        errors=UNENCODABLE if handle == STDOUT else "backslashreplace",
        line_buffering=handle == STDERR or raw.isatty() or unbuffered,
    )


class _Stream(io.FileIO):
    """A standard stream that fails once at most."""

    def write(self, data: ReadableBuffer, /) -> int:
        try:
            return super().write(data)
        except OSError as error:
            # What is buffered must not fail again when Python ends.
            nowhere = os.open(os.devnull, os.O_WRONLY)
            os.dup2(nowhere, self.fileno())
            os.close(nowhere)
            if self.fileno() == STDOUT and not isinstance(error, BrokenPipeError):
                raise OutputError(f"stdout: cannot be written: {error.strerror}") from error
            return memoryview(data).nbytes


def _encodable(error: UnicodeError) -> tuple[str | bytes, int]:
    """Bytes of file names as they are; `?` for characters that the encoding lacks."""
    try:
        return codecs.lookup_error("surrogateescape")(error)
    except UnicodeError:
        return codecs.lookup_error("replace")(error)
