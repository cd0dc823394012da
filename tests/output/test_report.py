"""report.html needs nothing but itself and believes no text it shows."""

import base64
import json
import re
from dataclasses import replace
from html.parser import HTMLParser

import numpy as np
import pytest
from synthetic_results import make_results, studied

from eigassign.output import (
    Curve,
    Graph,
    Look,
    Panel,
    Shade,
    page,
    run_figures,
    run_tables,
    screen_figure,
    write_run,
)

VOID = {"meta", "img", "br", "wbr", "link", "input"}
EVIL = '"><script>alert(1)</script>&amp;\x27 {{ 7*7 }} <!-- </SCRIPT>'


class Page(HTMLParser):
    def __init__(self, html: str) -> None:
        super().__init__()
        self.open: list[str] = []
        self.tags: list[tuple[str, dict[str, str | None]]] = []
        self.words: list[str] = []
        self.feed(html)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append((tag, dict(attrs)))
        if tag not in VOID:
            self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        self.words.append(data)

    @property
    def text(self) -> str:
        return " ".join(" ".join(self.words).split())


def shown_text(parsed: Page) -> str:
    """What a reader sees, from the first heading on."""
    return parsed.text.partition("Contents")[2] or parsed.text.rpartition("}")[2]


def made(results, full=False, size=0, more="") -> tuple[str, Page, dict[str, bytes]]:
    """The page with pictures of at least ``size`` bytes, and ``more`` text in its document."""
    plans = run_figures(results)
    images = {f"{p.name}.png": f"PNG of {p.name}".encode().ljust(size) for p in plans}
    data = ("results.json", json.dumps({"title": results.case.title + more}).encode())
    shown = run_tables(results)
    html = page(results, shown, plans, images, full=full, document=data).decode()
    parsed = Page(html)
    assert parsed.open == []
    return html, parsed, images


def island(html: str, name: str):
    """The JSON of one of the page's scripts."""
    (text,) = re.findall(rf'<script type="application/json" id="{name}">(.*?)</script>', html, re.S)
    return json.loads(text)


@pytest.mark.parametrize("full", [False, True])
def test_the_report_asks_nothing_of_the_network(full):
    html, parsed, _ = made(make_results(title="see https://example.org/x.png"), full)
    for tag, attributes in parsed.tags:
        assert tag not in ("iframe", "object", "base", "form"), tag
        assert full or tag != "script"
        assert not any(name.startswith("on") for name in attributes)
        assert (attributes.get("src") or "data:image/png;base64,").startswith(
            "data:image/png;base64,"
        )
        assert (attributes.get("href") or "#").startswith(("#", "data:,"))
    assert "default-src 'none'" in html
    assert not re.search(r"url\(|@import", html.split("<script>")[0])


def test_a_page_cannot_send_and_its_plots_have_no_button_that_would():
    html, _, _ = made(make_results(), full=True)
    (policy,) = re.findall(r'Content-Security-Policy" content="([^"]*)"', html)
    rules = dict(rule.strip().split(" ", 1) for rule in policy.split(";"))
    assert [rules[key] for key in ("default-src", "form-action", "base-uri")] == ["'none'"] * 3
    assert not {"connect-src", "frame-src", "object-src"} & rules.keys()
    assert "http" not in policy
    (config,) = re.findall(r"const config = (\{.*?\});", html, re.S)
    assert "displaylogo: false" in config
    assert 'showSendToCloud: false, plotlyServerURL: ""' in config
    assert '[["zoom2d", "pan2d", "resetScale2d", "toImage"]]' in config


def test_every_figure_is_inside_with_its_alternative_text_and_caption():
    results = make_results()
    _, parsed, images = made(results)
    shown = [attributes for tag, attributes in parsed.tags if tag == "img"]
    inside = [base64.b64decode((a["src"] or "").split(",", 1)[1]) for a in shown]
    assert inside == list(images.values())
    plans = run_figures(results)
    assert [a["alt"] for a in shown] == [plan.alt for plan in plans]
    for plan in plans:
        assert plan.caption in parsed.text


def test_a_full_report_plots_every_description_and_saves_its_numbers():
    results = studied(make_results())
    html, parsed, _ = made(results, full=True)
    plots = [a["data-figure"] for tag, a in parsed.tags if a.get("data-figure")]
    plans = [plan for plan in run_figures(results) if not plan.shows.sheet]
    assert plots == [plan.name for plan in plans]
    assert list(island(html, "figures")) == plots
    assert [a["data-csv"] for tag, a in parsed.tags if a.get("data-csv")] == plots
    curves = {c["name"]: c["y"] for c in island(html, "figures")["frequencies"]["data"]}
    target = results.targets[0]
    assert curves["mode 1 at 190 Hz"][0] == target.asked.hz[0]
    initial = island(html, "figures")["frequencies"]["data"]
    before = next(c for c in initial if c["name"] == "mode 1, initial design")
    assert before["y"][0] == pytest.approx(target.initial_hz[0], rel=1e-6)
    assert before["hovertemplate"].endswith("Hz")
    assert island(html, "results") == {"title": results.case.title}


@pytest.mark.parametrize(
    ("change", "word", "tone"),
    [
        ({"verdict": "reached"}, "Reached", "good"),
        ({"verdict": "improved", "max_error": 0.001}, "Improved", "fair"),
        ({"verdict": "unreachable"}, "Unreachable", "bad"),
        ({"verdict": "do_not_use"}, "Do not use", "bad"),
        ({"verdict": "infeasible"}, "Infeasible", "bad"),
    ],
)
def test_the_verdict_comes_first_in_words_and_colour(change, word, tone):
    results = make_results()
    row = replace(results.assignment, reason="so it is", **change)
    _, parsed, _ = made(replace(results, assignment=row))
    first = next(a for tag, a in parsed.tags if (a.get("class") or "").startswith("verdict"))
    assert first["class"] == f"verdict {tone}"
    asked = "so it is. Worst distance to the target: 6.00 % before, 1.00 % after"
    assert f"{word} : {asked}" in shown_text(parsed)[:1000]


@pytest.mark.parametrize("full", [False, True])
def test_text_from_the_case_is_never_markup(full):
    html, parsed, _ = made(make_results(title=EVIL, prefix=EVIL), full)
    scripts = [a for tag, a in parsed.tags if tag == "script"]
    assert len(scripts) == (6 if full else 0)
    assert " ".join(EVIL.split()) in parsed.text
    assert all(set(a) <= {"src", "alt"} for tag, a in parsed.tags if tag == "img")
    if full:
        assert island(html, "results") == {"title": EVIL}
        assert island(html, "figures")


def test_unpaired_surrogates_do_not_stop_the_report():
    html, _, _ = made(make_results(title="a\udcffb"))
    assert "a&#56575;b" in html


def test_a_run_leaves_results_report_and_figures(tmp_path):
    results = replace(make_results(), studies=())
    write_run(results, tmp_path, kind="light")
    names = {path.relative_to(tmp_path).as_posix() for path in tmp_path.rglob("*.*")}
    expected = {f"figures/{plan.name}.png" for plan in run_figures(results)}
    assert names == expected | {
        "results.json",
        "report.html",
        "trajectory.csv",
        "frequencies.csv",
    }
    picture = (tmp_path / "figures" / "mechanism.png").read_bytes()
    assert base64.b64encode(picture).decode() in (tmp_path / "report.html").read_text()


@pytest.mark.parametrize(
    ("formats", "embedded"),
    [(("svg", "pdf"), "data:image/svg+xml;base64,"), (("pdf",), None), (("svg", "png"), "png")],
)
def test_the_report_is_right_with_figures_of_any_format(tmp_path, formats, embedded):
    results = replace(make_results(n_y=1), assignment=None, studies=())
    write_run(results, tmp_path, formats, "light")
    plan, *others = run_figures(results)
    assert {p.name for p in (tmp_path / "figures").iterdir()} == {
        f"{each.name}.{kind}" for kind in formats for each in (plan, *others)
    }
    parsed = Page((tmp_path / "report.html").read_text())
    assert plan.caption in parsed.text
    images = [attributes["src"] or "" for tag, attributes in parsed.tags if tag == "img"]
    assert len(images) == (embedded is not None) * (1 + len(others))
    assert all((embedded or "") in image for image in images)
    assert (f"figures/{plan.name}.pdf" in parsed.text) == (embedded is None)


def test_no_report_is_written_where_none_is_wanted(tmp_path):
    write_run(make_results(n_y=1), tmp_path, ("png",), "none")
    assert (tmp_path / "figures").exists()
    assert not (tmp_path / "report.html").exists()


def test_many_samples_keep_a_report_small_and_their_extremes():
    t = np.linspace(0.0, 1.0, 20_000)
    y = np.sin(9.0 * t)
    y[[7_123, 15_001]] = 5.0, -4.0
    curve = Curve(y, Look("#000000"), label="measured")
    shade = Shade(y - 1.0, y + 1.0, "#00ff00")
    shown = Graph("measured", "t (s)", t, (Panel("f (Hz)", (shade, curve)),))
    figure = screen_figure(shown)
    filled, line = figure["data"]
    assert len(line["x"]) == len(line["y"]) <= 600
    assert (min(line["y"]), max(line["y"])) == (-4.0, 5.0)
    assert (line["x"][0], line["x"][-1]) == (0.0, 1.0)
    assert (min(filled["y"]), max(filled["y"])) == (-5.0, 6.0)
    assert len(json.dumps(figure)) < 60_000


def test_a_curve_under_the_pointer_has_a_name_and_a_strip_says_which_edges_are_its_own():
    """What is saved as CSV has a column for each of them, and none for an edge of the panel."""
    t = np.linspace(0.0, 1.0, 5)
    marks = (Shade(None, t + 1.0, "#00ff00", "below"), Curve(t, Look("#000000"), hover="after"))
    strip, line = screen_figure(Graph("g", "t (s)", t, (Panel("J1 [N m]", marks),)))["data"]
    assert strip["meta"] == [False, True]
    assert line["name"] == "after"
    assert "hoverinfo" not in line


def test_a_long_document_is_named_and_not_carried():
    html, _, _ = made(make_results(), full=True)
    assert 'id="results"' in html
    html, parsed, _ = made(make_results(), full=True, more="x" * 400_000)
    assert 'id="results"' not in html
    assert "All numbers are in results.json beside this page." in parsed.text


def test_what_stands_between_backticks_is_code_and_nothing_else_is_markup():
    html, _, _ = made(replace(make_results(), notes=("`order: <b>` was `taken`",)))
    assert "<code>order: &lt;b&gt;</code> was <code>taken</code>" in html
