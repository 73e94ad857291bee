"""The scene's light as edited, which is found in the background."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

from iprt.footage.daylight import Daylight
from iprt.footage.frame import Frame
from iprt.footage.sun import Sun
from iprt.footage.video.video_table import SunTable, VideoTable
from iprt.scene.light_edits import PARTS, LightEdit
from iprt.scene.light_report import LightReport, Shares, SkyReport, SunReport, describe_light
from iprt.scene.scene import Scene
from iprt.viewer.background_jobs import BackgroundJobs
from iprt.viewer.file_watch import Stamp
from iprt.viewer.scene_files import Loaded

SETTLED_S = 0.5
"""Seconds without a change after which the sky is estimated for a sun that is set by hand."""
_SOUGHT = {"gloss": "glossy surfaces", "sun": "the sun", "sky": "the sky"}


@dataclass(frozen=True, eq=False)
class LitScene:
    """A scene whose light and reflections have been found.

    Attributes
    ----------
    scene : Scene
        Its `[video]` has the choices of light as edited.
    stamp : Stamp
        Stamp of the files of the frames.
    """

    scene: Scene
    stamp: Stamp

    @property
    def video(self) -> VideoTable:
        """The table `[video]`."""
        return self.scene.manifest.video

    def same_footage(self, loaded: Loaded) -> bool:
        """Return True if a loaded scene has the same frames, whatever their light."""
        mine, other = self.scene.manifest, loaded.origin.manifest
        return (
            self.stamp == loaded.stamp
            and _unlit(mine.video) == _unlit(other.video)
            and mine.real_materials == other.real_materials
        )

    def same_frames(self, other: LitScene) -> bool:
        """Return True if both have the same frames but for the light from outside."""
        mine, theirs = self.scene.manifest, other.scene.manifest
        return self is other or (
            self.stamp == other.stamp
            and self.video.gloss == theirs.video.gloss
            and _unlit(mine.video) == _unlit(theirs.video)
            and mine.real_materials == theirs.real_materials
        )

    def daylight(self, video: VideoTable) -> Daylight:
        """Return the light of other choices, as far as it is known before a search for them."""
        found = self.scene.daylight
        if video == self.video:
            return found
        sun: Sun | None = found.sun
        if video.sun != "auto":
            sun = video.sun.sun if isinstance(video.sun, SunTable) else None
        return Daylight(sun, found.patches, None if video.sky == "none" else found.sky)


class SceneLight:
    """The light of a scene and its edits; `follow` and `describe` are called by one thread.

    Parameters
    ----------
    jobs : BackgroundJobs
    problems : dict of str to str
        Messages by subject, here "light".
    clock : callable
        Returns seconds.

    Attributes
    ----------
    lit : LitScene or None
        The scene as last searched; None before the first search.
    report : LightReport or None
        The words for it.
    """

    def __init__(
        self, jobs: BackgroundJobs, problems: dict[str, str], clock: Callable[[], float]
    ) -> None:
        self._jobs, self._problems, self._clock = jobs, problems, clock
        self._wanted: tuple[VideoTable, Loaded] | None = None
        self._since_s = 0.0  # time since which it has been wanted
        self._searching = self._failed = False
        self._described: LitScene | None = None
        self.lit: LitScene | None = None
        self.report: LightReport | None = None

    def follow(self, loaded: Loaded, edit: LightEdit) -> None:
        """Search for the light of a loaded scene with an edit, unless it is known."""
        video, lit = edit.applied(loaded.origin.manifest.video), self.lit
        known = self._wanted
        if known is None or known[0] != video or known[1].origin is not loaded.origin:
            self._wanted, self._since_s, self._failed = (video, loaded), self._clock(), False
        same = lit is not None and lit.same_footage(loaded)
        if self._searching or self._failed or (same and lit is not None and lit.video == video):
            return
        by_hand = same and isinstance(video.sun, SunTable)
        if by_hand and self._clock() < self._since_s + SETTLED_S:
            return
        self._search(loaded, video, lit if same else None)

    def _search(self, loaded: Loaded, video: VideoTable, lit: LitScene | None) -> None:
        base = loaded.origin if lit is None else lit.scene
        sought = [
            _SOUGHT[part]
            for part in PARTS
            if getattr(video, part) == "auto"
            and (lit is None or part == "sky" or getattr(lit.video, part) != "auto")
        ]

        def job() -> Callable[[], None]:
            scene = base.relit(LightEdit(video.gloss, video.sun, video.sky))
            assert scene.daylight is not None  # found and cached here

            def finish() -> None:
                self._searching = False
                self._problems.pop("light", None)
                self.lit = LitScene(scene, loaded.stamp)

            return finish

        def fail(problem: str) -> None:
            self._searching, self._failed = False, True
            self._problems["light"] = problem

        self._searching = True
        self._jobs.start(f"looking for {', '.join(sought) or 'light'}", job, fail)

    def describe(self, frame: Frame) -> None:
        """Describe the scene's light by a frame of the scene, once."""
        lit = self.lit
        if lit is not None and lit is not self._described:
            self._described = lit
            self.report = describe_light(lit.scene, frame, Shares.of(frame))

    def lines(self, video: VideoTable) -> list[tuple[str, str]]:
        """Return labels and sentences about the light of other choices; any thread may call it."""
        lit, report = self.lit, self.report
        if lit is None or report is None:
            return []
        light = lit.daylight(video)
        no_sun = report.no_sun if video.sun == lit.video.sun else ""
        sun, sky = SunReport.of(light.sun), SkyReport.of(light.sky)
        return replace(report, sun=sun, no_sun=no_sun, sky=sky).lines()


def _unlit(video: VideoTable) -> VideoTable:
    """Return `[video]` without choices of light."""
    return video.model_copy(update={"gloss": "auto", "sun": "auto", "sky": "auto"})
