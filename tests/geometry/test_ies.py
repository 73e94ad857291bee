"""Photometric files: symmetries, factors, and what is wrong with a file."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest

from iprt.errors import FormatError
from iprt.geometry.ies import read_ies

HEAD = "IESNA:LM-63-2002\n[TEST] none\n"


def written(
    path: Path,
    polar: Sequence[float],
    turn: Sequence[float],
    values: np.ndarray,
    *,
    tilt: str = "NONE",
    kind: int = 1,
    factors: tuple[float, float, float] = (1.0, 1.0, 1.0),
) -> Path:
    """A file of `values` (turn, polar), with its multiplier, ballast and lamp factors."""
    multiplier, ballast, lamp = factors
    numbers = [
        f"1 1000 {multiplier} {len(polar)} {len(turn)} {kind} 2 0 0 0",
        f"{ballast} {lamp} 40",
        *(" ".join(map(str, row)) for row in (polar, turn, *np.asarray(values))),
    ]
    path.write_text(f"{HEAD}TILT={tilt}\n" + "\n".join(numbers) + "\n")
    return path


def test_values_are_at_their_angles(tmp_path: Path) -> None:
    """All around in steps of 45 degrees, with every factor."""
    polar, turn = np.arange(0, 181, 30), np.arange(0, 361, 45)
    values = np.random.default_rng(0).random((len(turn), len(polar))) + 0.5
    values[-1] = values[0]
    values[:, [0, -1]] = values[:1, [0, -1]]
    path = written(tmp_path / "a.ies", polar, turn, values, factors=(2.0, 0.5, 3.0))
    found = read_ies(path)
    assert found.candela == pytest.approx(3.0 * values.max())
    table = found.profile.astype(float) * found.candela
    np.testing.assert_allclose(table[::30, ::9].T, 3.0 * values, rtol=1e-6)
    # Between them, both ways linear.
    np.testing.assert_allclose(table[15, ::9], 1.5 * (values[:, 0] + values[:, 1]), rtol=1e-6)


@pytest.mark.parametrize("last", [0, 90, 180])
def test_symmetric_files_are_unfolded(tmp_path: Path, last: int) -> None:
    polar, turn = [0, 45, 90], list(range(0, last + 1, 45))
    values = np.outer(1.0 + np.arange(len(turn)), [1.0, 2.0, 0.5])
    table = read_ies(written(tmp_path / "a.ies", polar, turn, values)).profile
    around = table[45] / table[45, 0]
    np.testing.assert_allclose(around, around[::-1], rtol=1e-6)
    if last == 90:
        np.testing.assert_allclose(around, np.roll(around[:-1], 36)[np.r_[0:72, 0]], rtol=1e-6)
    assert around[36] == pytest.approx({0: 1.0, 90: 1.0, 180: 5.0}[last])
    assert around[18] == pytest.approx({0: 1.0, 90: 3.0, 180: 3.0}[last])
    # Nothing is known of the upper half: it is dark.
    assert not table[91:].any()


def test_half_a_turn_from_90_degrees_on_is_unfolded(tmp_path: Path) -> None:
    turn = [90, 180, 270]
    values = np.outer([1.0, 4.0, 2.0], [1.0, 1.0])
    table = read_ies(written(tmp_path / "a.ies", [0, 90], turn, values)).profile[45] * 4.0
    np.testing.assert_allclose(table[[18, 36, 54, 0, 72]], [1.0, 4.0, 2.0, 4.0, 4.0], rtol=1e-6)


def test_tilt_factors_are_passed_over(tmp_path: Path) -> None:
    plain = written(tmp_path / "a.ies", [0, 90], [0], np.array([[5.0, 1.0]]))
    tilted = tmp_path / "b.ies"
    tilted.write_text(plain.read_text().replace("TILT=NONE", "TILT=INCLUDE\n1\n2\n0 90\n1 0.9"))
    np.testing.assert_array_equal(read_ies(tilted).profile, read_ies(plain).profile)
    assert read_ies(tilted).candela == 5.0


GOOD = np.array([[5.0, 1.0]])


@pytest.mark.parametrize(
    ("change", "told"),
    [
        (("TILT=NONE", "TILT=lamp.tlt"), "TILT=lamp.tlt names another file"),
        (("TILT", "TYLT"), "no line TILT="),
        (("1 2 0 0 0", "2 2 0 0 0"), "photometry of type 2"),
        (("5.0 1.0", "5.0"), "ends after 17 numbers"),
        (("5.0 1.0", "5.0 x"), "could not convert"),
        (("5.0 1.0", "5.0 nan"), "not finite"),
        (("5.0 1.0", "0 -1"), "largest intensity is 0"),
        (("0 90\n", "90 0\n"), "do not increase"),
        (("1000 1.0 2 1", "1000 1.0 2 0"), "2 vertical and 0 horizontal"),
        (("1000 1.0 2 1", "1000 1.0 2 2"), "ends after"),
    ],
)
def test_faults_are_named(tmp_path: Path, change: tuple[str, str], told: str) -> None:
    path = written(tmp_path / "a.ies", [0, 90], [0], GOOD)
    text = path.read_text()
    assert change[0] in text
    path.write_text(text.replace(*change))
    with pytest.raises(FormatError, match=told) as error:
        read_ies(path)
    assert str(path) in str(error.value)
    assert "\n" not in str(error.value)


def test_other_symmetries_are_refused(tmp_path: Path) -> None:
    path = written(tmp_path / "a.ies", [0, 90], [10, 50], np.repeat(GOOD, 2, axis=0))
    with pytest.raises(FormatError, match="horizontal angles from 10 to 50"):
        read_ies(path)
