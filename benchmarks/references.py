"""Cases to assign frequencies in, and SciPy's best designs for them, kept between runs.

The references take long. They are kept in ``--references``, by default a folder under the system's
temporary one, under the hash of the case and of the program that finds them.
"""

from __future__ import annotations

import common  # first: settles the threads

# isort: split
import argparse
import hashlib
import json
import sys
import tempfile
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import eigassign as ea

TESTS = Path(__file__).parents[1] / "tests"
sys.path[:0] = [str(TESTS / "oracles"), str(TESTS / "assignment")]

import assignment_oracle as oracle
import random_assignments as random

DEFAULT = Path(tempfile.gettempdir()) / "eigassign_references"


@dataclass(frozen=True)
class Named:
    """A case to solve, by its name."""

    name: str
    text: str
    case: ea.Case


def shipped() -> Iterator[Named]:
    """Every shipped case of frequencies in least squares that the oracle states.

    It knows bounds and linear constraints, no catalogues, and trajectories that keep their q.
    """
    for path in sorted(common.CASES.glob("*.yaml")):
        text = path.read_text(encoding="utf-8")
        case = ea.load_case(path)
        kinds = {target.kind for target in case.file.targets}
        own = case.file.assignment.objective == "least_squares" and not case.file.design.catalogues
        if kinds == {"frequency"} and own and not case.trajectory.follows_design:
            yield Named(path.stem, text, case)


def drawn(seeds: range) -> Iterator[Named]:
    """The random cases of these seeds."""
    for seed in seeds:
        text = random.random_case(seed)
        yield Named(f"random {seed}", text, random.load_text(text))


def options(description: str) -> argparse.ArgumentParser:
    """The options that the benchmarks with references share."""
    parser = argparse.ArgumentParser(description=description)
    parser.add_argument("names", nargs="*", help="only these cases, such as two_link or random_3")
    parser.add_argument("--confirmation", action="store_true", help="the other random cases")
    parser.add_argument("--references", type=Path, default=DEFAULT, help="folder to keep them in")
    parser.add_argument("--only-references", action="store_true", help="find them and stop")
    return parser


def chosen(given: argparse.Namespace) -> Iterator[Named]:
    """The cases asked for."""
    seeds = random.CONFIRMATION if given.confirmation else random.DEVELOPMENT
    wanted = [name.replace("_", " ") for name in given.names]
    for named in (*shipped(), *drawn(seeds)):
        if not wanted or named.name.replace("_", " ") in wanted:
            yield named


def reference(
    named: Named, folder: Path, search: Callable[[oracle.ExactAssignment], oracle.Found]
) -> dict[str, Any]:
    """What ``search`` finds, as plain numbers; from the folder where it is known."""
    program = Path(oracle.__file__).read_text(encoding="utf-8")
    parts = "\0".join([program, named.text, search.__name__])
    digest = hashlib.sha256(parts.encode()).hexdigest()
    kept = folder / f"{digest}.json"
    if kept.exists():
        return dict(json.loads(kept.read_text(encoding="utf-8")))
    found = asdict(search(oracle.of_case(named.case)))
    found["y"] = found["y"].tolist()
    folder.mkdir(parents=True, exist_ok=True)
    kept.write_text(json.dumps(found), encoding="utf-8")
    return found
