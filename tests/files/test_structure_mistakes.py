"""Mistakes in files of structures: exchanged matrices, and the word for what they are."""

import re
import shutil
import warnings
from pathlib import Path

import numpy as np
import pytest

import steadyslip as ss
from steadyslip.core.errors import UnitWarning
from steadyslip.model.numeric.machine_point import machine_point
from steadyslip.model.numeric.pencil import StatePencil

EXAMPLE = Path(__file__).parents[2] / "examples/structures"
TEXT = (EXAMPLE / "reed.toml").read_text(encoding="utf-8")
WORD = 'motion = "structure"'


def written(folder, text=TEXT, **matrices):
    """Path of the example's file with other text, or with other matrices."""
    path = folder / "reed.toml"
    path.write_text(text, encoding="utf-8")
    if matrices:
        np.savez(folder / "reed.npz", **matrices)
    else:
        shutil.copy(EXAMPLE / "reed.npz", folder)
    return path


def given():
    with np.load(EXAMPLE / "reed.npz") as table:
        return {name: table[name] for name in table.files}


def test_exchanged_matrices_are_asked_about(tmp_path):
    """The eigenfrequencies of a structure whose M and K are exchanged are the reciprocals of its own."""
    own = given()
    with pytest.warns(UnitWarning, match="slower than any structure: are M and K exchanged"):
        ss.read_rig(written(tmp_path, M=own["K"], K=own["M"], C=own["C"]))


def test_the_stiffness_of_what_is_free_in_place_of_its_inertia_is_asked_about(tmp_path):
    """It has motions without force, so that it is no inertia at all."""
    own = given()
    ways = np.eye(len(own["K"]))[:, 1:]
    free = own["K"] - own["K"] @ ways @ np.linalg.solve(ways.T @ own["K"] @ ways, ways.T @ own["K"])
    with pytest.raises(ss.RigFileError, match="are M and K exchanged"):
        ss.read_rig(written(tmp_path, M=own["K"] * 0 + free, K=own["M"], C=own["C"]))


@pytest.mark.parametrize("slower", [1.0, 1e2, 1e3])
def test_honest_matrices_of_slow_structures_are_not_asked_about(tmp_path, slower):
    """Down to a lowest mode of a turn in minutes: the fastest is far above."""
    own = given()
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        ss.read_rig(written(tmp_path, M=own["M"] * slower**2, K=own["K"], C=own["C"]))


@pytest.mark.parametrize("wrong", ['kind = "struct"', 'motion = "struct"', 'kind = "structur"', ""])
def test_a_misspelt_word_for_a_structure_is_one_problem(tmp_path, wrong):
    with pytest.raises(ss.RigFileError, match=re.escape("structure'")) as raised:
        ss.read_rig(written(tmp_path, TEXT.replace(WORD, wrong)))
    (problem,) = raised.value.problems
    assert "did you mean 'structure'? allowed: slide" in str(problem) or "write that" in str(problem)


def test_the_former_name_of_the_key_is_read(tmp_path):
    one, other = (ss.read_rig(written(tmp_path, TEXT.replace("motion", key))) for key in ("motion", "kind"))
    assert one == other


def modal(folder, modes):
    """Path of the example's file with modes of the tip in place of matrices."""
    (folder / "reed.csv").write_text(modes, encoding="utf-8")
    points = TEXT.index("x = 22"), TEXT.index("angle =")
    text = TEXT[: points[0]] + TEXT[points[1] :]
    path = folder / "modal.toml"
    path.write_text(text.replace('matrices = "reed.npz"', 'modes = "reed.csv"'), encoding="utf-8")
    return path


def test_a_mode_that_is_fed_is_asked_about(tmp_path):
    with pytest.warns(UnitWarning, match=r"damping ratio of -0\.01, which feeds its mode: is its sign right"):
        ss.read_rig(modal(tmp_path, "frequency,damping,tip.x,tip.y\n174,-0.01,0.001,11.9\n1090,0.007,0.01,-12\n"))


def test_shapes_scaled_to_one_are_asked_about(tmp_path):
    shapes = "frequency,damping{},tip.x,tip.y\n174,0.01{},0.01,1\n1090,0.007{},-1,{}\n"
    with pytest.warns(UnitWarning, match=r"largest entry is 1 in every mode, no modal masses: are they scaled"):
        ss.read_rig(modal(tmp_path, shapes.format("", "", "", "0.3")))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        ss.read_rig(modal(tmp_path, shapes.format(",mass", ",0.02", ",0.03", "0.3")))
        ss.read_rig(modal(tmp_path, shapes.format("", "", "", "1.2")))


def test_a_point_that_does_not_move_across_a_stiff_contact_is_asked_about(tmp_path):
    with pytest.warns(UnitWarning, match=r"reed\.tip has none: is there a column or degree of freedom y of it"):
        ss.read_rig(modal(tmp_path, "frequency,damping,tip.x\n174,0.01,11.9\n1090,0.007,12\n"))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        ss.read_rig(modal(tmp_path, "frequency,damping,tip.x,tip.y\n174,0.01,0.001,11.9\n1090,0.007,0.01,-12\n"))


def test_modes_with_an_eigenvalue_to_the_last_digit_have_shapes():
    """The pivot of zero became the least number there is, and the solutions overflowed."""
    pencil = machine_point(ss.read_rig("examples/structures/reed.toml")).pencil
    even = StatePencil(np.eye(4), np.diag([1.0, -2.0, -1e3, -4e3]) + np.triu(np.full((4, 4), 1e150), 2), 2, True)
    for one in (pencil, even):
        for s in one.eigenvalues:
            assert np.all(np.isfinite(one.mode(complex(s))))
