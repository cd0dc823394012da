"""`sweep` and --set: which variants of a case there are, and what is wrong with them."""

from pathlib import Path

import pytest

from eigassign.batch import Variants, variants_of
from eigassign.case import CaseFile, checked, key_path, load, parse, read, read_yaml
from eigassign.errors import CaseError

TEXT = (Path(__file__).parents[2] / "cases" / "two_link.yaml").read_text()
MASS, WANTED = "mechanism.bodies.tool_mass.mass", "targets.0.frequency"


def swept(tmp_path: Path, sweep: str) -> Variants:
    """The variants that a case with this `sweep` has."""
    file = tmp_path / "case.yaml"
    file.write_text(f"{TEXT}sweep:\n{sweep}")
    load(file)  # the file as it stands is in order
    return variants_of(read(file).source, tmp_path)


def given(*settings: str) -> Variants:
    """The variants that --set says."""
    return variants_of(read_yaml(TEXT.encode(), "case.yaml"), Path(), settings)


def refused(*settings: str) -> str:
    with pytest.raises(CaseError) as error:
        given(*settings)
    return str(error.value)


def rows(variants: Variants) -> list[list[object]]:
    return [[*variants[k].values()] for k in range(len(variants))]


def test_a_grid_takes_every_value_with_every_other_the_last_key_fastest(tmp_path: Path) -> None:
    span = "{min: 180 Hz, max: 181 Hz, count: 3}"
    found = swept(tmp_path, f"  parameters:\n    {MASS}: [0, 100 g]\n    {WANTED}: {span}\n")
    assert rows(found)[:4] == [[0, "180 Hz"], [0, "180.5 Hz"], [0, "181 Hz"], ["100 g", "180 Hz"]]
    assert len(found) == 6
    assert rows(given(f"{MASS}=0, 100 g", f"{WANTED}=180 Hz..181 Hz:3")) == rows(found)


def test_values_of_a_range_are_rounded_once() -> None:
    assert [row[0] for row in rows(given(f"{MASS}=0..1:11"))] == [k / 10 for k in range(11)]
    assert rows(given(f"{MASS}=0..300 g:4")) == [["0 g"], ["100 g"], ["200 g"], ["300 g"]]


def test_the_rows_of_a_file_are_variants(tmp_path: Path) -> None:
    (tmp_path / "runs.csv").write_text(f"# two\n{MASS};{WANTED}\n100 g;180 Hz\n\n0.2;190 Hz\n")
    found = swept(tmp_path, "  file: runs.csv\n")
    assert rows(found) == [["100 g", "180 Hz"], [0.2, "190 Hz"]]
    assert found.lines == (3, 5)


def test_a_list_takes_the_values_of_all_keys_together(tmp_path: Path) -> None:
    text = f"  sample: list\n  parameters:\n    {MASS}: [1, 2, 1]\n    {WANTED}: [180, 190, 190]\n"
    assert rows(swept(tmp_path, text)) == [[1, 180], [2, 190], [1, 190]]


@pytest.mark.parametrize(
    ("text", "says"),
    [
        (f"{MASS}\n1\n2,3\n", "runs.csv:3: 2 values for 1 columns"),
        (f"{MASS},{WANTED}\n1,\n", "runs.csv:2: 1 values for 2 columns"),
        (f"{MASS}\n", "a header and rows are expected"),
        (f"{MASS},{WANTED}\n1 g,2\n\n1g,2\n", "runs.csv:4: has the values of line 2"),
        ("tool_mass.mass\n1\n", "runs.csv:1: column tool_mass.mass: no such key; did you mean"),
    ],
)
def test_a_wrong_file_of_variants_is_refused_with_its_line(
    tmp_path: Path, text: str, says: str
) -> None:
    (tmp_path / "runs.csv").write_text(text)
    with pytest.raises(CaseError, match=says.replace("[", r"\[")):
        swept(tmp_path, "  file: runs.csv\n")


@pytest.mark.parametrize(
    ("sweep", "says"),
    [
        ("  {}\n", "sweep: give either parameters or file"),
        ("  parameters: {}\n", "sweep.parameters: needs at least 1 entries"),
        (f"  parameters: {{{MASS}: []}}\n", "needs at least 1 entries"),
        (f"  parameters: {{{MASS}: 3}}\n", "expected a list of values or a range"),
        (f"  parameters: {{{MASS}: {{min: 1, max: 2}}}}\n", "count: required key is missing"),
        (f"  sample: list\n  parameters: {{{MASS}: [1, 2], {WANTED}: [1]}}\n", "equally many"),
        (
            f"  sample: list\n  parameters: {{{MASS}: [1, 2, 1]}}\n",
            "variant 3 has the values of variant 1",
        ),
        (f"  parameters: {{{MASS}: {{min: 1, max: 2, count: 1}}}}\n", "must be >= 2, got 1"),
        (f"  parameters: {{{MASS}: [1, '1']}}\n", "'1' is given twice"),
        (f"  parameters: {{{MASS}: [1 g, 1g]}}\n", "'1g' is given twice"),
        ("  parameters: {sweep.count: [1, 2]}\n", "other keys than its own"),
        (f"  parameters: {{{MASS}: [1]}}\n  fiel: a.csv\n", "did you mean 'file'"),
        (f"  parameters: {{{MASS}: {{min: 1 g, max: 2 kg, count: 2}}}}\n", "in the same unit"),
    ],
)
def test_a_wrong_sweep_is_a_problem_of_its_file(tmp_path: Path, sweep: str, says: str) -> None:
    with pytest.raises(CaseError) as error:
        swept(tmp_path, sweep)
    assert says in str(error.value)
    assert all(problem.line > TEXT.count("\n") for problem in error.value.problems)


def test_a_wrong_setting_is_a_problem_of_its_option() -> None:
    assert "--set: tool_mass.mass: no such key; did you mean" in refused("tool_mass.mass=1")
    assert f"did you mean '{MASS}'" in refused("mechanism.bodies.tol.mass=1")
    assert "did you mean 'targets.0.frequency'" in refused("targets.1.frequency=1")
    assert "unknown key; did you mean 'method'" in refused("assignment.metod=one_shot")
    assert "did you mean 'title'" in refused("title.of=1")
    assert "--set: mass: expected KEY=VALUE" in refused("mass")
    assert "is given twice" in refused(f"{MASS}=1", f"{MASS}=2")
    assert "1 is given twice" in refused(f"{MASS}=1,1")
    assert "the number of values is missing" in refused(f"{MASS}=1..2")
    assert "max must be larger" in refused(f"{MASS}=2..1:3")
    assert "not valid YAML" in refused(f"{MASS}=[1")
    assert f"'{WANTED}' is the same key" in refused("targets[0].frequency=1", f"{WANTED}=2")
    assert "overwrites it" in refused(f"{MASS}=1,2", "mechanism.bodies={}")
    assert len(given("targets.0={mode: 1, frequency: 1}", f"{WANTED}=2,3")) == 2


def test_a_key_may_be_one_that_the_file_leaves_to_its_default() -> None:
    assert rows(given("assignment.method=one_shot,sequential")) == [["one_shot"], ["sequential"]]
    assert rows(given("assignment.method=nonsense")) == [["nonsense"]]  # refused as a value


def test_a_key_names_what_stands_in_the_file() -> None:
    tree = {"trajectory": {"set": {"bodies.tool.mass": 1}}, "targets": ({"frequency": 1},)}
    assert key_path(tree, "trajectory.set.bodies.tool.mass")[-1] == "bodies.tool.mass"
    assert key_path(tree, "targets[0].frequency") == ("targets", 0, "frequency")
    assert key_path(tree, "targets.0.frequency") == ("targets", 0, "frequency")


def test_a_variant_is_the_case_with_its_values_and_without_a_sweep(tmp_path: Path) -> None:
    file = tmp_path / "case.yaml"
    file.write_text(f"{TEXT}sweep: {{parameters: {{{MASS}: [1, 2]}}}}\n")
    written = read(file)
    variant = checked(written, values={MASS: "1250 g"})
    assert variant.mechanism.bodies["tool_mass"].mass == 1.25
    assert (variant.variant, variant.sweep) == ({MASS: "1250 g"}, None)
    assert variant.sha256 == load(file).sha256
    again = parse(variant.resolved().encode(), file)
    assert isinstance(again, CaseFile)
    assert again == variant
    assert load(file).sweep is not None
    with pytest.raises(CaseError, match="must be >= 0 kg"):
        checked(written, values={MASS: -1})


def test_content_is_what_a_case_says_and_what_its_files_do(tmp_path: Path) -> None:
    file, table = tmp_path / "case.yaml", tmp_path / "measured.csv"
    table.write_text("time,mode,frequency\n0,1,180\n")
    text = f"{TEXT}measurements: {{file: measured.csv, deviation: 1 %}}\n"
    file.write_text(text)
    content = read(file).content()
    file.write_text(f"# a comment\n{text}sweep: {{parameters: {{{MASS}: [1, 2]}}}}\n")
    assert read(file).content() == content
    table.write_text("time,mode,frequency\n0,1,181\n")
    assert read(file).content() != content


def test_bounds_that_a_sweep_sets_have_the_unit_of_their_parameter(tmp_path: Path) -> None:
    file = tmp_path / "case.yaml"
    file.write_text(TEXT)
    variant = checked(read(file), values={"design.m1.max": 0.2, WANTED: 188})
    assert variant.variant_units == {"design.m1.max": "kg", WANTED: "Hz"}
