"""Online learning of the radiance of real surfaces: local linear models in a uniform grid."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import scipy
from numpy.typing import NDArray

from iprt.device.block import Block, Float4s, Float32, Floats, Ints
from iprt.device.compute import ComputeDevice
from iprt.device.kernel_source import constant, float_constant

if TYPE_CHECKING:
    import pyopencl.array as cla

    from iprt.world.real.surfaces import Surfaces

Float = NDArray[np.float32]
Drawn = Callable[[], tuple[Float, Float]]
"""Function that waits for drawn samples, and returns them, (N, SAMPLE_PARTS, 4) as in
`cl/world/real/draw_samples.cl`, and the largest weight of any model at each of them, (N,)."""

HEADER = "lib/world/real/learned.h"
MODEL_PARTS = constant(HEADER, "MODEL_PARTS")
SAMPLE_PARTS = constant(HEADER, "SAMPLE_PARTS")
GRID = tuple(constant(HEADER, f"GRID_{axis}") for axis in "XYZ")
"""Cells of the table along each axis."""
CELLS = GRID[0] * GRID[1] * GRID[2]
NEIGHBOURS = np.stack(np.meshgrid(*[np.arange(3)] * 3, indexing="ij"), -1).reshape(-1, 3)
"""Steps (N, 3) from the lowest cell that a model reaches to all that it may reach."""
LEAST_WEIGHT = float_constant(HEADER, "LEAST_WEIGHT")
ALIKE_NORMAL = float_constant(HEADER, "ALIKE_NORMAL")
WIDEST = 1.0 / np.sqrt(-2.0 * np.log(LEAST_WEIGHT))
"""Bandwidth, over the search radius, of a model that reaches just as far as that."""

LEAST_REACH = 0.1
"""Least reach of a new model, over the search radius."""
PRIOR = 1e-5
"""Inverse of the diagonal of the first P (section IV-A)."""
FIRST_FORGETTING = 0.97
"""Forgetting factor of a model's first sample (section IV-A)."""
RATE = 1.0
"""Step of the gradient descent. The paper's is in a supplement."""
SLOPES_PENALTY = 1e-3
"""γ_1 of Eq. 8, of coefficients over the search radius."""
BANDWIDTH_PENALTY = 1e-10
"""γ_2 of Eq. 8, of bandwidths in metres of a room."""


@dataclass(frozen=True)
class Learning:
    """Parameters of a learner.

    Attributes
    ----------
    radius : float
        Search radius, metres; the same for all models of a learner.
    metre : float
        Length in metres of one metre in a room.
    unit : float
        Radiance that errors are relative to, together with the model's own.
    forgetting, first_forgetting : float
        Forgetting factor in the end, and of a model's first sample.
    rate : float
        Of the gradient descent of bandwidths; 0: they stay.
    slopes_penalty : float
        γ_1.
    """

    radius: float
    metre: float = 1.0
    unit: float = 1.0
    forgetting: float = 0.999
    first_forgetting: float = FIRST_FORGETTING
    rate: float = RATE
    slopes_penalty: float = SLOPES_PENALTY


@dataclass(kw_only=True)
class LearnedArgs(Block):
    """Models of learned radiance (`cl/lib/world/real/learned.h`).

    Attributes
    ----------
    models : (capacity, MODEL_PARTS, 4) float32
    start : (CELLS + 1,) int32
        First entry of each cell in `list`, and the end of the last one.
    list : int32
        Indices of models.
    pose : (12,) float32
        3 x 4, row by row: from the capture centre's axes to the world's.
    inverse_radius : float
        1 / metres.
    """

    models: Float4s
    start: Ints
    list: Ints
    pose: Floats
    inverse_radius: Float32


class Learner:
    """Local linear models of the radiance of real surfaces (Lee et al. 2022, section IV).

    Parameters
    ----------
    samples : int
        Samples per batch.
    capacity : int
        Most models.

    Attributes
    ----------
    count : int
        Number of models.
    learned : int
        Samples drawn from panoramas so far.
    """

    def __init__(self, device: ComputeDevice, samples: int, capacity: int) -> None:
        self._device, self._samples, self._capacity = device, samples, capacity
        self.count = self.learned = 0
        self._models = device.zeros("learned models", (capacity, MODEL_PARTS, 4))
        self._information = device.zeros("learned information", (capacity, 6))
        self._start = device.zeros("learned cells", (CELLS + 1,), np.int32)
        self._list = device.zeros("learned places", (len(NEIGHBOURS) * capacity,), np.int32)
        self._pose = device.upload("learned pose", np.eye(4, dtype=np.float32)[:3].ravel())
        self._sample_start = device.zeros("drawn samples cells", (CELLS + 1,), np.int32)
        self._drawn = device.zeros("drawn samples", (samples, SAMPLE_PARTS, 4))
        self._sorted = device.zeros("drawn samples by cells", (samples, SAMPLE_PARTS, 4))
        self._predicted = device.zeros("drawn samples predicted", (samples, 4))
        self._greatest = device.zeros("drawn samples covered", (samples,))
        self._draw = device.kernel("world/real/draw_samples.cl", "draw_samples").fixed(
            count=samples, pose=self._pose, samples=self._drawn
        )
        defines = {"PRIOR": PRIOR}
        self._learn = device.kernel("world/real/learn_models.cl", "learn_models", defines).fixed(
            start=self._sample_start,
            samples=self._sorted,
            models=self._models,
            information=self._information,
        )
        self._ask = device.kernel("world/real/ask_models.cl", "ask_models").fixed(
            samples=self._drawn, predicted=self._predicted, greatest=self._greatest
        )
        self._inverse_radius = 0.0
        self._forget_places()

    def arguments(self) -> LearnedArgs:
        """Return the models for kernels that ask them."""
        return LearnedArgs(
            models=self._models,
            start=self._start,
            list=self._list,
            pose=self._pose,
            inverse_radius=self._inverse_radius,
        )

    def models(self) -> Float:
        """Return the models (count, MODEL_PARTS, 4), as in `cl/lib/world/real/learned.h`."""
        read: Float = self._device.read(self._models)[: self.count]
        return read

    @property
    def nbytes(self) -> int:
        """Bytes of the models, their information matrices and their entries in the grid."""
        model = 4 * (4 * MODEL_PARTS + 6)
        return model * self.count + 4 * (len(self._listed) + CELLS + 1)

    def forget(self) -> None:
        """Drop all models."""
        self.count = 0
        self._forget_places()
        self._device.fill_zero(self._start)

    def _forget_places(self) -> None:
        """Start the host's lists of centres, and of places and their models, sorted by place."""
        self._centres = np.zeros((0, 3), np.float32)
        self._places = np.zeros(0, np.uint16)
        self._listed = np.zeros(0, np.int32)

    def place(self, pose: NDArray[np.float64] | None) -> None:
        """Set the (4, 4) pose from the capture centre's axes to the world's; None: identity."""
        rows = (np.eye(4) if pose is None else pose)[:3]
        self._device.write(self._pose, rows.astype(np.float32).ravel())

    def draw(self, surfaces: Surfaces, radiance: cla.Array) -> Drawn:
        """Draw the next samples of a panorama with this radiance, (H, W, 3) float32.

        The models are asked about them, and the answers copied to the host, without waiting.
        """
        self._draw(
            (self._samples,),
            width=surfaces.width,
            height=surfaces.height,
            first=self.learned,
            surface=surfaces.surface,
            radiance=radiance,
        )
        # The kernel takes it as a signed number, which must not overflow.
        self.learned = (self.learned + self._samples) % 2**30
        self._ask((self._samples,), learned=self.arguments(), count=self._samples)
        samples, covered = (self._device.fetch(part) for part in (self._drawn, self._greatest))
        return lambda: (samples(), covered())

    def learn(self, samples: Float, how: Learning, covered: Float | None = None) -> None:
        """Update the models around samples, and add models where there is none.

        Parameters
        ----------
        samples : (N, SAMPLE_PARTS, 4) float32
            From `draw`; entries without a surface or not finite are left out.
        how : Learning
        covered : (N,) float32, optional
            From `draw`, if nothing was learned since. By default the models are asked, which waits.
        """
        device = self._device
        self._inverse_radius = float(np.float32(1.0 / how.radius))
        known = (samples[:, 1, 3] > 0.0) & np.isfinite(samples).all(axis=(1, 2))
        chosen = np.flatnonzero(known)[: self._samples]
        if not len(chosen):
            return
        place = _place(self._cell(samples[chosen, 0, :3]))
        chosen = chosen[np.argsort(place, kind="stable")]
        samples = samples[chosen]
        covered = self._asked(samples)[1] if covered is None else covered[chosen]
        device.write(self._sorted[: len(samples)], samples)
        device.write(self._sample_start, _starts(place))
        self._create(samples[~(covered >= LEAST_WEIGHT)], how)
        if self.count:
            self._learn(
                (self.count,),
                count=self.count,
                radius=how.radius,
                first_forgetting=min(how.first_forgetting, how.forgetting),
                last_forgetting=how.forgetting,
                unit=how.unit,
                rate=how.rate,
                slopes_penalty=how.slopes_penalty,
                bandwidth_penalty=BANDWIDTH_PENALTY * (how.metre / how.radius) ** 4,
            )

    def ask(self, samples: Float) -> tuple[Float, NDArray[np.bool_]]:
        """Return the learned radiance at samples, at most as many as are drawn at a time.

        Returns
        -------
        radiance : (N, 3) float32
        known : (N,) bool
            False where nothing was learned; `radiance` is 0 there.
        """
        predicted, _ = self._asked(samples)
        return predicted[:, :3], predicted[:, 3] > 0.0

    def _asked(self, samples: Float) -> tuple[Float, Float]:
        """Return (N, 4) and (N,) of `ask_models.cl`, and leave the samples on the device."""
        device, count = self._device, len(samples)
        device.write(self._drawn[:count], samples)
        self._ask((count,), learned=self.arguments(), count=count)
        return device.read(self._predicted)[:count], device.read(self._greatest)[:count]

    def _cell(self, points: Float) -> NDArray[np.int64]:
        """Return (..., 3) coordinates of the cells of points, as `grid_cell` computes them."""
        scaled = points * np.float32(self._inverse_radius)
        cells: NDArray[np.int64] = np.floor(np.clip(scaled, -(2.0**31), 2.0**31 - 1.0)).astype(int)
        return cells

    def _create(self, samples: Float, how: Learning) -> None:
        """Create models at samples not yet covered, neither by old models nor by new ones."""
        chosen = _thinned(samples, how.radius)[: self._capacity - self.count]
        if not len(chosen):
            return
        centres = chosen[:, 0, :3]
        # Between models that have shrunk, a new one reaches no farther than the nearest of them.
        reach = np.full(len(chosen), how.radius)
        if self.count:
            nearest = scipy.spatial.cKDTree(self._centres).query(
                centres, distance_upper_bound=how.radius
            )[0]
            reach = np.clip(nearest, LEAST_REACH * how.radius, how.radius)
        models = np.zeros((len(chosen), MODEL_PARTS, 4), np.float32)
        models[:, 0, :3], models[:, 0, 3] = centres, WIDEST * reach
        models[:, 1, :3] = chosen[:, 1, :3]
        information = np.tile([PRIOR, 0.0, 0.0, PRIOR, 0.0, PRIOR], (len(chosen), 1))
        new = slice(self.count, self.count + len(chosen))
        self._device.write(self._models[new], models)
        self._device.write(self._information[new], information)
        self._index(centres, how.radius)
        self.count = new.stop

    def _index(self, centres: Float, radius: float) -> None:
        """List new models in each cell within the search radius, which no bandwidth exceeds."""
        cells = self._cell(centres - np.float32(radius))[:, None] + NEIGHBOURS
        nearest = np.clip(centres[:, None], cells * radius, (cells + 1) * radius)
        apart = np.linalg.norm(nearest - centres[:, None], axis=-1)
        # A little farther, because kernels round differently.
        model, step = np.nonzero(apart <= 1.001 * radius)
        places = np.concatenate([self._places, _place(cells[model, step])])
        listed = np.concatenate([self._listed, (self.count + model).astype(np.int32)])
        order = np.argsort(places, kind="stable")
        self._places, self._listed = places[order], listed[order]
        self._centres = np.concatenate([self._centres, centres])
        self._device.write(self._list[: len(listed)], self._listed)
        self._device.write(self._start, _starts(places))


def _place(cell: NDArray[np.int64]) -> NDArray[np.uint16]:
    """Return (N,) indices in the table of cells (N, 3), as `grid_place` computes them."""
    x, y, z = (cell[:, axis] & (GRID[axis] - 1) for axis in range(3))
    # Numbers of 16 bits are sorted in linear time.
    place: NDArray[np.uint16] = ((z * GRID[1] + y) * GRID[0] + x).astype(np.uint16)
    return place


def _starts(place: NDArray[np.uint16]) -> NDArray[np.int32]:
    """Return (CELLS + 1,) starts of each cell's part in a list sorted by index."""
    counts: NDArray[np.int64] = np.bincount(place, minlength=CELLS)
    return np.concatenate([[0], np.cumsum(counts)]).astype(np.int32)


def _thinned(samples: Float, radius: float) -> Float:
    """Return samples in order, each outside the radius of earlier ones that face alike."""
    if not len(samples):
        return samples
    points, normals = samples[:, 0, :3].astype(np.float64), samples[:, 1, :3]
    around = scipy.spatial.cKDTree(points)
    left = np.ones(len(samples), bool)
    chosen = []
    for i in range(len(samples)):
        if not left[i]:
            continue
        chosen.append(i)
        near = np.asarray(around.query_ball_point(points[i], radius))
        left[near[normals[near] @ normals[i] >= ALIKE_NORMAL]] = False
    return samples[chosen]
