"""Connected components of a panorama's texels: 8-neighbours, across the seam and the poles."""

from __future__ import annotations

import numpy as np
import scipy
from numpy.typing import NDArray

Mask = NDArray[np.bool_]


def components(chosen: Mask) -> tuple[NDArray[np.intp], int]:
    """Label components: 0-based labels (H, W), valid where `chosen`, and their number."""
    texel = np.flatnonzero(chosen)
    of_texel, count = component_of(chosen, texel)
    label = np.zeros(chosen.shape, np.intp)
    label.ravel()[texel] = of_texel
    return label, count


def component_of(chosen: Mask, texel: NDArray[np.intp]) -> tuple[NDArray[np.intp], int]:
    """Return 0-based labels (N,) of the components of `texel`, and the number of components.

    `texel` holds the flat indices where `chosen`.
    """
    height = chosen.shape[0]
    label, count = scipy.ndimage.label(chosen, structure=np.ones((3, 3)))
    pairs = [
        (label[up : height - down, -1], label[down : height - up, 0])
        for up, down in ((1, 0), (0, 0), (0, 1))
    ]
    # All texels of a polar row touch at the pole.
    for row in (0, height - 1):
        present = label[row][label[row] > 0]
        pairs.append((present[:1].repeat(present.size), present))
    a = np.concatenate([first for first, _ in pairs])
    b = np.concatenate([second for _, second in pairs])
    both = (a > 0) & (b > 0)
    links = scipy.sparse.coo_array(
        (np.ones(both.sum()), (a[both] - 1, b[both] - 1)), shape=(count, count)
    )
    merged, group = scipy.sparse.csgraph.connected_components(links, directed=False)
    return group.astype(np.intp)[label.ravel()[texel] - 1], int(merged)
