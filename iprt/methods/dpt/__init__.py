"""Delta path tracing: the objects' change of light alone, by paths with next event estimation."""

from __future__ import annotations

from iprt.settings.methods import MethodInfo
from iprt.settings.path_tracing import PATH_DEFAULTS, PathTracingSettings


class DptSettings(PathTracingSettings):
    """Paths and relit surfaces of delta path tracing."""


METHOD = MethodInfo(
    "dpt",
    "Delta path tracing on a plane or on any real surface",
    "iprt.methods.dpt.method:DeltaPathTracing",
    paper="Xu, Jiang, Wang, Li and Geng, Delta Path Tracing for Real-Time Global Illumination in "
    "Mixed Reality, IEEE VR 2023",
    doi="10.1109/VR55154.2023.00020",
    settings=DptSettings,
    needs=lambda settings: settings.own(DptSettings).needs(),
    defaults=PATH_DEFAULTS,
)
