"""Frames made ahead, on a thread of their own, while others are rendered."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from typing import Generic, Self, TypeVar

Item = TypeVar("Item")


class Ahead(Generic[Item]):
    """A context manager that iterates over items which a thread makes ahead, in their order.

    At most `ahead` items lie ready, and one more is in the making. The error that ends the items is
    raised where the next one would have come. Leaving the context ends the thread.

    Parameters
    ----------
    items : iterable
        Iterated over by the thread alone; closed in the end, if it is a generator. None of them is
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
            del item  # a frame must not live on while the next one is waited for

    def ready(self) -> Item | None:
        """The next item if it lies ready; None: it does not yet, or there is none any more."""
        return self._take() if self._made and self._made[0].done() else None

    def _take(self) -> Item | None:
        """The next item, once it is made; None: there is none any more."""
        if not self._made:
            return None
        item = self._made[0].result()
        if item is not None:  # the end, and an error, stay for those who ask again
            self._made.popleft()
            self._make()
        return item

    def _make(self) -> None:
        self._made.append(self._pool.submit(next, self._items, None))
