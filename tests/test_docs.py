"""The pages: tables can be made again (`docs/measure.py`), and the files that they name exist."""

from __future__ import annotations

import importlib.util
import re
import sys
from pathlib import Path
from types import ModuleType
from xml.etree import ElementTree

import pytest

from iprt.measure.plot import Mark, Plot, Series
from iprt.measure.report import Report
from iprt.settings import overrides

DOCS = Path(__file__).parents[1] / "docs"
PAGE = DOCS / "tradeoff.md"


@pytest.fixture(scope="module")
def measure() -> ModuleType:
    spec = importlib.util.spec_from_file_location("measure", DOCS / "measure.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_every_table_has_a_command_that_prints_markdown(measure: ModuleType) -> None:
    text = PAGE.read_text(encoding="utf-8")
    found = measure.commands(text)
    assert len(found) == len(set(found)) == text.count("<!-- measured") > 4
    assert all(command.endswith("--markdown") for command in found)


def test_swept_values_are_allowed_and_not_the_default(measure: ModuleType) -> None:
    for command in measure.commands(PAGE.read_text(encoding="utf-8")):
        for key, values in re.findall(r"--sweep (\S+?)=(\S+)", command):
            for value in values.split(",") if key != "quality" else ():
                item = overrides.parse_assignment("--sweep", f"{key}={value}")
                balanced = overrides.resolved("balanced")
                assert overrides.resolved("balanced", [item]) != balanced, item


def test_named_files_exist() -> None:
    """Code that `docs/method/` names by its file, or by the end of its path."""
    folders = (DOCS.parent / name for name in ("iprt", "cl", "tests"))
    files = [str(file) for folder in folders for file in folder.rglob("*.*")]
    for page in (DOCS / "method").glob("*.md"):
        named = re.findall(r"`([\w/]+\.(?:py|cl|h))`", page.read_text(encoding="utf-8"))
        missing = [name for name in named if not any(f.endswith("/" + name) for f in files)]
        assert not missing, page.name


def test_plots_follow_their_table(
    measure: ModuleType, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    plot = Plot("speed", "ms", "SSIM", (Series("", (Mark(1.0, 0.5), Mark(2.0, 0.9))),))
    html = Report("bench", "", plots=[plot]).html()
    script = f"import pathlib, sys; print('| t |'); pathlib.Path(sys.argv[-1]).write_text({html!r})"
    (tmp_path / "iprt.py").write_text(script)
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    monkeypatch.chdir(tmp_path)
    file = tmp_path / "page.md"
    file.write_text("```bash\niprt one\n```\n<!-- measured, plots front -->\n<!-- end -->\n")
    measure.main(file)
    assert "| t |\n\n![speed](page/front-1.svg)\n" in file.read_text()
    drawn = ElementTree.parse(tmp_path / "page" / "front-1.svg").getroot()
    assert drawn.tag == "{http://www.w3.org/2000/svg}svg"


def test_tables_are_replaced_and_nothing_else(
    measure: ModuleType, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    page = "a\n```bash\niprt one\n```\nb\n<!-- measured -->\nold\n<!-- end -->\nc\n"
    page += page.replace("iprt one", "iprt two")
    file = tmp_path / "page.md"
    file.write_text(page)
    (tmp_path / "iprt.py").write_text("import sys; print(f'| {sys.argv[1]} |')")
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    monkeypatch.chdir(tmp_path)
    measure.main(file, "two")
    assert file.read_text() == page[: len(page) // 2] + page[len(page) // 2 :].replace(
        "old\n", "\n| two |\n\n"
    )
    filled = file.read_text()
    measure.main(file, "two")
    assert file.read_text() == filled, "the same again"
    assert sys.executable
