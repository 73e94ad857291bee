"""The list of mutants fits the program, and the runner tells killed ones from survivors."""

import ast
from collections import Counter
from pathlib import Path

import pytest

from iprt.files.resources import CL
from tests.mutation import kernels, sampled
from tests.mutation.mutant import Mutant, read

ROOT = Path(__file__).resolve().parents[2]
# Nothing is computed there.
DECLARATIONS = {"objects.h", "scatterer.h", "strips.h", "kernel_attributes.h"}


def test_planted_defects_are_where_the_list_says():
    planted = kernels.planted()
    assert len(planted) >= 40
    for mutant in planted:
        assert mutant.old != mutant.new
        assert mutant.applied(read(ROOT, mutant)) != read(ROOT, mutant)
        assert all((ROOT / test).is_file() for test in mutant.tests), mutant


def test_every_kernel_file_has_a_defect():
    files = {path.name for path in CL.rglob("*") if path.suffix in (".cl", ".h")}
    assert {Path(mutant.file).name for mutant in kernels.planted()} == files - DECLARATIONS


def test_sampled_mutants_are_programs_that_differ():
    mutants = list(sampled.mutants(ROOT))
    assert len(mutants) >= 60
    assert Counter(m.file for m in mutants) == {f: n for f, (n, _) in sampled.GUARDED.items()}
    for mutant in mutants:
        text = read(ROOT, mutant)
        assert ast.dump(ast.parse(mutant.applied(text))) != ast.dump(ast.parse(text)), mutant
        assert all((ROOT / test).is_file() for test in mutant.tests), mutant


def test_explanations_belong_to_sampled_mutants():
    labels = [mutant.label(read(ROOT, mutant)) for mutant in sampled.mutants(ROOT)]
    assert sampled.EQUIVALENT.keys() <= set(labels)
    assert len(set(labels)) == len(labels)


def test_a_defect_needs_its_place():
    with pytest.raises(ValueError, match="2 times: a"):
        Mutant("f", "a", "b", ()).applied("aa")
    with pytest.raises(ValueError, match="0 times"):
        Mutant("f", "a", "b", ()).applied("x")
    with pytest.raises(ValueError, match="not at 1"):
        Mutant("f", "a", "b", (), start=1).applied("ax")
    assert Mutant("f", "a", "b", (), start=1).applied("aa") == "ab"
    assert (
        Mutant("f", "1 < 2", "1 > 2", ()).label("x\n  y = 1 < 2\n") == "f: y = 1 < 2 -> y = 1 > 2"
    )
