"""`iprt claims`: measurements of the claims of the papers behind the methods."""

from __future__ import annotations

from pathlib import Path

import tyro

from iprt.commands.measurement_flags import EVERY_VIEW, Measured, check_count
from iprt.commands.setting_flags import BALANCED


def claims(
    scene: tyro.conf.Positional[Path],
    /,
    *,
    accumulate: int = 30,
    measurement_flags: Measured = EVERY_VIEW,
) -> int:
    """Measure the claims of the methods' papers, beside the papers' own figures.

    A table says which claims hold on this scene, and why others do not.

    Parameters
    ----------
    scene
        Scene folder.
    accumulate
        Frames accumulated into each picture.

    Returns
    -------
    int
        Exit status 0.
    """
    check_count("--accumulate", accumulate)
    from iprt.commands.progress import progress_bar
    from iprt.measure.claims import Verdict, claims_grid, run_claims
    from iprt.measure.paper_claims import CLAIMS
    from iprt.measure.report import Report

    plan = measurement_flags.plan(scene, BALANCED)
    plan.announce("claims of papers")

    def page(verdicts: list[Verdict]) -> Report:
        title = f"{plan.scene.name}: claims of papers"
        return Report(title, plan.lines(), [claims_grid(verdicts)])

    with progress_bar("measuring", len(plan.targets) * len(CLAIMS)) as progress:
        verdicts = run_claims(plan, CLAIMS, accumulate, progress)
        measurement_flags.output.collect(
            ((verdict, tuple) for verdict in verdicts), "claims", plan.record(), page
        )
    return 0
