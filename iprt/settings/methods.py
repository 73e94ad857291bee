"""Relighting methods as settings see them: descriptions, own settings and requirements.

A method is an entry point of the group `iprt.methods`: a `MethodInfo`, loaded wherever settings are
read, in a module that imports no more than this one. The class that it names is imported when a
renderer is built. So an installed package adds a method without any change here.
"""

from __future__ import annotations

import logging
import pkgutil
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cache
from importlib.metadata import EntryPoint, entry_points
from typing import Any, Literal

from pydantic import BaseModel, ConfigDict

from iprt.errors import IprtError

ENTRY_POINTS = "iprt.methods"
"""Group of the entry points; each has the name of its method."""
DEFAULT = "iprt"
LOG = logging.getLogger("iprt.settings.methods")


class SettingsGroup(BaseModel):
    """Base of all groups of settings. Each field has a default and a description."""

    model_config = ConfigDict(frozen=True, extra="forbid")


class MethodSettings(SettingsGroup):
    """Base of a method's own settings. Files and flags set them as NAME.FIELD.

    The first line of the docstring is their title.
    """


@dataclass(frozen=True)
class Needs:
    """Requirements of a method in a scene that has objects.

    Attributes
    ----------
    tracing : bool
        Rays are traced. Without, only `relit` may be set.
    distant : bool
        Light paths see the panorama infinitely far away, in their direction. Only E_R uses its
        depth.
    impostor : bool
        Light paths see a distance impostor around the objects, placed by the method. Only E_R uses
        the panorama's depth.
    relit : bool
        Real surfaces are relit: the method returns `Signals.ratio`.
    objects : {"triangles", "layers"}
        Representation of objects for rays: triangles, or rasterized layers.
    irradiance : bool
        E_R of real surfaces, cached.
    gloss : bool
        Highlights of glossy real surfaces are split from their diffuse part.
    sun : bool
        A sun that the panorama does not show is a light.
    lights : bool
        Lights without geometry shine. Rays meet triangles then.
    relit_reflections : bool
        Objects reflect relit real surfaces.
    ratio_rows : int
        Rows of the map of ratios outside of the view; 0: no map.
    published_filter : bool
        Filter in space first, then accumulate a fixed share of each frame (IPRT, "Filtering").
    """

    tracing: bool = False
    distant: bool = False
    impostor: bool = False
    relit: bool = False
    objects: Literal["triangles", "layers"] = "triangles"
    irradiance: bool = False
    gloss: bool = False
    sun: bool = False
    lights: bool = False
    relit_reflections: bool = False
    ratio_rows: int = 0
    published_filter: bool = False


@dataclass(frozen=True)
class MethodInfo:
    """A relighting method.

    Attributes
    ----------
    name : str
        Its name on the command line, and the group of its own settings.
    title : str
        Short description.
    implementation : str
        "module:Class" of its `iprt.method.Method`.
    paper, doi : str
        Publication; empty if there is none.
    settings : subclass of MethodSettings or None
        Its own settings.
    needs : callable
        Returns the requirements for given `Settings`; it may read its own (`Settings.own`).
    defaults : mapping of str to object
        General settings, by dotted key, whose defaults differ with this method.
    """

    name: str
    title: str
    implementation: str
    paper: str = ""
    doi: str = ""
    settings: type[MethodSettings] | None = None
    needs: Callable[[Any], Needs] = lambda settings: Needs()
    defaults: Mapping[str, object] = field(default_factory=dict)

    def load(self) -> Any:
        """Import the class that implements the method.

        Raises
        ------
        IprtError
            It cannot be imported.
        """
        try:
            return pkgutil.resolve_name(self.implementation)
        except (ImportError, AttributeError) as error:
            raise IprtError(f"method '{self.name}' cannot be loaded: {error}") from error


@cache
def methods() -> Mapping[str, MethodInfo]:
    """Return all installed methods by name: the default one, then the others alphabetically."""
    found: dict[str, MethodInfo] = {}
    points = entry_points(group=ENTRY_POINTS)
    for point in sorted(points, key=lambda point: (point.name != DEFAULT, point.name)):
        info = _loaded(point)
        if info is not None:
            found[info.name] = info
    if DEFAULT not in found:
        raise IprtError("no method is installed: install iprt again (`pip install -e .`)")
    return found


def method(name: str) -> MethodInfo:
    """Return the method of that name.

    Raises
    ------
    IprtError
        No such method is installed.
    """
    known = methods()
    if name not in known:
        raise IprtError(f"there is no method '{name}'; there are {', '.join(known)}")
    return known[name]


def _loaded(point: EntryPoint) -> MethodInfo | None:
    """Load the method of an entry point; None, with a warning, if it is unusable."""
    package = point.dist.name if point.dist is not None else point.module
    try:
        info = point.load()
    except Exception as error:
        # A foreign package may fail in any way, and must not take the others with it.
        LOG.warning("method '%s' of %s cannot be loaded: %s", point.name, package, error)
        return None
    if not isinstance(info, MethodInfo) or info.name != point.name:
        LOG.warning("method '%s' of %s is no MethodInfo of that name", point.name, package)
        return None
    return info
