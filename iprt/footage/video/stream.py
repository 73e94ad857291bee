"""Preparation of frames ahead of time, in a thread, while others are rendered."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from typing import Generic, Self, TypeVar

Item = TypeVar("Item")


class Ahead(Generic[Item]):
    """Context manager that iterates over items which a thread makes ahead, in order.

    At most `ahead` items are ready, and one more is being made. An error from `items` is raised
    in place of the next item. Leaving the context ends the thread.

    Parameters
    ----------
    items : iterable
        Iterated over by the thread alone; closed at the end, if it is a generator. No item may be
        None.
    ahead : int
        At least 1.
    """

    def __init__(self, items: Iterable[Item], ahead: int) -> None:
        self._items, self._ahead = iter(items), ahead
        self._made: deque[Future[Item | None]] = deque()
        self._pool = ThreadPoolExecutor(1, "iprt frames")

    def __enter__(self) -> Self:
        for _ in range(self._ahead + 1):
            self._make()
        return self

    def __exit__(self, *_: object) -> None:
        self._pool.shutdown(cancel_futures=True)
        self._made.clear()
        if hasattr(self._items, "close"):
            self._items.close()

    def __iter__(self) -> Iterator[Item]:
        while (item := self._take()) is not None:
            yield item
            del item  # a frame must not stay alive while waiting for the next one

    def ready(self) -> Item | None:
        """Return the next item if it is ready; None if it is not, or if there are no more."""
        return self._take() if self._made and self._made[0].done() else None

    def _take(self) -> Item | None:
        """Wait for the next item; None if there are no more."""
        if not self._made:
            return None
        item = self._made[0].result()
        if item is not None:  # keep the end, or an error, for further calls
            self._made.popleft()
            self._make()
        return item

    def _make(self) -> None:
        self._made.append(self._pool.submit(next, self._items, None))
