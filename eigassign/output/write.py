"""Everything a run shows, written into a folder."""

from __future__ import annotations

from pathlib import Path

from eigassign.output import figures, report, results_json, samples_csv
from eigassign.study.findings import Findings


def write_run(findings: Findings, folder: Path) -> None:
    """results.json, report.html, CSV files and figures/*.png in ``folder``.

    It must exist and be empty. Wrap it in :func:`eigassign.output.run_folder.run_folder` to have
    them whole or not at all.
    """
    (folder / "results.json").write_bytes(results_json.to_json(findings))
    for name, data in samples_csv.sample_files(findings).items():
        (folder / name).write_bytes(data)
    plans = figures.plan(findings)
    images = figures.render(plans) if plans else {}
    (folder / "figures").mkdir()
    for name, data in images.items():
        (folder / "figures" / name).write_bytes(data)
    (folder / "report.html").write_bytes(report.to_html(findings, plans, images))
