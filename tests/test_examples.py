"""The examples of `docs/examples/` run as they are written."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
EXAMPLES = ROOT / "docs" / "examples"


@pytest.mark.thorough
@pytest.mark.gl
def test_script_writes_a_picture_and_prints_times(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "scenes360").symlink_to(ROOT / "scenes360")
    (tmp_path / "out").mkdir()  # by ./run demo
    monkeypatch.chdir(tmp_path)
    script = EXAMPLES / "turning_head.py"
    exec(compile(script.read_text(), script.name, "exec"), {})
    assert (tmp_path / "out" / "table.png").stat().st_size > 1000
    assert re.search(r"^trace real +\d+\.\d\d ms per frame$", capsys.readouterr().out, re.MULTILINE)


@pytest.mark.thorough
@pytest.mark.gl
def test_notebook_ranks_the_methods(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    notebook = json.loads((EXAMPLES / "compare.ipynb").read_text())
    monkeypatch.chdir(EXAMPLES)
    monkeypatch.setenv("MPLBACKEND", "agg")
    names: dict[str, object] = {}
    for cell in notebook["cells"]:
        assert not cell.get("outputs"), "outputs are not committed"
        if cell["cell_type"] == "code":
            exec(compile("".join(cell["source"]), cell["id"], "exec"), names)
    printed = re.findall(r"^(\w+) +SSIM of the cuts (\S+) / \S+$", capsys.readouterr().out, re.M)
    assert [method for method, _ in printed] == ["ibl", "em", "iprt"]
    ibl, em, default = (float(ssim) for _, ssim in printed)
    assert max(ibl, em) < default - 0.03
