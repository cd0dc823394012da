"""Random limits: all that states a verdict agrees with limits worked out here, and with the others.

A uniform arm in the vertical plane turns by a quintic: mass and torque have closed forms.
"""

from __future__ import annotations

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
from eigassign.study import BuiltCase

CASE = """
title: arm
mechanism:
  space: planar
  gravity: [0, -9.81]
  materials: {st: {youngs_modulus: 205 GPa, density: 7850}}
  sections: {A: {shape: tube, outer_diameter: 60 mm, thickness: 3 mm}}
  links: {a: {length: 0.8, material: st, section: A, elements: 2}}
  joints: {j1: {type: revolute, base: ground, follower: a.start}}
  bodies: {tool: {at: a.end, mass: 6}, hub: {at: a.start, mass: 1}}
coordinates: {q1: {joint: j1, drive: {stiffness: 60000}}}
trajectory: {points: [[0], [1]], duration: 2 s, samples: 9}
design:
  tool: {parameter: bodies.tool.mass, min: 1, max: 12}
  hub: {parameter: bodies.hub.mass, min: 0, max: 4}
  k: {parameter: coordinates.q1.drive.stiffness, min: 2e4, max: 1e5}
"""
LINK, INITIAL = 7850 * np.pi / 4 * (0.06**2 - 0.054**2) * 0.8, np.array([6.0, 1.0, 6e4])  # kg, y
LOW, HIGH = np.array([1.0, 0.0, 2e4]), np.array([12.0, 4.0, 1e5])
S = np.linspace(0.0, 1.0, 20001)  # of the duration; q = s³ (10 − 15 s + 6 s²)
LEVER, FAST = np.cos(S**3 * (10 - 15 * S + 6 * S**2)), (60 * S - 180 * S**2 + 120 * S**3) / 2.0**2
ENDS = {"mass": "  mass: {max: %r}", "torque": "  torque: {q1: {max: %r}}",
        "sum": "  constraints: {sum: {terms: {tool: 1, hub: 2}, min: %r}}",
        "at least": "  - {mode: 1, at_least: %r}", "at most": "  - {mode: 1, at_most: %r}",
        "clear of": "  - {keep_out: [%r, %r]}", "goal": "  - {mode: 1, frequency: %r}"}  # fmt: skip


class Limits:
    """Some of those, about what a random design has; errors and violations of any design."""

    def __init__(self, seed: int) -> None:
        rng = np.random.default_rng(seed)
        self.model = BuiltCase(parse(CASE.encode(), "arm.yaml")).model()
        has = self.quantities(LOW + rng.random(3) * (HIGH - LOW), np.zeros(1))
        kinds = [str(kind) for kind in rng.permutation([*ENDS])[:4]]
        self.edges = {kind: float(has[kind].flat[0]) * rng.uniform(0.7, 1.3) for kind in kinds}
        self.width = rng.uniform(1.02, 1.3)
        said = {k: ENDS[k] % ((e, e * self.width) if k == "clear of" else e)
                for k, e in self.edges.items()}  # fmt: skip
        design, targets = [*ENDS][:3], [*ENDS][3:]
        lines = [*(said[k] for k in design if k in said), "targets:"]
        lines += [said[k] for k in targets if k in said]
        self.aim = "" if "goal" in said else rng.choice(["", "lightest", "{highest: 1}"])
        own = f", objective: {self.aim}" if self.aim else ""
        self.text = f"{CASE}{chr(10).join(lines)}\nassignment: {{starts: 2{own}}}\n"
        self.text = self.text.replace("targets:\nassign", "assign")

    def quantities(self, y: np.ndarray, q: np.ndarray) -> dict[str, np.ndarray]:
        inertia, arm = 0.64 * (LINK / 3 + y[0]), 0.8 * (LINK / 2 + y[0])
        torque, hz = inertia * FAST + 9.81 * arm * LEVER, self.model.frequencies(q[:, None], y, 4)
        first = dict.fromkeys(("at least", "at most", "goal"), hz[:, 0])
        sums = {"mass": np.array(LINK + y[0] + y[1]), "sum": np.array(y[0] + 2 * y[1])}
        return {**first, **sums, "torque": np.abs(torque).max(keepdims=True), "clear of": hz}

    def missed(self, y: np.ndarray, q: np.ndarray) -> tuple[dict[str, float], float]:
        """The relative violation of each limit, and the error of what is wanted."""
        found, has = dict[str, float](), self.quantities(y, q)
        for kind, edge in self.edges.items():
            off = has[kind] / edge - 1.0
            if kind == "clear of":  # with k modes below
                up = 1.0 - has[kind] / (edge * self.width)
                each = [max(off[:, :k].max(initial=0), up[:, k:].max(initial=0)) for k in range(5)]
                found[kind] = float(min(each))
            else:
                sign = -1.0 if kind in ("sum", "at least") else 1.0
                found[kind] = float((np.abs(off) if kind == "goal" else sign * off).max())
        goal = found.pop("goal", 0.0)
        return {kind: max(share, 0.0) for kind, share in found.items()}, goal


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
    row, violation, q = made["assignment"], made["violation"], made["trajectory"]["coordinates"]
    q, y = np.array(q["q1"]["values"]), np.array([p["optimal"] for p in made["design"].values()])
    (before, off), (after, left) = limits.missed(INITIAL, q), limits.missed(y, q)
    for when, missed in (("initial", before), ("exact", after)) if before else ():
        worst, named = max(missed.values()), violation[f"{when}_limit"]
        assert violation[when] == pytest.approx(worst, rel=1e-5, abs=1e-6)
        if worst > 1e-6:
            assert any(kind in named and share > 0.9999 * worst for kind, share in missed.items())
            assert named in line
            assert f"{100 * violation[when]:#.3g}".rstrip(".") + " %" in line
    assert before or violation is None
    if "goal" in limits.edges:
        shares = [made["error"][when]["max_relative"] for when in ("initial", "exact")]
        assert shares == pytest.approx([off, left], rel=1e-6)
    broken, verdict = max(after.values(), default=0.0) > 1e-6, row["verdict"]
    kept = not broken and left <= row["max_error"]
    assert kept if verdict == "reached" else not (broken and verdict == "improved")
    assert not kept or verdict not in ("infeasible", "unreachable")
    if verdict == "infeasible":  # so is every design of a grid
        grid = itertools.product(*np.linspace(LOW, HIGH, 7).T)
        assert all(max(limits.missed(np.array(y), q[:1])[0].values()) > 0.0 for y in grid)
    if row["aim"] and row["aim"]["words"] in row["reason"]:
        assert ("with limits broken" in line) == (max(before.values(), default=0.0) > 1e-6)
    assert code == (verdict not in ("reached", "improved"))
    assert line.startswith(f"{verdict.replace('_', ' ').capitalize()}: {row['reason']}.")
    page = html.unescape(re.sub("<[^>]+>", "", Path("results/arm/report.html").read_text()))
    assert "".join(line.split()) in "".join(page.split())
    assert main(["batch", "arm.yaml", "--jobs", "1", "--reports", "none", "--out", "all"]) == code
    (outcome,) = csv.DictReader(Path("all/summary.csv").read_text().splitlines())
    assert (outcome["verdict"], outcome["message"]) == (verdict, row["shortcoming"] or "")
    for when in ("initial", "exact") if before else ():
        assert float(outcome[f"{when}_violation"]) == violation[when]
    (test,) = ET.parse("all/junit.xml").getroot().iter("testcase")
    assert [one.get("message") for one in test.iter("failure")] == [row["shortcoming"]] * code
