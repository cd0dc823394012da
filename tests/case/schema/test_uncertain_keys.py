"""What is not known exactly: what stands under `uncertain` is read, or told what is wrong."""

from pathlib import Path

import numpy as np
import pytest
from small_case import TEXT

from eigassign.case import CaseFile, Tolerance, parse
from eigassign.errors import CaseError

K = "  k: {parameter: materials.alu.youngs_modulus, standard_deviation: 3 %}\n"
R = "  r: {parameter: materials.alu.density, value: 2800, standard_deviation: 54}\n"
A = "  a: {parameter: links.fore.length, min: 44 cm, max: 46 cm}\n"
OTHER = "values: {k: 70 GPa, r: 2650}, standard_deviation: {k: 1 GPa, r: 1 %}"
WHOLE = f"{K}{R}{A}  correlation: {{k: {{r: -30 %}}}}\n  others: [{{{OTHER}}}]\n"
ROBUST = "assignment: {robust: true, probability: 99 %}\n"


def read(own: str, path: Path = Path("case.yaml")) -> CaseFile:
    return parse(f"{TEXT}uncertain:\n{own}{ROBUST}".encode(), path)


def test_what_is_not_known_is_read_in_si_and_read_back_equal() -> None:
    case = read(WHOLE)
    known = case.uncertain
    assert known is not None
    assert list(known.spread) == ["k", "r"]
    assert known.entries["k"].standard_deviation == Tolerance(0.03, relative=True)
    assert (known.entries["a"].min, known.entries["a"].max) == (0.44, 0.46)
    assert {n: p.min for n, p in case.design.parameters.items() if p.min == p.max} == {
        "k": 69e9, "r": 2800.0, "a": 0.45}  # fmt: skip
    (p, C), (other, D) = known.explained({"k": 69e9, "r": 2800.0})
    np.testing.assert_allclose(p, [69e9, 2800.0])
    cross = -0.3 * 2.07e9 * 54  # ρ σ_k σ_r
    np.testing.assert_allclose(C, [[2.07e9**2, cross], [cross, 54.0**2]], rtol=1e-14)
    np.testing.assert_allclose(other, [70e9, 2650.0])
    np.testing.assert_allclose(D, np.diag([1e18, 26.5**2]), rtol=1e-14)
    again = parse(case.resolved().encode(), "case.yaml")
    assert again.uncertain == known
    assert again.design == case.design


def test_what_is_not_known_counts_only_where_the_design_is_robust() -> None:
    case = parse(f"{TEXT}uncertain:\n{K}".encode(), "case.yaml")
    assert list(case.design.parameters) == ["m", "d"]
    assert case.assignment.probability == 0.95


def test_the_folder_of_an_update_stands_for_what_it_found(tmp_path: Path) -> None:
    (tmp_path / "run").mkdir()
    (tmp_path / "run" / "updated.yaml").write_text(f"uncertain:\n{K}{R}")
    written = read("  file: run\n", tmp_path / "case.yaml")
    assert list(written.uncertain.entries) == ["k", "r"]
    more = read(f"  file: run\n{A}", tmp_path / "case.yaml")
    assert list(more.uncertain.entries) == ["k", "r", "a"]


L = K + R
BESIDE_OTHER = f"  others: [{{{OTHER}, correlation: {{k: {{r: 2}}}}}}]\n"
WRONG = [
    ("  k: {parameter: materials.alu.density}\n", "k", "either standard_deviation or min"),
    (K.replace("}", ", min: 1, max: 2}"), "k", "standard_deviation or min, and not both"),
    (A.replace(", max: 46 cm", ""), "a.min", "give both min and max"),
    (A.replace("46", "43"), "a.max", "must be larger than min"),
    (K.replace("3 %", "-3 %"), "k.standard_deviation", "must be > 0, got '-3 %'"),
    (K.replace("3 %", "3 kg"), "k.standard_deviation", "expected a pressure or modulus"),
    (R.replace("2800", "-2800"), "r.value", "must be >= 0 kg/m3, got -2800"),
    (K.replace("alu", "iron"), "k.parameter", "unknown material 'iron'; known: alu"),
    (K.replace("_modulus", ""), "k.parameter", "did you mean 'youngs_modulus'"),
    (K.replace("materials.alu.youngs_modulus", "bodies.tool.mass"), "k.parameter", "already: 'm'"),
    (K.replace("k:", "m:"), "m", "is designed: how far it deviates is its tolerance, or name it"),
    (L + "  correlation: {k: {q: 0.5}}\n", "correlation.k", "q has no standard deviation here"),
    (L + A + "  correlation: {k: {a: 0.5}}\n", "correlation.k", "a has no standard deviation"),
    (L + "  correlation: {k: {r: 1}}\n", "correlation.k.r", "is between −1 and 1"),
    (L + "  correlation: {k: {k: 0.5}}\n", "correlation.k.k", "is between −1 and 1"),
    (L + "  correlation: {k: {r: 3 m}}\n", "correlation.k.r", "expected a fraction"),
    (L + "  correlation: {k: {r: 0.5}, r: {k: 0.4}}\n", "correlation.k.r", "is another than that"),
    (L + "  a: {parameter: links.fore.length, standard_deviation: 1 mm}\n"
     "  correlation: {k: {r: 0.9, a: 0.9}, r: {a: -0.9}}\n", "correlation", "positive definite"),
    (L + "  others: [{values: {k: 1}, standard_deviation: {k: 1, r: 1}}]\n", "others[0]",
     "needs values and standard deviations of k, r"),
    (L + BESIDE_OTHER, "others[0].correlation.k.r", "is between −1 and 1"),
    ("  correlation: {}\n", "", "names no property: such as {k: {parameter: …, standard_dev"),
    ("  file: nowhere\n", "file", "no such file"),
    ("  file: empty\n", "file", "has no key uncertain: give the folder of an update that"),
]  # fmt: skip


@pytest.mark.parametrize(("own", "place", "message"), WRONG)
def test_what_is_wrong_is_told_with_its_place(
    own: str, place: str, message: str, tmp_path: Path
) -> None:
    (tmp_path / "empty").mkdir()
    (tmp_path / "empty" / "updated.yaml").write_text("title: An arm\n")
    with pytest.raises(CaseError) as error:
        read(own, tmp_path / "case.yaml")
    for problem in error.value.problems:
        assert problem.line > TEXT.count("\n")
    assert message in error.value.problems[0].message
    assert error.value.problems[0].path == f"uncertain.{place}".rstrip(".")
    assert len(error.value.problems) == 1


def test_a_robust_design_of_which_nothing_deviates_is_refused() -> None:
    with pytest.raises(CaseError, match="robust: no parameter has a tolerance"):
        parse(f"{TEXT}{ROBUST}".encode(), "case.yaml")
