"""Signals that ask the process to end, raised so that what it has written is undone."""

from __future__ import annotations

import _thread
import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType

ENDING = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)

_ended: BaseException | None = None


class Ended(BaseException):
    """A signal asked the process to end; raised like `KeyboardInterrupt`, so that all is undone."""

    def __init__(self, number: int) -> None:
        self.signal = signal.Signals(number)


@contextmanager
def signals_raise() -> Iterator[None]:
    """Let SIGTERM and SIGHUP unwind the stack, as SIGINT does, where nobody handles them yet.

    Compilers within OpenCL drivers put their own handlers in the place of Python's (LLVM, to remove
    its files). So all threads are kept from these signals but one, which waits for them and tells
    the main thread.
    """
    global _ended
    if threading.current_thread() is not threading.main_thread():
        yield
        return

    def end(number: int, _: FrameType | None) -> None:
        global _ended
        for each in ours:
            signal.signal(each, signal.SIG_IGN)  # a second one must not disturb the clearing up
        _ended = KeyboardInterrupt() if number == signal.SIGINT else Ended(number)
        raise _ended

    def watch() -> None:
        while True:
            number = signal.Signals(signal.sigwait(ours))
            if over.is_set():
                return
            _thread.interrupt_main(number)

    before = {number: signal.getsignal(number) for number in ENDING}
    ours = {n for n in ENDING if before[n] in (signal.SIG_DFL, signal.default_int_handler)}
    for number in ours:
        signal.signal(number, end)
    over = threading.Event()
    watcher = threading.Thread(target=watch, daemon=True)
    mask = signal.pthread_sigmask(signal.SIG_BLOCK, ours)
    watcher.start()
    try:
        yield
        raise_if_ended()
    except Exception:
        raise_if_ended()
        raise
    finally:
        _ended = None
        for number in ours:
            signal.signal(number, before[number])
        over.set()
        if ours:
            signal.pthread_kill(watcher.ident or 0, min(ours))
            watcher.join()
        while ours & signal.sigpending():
            signal.sigwait(ours)
        signal.pthread_sigmask(signal.SIG_SETMASK, mask)


def raise_if_ended() -> None:
    """Raise again what a library has swallowed: some catch all exceptions while they are imported.

    To be called now and then by what takes long.
    """
    if _ended is not None:
        raise _ended
