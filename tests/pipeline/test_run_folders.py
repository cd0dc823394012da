import hashlib
import io
import json
import shutil
from pathlib import Path

import h5py
import numpy as np
import pytest
from run_cases import SHIPPED, UNCACHED, chain, without, written

from eigassign import load_case
from eigassign.errors import StorageError, UsageError
from eigassign.pipeline import Options, Outcome, expand_case, optimize, solve_case


def in_folder(path: Path) -> Options:
    """Without figures and report, which take longest."""
    return Options(out=path, use_cache=False, figures=(), report="none")


@pytest.fixture(scope="module")
def outcome(tmp_path_factory: pytest.TempPathFactory) -> Outcome:
    out = tmp_path_factory.mktemp("runs") / "two_link"
    return optimize(SHIPPED, Options(out=out, use_cache=False))


def test_a_run_leaves_results_report_figures_resolved_case_and_log(outcome: Outcome) -> None:
    folder = outcome.folder
    names = {path.name for path in folder.iterdir()}
    assert names >= {"results.json", "report.html", "figures", "case.yaml", "log.txt"}
    assert len(list((folder / "figures").glob("*.png"))) >= 4
    assert outcome.results.shortcoming is None
    assert outcome.results.warnings == ()
    assert outcome.seconds > 0.0


def test_the_resolved_case_solves_to_the_same_bits(outcome: Outcome) -> None:
    again = solve_case(load_case(outcome.folder / "case.yaml"), UNCACHED)
    design = {row.name: row.optimal for row in outcome.results.design}
    assert again.design == design


def test_the_log_tells_choices_outcome_and_times(outcome: Outcome) -> None:
    log = (outcome.folder / "log.txt").read_text()
    for line in (
        "note      expansion point: q1 = 1.817 rad, q2 = 5.312 rad, from the case file",
        "verdict   reached: ",
        "time      verification: ",
    ):
        assert line in log


def test_an_expansion_run_holds_its_coefficients_as_json_and_hdf5(tmp_path: Path) -> None:
    outcome = expand_case(SHIPPED, in_folder(tmp_path / "out"))
    document = json.loads((tmp_path / "out" / "coefficients.json").read_text())
    assert document["x_names"] == ["q1", "q2", "m1", "m2"]
    result = solve_case(load_case(SHIPPED), UNCACHED)
    data = (tmp_path / "out" / "coefficients.h5").read_bytes()
    with h5py.File(io.BytesIO(data)) as file:
        for part, expansion in (("full", result.expansion), ("linearised", result.linearised)):
            for name in ("indices", "coefficients"):
                expected = getattr(expansion, name)
                np.testing.assert_array_equal(file[f"{part}_{name}"], expected)
                np.testing.assert_array_equal(document[part][name], expected)
    assert outcome.results.targets == ()
    assert outcome.results.shortcoming is None
    assert {path.name for path in (tmp_path / "out").iterdir()} >= {"log.txt", "results.json"}


def test_order_and_modes_can_be_asked_for(tmp_path: Path) -> None:
    options = in_folder(tmp_path / "out")
    outcome = expand_case(SHIPPED, options, order=2, modes=(3, 1))
    document = json.loads((tmp_path / "out" / "coefficients.json").read_text())
    assert document["linearised"]["modes"] == [1, 3]
    assert max(map(sum, document["linearised"]["indices"])) == 2
    assert [(study.mode, study.order) for study in outcome.results.studies] == [(1, 2), (3, 2)]


def test_a_case_without_trajectory_is_expanded_where_it_says(tmp_path: Path) -> None:
    text = without(chain(3), "trajectory", "targets") + "expansion: {q: [0.3, 0.5, 0.7]}\n"
    outcome = expand_case(written(tmp_path, text), in_folder(tmp_path / "out"))
    (study,) = outcome.results.studies
    assert study.over_time is None
    assert study.everywhere is not None
    assert outcome.results.poses.tip_path is None


def test_modes_expanded_together_are_kept_as_the_series_of_their_matrix(tmp_path: Path) -> None:
    """Two equal cantilevers side by side have equal frequencies: one cluster."""
    options = in_folder(tmp_path / "out")
    outcome = expand_case(written(tmp_path, TWINS), options, order=2, modes=(1, 2))
    document = json.loads((tmp_path / "out" / "coefficients.json").read_text())
    assert document["full"]["cluster_0_modes"] == [1, 2]
    assert np.shape(document["full"]["cluster_0_coefficients"])[:2] == (2, 2)
    assert any("one cluster" in note for note in outcome.results.notes)


TWINS = Path(__file__).with_name("run_folders_twins.yaml").read_text(encoding="utf-8")


# Files that a case names are part of what it is


def superelement_case(folder: Path) -> Path:
    """A copy of the shipped case with its matrices, found by relative names."""
    cases = SHIPPED.parent
    shutil.copytree(cases / "superelement_arm", folder / "superelement_arm")
    return Path(shutil.copy(cases / "superelement_arm.yaml", folder / "superelement_arm.yaml"))


def test_results_name_the_files_of_a_case_and_their_content(tmp_path: Path) -> None:
    case = superelement_case(tmp_path)
    optimize(case, in_folder(tmp_path / "run"))
    named = json.loads((tmp_path / "run" / "results.json").read_text())["case"]["files"]
    for name in ("superelement_arm/stiffness.mtx", "superelement_arm/mass.mtx"):
        assert named[name] == hashlib.sha256((tmp_path / name).read_bytes()).hexdigest()
        assert named[name] in (tmp_path / "run" / "log.txt").read_text()


def test_the_resolved_case_finds_its_matrices_and_samples_from_its_folder(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    case = superelement_case(tmp_path)
    samples = "time, q1, q2\n0, 1.8, 5.3\n0.5, 1.85, 5.35\n1, 1.9, 5.5\n"
    (tmp_path / "samples.csv").write_text(samples)
    head, rest = case.read_text().split("trajectory:\n")
    case.write_text(head + "trajectory: {file: samples.csv}\n\ndesign:" + rest.split("design:")[1])
    first = optimize(case, in_folder(tmp_path / "deep" / "er" / "run")).results
    monkeypatch.chdir(tmp_path / "deep")
    again = solve_case(load_case("er/run/case.yaml", allow_outside=True), UNCACHED)
    assert again.design == {row.name: row.optimal for row in first.design}


def test_equal_cases_with_other_matrices_do_not_replace_each_others_runs(tmp_path: Path) -> None:
    for name in ("one", "same", "other"):
        (tmp_path / name).mkdir()
        superelement_case(tmp_path / name)
    mass = tmp_path / "other" / "superelement_arm" / "mass.mtx"
    lines = mass.read_text().splitlines()
    mass.write_text("\n".join([lines[0], "% lighter", *lines[1:]]) + "\n")
    target = tmp_path / "run"
    expand_case(tmp_path / "one" / "superelement_arm.yaml", in_folder(target))
    expand_case(tmp_path / "same" / "superelement_arm.yaml", in_folder(target))
    with pytest.raises(StorageError, match="holds a run of another case"):
        expand_case(tmp_path / "other" / "superelement_arm.yaml", in_folder(target))


def test_a_case_without_a_name_is_told_to_say_where_its_run_goes(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("..yaml").write_text(SHIPPED.read_text())
    with pytest.raises(UsageError, match="--out DIR"):
        expand_case("..yaml")
    assert not Path("results").exists()
