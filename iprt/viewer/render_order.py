"""Orders to render a viewer's picture to a file, by `iprt render`."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import tomlkit

from iprt.errors import FormatError
from iprt.geometry.camera import View
from iprt.output.frames import is_pattern
from iprt.render_check import check_format, check_frames
from iprt.settings.model import Settings
from iprt.settings.overrides import plain_values
from iprt.settings.presets import CONVERGED, Quality
from iprt.viewer.scene_snapshot import EditedScene


@dataclass(frozen=True, eq=False)
class RenderOrder:
    """A render to a file, of the state in which it was ordered.

    Attributes
    ----------
    scene : EditedScene
    view : View
        Its size is the picture's.
    name : str or None
        The scene's view of this direction, which may move; None for the user's own.
    objects : tuple of str or None
        Names of the shown objects; None for all.
    frames : range
        Numbers of the video's frames.
    output : Path
        Absolute; see `iprt render`.
    quality : Quality
        Whether a still is rendered until it has converged. All its settings are in `settings`.
    settings : Settings
    accumulate : int
        View frames per picture; at most, of a still that is to converge.
    """

    scene: EditedScene
    view: View
    name: str | None
    objects: tuple[str, ...] | None
    frames: range
    output: Path
    quality: Quality
    settings: Settings
    accumulate: int

    @property
    def converges(self) -> bool:
        """True for a still whose number of view frames is not known before."""
        return self.quality in CONVERGED

    @property
    def numbered(self) -> bool:
        """True for pictures of several files."""
        return is_pattern(self.output)

    def check(self) -> None:
        """Refuse an order that `iprt render` would refuse, or that would replace a file.

        Raises
        ------
        IprtError
        """
        check_format(self.output, self.quality)
        check_frames(self.scene.origin, self.view, self.output, self.frames)
        if self.output.exists():
            raise FormatError(f"{self.output}: exists already; name another file")

    def prepare(self, folder: Path) -> list[str]:
        """Write the scene and its settings to a folder; return the words behind `iprt render`.

        Raises
        ------
        IprtError
            The scene's edits cannot be saved.
        OSError
            The folder cannot be written.
        """
        scene, settings = folder / "scene", folder / "settings.toml"
        self.scene.write(scene, self.name, self.objects)
        # Also those at their default, which the user's file or the scene may set otherwise.
        values = plain_values(self.settings).items()
        lines = [f"{key} = {tomlkit.item(value).as_string()}" for key, value in values]
        settings.write_text("\n".join(lines), "utf-8")
        view, frames = self.view, self.frames
        if view.projection == "equirect":
            direction = ["--view=equirect"]
        elif self.name is not None:
            direction = [f"--view={self.name}"]
        else:
            angles = {"yaw": view.yaw_deg, "pitch": view.pitch_deg, "fov": view.fov_y_deg}
            direction = [f"--{flag}={float(value)!r}" for flag, value in angles.items()]
        return [
            str(scene),
            f"--output={self.output}",
            f"--frames={frames[0]}:{frames[-1]}:{frames.step}",
            *direction,
            *("--size", str(view.width), str(view.height)),
            f"--accumulate={self.accumulate}",
            f"--quality={self.quality}",
            f"--settings={settings}",
            "--allow-outside",
            "--progress=lines",
        ]
