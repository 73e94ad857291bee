"""Device functions have internal linkage, without which `inline` ones need not link.

OpenCL C follows C99: a function that is `inline` and not `static` has no definition that another
one can be linked with, and compilers may call it instead of inlining it. NVIDIA's does.
"""

from __future__ import annotations

import re
from pathlib import Path

import pytest

CL = Path(__file__).parents[2] / "cl"
SOURCES = sorted(path.relative_to(CL) for path in CL.rglob("*") if path.suffix in (".cl", ".h"))
FUNCTION = re.compile(r"^(?![\s#/{}])[^\n;={]*?\b\w+\s*\(", re.MULTILINE)
"""The beginning of a definition at file scope, up to its parameters."""


def external_functions(source: str) -> list[str]:
    """Beginnings of all functions that are neither kernels nor static."""
    heads = [match[0] for match in FUNCTION.finditer(source)]
    return [head for head in heads if not re.match(r"static |__kernel |TRACING_KERNEL ", head)]


@pytest.mark.parametrize("source", SOURCES, ids=str)
def test_all_device_functions_are_static(source: Path) -> None:
    assert not external_functions((CL / source).read_text(encoding="utf-8"))


def test_functions_are_found() -> None:
    source = "inline float a(float x) { return x; }\nfloat4 b(\n    int y)\n{\n}\n"
    assert external_functions(source) == ["inline float a(", "float4 b("]
    assert not external_functions("static inline int c(int x)\n{\n    return d(x);\n}\n")
