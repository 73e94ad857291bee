"""Self-contained HTML reports with tables, plots and pictures."""

from __future__ import annotations

import base64
import io
from dataclasses import dataclass, field
from functools import cache
from importlib.resources import files
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from iprt.files.atomic import replacing
from iprt.measure import metrics
from iprt.measure.compare import DIFFERENCE_GAIN, Compared, difference
from iprt.measure.plot import Plot
from iprt.output.display import display
from iprt.output.grid import Grid

if TYPE_CHECKING:
    from jinja2 import Template

    from iprt.measure.view_truth import Radiance, Target


@dataclass(frozen=True)
class EmbeddedPicture:
    """A PNG in the page; `data` is its data URI."""

    label: str
    width: int
    height: int
    data: str


@dataclass(frozen=True)
class Figures:
    """Pictures side by side under a heading."""

    title: str
    caption: str
    pictures: tuple[EmbeddedPicture, ...]


@dataclass
class Report:
    """The contents of a page, from top to bottom.

    Attributes
    ----------
    lines : list of str
        Notes on the origin of the figures.
    """

    title: str
    lines: list[str] = field(default_factory=list)
    grids: list[Grid] = field(default_factory=list)
    plots: list[Plot] = field(default_factory=list)
    figures: list[Figures] = field(default_factory=list)

    def html(self) -> str:
        """Render the page."""
        return _template().render(vars(self))

    def write(self, path: Path) -> None:
        """Write the page, atomically.

        Raises
        ------
        FormatError
            The file cannot be written.
        """
        with replacing(path) as temporary:
            temporary.write_text(self.html(), encoding="utf-8")


def compared_figures(compared: Compared) -> tuple[Figures, ...]:
    """Show render, truth, difference and FLIP map of a comparison."""
    result, scores = compared.comparison, compared.comparison.scores
    flip = "" if scores.flip is None else f", FLIP {scores.flip:.4f}"
    cuts = " / ".join(f"{value:.4f}" for value in scores.cuts)
    figures = Figures(
        title=f"{result.view}, method {result.method}",
        caption=(
            f"over the background of the {result.background}: SSIM {scores.ssim:.4f}, cuts {cuts}, "
            f"PSNR {scores.psnr:.2f} dB, MSE {scores.mse:.2e}, RMSE {scores.rmse:.4g}{flip}"
        ),
        pictures=scored_pictures(compared.target, compared.color),
    )
    return (figures,)


def scored_pictures(
    target: Target, color: Radiance, *, crop: bool = False
) -> tuple[EmbeddedPicture, ...]:
    """Show a picture, its truth, their difference, and the FLIP map if FLIP is installed.

    Parameters
    ----------
    color : (H, W, 3) float32
        Linear radiance.
    crop : bool
        Show only the bounding box of the target's cuts, if it has any.
    """
    render, truth = display(color, target.exposure), target.shown
    shown = {
        "render": render,
        "truth": truth,
        f"difference x{DIFFERENCE_GAIN:g}": difference(render, truth),
        "FLIP": metrics.flip_map(render, truth),
    }
    rows, columns = slice(None), slice(None)
    if crop and target.cuts:
        x0, y0, x1, y1 = np.array(target.cuts).T
        rows, columns = slice(y0.min(), y1.max()), slice(x0.min(), x1.max())
    return tuple(
        png_picture(label, image[rows, columns])
        for label, image in shown.items()
        if image is not None
    )


def png_picture(label: str, image: metrics.Image) -> EmbeddedPicture:
    """Encode a display-referred image (H, W, 3) in [0, 1] as an 8-bit PNG."""
    from PIL import Image

    stream = io.BytesIO()
    Image.fromarray(np.rint(image * 255.0).astype(np.uint8)).save(stream, "PNG", optimize=True)
    data = "data:image/png;base64," + base64.b64encode(stream.getvalue()).decode()
    return EmbeddedPicture(label, image.shape[1], image.shape[0], data)


@cache
def _template() -> Template:
    from jinja2 import Environment

    text = files("iprt.measure").joinpath("report.html").read_text(encoding="utf-8")
    return Environment(autoescape=True, trim_blocks=True).from_string(text)
