"""How steady a played video is: flicker after motion compensation, and trails of what has left.

Everything here works on pictures as displayed, in [0, 1], and on what the renderer knows of each
pixel; nothing renders. Both meters take one frame after the other and keep the last one only.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Literal, get_args

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import map_coordinates, uniform_filter

Image = NDArray[np.float64]
Mask = NDArray[np.bool_]

Kind = Literal["untouched", "relit", "object"]
"""Pixels by the objects' effect: none, to the last bit; lit or darkened; covered."""
KINDS: tuple[Kind, ...] = get_args(Kind)

Cause = Literal["object", "real", "light"]
"""Things that leave a pixel: an object, a real thing, or the shadow or light of an object."""
CAUSES: tuple[Cause, ...] = get_args(Cause)

NEIGHBOURHOOD = 3
"""Side in pixels of the squares over which errors are averaged before trails are looked for: a
trail is the same in neighbours, noise is not."""
LEVEL = 1.0 / 255.0
"""One step of an 8-bit display: smaller changes of a picture are not seen."""
SURE = 2.0
"""Standard errors by which a ghost must exceed what noise alone could make it."""
MOVED_DEPTH = 0.05
"""Share by which depth changes where another real surface is seen than before."""
INFLUENCE, NO_INFLUENCE = 0.06, 0.015
"""Changes of a real pixel's light that are seen, and that are not."""
MIN_PIXELS = 200
"""Fewer pixels of an age say nothing."""


def pixel_kinds(
    coverage: NDArray[np.floating], ratio: NDArray[np.floating], change: NDArray[np.floating]
) -> dict[Kind, Mask]:
    """Where each kind of pixel is.

    Parameters
    ----------
    coverage : (H, W)
        Fraction of the pixel that objects cover. Pixels that they cover in part are of no kind:
        they mix two surfaces, which move apart.
    ratio : (H, W, 3)
        E_RV / E_R.
    change : (H, W) or (H, W, 3)
        What objects change in the highlights of glossy real surfaces; 0 where there are none.
    """
    change = np.abs(change).reshape(*coverage.shape, -1).max(axis=-1)
    real = coverage == 0.0
    same = (ratio == 1.0).all(axis=-1) & (change == 0.0)
    return {"untouched": real & same, "relit": real & ~same, "object": coverage == 1.0}


def compensated(previous: Image, motion: NDArray[np.floating]) -> tuple[Image, Mask]:
    """The previous picture as the present one would show it, and where it shows anything.

    Parameters
    ----------
    previous : (H, W, C)
    motion : (H, W, 2)
        Where each pixel's surface was in the previous picture: x, y in pixels, of which the centre
        of the first has 0.5, 0.5; outside of the picture: nowhere.
    """
    height, width = previous.shape[:2]
    x, y = motion[..., 0].astype(np.float64) - 0.5, motion[..., 1].astype(np.float64) - 0.5
    # Rounding of a projection there and back must not lose the border.
    slack = 1e-3
    inside = (x > -slack) & (x < width - 1 + slack) & (y > -slack) & (y < height - 1 + slack)
    place = np.stack([np.where(inside, y, 0.0), np.where(inside, x, 0.0)])
    # Nor may it blend neighbours into pixels that did not move.
    whole = np.rint(place)
    place = np.where(np.abs(place - whole) < slack, whole, place)
    channels = [
        map_coordinates(previous[..., c], place, order=1, mode="nearest")
        for c in range(previous.shape[2])
    ]
    return np.stack(channels, axis=-1), inside


def was_so(before: Mask, motion: NDArray[np.floating]) -> Mask:
    """Pixels (H, W) all of whose surface, as interpolated, showed what is marked in `before`."""
    share, inside = compensated(before[..., None].astype(np.float64), motion)
    return np.asarray(inside & (share[..., 0] > 1.0 - 1e-9))


@dataclass(frozen=True)
class Flicker:
    """Mean absolute difference of consecutive pictures after motion compensation.

    Attributes
    ----------
    output, reference : float
        The difference in the pictures, and in what they are held against on the same pixels: the
        input, or the truth. NaN where there are no pixels.
    pixels : int
        That were looked at, over all frames.
    """

    output: float
    reference: float
    pixels: int

    @property
    def excess(self) -> float:
        """By how much the pictures flicker more."""
        return self.output - self.reference

    @property
    def ratio(self) -> float:
        """How many times as much; 1 where neither does, NaN where there are no pixels."""
        if self.output == self.reference:
            return 1.0
        return self.output / self.reference if self.reference > 0.0 else np.inf

    def record(self) -> dict[str, object]:
        """The same as plain data, NaN as None."""
        values = {
            "output": self.output,
            "reference": self.reference,
            "excess": self.excess,
            "ratio": self.ratio,
        }
        plain = {key: value if np.isfinite(value) else None for key, value in values.items()}
        return {**plain, "pixels": self.pixels}


_Picture = tuple[Image, Image | None, Mapping[Kind, Mask]]


class FlickerMeter:
    """Adds up flicker by kind of pixel, of pictures and of what they are held against."""

    def __init__(self) -> None:
        self._sums = {kind: np.zeros(3) for kind in KINDS}
        self._last: _Picture | None = None

    def add(
        self,
        shown: Image,
        reference: Image | None,
        kinds: Mapping[Kind, Mask],
        motion: NDArray[np.floating],
    ) -> None:
        """Add the next picture.

        Parameters
        ----------
        shown : (H, W, 3)
            The picture.
        reference : (H, W, 3) or None
            What it is held against. None: changes from and to this picture do not count.
        kinds : mapping of kind to (H, W) bool
            See `pixel_kinds`. Only pixels that were of their kind in the last picture too count.
        motion : (H, W, 2)
            See `compensated`.
        """
        before, self._last = self._last, (shown, reference, kinds)
        if before is None or before[1] is None or reference is None:
            return
        change = np.abs(shown - compensated(before[0], motion)[0]).mean(axis=-1)
        expected = np.abs(reference - compensated(before[1], motion)[0]).mean(axis=-1)
        for kind in KINDS:
            counted = kinds[kind] & was_so(before[2][kind], motion)
            self._sums[kind] += (change[counted].sum(), expected[counted].sum(), counted.sum())

    def result(self, kind: Kind) -> Flicker:
        output, reference, pixels = self._sums[kind]
        if pixels == 0:
            return Flicker(np.nan, np.nan, 0)
        return Flicker(float(output / pixels), float(reference / pixels), int(pixels))


def left_behind(
    before: Mapping[str, NDArray[np.floating]], now: Mapping[str, NDArray[np.floating]]
) -> dict[Cause, Mask]:
    """Pixels (H, W) that something has just left, by what it was.

    Parameters
    ----------
    before, now : mapping of str to array
        Auxiliary pictures of the picture before and of this one, once converged, by the renderer's
        names: coverage (H, W), depth (H, W) and ratio (H, W, 3).
    """
    free = now["coverage"] == 0.0
    uncovered = free & (before["coverage"] > 0.0)
    depths = before["depth"], now["depth"]
    nearer, farther = np.minimum(*depths), np.maximum(*depths)
    other = free & ~uncovered & (farther > (1.0 + MOVED_DEPTH) * nearer)
    freed = (_influence(before) > INFLUENCE) & (_influence(now) < NO_INFLUENCE)
    return {"object": uncovered, "real": other, "light": free & ~uncovered & ~other & freed}


def taken(now: Mapping[str, NDArray[np.floating]]) -> Mask:
    """Pixels (H, W) that an object covers, or whose light it changes visibly; see `left_behind`."""
    return np.asarray((now["coverage"] > 0.0) | (_influence(now) > INFLUENCE))


def _influence(picture: Mapping[str, NDArray[np.floating]]) -> NDArray[np.floating]:
    """(H, W) by how much objects change the light of a pixel, as a share."""
    return np.asarray(np.abs(picture["ratio"] - 1.0).max(axis=-1))


@dataclass(frozen=True)
class Age:
    """Pixels that were left so many frames ago.

    Attributes
    ----------
    error : float
        RMS difference from the converged picture: noise, and what is left of before.
    ghost : float
        Which share of what was there before is still seen: the least-squares coefficient of the
        difference on that between the old and the new picture.
    contrast : float
        RMS of that difference.
    """

    pixels: int
    error: float
    ghost: float
    contrast: float

    @property
    def known(self) -> bool:
        """There are pixels enough to say anything."""
        return self.pixels >= MIN_PIXELS

    @property
    def seen(self) -> bool:
        """The ghost is more than a step of a display, and more than noise would make it."""
        noise = SURE * self.error * NEIGHBOURHOOD / np.sqrt(max(self.pixels, 1))
        return bool(self.ghost * self.contrast > max(LEVEL, noise))


@dataclass(frozen=True)
class Trail:
    """Ghosts of things that have left.

    Attributes
    ----------
    ages : tuple of Age
        By the number of frames since something left.
    """

    ages: tuple[Age, ...]

    @property
    def frames(self) -> int | None:
        """Frames after which no ghost is seen any more; None: nothing left, or not so long before
        the end that it is known."""
        known = [index for index, age in enumerate(self.ages) if age.known]
        if not known:
            return None
        length = max((index + 1 for index in known if self.ages[index].seen), default=0)
        return length if length <= known[-1] else None

    def record(self) -> dict[str, object]:
        """The same as plain data."""
        return {"frames": self.frames, "ages": [asdict(age) for age in self.ages]}


class TrailMeter:
    """Follows pixels that one kind of thing has left, and adds up how wrong they are, by age."""

    def __init__(self) -> None:
        self._age: NDArray[np.int64] | None = None
        self._old: Image | None = None
        self._last: Image | None = None
        self._sums: list[NDArray[np.float64]] = []

    def add(self, shown: Image, converged: Image, *, left: Mask, taken: Mask) -> None:
        """Add the next picture of a film; the first is that with which it began.

        Parameters
        ----------
        shown, converged : (H, W, 3)
            The picture as it is, and as it would be without noise or past.
        left : (H, W) bool
            Pixels that something has just left; see `left_behind`.
        taken : (H, W) bool
            Pixels that something has come to, which are followed no longer; see `taken`.
        """
        if self._age is None or self._old is None or self._last is None:
            self._age = np.full(left.shape, -1)
            self._old, self._last = converged.copy(), converged
        size = (NEIGHBOURHOOD, NEIGHBOURHOOD, 1)
        error = uniform_filter(shown - converged, size)
        square = (error**2).mean(axis=-1)
        older = np.where((self._age >= 0) & ~taken, self._age + 1, -1)
        self._age = np.where(left, 0, older)
        self._sums.append(np.zeros(4))
        self._old[left] = self._last[left]
        apart = uniform_filter(self._old - converged, size)
        for age in range(len(self._sums)):
            here = self._age == age
            if here.any():
                along = (error[here] * apart[here]).sum()
                sums = (here.sum(), square[here].sum(), along, (apart[here] ** 2).sum())
                self._sums[age] += sums
        self._last = converged

    def result(self) -> Trail:
        return Trail(tuple(map(_age_of, self._sums)))


def _age_of(sums: NDArray[np.float64]) -> Age:
    pixels, square, along, apart = map(float, sums)
    if not pixels:
        return Age(0, 0.0, 0.0, 0.0)
    ghost = along / apart if apart > 0.0 else 0.0
    return Age(
        int(pixels), float(np.sqrt(square / pixels)), ghost, float(np.sqrt(apart / pixels / 3.0))
    )
