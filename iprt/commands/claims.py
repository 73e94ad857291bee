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
    from iprt.commands.measurement import printed_at_last
    from iprt.commands.progress import progress_bar
    from iprt.measure.claims import Verdict, claims_grid, run_claims
    from iprt.measure.published import CLAIMS
    from iprt.measure.report import Report

    plan = measurement_flags.measurement(measurement_flags.open(scene), BALANCED)
    plan.announce("claims of papers")
    report = Report(f"{plan.scene.name}: claims of papers", plan.lines())
    verdicts: list[Verdict] = []

    def finish() -> None:
        record = {**plan.record(), "claims": [verdict.record() for verdict in verdicts]}
        plan.output.print(record, [claims_grid(verdicts)])

    total = len(plan.targets) * len(CLAIMS)
    with printed_at_last(verdicts, finish), progress_bar("measuring", total) as progress:
        for verdict in run_claims(
            plan.scene,
            plan.targets,
            CLAIMS,
            device=plan.device,
            frames=accumulate,
            progress=progress,
        ):
            verdicts.append(verdict)
            report.grids = [claims_grid(verdicts)]
            plan.output.write(report)
    return 0
