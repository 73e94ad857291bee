"""Temporal stability of a played video: motion-compensated flicker, and ghost trails.

All functions take displayed pictures in [0, 1] and the renderer's AOVs. Both meters take frames in
order and keep only the last one.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import map_coordinates, uniform_filter

Image = NDArray[np.float64]
Mask = NDArray[np.bool_]

Kind = Literal["untouched", "relit", "object"]
"""Kind of pixel by the objects' effect: exactly none, relit (brighter or darker), or covered."""
KINDS: tuple[Kind, ...] = get_args(Kind)

Cause = Literal["object", "real", "light"]
"""Thing that leaves a pixel: an object, a real surface, or the shadow or light of an object."""
CAUSES: tuple[Cause, ...] = get_args(Cause)

NEIGHBOURHOOD = 3
"""Side in pixels of the box filter for errors before trails are measured. Trails are correlated
between neighbours, noise is not."""
LEVEL = 1.0 / 255.0
"""One step of an 8-bit display. Smaller changes are invisible."""
SURE = 2.0
"""Significance threshold of a ghost, in standard errors of the noise."""
MOVED_DEPTH = 0.05
"""Least relative change of depth that indicates another real surface."""
INFLUENCE, NO_INFLUENCE = 0.06, 0.015
"""Relative changes of a real pixel's light: visible above the first, invisible below the second."""
MIN_PIXELS = 200
"""Least number of pixels of an age for a result."""


def pixel_kinds(
    coverage: NDArray[np.floating], ratio: NDArray[np.floating], change: NDArray[np.floating]
) -> dict[Kind, Mask]:
    """Classify pixels; returns a mask (H, W) for each kind.

    Parameters
    ----------
    coverage : (H, W)
        Fraction of the pixel that objects cover. Partly covered pixels have no kind, because they
        mix two surfaces with different motion.
    ratio : (H, W, 3)
        Irradiance ratio E_RV / E_R.
    change : (H, W) or (H, W, 3)
        Change of the highlights of glossy real surfaces by objects; 0 without any.
    """
    change = np.abs(change).reshape(*coverage.shape, -1).max(axis=-1)
    real = coverage == 0.0
    same = (ratio == 1.0).all(axis=-1) & (change == 0.0)
    return {"untouched": real & same, "relit": real & ~same, "object": coverage == 1.0}


def compensated(previous: Image, motion: NDArray[np.floating]) -> tuple[Image, Mask]:
    """Warp the previous picture to the current one; returns it with a mask of valid pixels.

    Parameters
    ----------
    previous : (H, W, C)
    motion : (H, W, 2)
        Position x, y of each pixel's surface in the previous picture, in pixels. The centre of the
        first pixel is 0.5, 0.5. Positions outside of the picture are invalid.
    """
    height, width = previous.shape[:2]
    x, y = motion[..., 0].astype(np.float64) - 0.5, motion[..., 1].astype(np.float64) - 0.5
    # Rounding errors of the reprojection must not lose the border.
    slack = 1e-3
    inside = (x > -slack) & (x < width - 1 + slack) & (y > -slack) & (y < height - 1 + slack)
    place = np.stack([np.where(inside, y, 0.0), np.where(inside, x, 0.0)])
    # They must not blend neighbours into pixels that did not move either.
    whole = np.rint(place)
    place = np.where(np.abs(place - whole) < slack, whole, place)
    channels = [
        map_coordinates(previous[..., c], place, order=1, mode="nearest")
        for c in range(previous.shape[2])
    ]
    return np.stack(channels, axis=-1), inside


def was_so(before: Mask, motion: NDArray[np.floating]) -> Mask:
    """Mask the pixels (H, W) whose surface, warped bilinearly, lay entirely in `before`."""
    share, inside = compensated(before[..., None].astype(np.float64), motion)
    return np.asarray(inside & (share[..., 0] > 1.0 - 1e-9))


@dataclass(frozen=True)
class Flicker:
    """Mean absolute difference of consecutive pictures after motion compensation.

    Attributes
    ----------
    output, reference : float
        Difference in the pictures, and in the reference (the input or the truth) on the same
        pixels. NaN without pixels.
    ratio : float
        Flicker of the pictures over flicker of the reference; 1 if equal, NaN without pixels.
    pixels : int
        Number of evaluated pixels over all frames.
    """

    output: float
    reference: float
    ratio: float
    pixels: int

    @classmethod
    def of(cls, output: float, reference: float, pixels: int) -> Flicker:
        """Divide the sums of the differences by the number of pixels."""
        if pixels == 0:
            return cls(np.nan, np.nan, np.nan, 0)
        ratio = output / reference if reference > 0.0 else np.inf
        return cls(
            output / pixels, reference / pixels, 1.0 if output == reference else ratio, pixels
        )


_Picture = tuple[Image, Image | None, Mapping[Kind, Mask]]


class FlickerMeter:
    """Accumulator of the flicker of pictures and their reference, by kind of pixel."""

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
            Reference picture. None: changes from and to this picture are not counted.
        kinds : mapping of kind to (H, W) bool
            See `pixel_kinds`. A pixel counts only if it had the same kind in the last picture.
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
        """Return the flicker of a kind of pixel."""
        output, reference, pixels = self._sums[kind]
        return Flicker.of(float(output), float(reference), int(pixels))


def left_behind(
    before: Mapping[str, NDArray[np.floating]], now: Mapping[str, NDArray[np.floating]]
) -> dict[Cause, Mask]:
    """Mask the pixels (H, W) that something has just left, by cause.

    Parameters
    ----------
    before, now : mapping of str to array
        Converged AOVs of the previous and the current picture: coverage (H, W), depth (H, W) and
        ratio (H, W, 3).
    """
    free = now["coverage"] == 0.0
    uncovered = free & (before["coverage"] > 0.0)
    depths = before["depth"], now["depth"]
    nearer, farther = np.minimum(*depths), np.maximum(*depths)
    other = free & ~uncovered & (farther > (1.0 + MOVED_DEPTH) * nearer)
    freed = (_influence(before) > INFLUENCE) & (_influence(now) < NO_INFLUENCE)
    return {"object": uncovered, "real": other, "light": free & ~uncovered & ~other & freed}


def taken(now: Mapping[str, NDArray[np.floating]]) -> Mask:
    """Mask the pixels (H, W) that objects cover or visibly relight; AOVs as in `left_behind`."""
    return np.asarray((now["coverage"] > 0.0) | (_influence(now) > INFLUENCE))


def _influence(picture: Mapping[str, NDArray[np.floating]]) -> NDArray[np.floating]:
    """Return the relative change of a pixel's light by objects, (H, W)."""
    return np.asarray(np.abs(picture["ratio"] - 1.0).max(axis=-1))


@dataclass(frozen=True)
class Age:
    """Error statistics of the pixels that were left a given number of frames ago.

    Attributes
    ----------
    pixels : int
        Number of pixels.
    error : float
        RMS difference from the converged picture: noise and ghosts.
    ghost : float
        Visible share of the old picture: the least-squares coefficient of the error on the
        difference between the old and the new converged picture.
    contrast : float
        RMS difference between the old and the new converged picture.
    """

    pixels: int
    error: float
    ghost: float
    contrast: float

    @property
    def known(self) -> bool:
        """True if there are enough pixels for a result."""
        return self.pixels >= MIN_PIXELS

    @property
    def seen(self) -> bool:
        """True if the ghost exceeds both a step of the display and the noise."""
        noise = SURE * self.error * NEIGHBOURHOOD / np.sqrt(max(self.pixels, 1))
        return bool(self.ghost * self.contrast > max(LEVEL, noise))


@dataclass(frozen=True)
class Trail:
    """Ghost trail of things that have left.

    Attributes
    ----------
    frames : int or None
        Number of frames after which no ghost is visible. None: nothing left, or the video ends
        before the ghost has vanished.
    ages : tuple of Age
        Statistics by the number of frames since something left.
    """

    frames: int | None
    ages: tuple[Age, ...]

    @classmethod
    def of(cls, ages: Sequence[Age]) -> Trail:
        """Find the length of a trail."""
        known = [index for index, age in enumerate(ages) if age.known]
        length = max((index + 1 for index in known if ages[index].seen), default=0)
        return cls(length if known and length <= known[-1] else None, tuple(ages))


class TrailMeter:
    """Accumulator of the error of pixels that one kind of thing has left, by age."""

    def __init__(self) -> None:
        self._age: NDArray[np.int64] | None = None
        self._old: Image | None = None
        self._last: Image | None = None
        self._sums: list[NDArray[np.float64]] = []

    def add(self, shown: Image, converged: Image, *, left: Mask, taken: Mask) -> None:
        """Add the next picture of a film, starting with its first.

        Parameters
        ----------
        shown, converged : (H, W, 3)
            The picture, and its converged version without noise or temporal lag.
        left : (H, W) bool
            Pixels that something has just left; see `left_behind`.
        taken : (H, W) bool
            Pixels that are followed no longer, because something has moved into them; see `taken`.
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
        """Return the trail of all pictures so far."""
        return Trail.of([_age_of(sums) for sums in self._sums])


def _age_of(sums: NDArray[np.float64]) -> Age:
    pixels, square, along, apart = map(float, sums)
    if not pixels:
        return Age(0, 0.0, 0.0, 0.0)
    ghost = along / apart if apart > 0.0 else 0.0
    return Age(
        int(pixels), float(np.sqrt(square / pixels)), ghost, float(np.sqrt(apart / pixels / 3.0))
    )
