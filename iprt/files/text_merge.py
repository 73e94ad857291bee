"""Three-way merge of texts by lines."""

from __future__ import annotations

from collections.abc import Sequence
from difflib import SequenceMatcher


def merged(base: str, ours: str, theirs: str) -> str | None:
    """Apply the changes between two texts to a third one.

    Parameters
    ----------
    base : str
        The text to change.
    ours, theirs : str
        Texts before and after the changes; `ours` descends from `base`.

    Returns
    -------
    str or None
        None if a change concerns lines that differ between `base` and `ours`.
    """
    old, mid, new = (text.splitlines(keepends=True) for text in (base, ours, theirs))
    blocks = SequenceMatcher(None, mid, old, autojunk=False).get_matching_blocks()
    found = list(old)
    changes = SequenceMatcher(None, mid, new, autojunk=False).get_opcodes()
    for tag, first, last, start, end in reversed(changes):
        if tag == "equal":
            continue
        if first == last == len(mid):
            place, length = len(old), 0  # added at the end, after all that was added before
        else:
            shift = _shift(blocks, first, last)
            if shift is None:
                return None
            place, length = first + shift, last - first
        found[place : place + length] = new[start:end]
    return "".join(found)


def _shift(blocks: Sequence[tuple[int, int, int]], first: int, last: int) -> int | None:
    """Return the offset of equal lines around a changed range; None if a change touches it."""
    for ours, base, length in blocks:
        inside = ours <= first and last <= ours + length
        if inside and (first < last or ours < first < ours + length or first == base == 0):
            return base - ours
    return None
