"""Delta path tracing (Xu et al. 2023, Algorithm 1)."""

from __future__ import annotations

from iprt.methods.dpt import DptSettings
from iprt.trace.paths import PathTracing


class DeltaPathTracing(PathTracing):
    """Path tracing restricted to paths that hit objects."""

    own = DptSettings
    one_pass = False
