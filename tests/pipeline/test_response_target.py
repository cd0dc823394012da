"""Dynamic stiffness as a requirement: its rows, slopes, answers and words."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from scipy.optimize import minimize

import eigassign as ea
from eigassign.assignment import design_limits
from eigassign.case import from_mapping
from eigassign.errors import CaseError
from eigassign.modal import dampings, modal_response, unit_forces
from eigassign.study import BuiltCase

ARM = Path(__file__).parents[2] / "cases" / "milling_arm.yaml"
TARGET = {"at": "forearm.end", "direction": [0, 1], "from": "6 Hz", "to": "24 Hz"}
Tree = dict[str, Any]


def tree(k: str, damping: Any = "2 %", **more: Any) -> Tree:
    """The milling arm that is to be as cheap as can be."""
    data: Tree = yaml.safe_load(ARM.read_text())
    data = {key: data[key] for key in ("title", "mechanism", "coordinates", "trajectory", "design")}
    data["trajectory"]["samples"] = 13
    data["targets"] = [{"response": {**TARGET}, "at_least": k, **more}]
    prices = {"k1": 1e-6, "k2": 1e-6, "wall": 100.0}
    for name, price in prices.items():
        data["design"][name]["price"] = price
    for material in data["mechanism"]["materials"].values():
        material.pop("loss_factor", None)
    for own in data["coordinates"].values():
        own["drive"].pop("loss_factor", None)
    if damping == "losses":
        data["mechanism"]["materials"]["steel"]["loss_factor"] = [0.002, 0.004]
        for own in data["coordinates"].values():
            own["drive"]["loss_factor"] = 0.05
    elif damping is not None:
        data["damping"] = damping
    return data


def worst(
    case: BuiltCase, y: np.ndarray, q: np.ndarray, count: int, low: float = 6.0, high: float = 24.0
) -> float:
    """The largest |H| of many frequencies by direct solves of K + iK_loss − ω²M + iωC."""
    model = case.model()
    x, omega = model.x(q, y), 2.0 * np.pi * np.linspace(low, high, count)
    own = unit_forces(model, {"forearm.end": [[0, 1]]})
    found = 0.0
    for damping in dampings(model):
        b = modal_response(model, damping, own, x, omega[-1]).b[..., 0]
        for k, at in enumerate(x):
            M, K = model.matrices(at[:2], at[2:])
            C = np.zeros_like(M)
            if damping.loss is None:
                hz, phi = model.modes(at[:2], at[2:], len(K))
                MP = M @ phi[0]
                C = MP @ np.diag(4.0 * np.pi * damping.zeta(len(K)) * hz[0]) @ MP.T
            else:
                theta = damping.loss.theta(at[None])
                K = K + 1j * damping.loss.stiffness_matrices(theta)[0]
            D = K - omega[:, None, None] ** 2 * M + 1j * omega[:, None, None] * C
            u = np.linalg.solve(D, np.broadcast_to(b[k][:, None], (count, len(K), 1)))
            found = max(found, float(np.abs(u[..., 0] @ b[k]).max()))
    return found


@pytest.mark.parametrize(
    ("damping", "low", "high", "stiffness"),
    [
        ("5 %", 2.0, 10.0, 0.45e6),
        ("4 %", 6.0, 24.0, 0.05e6),
        (["4 %", "6 %"], 2.0, 10.0, 0.4e6),
        ("losses", 2.0, 10.0, 0.3e6),
    ],
)
def test_the_cheapest_arm_is_as_stiff_as_asked_between_samples_and_frequencies(
    damping: Any, low: float, high: float, stiffness: float
) -> None:
    """Direct solves at 20 times the poses and frequencies; no cheaper one by SLSQP on these."""
    data = tree(f"{stiffness} N/m", damping)
    data["targets"][0]["response"] |= {"from": low, "to": high}
    case = ea.load_case(data)
    found = ea.assign(case)
    y, (lower, upper) = np.array(list(found.design.values())), np.array(case.file.box).T
    assert found.results.assignment.verdict == "reached"
    between = np.linspace(0.0, 12.0, 241)
    q = np.column_stack([np.interp(between, np.arange(13), c) for c in case.trajectory.q.T])
    assert stiffness * worst(case, y, q, 240, low, high) < 1.01
    few, width, prices = case.trajectory.q[::2], upper - lower, np.array([1e-6, 1e-6, 100.0])
    costs = [prices @ (y - lower)]
    for start in (0.3, 0.9):
        one = minimize(
            lambda z: prices @ (z * width),
            np.full(3, start),
            constraints={
                "type": "ineq",
                "fun": lambda z: 1 - stiffness * worst(case, lower + z * width, few, 40, low, high),
            },
            bounds=[(0.0, 1.0)] * 3,
            method="SLSQP",
        )
        costs += [one.fun] if one.success else []
    assert len(costs) > 1
    assert costs[0] <= min(costs) + 0.01 * float(prices @ width)


@pytest.mark.parametrize("damping", ["2 %", {"ratio": ["1 %", "3 %"], "modes": ["2 %"]}, "losses"])
def test_slopes_of_its_rows_are_differences(damping: Any) -> None:
    case = ea.load_case(tree("9 N/um", damping, during=["2 s", "14 s"]))
    (limit,) = (
        one for one in design_limits(case.file, case.model(), case.trajectory) if one.quantity
    )
    y = case.initial_design
    value, slopes = limit.quantity(y)
    rows = limit.rows.stop - limit.rows.start
    assert len(value) == rows * limit.each
    assert limit.each == 6 * len(dampings(case.model()))
    for j in range(len(y)):
        h = 1e-5 * y[j] * np.eye(len(y))[j]
        beside = (limit.quantity(y + h)[0] - limit.quantity(y - h)[0]) / (2.0 * h[j])
        # a top that is a thousandth of its width off has slopes a thousandth off
        np.testing.assert_allclose(slopes[:, j], beside, atol=5e-3 * np.abs(slopes[:, j]).max())
    assert limit.amount(y) == pytest.approx(1.0 / value.max())
    assert len(limit.curve_of(y)) == rows


@pytest.mark.parametrize("damping", ["2 %", {"ratio": "1 %", "modes": ["3 %", "2 %"]}, "losses"])
def test_slopes_at_a_frequency_are_differences_to_a_millionth(damping: Any) -> None:
    case = ea.load_case(tree("9 N/um", damping))
    model = case.model()
    x, own = model.x(case.trajectory.q[::4], case.initial_design), dampings(model)[-1]
    omega = np.tile(2.0 * np.pi * np.array([5.0, 15.5, 30.0, 110.0]), (len(x), 1))
    force = unit_forces(model, {"forearm.end": [[0, 1]]})

    def responses(x: np.ndarray) -> np.ndarray:
        return modal_response(model, own, force, x, omega[0, -1]).at(omega)

    found = modal_response(model, own, force, x, omega[0, -1])
    slopes = found.slopes(omega, np.ones(x.shape[1], dtype=bool))
    for j in range(x.shape[1]):
        step = 2e-4 * max(abs(x[0, j]), 1e-2) * np.eye(x.shape[1])[j]
        two, one = (
            (responses(x + k * step) - responses(x - k * step)) / (2.0 * k * step[j])
            for k in (1.0, 0.5)
        )
        np.testing.assert_allclose(
            slopes[..., j], (4.0 * one - two) / 3.0, rtol=1e-6, atol=1e-6 * np.abs(one).max()
        )


def test_of_ranges_every_choice_of_ends_counts() -> None:
    """Some choice between is softer than both with all least and with all most."""
    data = tree("9 N/um", None)
    for own in data["coordinates"].values():
        own["drive"]["loss_factor"] = ["1 %", "10 %"]
    model = ea.load_case(data).model()
    every = dampings(model)
    assert len(every) == 4
    x = model.x([0.97, -1.14], ea.load_case(data).initial_design)
    omega = 2.0 * np.pi * np.linspace(10.0, 60.0, 400)[None]
    own = unit_forces(model, {"forearm.end": [[0, 1]]})
    least, a, b, most = (np.abs(modal_response(model, d, own, x, 400.0).at(omega)) for d in every)
    assert (np.maximum(a, b) / np.maximum(least, most)).max() > 1.02
    data["mechanism"]["materials"]["steel"]["loss_factor"] = [0.001, 0.002]
    assert len(dampings(ea.load_case(data).model())) == 8


def test_it_is_told_as_what_it_is() -> None:
    data = tree("30 N/um")
    data["assignment"] = {"starts": 1}
    results = ea.assign(ea.load_case(data)).results
    assert "dynamic stiffness of forearm.end along [0, 1] at 6 … 24 Hz" in results.assignment.reason
    (row,) = results.statics
    assert row.handy[0] == "N/um"
    assert results.assignment.verdict in ("infeasible", "do_not_use")


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"damping": None}, "needs damping: ratios"),
        ({"to": "5 Hz"}, "the lowest frequency comes first"),
        ({"at": "forearm.tip"}, "forearm.tip"),
        ({"at_most": "1 N/um"}, "a response has the limit at_least"),
        ({"both": True}, "is given beside damping"),
        ({"damping": ["3 %", "1 %"]}, "is least, then most"),
        ({"damping": "120 %"}, "must be < 1"),
    ],
)
def test_what_cannot_be_meant_is_named(change: Tree, message: str) -> None:
    data = tree("9 N/um", change.get("damping", "2 %"))
    for key in change.keys() & {"to", "at"}:
        data["targets"][0]["response"][key] = change[key]
    if "at_most" in change:
        data["targets"][0] = {"response": TARGET, "at_most": "1 N/um"}
    if "both" in change:
        data["mechanism"]["materials"]["steel"]["loss_factor"] = 0.01
    with pytest.raises(CaseError, match=message):
        from_mapping(data)
