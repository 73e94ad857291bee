"""IPRT as published (Wu and Wang 2023): rasterized layers, ratio estimator, one bounce."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from iprt.settings.methods import MethodInfo, MethodSettings, Needs
from iprt.settings.model import Settings


class Iprt2023Settings(MethodSettings):
    """Parts of the published method that can be exchanged, to measure their cost and gain."""

    objects: Literal["layers", "triangles"] = Field(
        default="layers",
        description="Representation of objects that rays intersect: front and back layers "
        "rasterized in screen and equirect space, or triangles.",
    )
    filter: Literal["published", "fast-slow"] = Field(
        default="published",
        description="published: spatial filter first, without variance, then exponential averaging "
        "with a fixed weight and history clamped to the frame's neighbourhoods. fast-slow: the "
        "filter of iprt.",
    )


def _needs(settings: Settings) -> Needs:
    own = settings.own(Iprt2023Settings)
    return Needs(
        tracing=True,
        relit=True,
        objects=own.objects,
        relit_reflections=True,
        published_filter=own.filter == "published",
    )


METHOD = MethodInfo(
    "iprt2023",
    "Panoramic ray tracing as published",
    "iprt.trace.sparse:SparseMethod",
    paper="Wu and Wang, Panoramic Ray Tracing for Interactive Mixed Reality Rendering Based on "
    "360° RGBD Video, IEEE CG&A 2023",
    doi="10.1109/MCG.2023.3327383",
    settings=Iprt2023Settings,
    needs=_needs,
    defaults={
        "trace.bounces": 1,
        "trace.object_rays": 1,
        "trace.light_sampling": False,
        "trace.background": False,
        "trace.openings": "surface",
        "trace.jitter": False,
    },
)
