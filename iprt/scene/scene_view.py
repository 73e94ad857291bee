"""The views of a scene."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from iprt.geometry.camera import View
from iprt.geometry.keyframes import ViewMotion
from iprt.scene.manifest import ViewTable


@dataclass(frozen=True)
class SceneView:
    """A view of the scene with its ground truth.

    Attributes
    ----------
    objects : tuple of str
        Names of the shown objects.
    truth, truth_background, truth_mask : Path or None
        Path-traced pictures with and without the objects, and the objects' coverage. Absolute, with
        an optional printf pattern for the frame's number (`frame_path`).
    cuts : tuple of (x0, y0, x1, y1)
        Crops in pixels.
    motion : ViewMotion or None
        The view over time; None if it is static. `view` is the view at time 0.
    truth_outdated : bool
        Objects in the view have been edited since the truth was made.
    """

    name: str
    view: View
    objects: tuple[str, ...]
    truth: Path | None
    truth_background: Path | None
    truth_mask: Path | None
    cuts: tuple[tuple[int, int, int, int], ...]
    motion: ViewMotion | None = None
    truth_outdated: bool = False

    @property
    def truth_warning(self) -> str | None:
        """Reason not to trust comparisons with the truth, or None."""
        if self.truth is None or not self.truth_outdated:
            return None
        return (
            f"views.{self.name}.truth: objects have been edited since it was made; make it again, "
            "then remove truth_outdated"
        )

    def at(self, time_s: float) -> View:
        """Return the view at a time in seconds (`Scene.time_of`)."""
        return self.view if self.motion is None else self.motion.at(time_s)


def scene_view(root: Path, table: ViewTable, all_objects: tuple[str, ...]) -> SceneView:
    """Return the view of a table; by default it shows `all_objects`."""

    def absolute(name: str | None) -> Path | None:
        return None if name is None else root / name

    motion = ViewMotion.of(table.view, table.keyframes) if table.keyframes else None
    return SceneView(
        name=table.name,
        view=table.view if motion is None else motion.at(0.0),
        objects=all_objects if table.objects is None else tuple(table.objects),
        truth=absolute(table.truth),
        truth_background=absolute(table.truth_background),
        truth_mask=absolute(table.truth_mask),
        truth_outdated=table.truth_outdated,
        cuts=tuple((x0, y0, x1, y1) for x0, y0, x1, y1 in table.cuts),
        motion=motion,
    )
