"""Draw the packages and list the passes of a frame in docs/architecture.md.

`python docs/architecture.py` fails if the page was outdated, which `./run lint` notices.
An arrow that others imply is left out: if A uses B and B uses C, A may use C as well.
"""

from __future__ import annotations

import re
import sys
from pathlib import Path

import grimp
import networkx as nx

from iprt.device.plan import PlanDevice
from iprt.renderer import Renderer
from iprt.scene.scene import Scene

PAGE = Path(__file__).with_name("architecture.md")
SCENE = Path(__file__).parents[1] / "scenes360/lounge"
"""Scene whose passes are listed."""
PACKAGES, PASSES = (f"<!-- {what} by docs/architecture.py -->" for what in ("drawn", "listed"))
END = "<!-- end -->"


def packages() -> nx.DiGraph[str]:
    """Build the graph of imports by the names below `iprt`; `world` is shown by its parts."""
    modules = grimp.build_graph("iprt", cache_dir=None)
    found: nx.DiGraph[str] = nx.DiGraph()
    for importer in modules.modules:
        for imported in modules.find_modules_directly_imported_by(importer):
            ends = _package(importer), _package(imported)
            if ends[0] != ends[1] and all(ends):
                found.add_edge(*ends)
    return found


def _package(module: str) -> str:
    parts = module.split(".")[1:]
    if parts[:1] == ["world"]:
        return "/".join(parts[: 2 if parts[1:2] in (["real"], ["objects"]) else 1])
    return "" if not parts or parts[0] == "errors" else parts[0]


def drawing() -> str:
    """Return a Mermaid flowchart."""
    arrows = sorted(nx.transitive_reduction(packages()).edges)
    lines = [f"    {_node(a)} --> {_node(b)}" for a, b in arrows]
    return "\n".join(["```mermaid", "flowchart TD", *lines, "```"])


def _node(name: str) -> str:
    return f"{name.replace('/', '_')}[{name}]"


def passes() -> str:
    """Return a Markdown table of the passes of a frame with the default settings."""
    scene = Scene.open(SCENE)
    view = next(iter(scene.views.values())).view
    renderer = Renderer(PlanDevice(), scene.frame(), scene.instances, view)
    world = renderer.real_world
    rows = [
        f"| {one.name} | {one.clock} | {', '.join(one.reads)} | {', '.join(one.writes)} |"
        for schedule in (world.schedule, world.shown, renderer.schedule)
        for one in schedule.passes
    ]
    return "\n".join(["| pass | clock | reads | writes |", "|---|---|---|---|", *rows])


def main() -> int:
    """Update the page; return 1 if it was outdated."""
    text = drawn = PAGE.read_text(encoding="utf-8")
    for start, made in ((PACKAGES, drawing()), (PASSES, passes())):
        pattern = f"{re.escape(start)}.*?{re.escape(END)}"
        drawn = re.sub(pattern, f"{start}\n{made}\n{END}", drawn, flags=re.DOTALL)
    PAGE.write_text(drawn, encoding="utf-8")
    return int(drawn != text)


if __name__ == "__main__":
    sys.exit(main())
