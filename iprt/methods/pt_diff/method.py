"""One-pass differential path tracing (Kán and Kaufmann 2013)."""

from __future__ import annotations

from iprt.methods.pt_diff import PtDiffSettings
from iprt.trace.paths import PathTracing


class DifferentialPathTracing(PathTracing):
    """Path tracing of all light with and without the objects."""

    own = PtDiffSettings
    one_pass = True
