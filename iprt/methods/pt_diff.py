"""One-pass differential path tracing: all light with objects and without, from the same paths."""

from __future__ import annotations

from iprt.methods.dpt import DEFAULTS, PathTracingSettings, needs
from iprt.settings.methods import MethodInfo, Needs
from iprt.settings.model import Settings


class PtDiffSettings(PathTracingSettings):
    """One-pass differential path tracing."""


def _needs(settings: Settings) -> Needs:
    return needs(settings.own(PtDiffSettings))


METHOD = MethodInfo(
    "pt-diff",
    "One-pass differential path tracing",
    "iprt.methods.path_tracing:DifferentialPathTracing",
    paper="Kán and Kaufmann, Differential Progressive Path Tracing for High-Quality "
    "Previsualization and Relighting in Augmented Reality, ISVC 2013",
    doi="10.1007/978-3-642-41939-3_32",
    settings=PtDiffSettings,
    needs=_needs,
    defaults=DEFAULTS,
)
