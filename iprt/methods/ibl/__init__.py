"""Image-based lighting: the panorama as a distant environment, without effect of the objects."""

from __future__ import annotations

from iprt.settings.methods import MethodInfo

METHOD = MethodInfo(
    "ibl",
    "The panorama as a distant environment, without shadows",
    "iprt.trace.sparse:SparseMethod",
    paper="Debevec, Rendering Synthetic Objects into Real Scenes, SIGGRAPH 1998",
    doi="10.1145/280814.280864",
)
