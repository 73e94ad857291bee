"""One-pass differential path tracing: the same paths give the light with and without objects."""

from __future__ import annotations

from iprt.settings.methods import MethodInfo
from iprt.settings.path_tracing import PATH_DEFAULTS, PathTracingSettings


class PtDiffSettings(PathTracingSettings):
    """Paths and relit surfaces of one-pass differential path tracing."""


METHOD = MethodInfo(
    "pt-diff",
    "One-pass differential path tracing",
    "iprt.methods.pt_diff.method:DifferentialPathTracing",
    paper="Kán and Kaufmann, Differential Progressive Path Tracing for High-Quality "
    "Previsualization and Relighting in Augmented Reality, ISVC 2013",
    doi="10.1007/978-3-642-41939-3_32",
    settings=PtDiffSettings,
    needs=lambda settings: settings.own(PtDiffSettings).needs(),
    defaults=PATH_DEFAULTS,
)
