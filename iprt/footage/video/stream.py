"""Frames made ahead, on a thread of their own, while others are rendered."""

from __future__ import annotations

import queue
import threading
from collections.abc import Iterable, Iterator
from types import TracebackType
from typing import Generic, TypeVar

Item = TypeVar("Item")

WAKE_S = 0.1
"""Seconds after which a thread that waits looks whether the context was left."""


class _End:
    """What the thread puts last: the error that ended it, if any."""

    def __init__(self, error: BaseException | None) -> None:
        self.error = error


class Ahead(Generic[Item]):
    """A context manager that iterates over items which a thread makes ahead, in their order.

    At most `ahead` items lie ready, and one more is in the making. The thread ends when the items
    do, when making one fails (the error is raised where the item would have come), or when the
    context is left.

    Parameters
    ----------
    items : iterable
        Iterated over by the thread alone; closed by it, if it is a generator.
    ahead : int
        At least 1.
    """

    def __init__(self, items: Iterable[Item], ahead: int) -> None:
        if ahead < 1:
            raise ValueError(f"ahead = {ahead}: at least one item is made ahead")
        self._items = items
        self._ready: queue.Queue[Item | _End] = queue.Queue(maxsize=ahead)
        self._left = threading.Event()
        self._thread = threading.Thread(target=self._make, name="iprt frames", daemon=True)

    def __enter__(self) -> Ahead[Item]:
        self._thread.start()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._left.set()
        self._thread.join()

    def ready(self) -> Item | None:
        """The next item if it lies ready; None: it does not yet, or there is none any more.

        The error that ended the items is raised where the next one would have come.
        """
        try:
            item = self._ready.get_nowait()
        except queue.Empty:
            return None
        if not isinstance(item, _End):
            return item
        self._put(item)
        if item.error is not None:
            raise item.error
        return None

    def __iter__(self) -> Iterator[Item]:
        while not self._left.is_set():
            try:
                item = self._ready.get(timeout=WAKE_S)
            except queue.Empty:
                continue
            if isinstance(item, _End):
                self._put(item)  # whoever asks again gets the same answer
                if item.error is not None:
                    raise item.error
                return
            yield item
            del item  # a frame must not live on while the next one is waited for

    def _make(self) -> None:
        end = _End(None)
        items = iter(self._items)
        try:
            for item in items:
                if not self._put(item):
                    break
                del item
        except BaseException as error:
            end = _End(error)
        finally:
            if hasattr(items, "close"):
                items.close()
        self._put(end)

    def _put(self, item: Item | _End) -> bool:
        """Whether there was room before the context was left."""
        while not self._left.is_set():
            try:
                self._ready.put(item, timeout=WAKE_S)
            except queue.Full:
                continue
            return True
        return False
