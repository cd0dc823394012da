"""The stages of a run, its folder and the log in it; expansions of a plan, and their files.

A stage that lasts says every second how far it is.
"""

from __future__ import annotations

import hashlib
import json
import logging
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from math import comb
from pathlib import Path
from threading import Event, Thread
from time import perf_counter, process_time
from types import MappingProxyType
from typing import Any

import numpy as np
import scipy
from numpy.typing import NDArray

from eigassign._version import __version__
from eigassign.case.case_file import CaseFile
from eigassign.errors import UsageError
from eigassign.files import folder_name, printable
from eigassign.modal.arguments import MOST_TERMS
from eigassign.modal.expansion import (
    ALGORITHM,
    Expansion,
    NearestExpansion,
    expand,
    expansion_arrays,
    stored_series,
    tree_arrays,
)
from eigassign.modal.model import Model
from eigassign.output.documents import dumps, to_json
from eigassign.output.result_files import sample_files
from eigassign.output.store.cache import Cache, content_key, hdf5
from eigassign.output.store.run_folder import run_folder
from eigassign.study.planning import Plan
from eigassign.study.results import RunResults
from eigassign.study.scene import Expansions, Scene


def silent(_line: str) -> None:
    """No progress is shown."""


@dataclass(frozen=True)
class Options:
    """Options of a run, none of which changes a number."""

    out: Path | None = None  # the run folder; below results, by the case file, if None
    cache_dir: Path | None = None  # the user's cache folder if None
    use_cache: bool = True
    force: bool = False  # a folder that another case wrote is moved aside
    figures: tuple[str, ...] = ("png",)  # of png, svg and pdf; none are drawn if empty
    report: str = "full"  # full, light or none
    study: str = "cheap"  # of what the answer means: none, cheap or all
    allow_outside: bool = False  # the case may name files outside its own folder
    progress: Callable[[str], None] = silent  # called with a line as each stage begins


DEFAULT = Options()


class Stages:
    """A stopwatch with a lap for each stage; ``timing_s`` holds them in the order they ran.

    While a stage lasts a line of progress, which begins with two blanks, says every ``pause_s``
    what it is at, for how long, and what is left where its pieces are counted.
    """

    def __init__(self, progress: Callable[[str], None], pause_s: float = 1.0) -> None:
        self.timing_s: dict[str, float] = {}
        self._progress, self._pause_s = progress, pause_s
        self._begun = self._start = perf_counter()
        self._stage = self._detail = ""
        self._share = 0.0

    @contextmanager
    def __call__(self, name: str, announcement: str) -> Iterator[None]:
        """Announce the stage, run the body, and add what it took to the stage ``name``."""
        self._progress(announcement)
        self._stage, self._detail, self._share = announcement, "", 0.0
        start, over = perf_counter(), Event()
        self._start = start
        if self._progress is not silent:
            Thread(target=self._tick, args=(over,), daemon=True).start()
        try:
            yield
        finally:
            over.set()
        self.timing_s[name] = self.timing_s.get(name, 0.0) + perf_counter() - start

    def advance(self, done: int, of: int) -> None:
        """Count the pieces of the stage that are done."""
        self._detail, self._share = f"{done} of {of}", done / of

    def tell(self, detail: str) -> None:
        """Say what the stage is at now."""
        self._detail, self._share = detail.strip(), 0.0
        self._say()

    def _tick(self, over: Event) -> None:
        while not over.wait(self._pause_s):
            self._say()

    def _say(self) -> None:
        spent, share = perf_counter() - self._start, self._share
        left = f"about {spent / share - spent:.0f} s left" if 0.0 < share < 1.0 else ""
        told = ", ".join(filter(None, (self._detail, f"{spent:.0f} s", left)))
        self._progress(f"  {self._stage}: {told}")

    @property
    def total_s(self) -> float:
        """Seconds since the first stage was to begin."""
        return perf_counter() - self._begun


@dataclass(frozen=True)
class RunFolder:
    """A run folder being filled; it appears at ``path`` when the run has succeeded."""

    path: Path
    hidden: Path

    def write(
        self,
        results: RunResults,
        formats: Sequence[str],
        kind: str,
        extra: Mapping[str, bytes] | None = None,
    ) -> None:
        """Results, report of this kind, figures in these formats; log; ``extra`` by name."""
        files = {"log.txt": log_text(results).encode(), **(extra or {})}
        if formats or kind != "none":
            from eigassign.output.reports.page import write_run

            write_run(results, self.hidden, formats, kind)
        else:  # without what draws
            files |= {**sample_files(results), "results.json": to_json(results)}
        for name, data in files.items():
            (self.hidden / name).write_bytes(data)


@contextmanager
def new_run_folder(
    file: CaseFile,
    out: Path | None,
    force: bool,
    suffix: str = "",
    key: str | None = None,
    outcome: Mapping[str, Any] = MappingProxyType({}),
) -> Iterator[RunFolder]:
    """Yield the folder to fill: ``out``, or results/<stem of the case file><suffix>.

    It has the case already, as case.yaml. ``key`` (default: of the bytes of the case and of the
    files it names) and ``outcome``, as it is at the end, stand in run.json.

    Raises StorageError on entry already where the folder may not be replaced, UsageError where the
    file has no stem.
    """
    if out is None and not file.path.stem.strip("."):
        message = f"{file.path} has no name before its ending: say where the run goes, --out DIR"
        raise UsageError(message)
    usual = Path("results", folder_name(file.path.stem + suffix))
    target = usual if out is None else Path(out)
    if key is None:
        said = json.dumps([__version__, file.sha256, dict(file.files)])
        key = hashlib.sha256(said.encode()).hexdigest()
    with run_folder(target, case_path=file.path, key=key, outcome=outcome, force=force) as hidden:
        (hidden / "case.yaml").write_text(file.resolved(), encoding="utf-8")
        yield RunFolder(target, hidden)


def log_text(results: RunResults) -> str:
    """Lines of what was run, chosen, warned of and found, and how long it took."""
    lines = [
        f"eigassign {results.version}",
        f"case      {results.case.name}: {results.case.title}",
        f"sha256    {results.case.sha256}",
        *(f"sha256    {digest} {name}" for name, digest in results.case.files.items()),
        *(f"note      {note}" for note in results.notes),
        *(f"warning   {warning}" for warning in results.warnings),
        *([f"verdict   {found.verdict}: {found.reason}"] if (found := results.assignment) else []),
        *(f"time      {stage}: {1e3 * spent:.2f} ms" for stage, spent in results.timing_s.items()),
    ]
    return "".join(f"{printable(line)}\n" for line in lines)


Array = NDArray[Any]
_log = logging.getLogger(__name__)


def expand_plan(model: Model, plan: Plan, cache: Cache | None) -> tuple[Expansions, list[str]]:
    """Both expansions of a plan, and notes on how they came about.

    The linearised one is what the optimum rests on and is always of the plan's order; the full one
    is there to compare with, and of a lower order where its set would be too large.
    """
    full_order = affordable_order(model, plan.order)
    points = [plan, *(plan._replace(q0=np.array(q)) for q in plan.more_q)]
    made = [_expansions(model, at, full_order, cache) for at in points]
    fulls, linears = (
        NearestExpansion(parts) for parts in zip(*(both for both, _ in made), strict=True)
    )
    expansions = Expansions(fulls, linears, plan.order, full_order)
    (full, linear), known = made[0]
    notes = [
        f"order {plan.order} in {full.space.n_variables} variables: {len(linear.space)} "
        f"coefficients partially linearised, {len(full.space)} in full",
        *dict.fromkeys(full.notes + linear.notes),
    ]
    if full_order < plan.order:
        notes.append(
            f"the full expansion, only there to compare with, stops at order {full_order}: order "
            f"{plan.order} in so many variables has over {MOST_TERMS} coefficients"
        )
    if known:
        notes.append("the expansion coefficients come from the cache")
    return expansions, notes


def affordable_order(model: Model, order: int) -> int:
    """The highest order up to ``order`` whose full set has at most `MOST_TERMS` members; ≥ 1."""
    n = int(model.pencil.active.sum())
    fitting = [p for p in range(1, order + 1) if comb(n + p, p) <= MOST_TERMS]
    return fitting[-1] if fitting else 1


def _expansions(
    model: Model, plan: Plan, full_order: int, cache: Cache | None
) -> tuple[tuple[Expansion, Expansion], bool]:
    """The two expansions about one point, and True where they come from the cache."""
    if cache is None:
        return _made(model, plan, full_order), False
    entry = expansion_key(model, plan, full_order)
    if (stored := cache.load(entry)) is not None:
        try:
            return _made(model, plan, full_order, stored), True
        except UsageError as error:
            _log.warning("cache entry %s cannot be used (%s); computed anew", entry[:12], error)
    start = process_time()
    fresh = _made(model, plan, full_order)
    if process_time() - start >= cache.least_s:
        cache.store(entry, expansion_arrays(*fresh))
    return fresh, False


def _made(
    model: Model, plan: Plan, full_order: int, stored: Mapping[str, Array] | None = None
) -> tuple[Expansion, Expansion]:
    """The full and the linearised expansion, of what is ``stored`` where that is given."""
    full, linear = (
        expand(
            *(model.pencil, plan.q0, plan.y0, plan.modes, order, linear_in_y),
            known=None if stored is None else stored_series(stored, k),
        )
        for k, (order, linear_in_y) in enumerate([(full_order, False), (plan.order, True)])
    )
    return full, linear


def expansion_key(model: Model, plan: Plan, full_order: int) -> str:
    """SHA-256 over all that the numbers of both expansions follow from.

    The pencil's arrays, the point, the modes, the sets, and the versions of this algorithm and of
    all that does its arithmetic: where any of them differs, so may the last bit.
    """
    pencil = replace(model.pencil, rails=None, limits=None)  # which refuse, and change no number
    point = (plan.q0, plan.y0, tuple(plan.modes), full_order, plan.order)
    versions = (__version__, np.__version__, scipy.__version__)
    return content_key(tree_arrays((pencil, *point, *versions)), ALGORITHM)


def coefficient_files(scene: Scene) -> dict[str, bytes]:
    """coefficients.json and coefficients.h5 of a scene's expansions.

    Names are those of the Python face. For ``linearised`` and ``full``: ``indices``
    (n_coefficients, n_q + n_y) and ``coefficients`` (n_modes, n_coefficients) with
    λ = Σ_γ λ_γ (x − x0)^γ in rad²/s², x = (q, y) in SI units; of modes that are expanded together
    ``cluster_<k>_coefficients`` (r, r, N) over w = ``directions`` (x − x0) with ``local_indices``.
    """
    expansions = scene.expansions
    tables = {}
    each = zip(expansions.linears.parts, expansions.fulls.parts, strict=True)
    for k, (linear, full) in enumerate(each, 1):
        where = f"_at_point_{k}" if k > 1 else ""
        tables[f"linearised{where}"] = _table(linear)
        tables[f"full{where}"] = _table(full)
    names = [*scene.model.q_names, *scene.model.y_names]
    point = {"q0": expansions.full.q0, "y0": expansions.full.y0}
    document = {
        "case": {"title": scene.file.title, "sha256": scene.file.sha256},
        "x_names": names,
        **point,
        **tables,
    }
    flat = {f"{part}_{name}": a for part, table in tables.items() for name, a in table.items()}
    meta = {"case": scene.file.title, "sha256": scene.file.sha256, "x_names": ", ".join(names)}
    return {
        "coefficients.json": (dumps(document) + "\n").encode(),
        "coefficients.h5": hdf5({**point, **flat}, meta),
    }


def _table(expansion: Expansion) -> dict[str, Array]:
    """The arrays of an expansion, by the names of the Python face."""
    modes = {
        "modes": np.array(expansion.modes),
        "order": np.array(expansion.order),
        "q0": expansion.q0,
        "y0": expansion.y0,
    }
    if all(len(cluster.modes) == 1 for cluster in expansion.clusters):
        return {**modes, "indices": expansion.indices, "coefficients": expansion.coefficients}
    series: dict[str, Array] = {}
    for k, cluster in enumerate(expansion.clusters):
        series[f"cluster_{k}_modes"] = np.array(cluster.modes)
        series[f"cluster_{k}_coefficients"] = cluster.coefficients
    local = {"local_indices": expansion.space.indices, "directions": expansion.directions}
    return {**modes, **local, **series}
