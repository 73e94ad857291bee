"""Twin of `cl/lib/world/real/edges.h` and `cl/compositing/real_layer.cl`, by pixels in float64."""

from __future__ import annotations

import itertools
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from iprt.geometry.camera import View
from iprt.geometry.equirect import equirect_pixel
from tests.worlds import Float, keys, panorama_cubic

EAST, WEST, NORTH, SOUTH, NONE = 1, 2, 4, 8, 32
Place = tuple[int, int]
"""Row and column in the window, from 0 to 3."""
NEIGHBOURS = ((0, 1), (0, -1), (1, 0), (-1, 0))
INNER = tuple(itertools.product((1, 2), repeat=2))
WINDOW = tuple(itertools.product(range(4), repeat=2))


@dataclass(frozen=True)
class Pixel:
    """Color (3,); texel (row, column) whose surface is shown, None: that of the centre; shares of
    the other side, in the radiance (3) and in the area, and the nearest texel that shows it.
    """

    color: Float
    texel: tuple[int, int] | None
    other: Float | None = None
    beyond: tuple[int, int] | None = None


class Panorama:
    """Color (H, W, 3) and flags (H, W) of the texels."""

    def __init__(self, color: NDArray[np.floating], flags: NDArray[np.integer]) -> None:
        self._color, self._flags = color.astype(np.float64), flags
        self._height, self._width = flags.shape

    def pixel(self, view: View, x: int, y: int) -> Pixel:
        """Return the pixel's contents."""
        middle = np.array([x + 0.5, y + 0.5])
        d = view.unproject(middle)
        blurred = panorama_cubic(self._color, d)
        column, row = equirect_pixel(d, self._width, self._height) - 0.5
        row = float(np.clip(row, 0.0, self._height - 1.0))
        left, upper = int(np.floor(column)), int(np.floor(row))
        texels = {
            (r, c): (
                int(np.clip(upper + r - 1, 0, self._height - 1)),
                (left + c - 1) % self._width,
            )
            for r, c in WINDOW
        }
        at = np.array([row - upper + 1.0, column - left + 1.0])
        if not any(self._at_gap(texels[place]) for place in INNER):
            return Pixel(blurred, None)
        sides = self._sides(texels, at)
        if sides is None or not set(INNER) <= sides[0] | sides[1]:
            return Pixel(blurred, None)
        mixed = {p for p in WINDOW if self._mixed(texels, p)}
        pure = [sorted(side - mixed) for side in sides]
        colors = {p: self._color[texels[p]] for p in WINDOW}
        for one, other in ((0, 1), (1, 0)):
            if pure[other] and not pure[one]:
                mean = np.mean([colors[p] for p in pure[other]], axis=0)
                apart = {p: float(np.sum((colors[p] - mean) ** 2)) for p in sorted(sides[one])}
                pure[one] = [max(apart, key=lambda p: apart[p])]
        if not pure[0]:
            return Pixel(blurred, None)
        weights = [np.array([_fading(p, at) for p in one]) for one in pure]
        front, back = (
            np.average([colors[p] for p in one], axis=0, weights=weight)
            for one, weight in zip(pure, weights, strict=True)
        )
        expected = np.sqrt(self._prior(colors, pure, weights, front, back))
        coverage = {
            p: self._coverage(colors[p], p, sides, p in mixed, front, back, expected)
            for p in WINDOW
        }
        share = self._share(coverage, at, view, middle)
        residual = sum(
            np.prod(1.0 - np.abs(at - p))
            * np.sum((colors[p] - coverage[p] * front - (1.0 - coverage[p]) * back) ** 2)
            for p in INNER
        )
        contrast = float(np.sum((front - back) ** 2))
        bright = float(np.sum(np.maximum(front, back) ** 2))
        enough = 0.01 * contrast + 1e-5 * bright
        mixtures = max(1.05 / (1.0 + (residual / enough) ** 2) - 0.05, 0.0)
        for side, used, whole in zip(
            sides, pure, (lambda c: c > 0.97, lambda c: c < 0.03), strict=True
        ):
            used.extend(p for p in side if p not in used and whole(coverage[p]))
        shown = [self._side(colors, used, at) for used in pure]
        sharp = share * shown[0] + (1.0 - share) * shown[1]
        color = mixtures * sharp + (1.0 - mixtures) * blurred
        own = 0 if share > 0.5 else 1

        def nearest_of(places: Iterable[Place]) -> tuple[int, int]:
            return texels[min(sorted(places), key=lambda p: float(np.sum((p - at) ** 2)))]

        of_front = mixtures * share + (1.0 - mixtures) * float(
            np.clip(self._held(coverage, at), 0, 1)
        )
        areas = [of_front, 1.0 - of_front]
        parts = [areas[0] * shown[0], areas[1] * shown[1]]
        other = np.append(parts[1 - own] / (parts[0] + parts[1]), areas[1 - own])
        return Pixel(color, nearest_of(sides[own]), other, nearest_of(pure[1 - own]))

    @staticmethod
    def _held(coverage: dict[Place, float], at: Float) -> float:
        weights = {(r, c): keys(at[:1] - r).item() * keys(at[1:] - c).item() for r, c in WINDOW}
        return sum(weights[p] * coverage[p] for p in WINDOW)

    def _at_gap(self, texel: tuple[int, int]) -> bool:
        flags = int(self._flags[texel])
        joined = EAST | WEST | NORTH | SOUTH
        return not flags & NONE and flags & joined != joined

    def _joined(self, texels: dict[Place, tuple[int, int]], one: Place, other: Place) -> bool:
        if texels[one] == texels[other]:
            return True
        first, second = sorted([one, other])
        flag = EAST if first[0] == second[0] else SOUTH
        a, b = int(self._flags[texels[first]]), int(self._flags[texels[second]])
        return bool(a & flag) or bool(a & b & NONE)

    def _mixed(self, texels: dict[Place, tuple[int, int]], place: Place) -> bool:
        if not int(self._flags[texels[place]]) & NONE:
            return self._at_gap(texels[place])
        around = [(place[0] + r, place[1] + c) for r, c in NEIGHBOURS]
        return any(p in texels and not self._joined(texels, place, p) for p in around)

    def _sides(self, texels: dict[Place, tuple[int, int]], at: Float) -> list[set[Place]] | None:
        gaps = []
        for r, c in WINDOW:
            for down, right in ((0, 1), (1, 0)):
                other = (r + down, c + right)
                if other not in texels or self._joined(texels, (r, c), other):
                    continue
                across = at - [r, c]
                long, short = (across[1], across[0]) if right else (across[0], across[1])
                distance = (long - 0.5) ** 2 + max(abs(short) - 0.5, 0.0) ** 2
                gaps.append((distance, (r, c), other))
        gaps = [gap for gap in gaps if gap[0] < 2.25]
        if not gaps:
            return None
        _, one, other = min(gaps, key=lambda gap: gap[0])
        sides: list[set[Place]] = [{one}, {other}]
        for step in range(8):
            side, rival = sides[step % 2], sides[1 - step % 2]
            reached = {
                (r + down, c + right)
                for (r, c), (down, right) in itertools.product(side, NEIGHBOURS)
                if (r + down, c + right) in texels
                and self._joined(texels, (r, c), (r + down, c + right))
            }
            side |= reached - rival
        return sides

    @staticmethod
    def _prior(
        colors: dict[Place, Float],
        pure: list[list[Place]],
        weights: list[Float],
        front: Float,
        back: Float,
    ) -> float:
        variances = [
            float(np.average([np.sum((colors[p] - mean) ** 2) for p in side], weights=weight))
            for side, weight, mean in zip(pure, weights, (front, back), strict=True)
        ]
        return sum(variances) + 0.01 * float(np.sum(np.maximum(front, back) ** 2))

    @staticmethod
    def _coverage(
        seen: Float,
        place: Place,
        sides: list[set[Place]],
        mixed: bool,
        front: Float,
        back: Float,
        weight: float,
    ) -> float:
        own = float(place in sides[0])
        if not mixed:
            return own
        expected = own
        if place in INNER:
            around = [(place[0] + r, place[1] + c) for r in (-1, 0, 1) for c in (-1, 0, 1)]
            expected = 0.5 + 2.25 * (np.mean([p in sides[0] for p in around]) - 0.5)
        # One equation per channel, and one more for what is expected.
        left = np.append(front - back, weight)
        right = np.append(seen - back, weight * expected)
        share = np.linalg.lstsq(left[:, None], right, rcond=None)[0].item()
        return float(np.clip(share, 0.5 * own, 0.5 + 0.5 * own))

    @staticmethod
    def _side(colors: dict[Place, Float], own: list[Place], at: Float) -> Float:
        near = [_fading(p, at) / (0.1 + float(np.sum((p - at) ** 2))) for p in own]
        mean = np.average([colors[p] for p in own], axis=0, weights=near)
        total = np.zeros(3)
        for r, c in WINDOW:
            weight = keys(at[:1] - r).item() * keys(at[1:] - c).item()
            total += weight * (colors[r, c] if (r, c) in own else mean)
        return np.asarray(np.maximum(total, 0.0))

    def _share(self, coverage: dict[Place, float], at: Float, view: View, middle: Float) -> float:
        level = {p: _level(coverage[p]) for p in INNER}

        def blend(row: float, column: float) -> float:
            y, x = row - 1.0, column - 1.0
            upper = (1.0 - x) * level[1, 1] + x * level[1, 2]
            lower = (1.0 - x) * level[2, 1] + x * level[2, 2]
            return (1.0 - y) * upper + y * lower

        row, column = at
        slope = np.array(
            [blend(row, 2.0) - blend(row, 1.0), blend(2.0, column) - blend(1.0, column)]
        )
        changes = []
        for step in np.eye(2) * 1e-3:
            ends = [
                equirect_pixel(view.unproject(middle + sign * step), self._width, self._height)
                for sign in (-1.0, 1.0)
            ]
            covers = (ends[1] - ends[0] + 0.5 * self._width) % self._width - 0.5 * self._width
            changes.append(float(slope @ covers) / 2e-3)
        away = (blend(row, column) - 0.5) / max(float(np.hypot(*changes)), 1e-6)
        # What is on this side of a filter that falls as 1 - s^2 across the edge.
        s = float(np.clip(away / 0.83, -1.0, 1.0))
        return 0.5 + 0.75 * (s - s**3 / 3.0)


def _level(f: float) -> float:
    """Such that a line to the level 0 or 1 of the next texel is 1/2 where an edge cuts this one."""
    return 1.0 - 0.5 / (0.5 + f) if f < 0.5 else 0.5 / (1.5 - f)


def _fading(place: Place, at: Float) -> float:
    row, column = np.maximum(1.0 - 0.5 * np.abs(at - place), 1e-3)
    return float(row * column)
