"""Selection of a scene's view by the flags of a verb."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from iprt.errors import IprtError

if TYPE_CHECKING:
    from iprt.geometry.camera import View
    from iprt.geometry.mesh import Instance
    from iprt.scene.scene import Scene
    from iprt.scene.scene_view import SceneView

MAX_SIZE = 16384
DEFAULT_SIZE = (1024, 1024)


def choose_view(
    scene: Scene, name: str | None, *, size: tuple[int, int] | None = None
) -> tuple[View, tuple[Instance, ...]]:
    """Return the view of `moving_view` at its start, and its objects."""
    from iprt.geometry.camera import View

    view, objects = moving_view(scene, name, size=size)
    instances = scene.instances if objects is None else scene.instances_named(objects)
    return (view if isinstance(view, View) else view.view), instances


def moving_view(
    scene: Scene,
    name: str | None,
    *,
    yaw: float | None = None,
    pitch: float | None = None,
    fov: float | None = None,
    size: tuple[int, int] | None = None,
) -> tuple[SceneView | View, tuple[str, ...] | None]:
    """Return the view that the flags select, and its objects (None: all of the scene).

    A view of the scene keeps its motion, at the requested size.

    Raises
    ------
    IprtError
        Unknown view, contradicting flags, or a value out of range.
    """
    from iprt.geometry.camera import View

    own = yaw is not None or pitch is not None or fov is not None
    if own and name is not None:
        raise IprtError("--view names a direction already; leave out --yaw, --pitch and --fov")
    require_size(size)
    if fov is not None and not 1.0 < fov < 179.0:
        raise IprtError(f"--fov {fov:g}: expected more than 1 and less than 179 degrees")
    # The comparisons are written so that NaN is rejected too.
    if yaw is not None and not abs(yaw) <= 360.0:
        raise IprtError(f"--yaw {yaw:g}: expected -360 to 360 degrees")
    if pitch is not None and not abs(pitch) <= 90.0:
        raise IprtError(f"--pitch {pitch:g}: expected -90 to 90 degrees")
    if name == "equirect":
        width, height = size or scene.source.size
        if width != 2 * height:
            raise IprtError(
                f"--size {width} {height}: the whole panorama is twice as wide as high; try "
                f"--size {2 * height} {height}"
            )
        return View(width, height, projection="equirect"), None
    if name is None and not own and scene.views:
        name = next(iter(scene.views))
    if name is None:
        width, height = size or DEFAULT_SIZE
        return View(width, height, yaw or 0.0, pitch or 0.0, 60.0 if fov is None else fov), None
    if name not in scene.views:
        known = ", ".join([*scene.views, "equirect"])
        raise IprtError(f"--view {name}: {scene.name} has no such view; the views are: {known}")
    entry = scene.views[name]
    resized = entry if size is None else replace(entry, view=entry.view.resized(*size))
    return resized, entry.objects


def require_size(size: tuple[int, int] | None) -> None:
    """Refuse a picture or window without pixels, or too large.

    Raises
    ------
    IprtError
    """
    if size is not None and not all(0 < side <= MAX_SIZE for side in size):
        raise IprtError(f"--size {size[0]} {size[1]}: expected 1 to {MAX_SIZE} pixels a side")
