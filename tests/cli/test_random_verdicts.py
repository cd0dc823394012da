"""Random limits: all that states a verdict agrees with limits worked out here, and with the others.

A uniform arm in the vertical plane turns by a quintic: mass and torque have closed forms.
"""

import csv
import html
import itertools
import json
import re
import xml.etree.ElementTree as ET
from pathlib import Path

import numpy as np
import pytest

from eigassign.case import parse
from eigassign.cli import main
from eigassign.pipeline import solve_case
from eigassign.study import BuiltCase

CASE = Path(__file__).with_name("random_verdicts_case.yaml").read_text(encoding="utf-8")
LINK, INITIAL = 7850 * np.pi / 4 * (0.06**2 - 0.054**2) * 0.8, np.array([6.0, 1.0, 6e4])  # kg, y
LOW, HIGH = np.array([1.0, 0.0, 2e4]), np.array([12.0, 4.0, 1e5])
NEAR = 1e-5  # of a limit: by less the peak of a torque is above what it is at the finest instants
S = np.linspace(0.0, 1.0, 20001)  # of the duration; q = s³ (10 − 15 s + 6 s²)
LEVER, FAST = np.cos(S**3 * (10 - 15 * S + 6 * S**2)), (60 * S - 180 * S**2 + 120 * S**3) / 2.0**2
ENDS = {"mass": "  mass: {{max: {}}}", "torque": "  torque: {{q1: {{max: {}}}}}",
        "sum": "  constraints: {{sum: {{terms: {{tool: 1, hub: 2}}, min: {}}}}}",
        "at least": "  - {{mode: 1, at_least: {}}}", "at most": "  - {{mode: 1, at_most: {}}}",
        "clear of": "  - {{keep_out: [{}, {}]}}",
        "goal": "  - {{mode: 1, frequency: {}}}"}  # fmt: skip


class Limits:
    """Some of those, about what a random design has; errors and violations of any design."""

    def __init__(self, seed: int) -> None:
        rng = np.random.default_rng(seed)
        self.model = BuiltCase(parse(CASE.encode(), "arm.yaml")).model()
        has = self.quantities(LOW + rng.random(3) * (HIGH - LOW), np.zeros(1))
        kinds = sorted(rng.permutation([*ENDS])[:4].tolist(), key=[*ENDS].index)
        self.edges = {kind: float(has[kind].flat[0]) * rng.uniform(0.7, 1.3) for kind in kinds}
        self.width, aims = rng.uniform(1.02, 1.3), ("least_squares", "lightest", "{highest: 1}")
        lines = [ENDS[k].format(e, e * self.width) for k, e in self.edges.items()]
        lines.insert(len({"mass", "torque", "sum"}.intersection(kinds)), "targets:")
        aim = aims[0] if "goal" in kinds else rng.choice(aims)
        self.text = "\n".join([CASE, *lines, f"assignment: {{starts: 2, objective: {aim}}}", ""])

    def quantities(self, y: np.ndarray, q: np.ndarray) -> dict[str, np.ndarray]:
        inertia, arm = 0.64 * (LINK / 3 + y[0]), 0.8 * (LINK / 2 + y[0])
        torque, hz = inertia * FAST + 9.81 * arm * LEVER, self.model.frequencies(q[:, None], y, 4)
        first = dict.fromkeys(("at least", "at most", "goal"), hz[:, 0])
        sums = {"mass": np.array(LINK + y[0] + y[1]), "sum": np.array(y[0] + 2 * y[1])}
        return {**first, **sums, "torque": np.abs(torque).max(keepdims=True), "clear of": hz}

    def missed(self, y: np.ndarray, q: np.ndarray) -> tuple[dict[str, float], float]:
        """The relative violation of each limit, and the error of what is wanted."""
        has = self.quantities(y, q)
        off = {kind: has[kind] / edge - 1.0 for kind, edge in self.edges.items()}
        off |= {kind: -off[kind] for kind in {"sum", "at least"}.intersection(off)}
        if "clear of" in off:  # with the best number k of modes below
            low, up = off["clear of"], 1.0 - has["clear of"] / self.edges["clear of"] / self.width
            each = [max(low[:, :k].max(initial=0), up[:, k:].max(initial=0)) for k in range(5)]
            off["clear of"] = np.array(min(each))
        goal = float(np.abs(off.pop("goal", np.zeros(1))).max())
        return {kind: max(float(share.max()), 0.0) for kind, share in off.items()}, goal


def test_a_torque_that_the_initial_design_misses_most_is_in_the_headline() -> None:
    edges = (
        ENDS["mass"].format(7),
        ENDS["torque"].format(40),
        "targets:",
        ENDS["at least"].format(3),
    )
    case = BuiltCase(parse("\n".join([CASE, *edges]).encode(), "arm.yaml"))
    words = "67.0 % before (torque of q1 at most 40 N m), 0 % after"
    assert f"every target is met. Worst violation of a limit: {words}" in repr(solve_case(case))


@pytest.mark.parametrize("seed", range(300))
def test_all_that_states_a_verdict_agrees_with_the_limits(
    seed: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    limits = Limits(seed)
    Path("arm.yaml").write_text(limits.text)
    code = main(["optimize", "arm.yaml", "--figures", "none", "--report", "light", "--no-cache"])
    line = capsys.readouterr().out.partition("\n")[0]
    made = json.loads(Path("results/arm/results.json").read_text())
    row, violation = made["assignment"], made["violation"]
    q = np.loadtxt("results/arm/trajectory.csv", delimiter=",", skiprows=1)[:, 1]
    y = np.array([p["optimal"] for p in made["design"].values()])
    (before, _), (after, left) = both = limits.missed(INITIAL, q), limits.missed(y, q)
    for when, (missed, error) in zip(("initial", "exact"), both, strict=True):
        if "goal" in limits.edges:
            assert made["error"][when]["max_relative"] == pytest.approx(error, rel=1e-6)
        worst, named = max(missed.values()), violation[f"{when}_limit"]
        assert violation[when] == pytest.approx(worst, abs=NEAR)
        if worst > NEAR:
            assert any(kind in named and share > worst - NEAR for kind, share in missed.items())
            assert named in line
            assert f"{100 * violation[when]:#.3g}".rstrip(".") + " %" in line
    broken, verdict = max(after.values()) > NEAR, row["verdict"]
    kept = not broken and left <= row["max_error"]
    assert kept if verdict == "reached" else not (broken and verdict == "improved")
    assert not kept or verdict not in ("infeasible", "unreachable")
    if verdict == "infeasible":  # so is every design of a grid
        grid = itertools.product(*np.linspace(LOW, HIGH, 7).T)
        assert all(max(limits.missed(np.array(y), q[:1])[0].values()) > 0.0 for y in grid)
    if row["aim"] and row["aim"]["words"] in row["reason"]:
        assert ("with limits broken" in line) == (max(before.values()) > NEAR)
    assert code == (verdict not in ("reached", "improved"))
    assert line.startswith(f"{verdict.replace('_', ' ').capitalize()}: {row['reason']}.")
    page = html.unescape(re.sub("<[^>]+>", "", Path("results/arm/report.html").read_text()))
    assert "".join(line.split()) in "".join(page.split())
    assert main(["batch", "arm.yaml", "--jobs", "1", "--reports", "none", "--out", "all"]) == code
    (outcome,) = csv.DictReader(Path("all/summary.csv").read_text().splitlines())
    assert (outcome["verdict"], outcome["message"]) == (verdict, row["shortcoming"] or "")
    both = [float(outcome[f"{when}_violation"]) for when in ("initial", "exact")]
    assert both == [violation["initial"], violation["exact"]]
    (test,) = ET.parse("all/junit.xml").getroot().iter("testcase")
    assert [one.get("message") for one in test.iter("failure")] == [row["shortcoming"]] * code
