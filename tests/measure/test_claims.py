"""`iprt claims`: what is made of times and pictures that are known."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any, cast

import numpy as np
import pytest

from iprt import cli
from iprt.measure.claims import Claim, ClaimView, Finding, Verdict, claims_grid
from iprt.measure.intervals import Ratio
from iprt.measure.learned_accuracy import LearnedAccuracy
from iprt.measure.paper_claims import CLAIMS
from iprt.measure.view_truth import Scores
from iprt.settings.methods import methods
from iprt.settings.overrides import all_settings
from tests.measure.tiny import write_tiny


class Known:
    """A subject whose times and scores follow from the settings, and that keeps what was asked."""

    def __init__(
        self, ms: dict[str, float], ssim: dict[str, float], learned: LearnedAccuracy | None = None
    ) -> None:
        self._ms, self._ssim = ms, ssim
        self.learned = learned or LearnedAccuracy(0.1, 0.2, 0.05, (1.0, 2.0, 2.1), 50.0, 1.0)
        self.asked: list[dict[str, Any]] = []

    def _of(self, values: dict[str, Any], table: dict[str, float]) -> float:
        self.asked.append(values)
        found = [key for key in table if key in json.dumps(values)]
        return table[max(found, key=len)]

    def times(self, *variants: dict[str, Any]) -> list[list[float]]:
        return [[self._of(values, self._ms)] * 3 for values in variants]

    def ratio(self, values: dict[str, Any], base: dict[str, Any]) -> Ratio:
        return Ratio(self._of(values, self._ms) / self._of(base, self._ms), None, None)

    def scores(self, values: dict[str, Any]) -> Scores:
        ssim = self._of(values, self._ssim)
        return Scores(ssim, (ssim, ssim - 0.1), 30.0, 0.0, 1.0 - ssim, None)

    def errors(self, values: dict[str, Any]) -> tuple[float, float]:
        near = self._of(values, self._ssim)
        return near, 0.9

    def likeness(self, values: dict[str, Any], other: dict[str, Any]) -> float:
        self.asked += [values, other]
        return 0.97


def found(
    text: str, ms: dict[str, float], ssim: dict[str, float], learned: LearnedAccuracy | None = None
) -> Finding:
    (claim,) = (claim for claim in CLAIMS if claim.text.startswith(text))
    return claim.measure(cast(ClaimView, Known(ms, ssim, learned)))


def test_times_decide() -> None:
    for one_pass, holds in ((3.0, True), (2.8, False)):
        ms = {"pt-diff": one_pass, "dpt": 2.0}
        assert found("1.5 times", ms, {}).holds == (one_pass / 2.0 >= 1.5) == holds
        assert f"{one_pass / 2.0:.2f}x at 1" in found("The same where", ms, {}).measured
    for mixed, holds in ((1.04, True), (1.06, False)):
        ms = {"dpt": mixed, '"trace.light_sampling": false': 1.0}
        assert found("Multiple importance", ms, {}).holds == holds
    for ours, holds in ((1.5, True), (0.9, False)):
        assert found("Voxel cone tracing takes", {"em": 1.0, "vct": ours}, {}).holds == holds
    cones = "Time grows linearly with the number"
    line = {f'trace.rays": {count},': 10.0 + count for count in (2, 4, 8, 16)}
    assert found(cones, line, {}).holds
    assert not found(cones, {**line, 'trace.rays": 4,': 19.0}, {}).holds
    for paths, holds in ((1.1, True), (0.9, False)):
        assert found("Takes less time", {"pt-diff": paths, "dvct": 1.0}, {}).holds == holds
    line = {f'bounces": {count}': 10.0 + count for count in (3, 5, 7, 10)}
    assert found("Time grows linearly with bounces", line, {}).holds
    assert not found("Time grows linearly with bounces", {**line, 'bounces": 10': 25.0}, {}).holds
    for ours, holds in ((1.3, True), (1.6, False), (0.9, False)):
        assert found("Environment mapping costs", {'"dit"': ours, '"em"': 1.0}, {}).holds == holds
    for many, holds in ((9.0, True), (10.0, False)):
        ms = {'"cached"': 1.0, '"cached", "trace.rays": 128': many}
        ms |= {'"all"': 1.0, '"all", "trace.rays": 128': 10.6}
        told = found("The cache of directions", ms, {})
        assert told.holds == holds
        assert "0.100 without" in told.measured
    for sparse, holds in ((0.8, True), (1.1, False)):
        ms = {'sparse": true': sparse, 'sparse": false': 1.0}
        assert found("Sparse tracing", ms, {}).holds == holds


def test_pictures_decide() -> None:
    for ours, holds in ((0.91, True), (0.89, False)):
        ssim = {"iprt2023": ours, "ibl": 0.9}
        assert found("SSIM above", {}, ssim).holds == holds
        ssim = {'back_faces": true': ours, 'back_faces": false': 0.9}
        assert found("Substituted", {}, ssim).holds == holds
    for ours, holds in ((0.91, True), (0.89, False)):
        assert found("Light varies", {}, {'"dit"': ours, '"em"': 0.9}).holds == holds
    assert found("No more error", {}, {"pt-diff": 0.9, "dpt": 0.902}).holds
    assert found("Voxel cone tracing varies", {}, {"em": 0.8, "vct": 0.9}).holds
    assert not found("Voxel cone tracing varies", {}, {"em": 0.9, "vct": 0.8}).holds
    assert not found("No more error", {}, {"pt-diff": 0.9, "dpt": 0.8}).holds
    for coarse, holds in ((0.8, True), (0.96, False)):
        ssim = {'voxels": 32': coarse, 'voxels": 64': 0.9, 'voxels": 128': 0.95}
        assert found("Finer volumes", {}, ssim).holds == holds
    for near, holds in ((0.95, True), (0.85, False)):
        assert found("Errors are largest", {}, {"dvct": near}).holds == holds


def test_what_was_learned_decides() -> None:
    poor = LearnedAccuracy(0.3, 0.2, 0.05, (1.0, 1.5, 2.0), 150.0, 1.0)
    for text in ("Shows more detail", "Learns in less", "Memory grows ever"):
        assert found(text, {}, {}).holds
        assert not found(text, {}, {}, poor).holds
    assert "50 ms" in found("Learns in less", {}, {}).measured


def test_claims_are_of_installed_methods_and_settings() -> None:
    known = Known(dict.fromkeys(["method"], 1.0), dict.fromkeys(["method"], 0.9))
    for claim in CLAIMS:
        claim.measure(cast(ClaimView, known))
    methods_asked = {values["method"] for values in known.asked}
    assert methods_asked == {"iprt2023", "ibl", "dpt", "pt-diff", "dit", "em", "vct", "dvct"}
    for values in known.asked:
        assert values["method"] in methods()
        assert set(values) <= set(all_settings())


def test_a_claim_that_does_not_hold_says_why() -> None:
    claim = Claim("Paper", "claim", "2x", lambda _: Finding("1x", False), "slow")
    found = (Finding("2x", True), Finding("1x", False))
    grid = claims_grid([Verdict.of(claim, "near", each) for each in found])
    assert [row[-2:] for row in grid.rows] == [("yes", ""), ("no", "slow")]


@pytest.mark.thorough
@pytest.mark.gl
def test_a_view_is_measured(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """The one about image-based lighting, from files to JSON and a page."""
    folder = write_tiny(tmp_path / "room", "near")
    monkeypatch.setattr("iprt.measure.paper_claims.CLAIMS", CLAIMS[:2])
    page = tmp_path / "page.html"
    words = ["claims", str(folder), "--accumulate", "2", "--device", "pocl"]
    assert cli.main([*words, "--json", "--html", str(page)]) == 0
    first, second = json.loads(capsys.readouterr().out)["claims"]
    assert first["view"] == second["view"] == "near"
    assert "against" in first["measured"]
    assert "SSIM" in second["measured"]
    assert isinstance(first["holds"], bool)
    assert first["why"] == ("" if first["holds"] else CLAIMS[0].unless)
    assert CLAIMS[1].text in page.read_text()
    assert np.isfinite(float(second["measured"].split("SSIM ")[1]))
