"""From the committed charts: two figures, and who holds each front."""

from __future__ import annotations

import io
import json
from pathlib import Path
from typing import Any

import common

SHOWN = {"two_link": "the paper's arm, 23 dof", "large": "spatial trunk with chains, 10⁴ dof"}
LOW, HIGH = 1e-8, 1e-2  # relative errors between which a front counts
GROUPS = (  # families that begin so, how they are called, colour
    ("fit", "fits", "#0b6e99"),
    ("1/λ", "series of 1/λ", "#c2571a"),
    ("Taylor", "series of λ", "#8a5aa8"),
    ("reduced", "reduced models", "#2f7d4f"),
    ("exact", "exact solves", "#222222"),
)
INTRODUCTION = """# Who holds the fronts

A method is on a front if no other is both quicker and more accurate. The table counts those with
relative errors between 1e-2 and 1e-8; the committed charts have all of them. How times are counted:

- Fits, and every other method whose formula separates into a factor of pose and a factor of
  design (response surfaces, grids), answer whole trajectories of many designs in one matrix
  product. So do stations, which interpolate between solves along the trajectory. What all designs
  share is computed once and is not counted, for eigassign's methods and for the others.
- Radial basis functions, Kriging, the series and the reduced models are evaluated point by point.
- Fits include their exact solves, checks and error estimate. The other methods are trained on
  eigassign's exact solves, whose time is counted too, and have no error estimate.
"""
PEERS = ("interpolation and surrogates", "#9a9a9a")


def share(case: str, chart: dict[str, Any]) -> list[dict[str, Any]]:
    """One row a front: methods between LOW and HIGH, how many are eigassign's, the others."""
    known = {point["method"]: point for point in chart["points"]}
    rows = []
    for front in chart["fronts"]:
        inside = [
            known[name]
            for name in front["methods"]
            if LOW <= known[name]["everywhere"]["worst_relative"] <= HIGH
        ]
        peers = [point["method"] for point in inside if not point["ours"]]
        rows.append(
            {
                "case": case,
                "front": front["name"],
                "methods": len(inside),
                "ours": len(inside) - len(peers),
                "peers": peers,
            }
        )
    return rows


def write_shares() -> str:
    """``results/fronts.json`` and ``.md`` of all charts there; the table."""
    paths = sorted(common.RESULTS.glob("chart_*/chart.json"))
    rows = [row for path in paths for row in share(path.parent.name[6:], _read(path))]
    lines = [
        INTRODUCTION,
        "| case | front | methods | eigassign's | others |",
        "|---|---|---|---|---|",
    ]
    lines += [
        f"| {r['case']} | {r['front']} | {r['methods']} | {r['ours']} | {', '.join(r['peers'])} |"
        for r in rows
    ]
    text = "\n".join(lines) + "\n"
    (common.RESULTS / "fronts.md").write_text(text, encoding="utf-8")
    data = json.dumps(rows, indent=1, ensure_ascii=False) + "\n"
    (common.RESULTS / "fronts.json").write_text(data, encoding="utf-8")
    return text


def write_figures() -> None:
    """``results/chart_<case>/front.png`` of the cases SHOWN, under 40 kB each."""
    for name, title in SHOWN.items():
        path = common.RESULTS / f"chart_{name}" / "chart.json"
        if path.exists():
            _draw(_read(path), title, path.with_name("front.png"))


def _read(path: Path) -> dict[str, Any]:
    chart: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
    return chart


def _draw(chart: dict[str, Any], title: str, target: Path) -> None:
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt
    from PIL import Image

    figure, axes = plt.subplots(1, 2, figsize=(8.4, 3.7), sharey=True, layout="constrained")
    for axis, front in zip(axes, chart["fronts"][:2], strict=True):
        _panel(axis, chart, front)
    axes[0].set_ylabel("worst relative error of a frequency")
    handles, labels = axes[0].get_legend_handles_labels()
    more, names = axes[1].get_legend_handles_labels()
    every = {**dict(zip(labels, handles, strict=True)), **dict(zip(names, more, strict=True))}
    figure.suptitle(f"Time against accuracy: {title}", fontsize=11)
    figure.legend(every.values(), every.keys(), loc="outside lower center", ncols=4, frameon=False,
                  fontsize=8.5)  # fmt: skip
    raw = io.BytesIO()
    figure.savefig(raw, dpi=120)
    plt.close(figure)
    Image.open(raw).convert("RGB").quantize(96).save(target, optimize=True)


def _panel(axis: Any, chart: dict[str, Any], front: dict[str, Any]) -> None:
    n = front["evaluations"]
    for label, colour, ours, points in _groups(chart["points"]):
        x = [p["offline"]["median_s"] + n * p["online"]["median_s"] for p in points]
        y = [max(p["everywhere"]["worst_relative"], 1e-13) for p in points]
        face = colour if ours else "none"
        axis.scatter(x, y, s=22 if ours else 14, marker="o", facecolor=face, edgecolor=colour,
                     linewidth=0.9, label=label, zorder=3 if ours else 2)  # fmt: skip
    known = {p["method"]: p for p in chart["points"]}
    best = [known[name] for name in front["methods"]]
    x = [p["offline"]["median_s"] + n * p["online"]["median_s"] for p in best]
    y = [max(p["everywhere"]["worst_relative"], 1e-13) for p in best]
    axis.plot(x, y, color="#0b6e99", alpha=0.35, linewidth=5, zorder=1, label="front")
    axis.set(xscale="log", yscale="log", xlabel="set-up and all evaluations [s]", ylim=(3e-14, 1.0))
    axis.set_title(f"{front['name']} ({n:,.0f} evaluations)", fontsize=9.5)
    axis.grid(alpha=0.25)


def _groups(points: list[dict[str, Any]]) -> list[tuple[str, str, bool, list[dict[str, Any]]]]:
    shown = [p for p in points if p["everywhere"]["worst_relative"] < 1.0]
    made = []
    for start, label, colour in GROUPS:
        mine = [p for p in shown if p["ours"] and p["family"].startswith(start)]
        made.append((label, colour, True, mine))
    return [*made, (*PEERS, False, [p for p in shown if not p["ours"]])]


if __name__ == "__main__":
    write_figures()
    print(write_shares())
