"""One case from its file to its run folder: the paper's flowchart.

`solve_case` computes and writes nothing; `optimize`, `expand_case` and `validate` are what the
commands ``optimize``, ``expand`` and ``validate`` do.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from eigassign.arrays import Floats
from eigassign.assignment.one_shot import Assignment
from eigassign.assignment.requirements.sampling import with_instants
from eigassign.brief import counted
from eigassign.case.reader import dotted, read_mapping, shown
from eigassign.case.rules.mechanism import node_problem
from eigassign.case.schema.document import validated_part
from eigassign.case.schema.targets import DrawnResponse
from eigassign.case.units import handy
from eigassign.errors import EigassignError, UsageError
from eigassign.modal.expansion import Expansion, NearestExpansion
from eigassign.output import tables
from eigassign.output.reports.notebook import Pictured, html
from eigassign.output.result_files import frequency_columns
from eigassign.output.store.cache import Cache, default_directory, least_work
from eigassign.output.store.run_folder import UNFINISHED, unfinished_beside
from eigassign.pipeline.queries import pose_and_design
from eigassign.pipeline.stages import DEFAULT as DEFAULT
from eigassign.pipeline.stages import Options as Options
from eigassign.pipeline.stages import Stages, coefficient_files, expand_plan, new_run_folder
from eigassign.study.built_case import BuiltCase, load_case
from eigassign.study.checks import study_accuracy, truncation_lines, weight_at
from eigassign.study.collect import between_samples, collect_results
from eigassign.study.design.account import VerifiedAssignment
from eigassign.study.design.answer import MAX_ERROR, Answer, find_answer, require_assignable
from eigassign.study.design.conclusions import proof
from eigassign.study.design.followed import followers, solve_design
from eigassign.study.design.judgement import SolvedDesigns, judged_modes, study_targets
from eigassign.study.meaning import Studies, study_meaning
from eigassign.study.moves import study_moves
from eigassign.study.pictures import motions
from eigassign.study.planning import expansion_needed, plan_expansion
from eigassign.study.response import study_responses
from eigassign.study.results import Motion, MoveRow, ResponseRow, RunResults, TargetStudy
from eigassign.study.scene import (
    TRAJECTORY,
    Expansions,
    ModeStudies,
    Scene,
    Validation,
    reach_warnings,
    study_modes,
    validate_expansions,
)

if TYPE_CHECKING:
    from eigassign.output.figures.graph import FigurePlan

SHOWN = 6  # modes of which a page shows the shapes


@dataclass(frozen=True, repr=False)
class Result(Pictured):
    """The whole answer, in memory. Frequencies (n_t,) in Hz of the first target on modes, if any.

    Of mode 1 without targets. At all samples, or those of the trajectory that the first target
    names; ``results`` has the rest: ``.results.targets``, ``.design``, ``.error``, ``.shortcoming``
    (None if this is an answer to build on) and more. ``plot()`` draws it, ``to_dict()`` gives its
    columns to pandas.
    """

    design: Mapping[str, float]  # the optimum, SI
    time_s: Floats
    target_hz: Floats
    initial_hz: Floats
    predicted_hz: Floats | None  # None of a limit
    exact_hz: Floats
    results: RunResults
    # about one point; or about several that `auto` took, the nearest of which is evaluated; None
    # where none meets the accuracy and the answer does without
    expansion: Expansion | NearestExpansion | None  # full
    linearised: Expansion | NearestExpansion | None
    assignment: Assignment | None  # the paper's one shot, where the case has one

    def __repr__(self) -> str:
        rows = self.results.design
        design = ", ".join(f"{r.name} = {handy(r.optimal, r.unit, 4)}" for r in rows)
        return f"<Result: {design}. {tables.headline(self.results)}>"

    def _repr_html_(self) -> str:
        made = tables.run_tables(self.results)
        shown = [one for one in made if one.title == "Design" or one.section == "requirements"]
        return html([tables.headline(self.results) or ""], shown, self.plan())

    def plans(self) -> dict[str, FigurePlan]:
        """The figures of the report."""
        from eigassign.output.figures.run import run_figures

        return {plan.name: plan for plan in run_figures(self.results)}

    def to_dict(self) -> dict[str, NDArray[Any]]:
        """The columns of frequencies.csv as arrays (n_t,): ``pandas.DataFrame(result.to_dict())``.

        Time in s, coordinates in rad or m, and of every target the frequency in Hz that is wanted,
        at the initial design, as predicted, and exact; NaN where a target does not hold.
        """
        return {name: np.array(values) for name, values in frequency_columns(self.results)}


@dataclass(frozen=True)
class Outcome:
    """A finished run: where it is and what it found."""

    folder: Path
    results: RunResults
    seconds: float


def solve_case(case: BuiltCase, options: Options = DEFAULT) -> Result:
    """The paper's flowchart: case → model → trajectory → expansion → assignment → verification.

    Raises CaseError for what the case lacks, InfeasibleError for limits that contradict each
    other, AccuracyError for numbers that cannot be vouched for.
    """
    file, stages = case.file, Stages(options.progress)
    require_assignable(file)
    with case.located():
        prepared = prepare(case, stages, _cache(options), assigned=True)
        with stages("assignment", "assigning the frequencies"):
            answer = find_answer(prepared, stages.tell)
        scene, solved = answer.scene, _solved(answer, stages)
        accepted = file.assignment.max_error or MAX_ERROR
        targets = study_targets(scene.path, scene.wanted, solved, answer.predicted, accepted)
        with stages("comparison", "comparing the expansion with exact frequencies"):
            studies = study_modes(scene, solved.initial.hz)
            accuracy = study_accuracy(scene, answer.y, judged_modes(file, targets))
        with stages("meaning", "studying what the answer means"):
            asked = Studies(options.study)
            meaning = study_meaning(scene, answer, scene.wanted, solved.exact, accepted, asked)
            bound = None
            if answer.found is not None and asked is not Studies.NONE:
                bound = proof(scene, answer.found, thorough=asked is Studies.ALL)
        drawn = _responses(scene, answer.y, stages)
        moves = _moves(scene, answer.y, stages)
    found = VerifiedAssignment(answer, targets, solved, meaning, bound)
    moving = _moving(scene, answer.y, targets, options)
    results = collect_results(scene, studies, accuracy, found, moving, stages.timing_s, drawn)
    results = replace(results, moves=moves)
    if options.figures or options.report != "none":
        between = between_samples(scene, answer.y, len(results.spectrum))
        results = replace(results, between=between)
    return _result(results, scene.expanded, answer.one_shot)


def _solved(answer: Answer, stages: Stages) -> SolvedDesigns:
    """The initial design, the answer and the paper's one shot, solved exactly at every sample."""
    scene, count = answer.scene, answer.scene.shown_modes(answer.modes)
    own = followers(scene, scene.wanted)
    with stages("initial", "solving the initial design exactly"):
        initial = solve_design(scene, own, scene.initial, count, stages.advance)
    with stages("verification", "solving the optimal design exactly"):
        exact = solve_design(scene, own, answer.y, count, stages.advance)
        if answer.one_shot is None or answer.found is None:
            return SolvedDesigns(initial, exact, None if answer.one_shot is None else exact)
        try:
            one_shot = solve_design(scene, (), answer.one_shot.y, count)
        except EigassignError as error:  # a pose that its lengths cannot reach, say
            note = f"no errors of the one-shot design: {error}"
            return SolvedDesigns(initial, exact, None, (note,))
    return SolvedDesigns(initial, exact, one_shot)


def _moving(
    scene: Scene, y: Floats, targets: Sequence[TargetStudy], options: Options
) -> tuple[Motion, ...]:
    """Modes at design y, if a report shows them: first that of the first target, or expanded."""
    if options.report != "full" or scene.trajectory is None:
        return ()
    ones = np.ones(len(scene.path.q))
    numbers = {f"mode {k}": k * ones for k in range(1, min(scene.shown_modes(), SHOWN) + 1)}
    of_modes = [t for t in targets if t.followed or not t.asked.followed]
    target = next((t for t in of_modes if t.asked.is_goal), next(iter(of_modes), None))
    name, first = f"mode {scene.modes[0]}", scene.modes[0] * ones
    if target is not None:
        name, first = target.asked.curve_name, target.asked.mode * ones
        for row in target.followed[:1]:
            first[target.asked.rows] = row.exact_numbers
    numbers = {name: first, **numbers} | {name: first}
    return tuple(motions(scene.file, scene.model, scene.path, y, numbers))


def _responses(scene: Scene, y: Floats, stages: Stages) -> tuple[ResponseRow, ...]:
    if not scene.file.responses:
        return ()
    with stages("responses", "computing responses along the trajectory"):
        return tuple(study_responses(scene, y))


def _moves(scene: Scene, y: Floats, stages: Stages) -> tuple[MoveRow, ...]:
    if not scene.residuals:
        return ()
    with stages("moves", "what the move leaves, and input shapers"):
        return tuple(study_moves(scene, y))


def respond(case: BuiltCase, options: Options = DEFAULT) -> RunResults:
    """Responses of a case as it is written, along its trajectory; nothing written.

    Raises CaseError where the case has no trajectory, or a coordinate is free.
    """
    stages, file = Stages(options.progress), case.file
    needs = {"trajectory": bool(file.trajectory), "response": bool(file.responses)}
    told = {key: (given, "what is drawn, and where") for key, given in needs.items()}
    file.require("eigassign response", told)
    with case.located():
        scene = prepare(case, stages, None, assigned=True)
        accuracy, drawn = study_accuracy(scene), _responses(scene, scene.initial, stages)
    return collect_results(scene, ModeStudies(), accuracy, None, (), stages.timing_s, drawn)


def respond_case(
    path: str | Path, options: Options, drawn: Mapping[str, object], y: str | None
) -> Outcome:
    """`respond` into a run folder; ``drawn`` are keys of a response instead of the case's."""
    case = responding(load_case(path, options.allow_outside), drawn, y)
    with new_run_folder(case.file, options.out, options.force, "_response") as folder:
        results = respond(case, options)
        folder.write(results, options.figures, options.report)
    return Outcome(folder.path, results, sum(results.timing_s.values()))


def responding(case: BuiltCase, drawn: Mapping[str, object], y: str | None = None) -> BuiltCase:
    """The case with another response and design y; raises UsageError for keys that are wrong."""
    file = case.file if y is None else case.file.with_design(pose_and_design(case, None, y)[1])
    if drawn:
        context = {"space": file.mechanism.space, "folder": None}
        body = read_mapping(drawn, "response").tree
        keys, wrong = validated_part(DrawnResponse, body, context, "response")
        named = [
            node_problem(file.mechanism, place.at) for place in ({*keys.places} if keys else ())
        ]
        wrong += [(("response", "at"), problem) for problem in named if problem]
        if keys is None or wrong:
            raise UsageError("; ".join(f"{dotted(path)}: {message}" for path, message in wrong))
        file = replace(file, response=keys)
    return BuiltCase(file)


def prepare(
    case: BuiltCase,
    stages: Stages,
    cache: Cache | None,
    order: int | None = None,
    modes: Sequence[int] | None = None,
    assigned: bool = False,
) -> Scene:
    """Case → model → trajectory (if it has one) → expansions about the planned point.

    To be ``assigned``, the trajectory has what targets ask between samples among its samples, and a
    search that does without the expansions goes on without any that meets the accuracy.
    """
    file = case.file
    with stages("model", "assembling K and M"):
        model, initial = case.model(), case.initial_design
    with stages("trajectory", "following the trajectory"):
        path = None if file.trajectory is None else case.trajectory
    with stages("expansion", "expanding the eigenvalues"):
        needed = not assigned or expansion_needed(file)
        plan = plan_expansion(file, model, path, order, modes, needed)
        expansions, notes = expand_plan(model, plan, cache) if plan.order else (None, [])
    moving = () if path is None else path.notes
    variant = (f"variant: {key} = {shown(value)}" for key, value in file.variant.items())
    notes = [*variant, *case.settled.reasons, *moving, *plan.notes, *notes]
    path = with_instants(file, path) if assigned and path is not None else path
    if path is not None and (count := int(path.inserted.sum())):
        instants = f"{counted(count, 'instant')} between samples, of which something is asked"
        notes.append(f"{instants}, {'is' if count == 1 else 'are'} looked at like samples")
    return Scene(file, model, initial, path, plan, expansions, tuple(notes))


def _result(
    results: RunResults, expansions: Expansions | None, assignment: Assignment | None
) -> Result:
    full, linear = None, None
    if expansions is not None:
        several = len(expansions.fulls.parts) > 1
        full = expansions.fulls if several else expansions.full
        linear = expansions.linears if several else expansions.linear
    design = {row.name: row.optimal for row in results.design}
    return Result(design, *_first_curve(results), results, full, linear, assignment)


def _first_curve(results: RunResults) -> tuple[Floats, Floats, Floats, Floats | None, Floats]:
    """Times, and the first target's frequencies: wanted, initial, predicted and exact."""
    if results.targets:
        first = results.targets[0]
        times = results.time_s[first.asked.rows]
        return times, first.asked.hz, first.initial_hz, first.predicted_hz, first.exact_hz
    before, after = results.spectrum[0].initial_hz, results.spectrum[0].optimal_hz
    return results.time_s, np.full_like(before, np.nan), before, None, after


def optimize(path: str | Path, options: Options = DEFAULT) -> Outcome:
    """`solve_case`, and its run folder: results.json, report.html, figures, case.yaml, log.txt.

    What Ctrl-C ended goes to `unfinished_beside` it. Raises StorageError before anything is
    computed where the folder may not be replaced.
    """
    stages = Stages(options.progress)
    case, ended = load_case(path, options.allow_outside), dict[str, bool]()
    with new_run_folder(case.file, options.out, options.force, outcome=ended) as folder:
        results = solve_case(case, options).results
        with stages("report", "writing the report"):
            folder.write(results, options.figures, options.report)
        ended |= {UNFINISHED: True} if results.interrupted else {}
    place = unfinished_beside(folder.path) if results.interrupted else folder.path
    return Outcome(place, results, stages.total_s)


def expand_case(
    path: str | Path,
    options: Options = DEFAULT,
    order: int | None = None,
    modes: Sequence[int] | None = None,
) -> Outcome:
    """Expansion coefficients of a case and how good they are, in a run folder.

    ``order`` and ``modes`` override the case's. The case needs neither design nor targets, and no
    trajectory if it gives q.
    """
    stages = Stages(options.progress)
    case = load_case(path, options.allow_outside)
    out, force = options.out, options.force
    with new_run_folder(case.file, out, force, "_expansion") as folder, case.located():
        scene = prepare(case, stages, _cache(options), order, modes)
        with stages("comparison", "comparing the expansion with exact frequencies"):
            studies, accuracy = study_modes(scene), study_accuracy(scene)
        moving = _moving(scene, scene.initial, (), options)
        results = collect_results(scene, studies, accuracy, None, moving, stages.timing_s)
        with stages("report", "writing the report"):
            folder.write(results, options.figures, options.report, coefficient_files(scene))
    return Outcome(folder.path, results, stages.total_s)


def validate(path: str | Path, options: Options = DEFAULT) -> Validation:
    """Compare both expansions of a case with exact, where `eigassign.study.scene` says."""
    stages = Stages(options.progress)
    case = load_case(path, options.allow_outside)
    with case.located():
        scene = prepare(case, stages, _cache(options))
        with stages("validation", "comparing both expansions with exact frequencies"):
            rows = validate_expansions(scene)
            weight = weight_at(scene, scene.initial, "initial")
            notes = (*scene.notes, *weight.lines, *truncation_lines(scene))
    along = [(row.worst_taylor, row.mode) for row in rows if row.where.startswith(TRAJECTORY)]
    warnings = (*scene.warnings, *reach_warnings(scene, along), *weight.warnings)
    return Validation(rows, notes, warnings, stages.total_s)


def _cache(options: Options) -> Cache | None:
    least_s = least_work()
    if least_s is None or not options.use_cache:
        return None
    directory = options.cache_dir if options.cache_dir is not None else default_directory()
    return None if directory is None else Cache(directory, least_s)
