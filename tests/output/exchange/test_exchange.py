"""A reduced model read by others says the same frequencies as in eigassign, to 1e-12."""

from __future__ import annotations

import ctypes
import runpy
import shutil
import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.io import loadmat

import eigassign as ea
from eigassign.errors import StorageError, UsageError
from eigassign.modal import ReducedModel
from eigassign.output import write_exchange

Floats = NDArray[np.float64]
CASES = Path(__file__).parents[3] / "cases"
COMPILER = shutil.which("gcc") or shutil.which("clang") or shutil.which("cc")
OCTAVE = shutil.which("octave-cli") or shutil.which("octave")
# Products, sines and powers; a screw's system of equations; loops of one and of two closures.
NAMES = ["two_link", "arm_lengths", "ball_screw", "four_bar", "six_bar"]
AGREE = 1e-12  # relative
SAMPLES = 6


@cache
def example(name: str) -> tuple[ReducedModel, Floats, Floats]:
    """A reduced model, and poses and designs within its case's trajectory and bounds."""
    case = ea.load_case(CASES / f"{name}.yaml")
    path, rng = case.trajectory.q, np.random.default_rng(0)
    reduced = ea.reduce(case.model(), path[len(path) // 2], case.initial_design, modes=(1, 2))
    columns = case.file.design.parameters.values()
    bounds = np.array([(c.min, c.max) for c in columns]).reshape(-1, 2)
    share = rng.random((SAMPLES, len(bounds)))
    return (
        reduced,
        path[rng.integers(len(path), size=SAMPLES)],
        bounds[:, 0] + share * np.ptp(bounds, axis=1),
    )


@pytest.mark.parametrize("name", NAMES)
def test_numpy_alone_reads_it(name: str, tmp_path: Path) -> None:
    reduced, q, y = example(name)
    ea.save_reduced(reduced, tmp_path / "arm.npz")
    np.savez(tmp_path / "samples.npz", q=q, y=y)
    script = (
        "import sys; sys.modules['eigassign'] = sys.modules['scipy'] = None\n"
        "import numpy as np, arm_frequencies as reader\n"
        "at, model = np.load('samples.npz'), reader.read('arm.npz')\n"
        "hz = [reader.frequencies(model, q, y) for q, y in zip(at['q'], at['y'])]\n"
        "np.save('hz.npy', hz)\n"
    )
    subprocess.run([sys.executable, "-c", script], cwd=tmp_path, check=True)
    np.testing.assert_allclose(np.load(tmp_path / "hz.npy"), reduced.frequencies(q, y), rtol=AGREE)


@pytest.mark.parametrize("name", NAMES)
def test_the_mat_file_holds_the_same_numbers(name: str, tmp_path: Path) -> None:
    reduced = example(name)[0]
    ea.save_reduced(reduced, tmp_path / "arm.mat")
    ea.save_reduced(reduced, tmp_path / "arm.npz")
    there, model = loadmat(tmp_path / "arm.mat"), np.load(tmp_path / "arm.npz")
    for key in model:
        if key not in ("about", "format"):
            np.testing.assert_array_equal(there[key].ravel(), model[key].ravel(), err_msg=key)
    assert there["about"].item() == str(model["about"])


@pytest.mark.slow
@pytest.mark.skipif(OCTAVE is None, reason="no Octave to run the MATLAB function with")
@pytest.mark.parametrize("name", NAMES)
def test_octave_runs_the_matlab_function(name: str, tmp_path: Path) -> None:
    reduced, q, y = example(name)
    ea.save_reduced(reduced, tmp_path / "arm.mat")
    far = (np.vstack([q, q[:1] + 1e4, q[:1]]), np.vstack([y, y[:1], np.full_like(y[:1], np.nan)]))
    np.savetxt(tmp_path / "samples.txt", np.hstack(far), fmt="%.17g")
    script = (
        f"x = load('samples.txt'); for k = 1:rows(x); [hz, ~, ~, status] = arm_frequencies("
        f"x(k, 1:{q.shape[1]}), x(k, {q.shape[1]} + 1:end)); "
        "disp(sprintf('%.17g ', status, hz)); end"
    )
    assert OCTAVE is not None
    command = [OCTAVE, "--no-gui", "--quiet", "--eval", script]
    told = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert told.returncode == 0, told.stderr
    found = np.array([line.split() for line in told.stdout.splitlines()], dtype=float)
    assert not found[:SAMPLES, 0].any()
    np.testing.assert_allclose(found[:SAMPLES, 1:], reduced.frequencies(q, y), rtol=AGREE)
    refused = found[found[:, 0] > 0]
    assert len(refused) >= bool(y.size)  # of angles far away only loops cannot be closed
    assert np.isnan(refused[:, 1:]).all()


# --- C


Evaluate = Callable[[Floats, Floats], tuple[int, Floats]]
needs_compiler = pytest.mark.skipif(COMPILER is None, reason="no C compiler on this machine")


def compiled(reduced: ReducedModel, folder: Path, stem: str = "arm") -> Evaluate:
    """The function of the exported source, compiled without a warning."""
    ea.save_reduced(reduced, folder / f"{stem}.c")
    strict = ["-std=c99", "-O1", "-Wall", "-Wextra", "-Wpedantic", "-Werror", "-fPIC", "-shared"]
    assert COMPILER is not None
    made = folder / "model.so"
    subprocess.run([COMPILER, *strict, folder / f"{stem}.c", "-o", made, "-lm"], check=True)
    function = getattr(ctypes.CDLL(str(made)), f"{stem}_frequencies")

    def evaluate(q: Floats, y: Floats) -> tuple[int, Floats]:
        given = [np.ascontiguousarray(a, dtype=np.float64) for a in (q, y)]
        hz = np.full(len(reduced.modes), np.nan)
        pointers = [a.ctypes.data_as(ctypes.c_void_p) for a in (*given, hz)]
        return function(*pointers), hz

    return evaluate


@needs_compiler
@pytest.mark.parametrize("name", NAMES)
def test_the_c_source_compiles_and_agrees(name: str, tmp_path: Path) -> None:
    reduced, q, y = example(name)
    evaluate = compiled(reduced, tmp_path)
    answers = [evaluate(*sample) for sample in zip(q, y, strict=True)]
    assert {status for status, _ in answers} == {0}
    hz = np.array([hz for _, hz in answers])
    np.testing.assert_allclose(hz, reduced.frequencies(q, y), rtol=AGREE)


PROGRAM = """
#include "arm.h"
#include <stdio.h>
int main(void)
{
    double q[ARM_N_Q + 1], y[ARM_N_Y + 1], hz[ARM_N_MODES];
    for (;;) {
        for (int i = 0; i < ARM_N_Q + ARM_N_Y; i++)
            if (scanf("%lf", i < ARM_N_Q ? q + i : y + i - ARM_N_Q) != 1) return 0;
        printf("%d", arm_frequencies(q, y, hz));
        for (int i = 0; i < ARM_N_MODES; i++) printf(" %.17g", hz[i]);
        printf("\\n");
    }
}
"""


@needs_compiler
@pytest.mark.slow
@pytest.mark.parametrize("name", NAMES)
def test_the_c_source_stays_within_its_arrays(name: str, tmp_path: Path) -> None:
    reduced, q, y = example(name)
    ea.save_reduced(reduced, tmp_path / "arm.c")
    (tmp_path / "main.c").write_text(PROGRAM)
    watched = ["-std=c99", "-g", "-fsanitize=address,undefined", "-fno-sanitize-recover=all"]
    command = [str(COMPILER), *watched, "main.c", "arm.c", "-o", "program", "-lm"]
    made = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
    if "cannot find" in made.stderr:
        pytest.skip("no sanitizer on this machine")
    assert not made.returncode, made.stderr
    rng = np.random.default_rng(1)
    others = rng.uniform(-10.0, 10.0, (40, q.shape[1])), rng.uniform(-1.0, 1.0, (40, y.shape[1]))
    strange = [np.full((1, q.shape[1] + y.shape[1]), value) for value in (np.nan, np.inf, 1e300)]
    rows = np.vstack([np.hstack([q, y]), np.hstack(others), *strange])
    given = "\n".join(" ".join(map(repr, row)) for row in rows.tolist())
    told = subprocess.run(
        [tmp_path / "program"], input=given, capture_output=True, text=True, check=False
    )
    assert (told.returncode, told.stderr) == (0, "")
    found = np.array([line.split() for line in told.stdout.splitlines()], dtype=float)
    assert len(found) == len(rows)
    assert not found[:SAMPLES, 0].any()
    np.testing.assert_allclose(found[:SAMPLES, 1:], reduced.frequencies(q, y), rtol=AGREE)


@needs_compiler
def test_the_c_function_refuses_what_eigassign_refuses(tmp_path: Path) -> None:
    reduced, q, y = example("arm_lengths")
    evaluate = compiled(reduced, tmp_path)
    assert evaluate(q[0], np.full_like(y[0], np.nan))[0] == 1
    (tmp_path / "loop").mkdir()
    reduced, q, y = example("four_bar")
    assert compiled(reduced, tmp_path / "loop")(q[0] + 1e4, y[0])[0] == 2
    limp = replace(example("two_link")[0], stiffness=-example("two_link")[0].stiffness)
    (tmp_path / "limp").mkdir()
    assert compiled(limp, tmp_path / "limp")(np.zeros(2), np.zeros(2))[0] == 3


@needs_compiler
def test_an_exported_model_has_no_answer_where_it_was_not_judged(tmp_path: Path) -> None:
    case = ea.load_case(CASES / "two_link.yaml")
    for ending in ("npz", "c"):
        command = [sys.executable, "-m", "eigassign", "export", CASES / "two_link.yaml"]
        subprocess.run([*command, tmp_path / f"arm.{ending}"], check=True)
    reader = runpy.run_path(str(tmp_path / "arm_frequencies.py"))
    model = reader["read"](str(tmp_path / "arm.npz"))
    made = tmp_path / "model.so"
    command = [str(COMPILER), "-std=c99", "-fPIC", "-shared", str(tmp_path / "arm.c")]
    subprocess.run([*command, "-o", str(made), "-lm"], check=True)
    function = ctypes.CDLL(str(made)).arm_frequencies
    q, y = case.trajectory.q[40], np.array([0.1, 0.2])
    for design, code in ((y, 0), (np.array([0.1, 0.25]), 0), (np.array([0.1, 0.26]), 1), (-y, 1)):
        hz = np.zeros(1)
        given = (a.ctypes.data_as(ctypes.c_void_p) for a in (q, design, hz))
        assert function(*given) == code
        answer, told = reader["answer"](model, q, design)
        assert told == code
        assert np.isnan(hz).all() == np.isnan(answer).all() == (code == 1)
    assert reader["answer"](model, q + 3.0, y)[1] == 1


@needs_compiler
@pytest.mark.slow
@pytest.mark.parametrize("name", ["arm_6r", "scissor_lift", "palletiser", "superelement_arm"])
def test_larger_c_sources_agree_too(name: str, tmp_path: Path) -> None:
    test_the_c_source_compiles_and_agrees(name, tmp_path)


def test_numpy_refuses_what_eigassign_refuses(tmp_path: Path) -> None:
    reduced, q, y = example("four_bar")
    ea.save_reduced(reduced, tmp_path / "arm.npz")
    reader = runpy.run_path(str(tmp_path / "arm_frequencies.py"))
    model, frequencies = reader["read"](str(tmp_path / "arm.npz")), reader["frequencies"]
    hz, code = reader["answer"](model, q[0] + 1e4, y[0])
    assert np.isnan(hz).all()
    assert code == reader["LOOP"]
    assert np.isnan(frequencies(model, q[0] + 1e4, y[0])).all()
    with pytest.raises(ValueError, match="cannot be followed so far"):
        reader["matrices"](model, q[0] + 1e4, y[0])
    with pytest.raises(ValueError, match="another length"):
        frequencies(model, q[0][:0], y[0])


# --- Files and names


def test_a_name_that_is_no_identifier_becomes_one(tmp_path: Path) -> None:
    reduced = example("two_link")[0]
    for ending, reader in (
        ("c", "2-link arm.h"),
        ("mat", "model_2_link_arm_frequencies.m"),
        ("npz", "model_2_link_arm_frequencies.py"),
    ):
        files = write_exchange(reduced, tmp_path / f"2-link arm.{ending}", "*/ evil\n\\")
        assert [file.name for file in files] == [f"2-link arm.{ending}", reader]
    assert "model_2_link_arm_frequencies(const double" in (tmp_path / "2-link arm.c").read_text()
    assert "* / evil /: modes 1, 2" in (tmp_path / "2-link arm.h").read_text()


def test_a_file_of_somebody_else_is_not_replaced_by_a_reader(tmp_path: Path) -> None:
    mine = tmp_path / "arm_frequencies.py"
    mine.write_text("print('mine')")
    with pytest.raises(StorageError, match=r"arm_frequencies\.py is in the way"):
        ea.save_reduced(example("two_link")[0], tmp_path / "arm.npz")
    assert mine.read_text() == "print('mine')"
    assert not (tmp_path / "arm.npz").exists()


def test_the_same_model_is_the_same_source(tmp_path: Path) -> None:
    reduced = example("two_link")[0]
    for name in ("one", "two"):
        (tmp_path / name).mkdir()
        ea.save_reduced(reduced, tmp_path / name / "arm.c")
    assert (tmp_path / "one/arm.c").read_text() == (tmp_path / "two/arm.c").read_text()


def test_numbers_that_are_not_finite_are_refused(tmp_path: Path) -> None:
    reduced = example("two_link")[0]
    with pytest.raises(UsageError, match="not finite"):
        ea.save_reduced(
            replace(reduced, mass=np.full_like(reduced.mass, np.inf)), tmp_path / "arm.c"
        )
