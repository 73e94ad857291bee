"""Termination of the process by signals: immediate, with nothing half written.

One thread waits for SIGINT, SIGTERM and SIGHUP, which are blocked in all others. Python's own
handlers run only between two steps of the main thread, which may wait half a minute for a compiler.
Compilers within OpenCL drivers replace the handlers by their own (LLVM, to remove its files), and
some libraries swallow the exceptions that handlers raise. The stack is therefore not unwound.
Actions registered by `at_termination` clean up instead.
"""

from __future__ import annotations

import os
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress

TYPE_CHECKING = False  # `typing` takes long to import
if TYPE_CHECKING:
    from typing import NoReturn

Action = Callable[[], str | None]

SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
REPEAT_S = 0.5
"""Window in which a repeated signal is the same key press, sent by the terminal and by a program
that forwards it."""
PATIENCE_S = 5.0
"""Longest wait for the actions; service managers wait twice as long before they send SIGKILL."""
POLL_S = 0.05

_lock = threading.RLock()  # never released once the process terminates
_actions: dict[object, Action] = {}


def end_on_signals() -> None:
    """Let signals end the process, with one line on stderr and exit code 128 + their number.

    The main thread calls it before it starts others, which inherit its signal mask. Signals that
    the process was started to ignore, as by `nohup`, stay ignored. A second signal ends the process
    without waiting for the actions.
    """
    defaults = (signal.SIG_DFL, signal.default_int_handler)
    awaited = {number for number in SIGNALS if signal.getsignal(number) in defaults}
    if not awaited:
        return
    signal.pthread_sigmask(signal.SIG_BLOCK, awaited)
    received: list[signal.Signals] = []
    begin = threading.Event()

    def close() -> None:
        begin.wait()
        (number,) = received
        notes = _run_actions()
        line = "interrupted" if number == signal.SIGINT else f"terminated by {number.name}"
        os.write(2, f"iprt: {'; '.join([line, *notes])}\n".encode(errors="backslashreplace"))
        with suppress(OSError, ValueError):  # stdout is full or closed
            sys.stdout.flush()

    def watch() -> None:
        number = signal.Signals(signal.sigwait(awaited))
        received.append(number)
        begin.set()
        closing.join(REPEAT_S)
        until = time.monotonic() + PATIENCE_S
        while closing.is_alive() and time.monotonic() < until and not awaited & signal.sigpending():
            time.sleep(POLL_S)
        os._exit(128 + number)

    # Start both now: no thread can be started while the interpreter shuts down.
    closing = threading.Thread(target=close, daemon=True)
    closing.start()
    threading.Thread(target=watch, daemon=True).start()


@contextmanager
def at_termination(action: Action) -> Iterator[None]:
    """Call `action` before a signal ends the process, while the block runs.

    The last action is called first, on a thread of its own. Its result is added to the line on
    stderr. The block continues meanwhile, but is never left: no code after it runs.
    """
    key = register(action)
    try:
        yield
    finally:
        with _lock:
            del _actions[key]


def register(action: Action) -> object:
    """Register an action like `at_termination`, for the rest of the process."""
    key = object()
    with _lock:
        _actions[key] = action
    return key


@contextmanager
def undisturbed() -> Iterator[None]:
    """Delay signals until the block is done, by at most `PATIENCE_S`; one block runs at a time."""
    with _lock:
        yield


def end(code: int) -> NoReturn:
    """End the process with this exit code, without waiting for threads or drivers."""
    _run_actions()
    os._exit(code)


def _run_actions() -> list[str]:
    """Run all actions and return their notes.

    From now on no other thread leaves a block of `at_termination`.
    """
    _lock.acquire()
    notes = []
    for action in reversed(tuple(_actions.values())):  # actions may register others
        with suppress(Exception):  # the other actions must run
            notes.append(action())
    return [note for note in notes if note]
