"""Reports in a real browser: no error, no request, nothing too wide, sliders and keys that work."""

import csv
import json
import re
import shutil
import time
from collections.abc import Iterator
from dataclasses import replace
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from threading import Thread
from typing import Any

import numpy as np
import pytest

from eigassign.cli import main
from eigassign.output import CaseOutcome, write_files

webdriver = pytest.importorskip("selenium.webdriver", reason="selenium is not installed")
BROWSER, DRIVER = shutil.which("chromium"), shutil.which("chromedriver")
pytestmark = [
    pytest.mark.browser,
    pytest.mark.skipif(not (BROWSER and DRIVER), reason="no Chromium with its driver installed"),
]
CASES = ("two_link", "arm_6r", "milling_column", "lift_arm")
WIDTHS = (390, 800, 1200, 1920)
QUIET = ("--headless=new", "--no-sandbox", "--disable-quic", "--no-first-run",
         "--disable-background-networking", "--disable-component-update", "--disable-sync",
         "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader")  # fmt: skip


@pytest.fixture(scope="module")
def reports(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    folder, cases = tmp_path_factory.mktemp("reports"), Path(__file__).parents[2] / "cases"
    found = {}
    for name in CASES:
        out = folder / name
        main(["optimize", str(cases / f"{name}.yaml"), "--out", str(out), "--figures", "none"])
        found[name] = out / "report.html"
    return found


@pytest.fixture(scope="module")
def browser(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Any]:
    options = webdriver.ChromeOptions()
    options.binary_location = BROWSER
    for argument in (*QUIET, f"--user-data-dir={tmp_path_factory.mktemp('profile')}"):
        options.add_argument(argument)
    options.set_capability("goog:loggingPrefs", {"browser": "ALL", "performance": "ALL"})
    opened = webdriver.Chrome(options=options, service=webdriver.ChromeService(DRIVER))
    yield opened
    opened.quit()


def at(browser: Any, page: Path, width: int) -> None:
    size = {"width": width, "height": 900, "deviceScaleFactor": 1, "mobile": width < 600}
    browser.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", size)
    browser.get(page.as_uri())


def drawn(browser: Any) -> None:
    """Open what is folded, and scroll through the page until every plot on it is there."""
    browser.execute_script("document.querySelectorAll('details').forEach((e) => e.open = true)")
    boxes = browser.find_elements("css selector", ".plot[data-figure]")
    for box in boxes:
        browser.execute_script("arguments[0].scrollIntoView()", box)
        end = time.monotonic() + 30.0
        while not box.find_elements("css selector", ".main-svg") and time.monotonic() < end:
            time.sleep(0.05)
        assert box.find_elements("css selector", ".main-svg"), box.get_attribute("data-figure")


def requests(browser: Any) -> list[str]:
    messages = (json.loads(entry["message"])["message"] for entry in browser.get_log("performance"))
    sent = [
        m["params"]["request"]["url"]
        for m in messages
        if m["method"] == "Network.requestWillBeSent"
    ]
    return [url for url in sent if not url.startswith(("data:", "blob:"))]


@pytest.mark.parametrize("name", CASES)
def test_all_plots_are_drawn_without_error_or_request(browser, reports, name):
    browser.get_log("browser")
    requests(browser)
    at(browser, reports[name], 1200)
    drawn(browser)
    assert [e for e in browser.get_log("browser") if e["level"] == "SEVERE"] == []
    assert requests(browser) == [reports[name].as_uri()]


# --- Nothing leaves the machine

BUTTONS = ["Zoom", "Pan", "Reset axes", "Download plot as a PNG"]
SENDING = """const url = arguments[0], done = arguments[1], failed = () => null;
  const form = document.body.appendChild(document.createElement("form"));
  form.action = url; form.target = "_self"; form.method = "post"; form.submit();
  for (const [tag, key] of Object.entries(
      {img: "src", script: "src", iframe: "src", link: "href", object: "data"})) {
    const made = document.createElement(tag);
    if (tag === "link") made.rel = "stylesheet";
    made[key] = url;
    document.body.append(made);
  }
  const request = new XMLHttpRequest();
  try { request.open("POST", url); request.onerror = failed; request.send("x"); } catch { }
  try { navigator.sendBeacon(url, "x"); } catch { }
  try { new WebSocket(url.replace("http", "ws")); } catch { }
  fetch(url, { method: "POST", body: "x" }).catch(failed).then(() => setTimeout(done, 500));"""
ABROAD = r"""const abroad = (e) => ["src", "href", "action", "data", "srcset"].some(
  (key) => /^(https?:)?\/\//.test(e.getAttribute(key) || ""));
  return [...document.querySelectorAll("*")].filter((e) =>
  abroad(e) || /^(iframe|form|object|embed|base)$/i.test(
  e.tagName)).map((e) => e.outerHTML.slice(0, 200))"""


@pytest.fixture
def listener() -> Iterator[tuple[str, list[str]]]:
    """A server on this machine, and the requests that it got."""
    heard: list[str] = []

    class Heard(BaseHTTPRequestHandler):
        timeout = 1.0  # a browser opens connections that it does not use

        def do_GET(self) -> None:
            heard.append(self.requestline)

        do_POST = do_GET  # noqa: N815

    server = ThreadingHTTPServer(("127.0.0.1", 0), Heard)
    thread = Thread(target=server.serve_forever)
    thread.start()
    yield f"http://127.0.0.1:{server.server_port}/", heard
    server.shutdown()
    thread.join()
    server.server_close()


@pytest.fixture(scope="module")
def pages(reports, batch, tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """A page of every kind that we write."""
    folder, root = tmp_path_factory.mktemp("kinds"), Path(__file__).parents[2]
    found = {"run": reports["two_link"], "batch": batch}
    for name, command in {
        "update": ["update", root / "cases" / "arm_update.yaml"],
        "chart": ["chart", root / "benchmarks" / "small_arm.yaml", "--quick"],
        "light": ["optimize", root / "benchmarks" / "small_arm.yaml", "--report", "light"],
    }.items():
        main([*map(str, command), "--quiet", "--out", str(folder / name)])
        found[name] = folder / name / "report.html"
    both = [str(page.parent) for page in (reports["two_link"], found["light"])]
    main(["compare", *both, "--quiet", "--out", str(folder / "compare")])
    return found | {"compare": folder / "compare" / "compare.html"}


@pytest.mark.parametrize("kind", ["run", "batch", "update", "chart", "light", "compare"])
def test_no_page_can_send_anything(browser, pages, listener, kind):
    url, heard = listener
    at(browser, pages[kind], 1200)
    drawn(browser)
    assert browser.execute_script(ABROAD) == []
    for bar in browser.find_elements("css selector", ".modebar"):
        buttons = bar.find_elements("css selector", ".modebar-btn")
        assert [button.get_attribute("data-title") for button in buttons] == BUTTONS
    titles = "return [...document.querySelectorAll('[data-title]')].map((e) => e.dataset.title)"
    assert set(browser.execute_script(titles)) <= {*BUTTONS}
    requests(browser)
    browser.execute_async_script(SENDING, url)
    assert heard == []
    assert browser.current_url == pages[kind].as_uri()


def test_a_page_without_its_policy_could_send(browser, pages, listener, tmp_path):
    """The test above would see it."""
    url, heard = listener
    html = pages["light"].read_text(encoding="utf-8")
    (tmp_path / "open.html").write_text(html.replace("default-src 'none'", "default-src *"))
    at(browser, tmp_path / "open.html", 1200)
    browser.execute_async_script(SENDING, url)
    assert heard


def test_a_plot_is_saved_as_one_table_with_units(browser, reports):
    at(browser, reports["two_link"], 1200)
    script = "return eigassign.csv(arguments[0])"
    head, *rows = csv.reader(browser.execute_script(script, "frequencies").splitlines())
    assert head[0] == "time [s]"
    assert "mode 1 at 190 Hz: frequency [Hz]" in head
    assert "mode 1, initial design: off target [%]" in head
    column = head.index("mode 1: frequency [Hz]")
    assert len(set(head)) == len(head)
    final = json.loads((reports["two_link"].parent / "results.json").read_text())["frequencies"]
    samples = {float(row[0]): row for row in rows}
    assert [float(samples[float(f"{t:.7g}")][column]) for t in final["time_s"]] == pytest.approx(
        final["exact_hz"], rel=1e-6
    )
    assert all(len(row) == len(head) for row in rows)


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_print_is_light_and_cuts_no_figure(browser, reports, scheme):
    media = {"features": [{"name": "prefers-color-scheme", "value": scheme}]}
    browser.execute_cdp_cmd("Emulation.setEmulatedMedia", media)
    at(browser, reports["two_link"], 1200)
    drawn(browser)
    browser.execute_script("dispatchEvent(new Event('beforeprint'))")
    colour = """return getComputedStyle(document.querySelector(
      "[data-figure=frequencies] .xaxislayer-above text")).fill"""
    assert browser.execute_script(colour) == "rgb(26, 26, 26)"
    whole = "return getComputedStyle(document.querySelector('figure')).breakInside"
    assert browser.execute_script(whole) == "avoid"
    browser.execute_script("dispatchEvent(new Event('afterprint'))")
    if scheme == "dark":
        assert browser.execute_script(colour) == "rgb(232, 232, 232)"
    browser.execute_cdp_cmd("Emulation.setEmulatedMedia", {"features": []})


@pytest.mark.parametrize("width", WIDTHS)
def test_nothing_is_wider_than_the_window(browser, reports, batch, sweep, width):
    for page in (reports["two_link"], batch, sweep):
        at(browser, page, width)
        drawn(browser)
        assert browser.execute_script("return document.documentElement.scrollWidth") <= width
    over = browser.execute_script(  # words that a plot of the sweep cuts
        "return [...document.querySelectorAll('svg text')].filter((t) => { const a = "
        "t.getBoundingClientRect(), b = t.closest('svg').getBoundingClientRect(); "
        "return a.left < b.left - 1 || a.right > b.right + 1; }).map((t) => t.textContent)"
    )
    assert over == []


def field(browser: Any, name: str) -> Any:
    return browser.find_element("css selector", f"#motion-player [name={name}]")


def said(browser: Any) -> str:
    return browser.find_element("css selector", "#motion-player output").text


def picture(browser: Any) -> str:
    return browser.execute_script("return document.querySelector('canvas').toDataURL()")


def cursors(browser: Any) -> list[float]:
    """Where the cursors of the plots are, in time."""
    script = """return [...document.querySelectorAll(".plot")].filter((box) => box.querySelector(
      ".cursor:not([hidden])")).map((box) => box._fullLayout.xaxis.p2l(parseFloat(
      box.querySelector(".cursor").style.left) - box._fullLayout.xaxis._offset));"""
    return browser.execute_script(script)


def playing(browser: Any) -> bool:
    return field(browser, "play").text == "Pause"


def started(browser: Any, page: Path, width: int = 1200) -> None:
    at(browser, page, width)
    browser.execute_script("document.querySelector('canvas').scrollIntoView()")
    end = time.monotonic() + 10.0
    while not playing(browser) and time.monotonic() < end:
        time.sleep(0.05)
    assert playing(browser)


def test_one_cursor_in_time_for_plots_and_mechanism(browser, reports):
    started(browser, reports["two_link"])
    field(browser, "play").click()
    drawn(browser)
    slider = field(browser, "time")
    before = picture(browser)
    slider.send_keys("\ue010")  # End
    assert said(browser).startswith("1.00 s")
    assert slider.get_attribute("aria-valuetext") == said(browser)
    assert picture(browser) != before
    assert cursors(browser) == pytest.approx([1.0] * len(cursors(browser)), abs=2e-3)
    assert len(cursors(browser)) == 2  # frequencies and coordinates: what is folded has none
    # a click into a plot sets the mechanism's time
    script = "eigassign.setTime('1', 0.5)"
    browser.execute_script(script)
    assert cursors(browser) == pytest.approx([0.5] * len(cursors(browser)), abs=2e-3)
    assert float(said(browser).split()[0]) == pytest.approx(0.5, abs=0.01)


@pytest.mark.parametrize("how", ["time", "scale", "canvas", "key"])
def test_touching_anything_of_it_or_pressing_a_key_pauses(browser, reports, how):
    started(browser, reports["lift_arm"])
    if how == "key":
        browser.find_element("css selector", "body").send_keys("x")
    else:
        target = "canvas" if how == "canvas" else f"[name={how}]"
        event = "new PointerEvent('pointerdown', {bubbles: true})"
        script = f"document.querySelector(arguments[0]).dispatchEvent({event})"
        browser.execute_script(script, f"#motion-player {target}")
    assert not playing(browser)
    there = said(browser)
    time.sleep(0.3)
    assert said(browser) == there


def test_modes_scale_and_trajectory_can_be_chosen_and_space_turned(browser, reports):
    started(browser, reports["arm_6r"])
    field(browser, "play").click()
    pictures = {picture(browser)}
    field(browser, "mode").send_keys("mode 2")
    hz = said(browser)
    pictures.add(picture(browser))
    field(browser, "scale").send_keys("\ue010")
    pictures.add(picture(browser))
    turn = """const c = document.querySelector("canvas"), r = c.getBoundingClientRect();
      c.setPointerCapture = () => {};
      for (const [type, x] of [["pointerdown", 10], ["pointermove", 90], ["pointerup", 90]]) {
        const at = {clientX: r.left + x, clientY: r.top + 20, pointerId: 1, bubbles: true};
        c.dispatchEvent(new PointerEvent(type, at));
      }"""
    browser.execute_script(turn)
    pictures.add(picture(browser))
    assert len(pictures) == 4
    final = json.loads((reports["arm_6r"].parent / "results.json").read_text())
    second, shown = (float(word) for word in re.findall(r"[0-9.]+", hz))
    curve = final["frequencies"]["time_s"], final["other_modes"][0]["optimal_hz"]
    assert shown == pytest.approx(np.interp(second, *curve), abs=0.02)  # digits; between samples
    started(browser, reports["lift_arm"])
    field(browser, "along").send_keys("return")
    assert not playing(browser)
    assert said(browser).startswith("0.00 s")


def test_the_canvas_is_stepped_by_arrow_keys(browser, reports):
    started(browser, reports["two_link"])
    canvas = browser.find_element("css selector", "canvas")
    canvas.send_keys("\ue014")
    first = float(said(browser).split()[0])
    canvas.send_keys("\ue014")
    assert float(said(browser).split()[0]) > first


def test_modes_that_are_left_out_are_behind_a_click(browser, reports):
    at(browser, reports["two_link"], 1200)
    drawn(browser)
    script = "return document.querySelector('[data-figure=frequencies]')._fullLayout.yaxis.range[1]"
    assert browser.execute_script(script) < 250.0
    buttons = browser.find_elements("css selector", "#answer button")
    next(button for button in buttons if button.text == "All modes").click()
    assert browser.execute_script(script) > 700.0


CONTRAST = (Path(__file__).parent / "contrast.js").read_text(encoding="utf-8")


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_words_have_contrast(browser, reports, scheme):
    media = {"features": [{"name": "prefers-color-scheme", "value": scheme}]}
    browser.execute_cdp_cmd("Emulation.setEmulatedMedia", media)
    at(browser, reports["arm_6r"], 1200)
    assert browser.execute_script(CONTRAST) == []
    browser.execute_cdp_cmd("Emulation.setEmulatedMedia", {"features": []})


def test_headings_are_in_order_and_all_fields_have_labels(browser, reports):
    at(browser, reports["lift_arm"], 1200)
    tags = "return [...document.querySelectorAll('h1, h2, h3, h4')].map((e) => e.tagName)"
    levels = [int(tag[1]) for tag in browser.execute_script(tags)]
    assert levels[0] == 1
    assert levels.count(1) == 1
    assert sum(level == 2 for level in levels) <= 10
    unnamed = """return [...document.querySelectorAll("input, select, button, canvas")].filter(
      (e) => !(e.labels?.length || e.textContent.trim() || e.ariaLabel)).length"""
    assert browser.execute_script(unnamed) == 0
    links = "return [...document.querySelectorAll('nav a')]"
    assert browser.execute_script(f"{links}.every((a) => document.querySelector(a.hash))")


def test_a_page_is_light_and_is_seen_before_its_plots_are_made(browser, reports):
    """Compiled with the page, Plotly's script delayed the first paint from 0.1 to 0.6 s."""
    for page in reports.values():
        assert page.stat().st_size <= 6_000_000
    at(browser, reports["two_link"], 1200)
    drawn(browser)
    large = "return [...document.scripts].filter((e) => e.textContent.length > 1e6)"
    kinds = browser.execute_script(f"{large}.map((e) => e.type)")
    assert kinds == ["text/plain", ""]  # the second one made later


def test_what_a_plot_says_under_the_pointer_is_the_frequency(browser, reports):
    at(browser, reports["two_link"], 1200)
    drawn(browser)
    box = browser.find_element("css selector", ".plot[data-figure=frequencies]")
    browser.execute_script(
        "arguments[0].scrollIntoView(); Plotly.Fx.hover(arguments[0], {xval: 1})", box
    )
    words = box.find_element("css selector", ".hoverlayer").text
    final = json.loads((reports["two_link"].parent / "results.json").read_text())
    for when in ("exact_hz", "initial_hz"):
        assert f"{final['frequencies'][when][-1]:.4g} Hz" in words
    assert "initial design" in words


def test_without_motion_wanted_nothing_moves(browser, reports):
    quiet = [{"name": "prefers-reduced-motion", "value": "reduce"}]
    browser.execute_cdp_cmd("Emulation.setEmulatedMedia", {"features": quiet})
    at(browser, reports["two_link"], 1200)
    drawn(browser)
    time.sleep(0.5)
    assert not playing(browser)
    browser.execute_cdp_cmd("Emulation.setEmulatedMedia", {"features": []})


@pytest.fixture(scope="module")
def batch(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder, rows = tmp_path_factory.mktemp("batch"), []
    for k in range(450):
        status, verdict = ("failed", "unreachable") if k % 100 == 7 else ("ok", "reached")
        values = {"mechanism.bodies.tool.mass": f"{(k * 7) % 450} g"}
        run = "run" if k == 0 else None
        row = CaseOutcome(
            f"tool={k}", "arm.yaml", status, 0.1, "", run, verdict=verdict, values=values
        )
        rows.append(replace(row, index=k))
    (folder / "run" / "figures").mkdir(parents=True)
    picture = Path(__file__).parents[2] / "cases" / "two_link.png"
    shutil.copy(picture, folder / "run" / "figures" / "frequencies.png")
    write_files(folder, rows, ("mechanism.bodies.tool.mass",))
    return folder / "index.html"


def names(browser: Any) -> list[str]:
    return browser.execute_script(
        "return [...document.querySelectorAll('td.case')].map((cell) => cell.textContent)"
    )


def test_rows_of_a_batch_sort_by_size_and_filter_by_words_and_verdict(browser, batch):
    browser.get_log("browser")
    at(browser, batch, 1200)
    assert names(browser)[:2] == ["1", "2"]
    mass = browser.find_element("css selector", "[data-column='tool.mass']")
    mass.find_element("css selector", "button").click()
    assert names(browser)[1] == "194"  # 193 · 7 = 1351 = 3 · 450 + 1
    mass.find_element("css selector", "button").click()
    assert mass.get_attribute("aria-sort") == "descending"
    assert len(names(browser)) == 200
    browser.find_element("css selector", ".more button").click()
    assert len(names(browser)) == 400
    browser.find_element("css selector", "[data-word='Unreachable']").click()
    assert sorted(names(browser)) == ["108", "208", "308", "408", "8"]
    browser.find_element("css selector", "input").send_keys("308 unreach")
    assert names(browser) == ["308"]
    assert [e for e in browser.get_log("browser") if e["level"] == "SEVERE"] == []


def test_a_batch_shows_small_pictures(browser, batch):
    at(browser, batch, 1200)
    time.sleep(0.5)
    wide = browser.execute_script("return document.querySelector('td img').naturalWidth")
    assert wide > 0


# --- The page of a sweep: its plots

MASS, WANTED = "mechanism.bodies.tool.mass", "targets.0.frequency"


@pytest.fixture(scope="module")
def sweep(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder, rows = tmp_path_factory.mktemp("sweep"), []
    for k in range(50):
        mass, hz = k // 5, 12 + k % 5
        far = abs(mass - (hz - 12)) / 40
        ended = ("ok", "reached") if far < 0.04 else ("failed", "unreachable")
        row = CaseOutcome(
            f"mass={mass}", "arm.yaml", ended[0], 0.1, "unreachable: it is far off" * (far >= 0.04),
            f"run {k}", 2 * far, far, far + 0.001, design=(("width", 0.03 + k / 1e4),),
            units={MASS: "kg", "width": "m"}, verdict=ended[1], index=k,
            values={MASS: mass / 7, WANTED: f"{hz} Hz"},
        )  # fmt: skip
        rows.append(row)
        (folder / f"run {k}").mkdir()
        (folder / f"run {k}" / "report.html").write_text("<title>one</title>")
    write_files(folder, rows, (MASS, WANTED))
    return folder / "index.html"


def select(browser: Any, plot: str, label: str, choice: str) -> None:
    """Choose in the field of this label, as a person does."""
    for field in browser.find_elements("css selector", f"{plot} label"):
        if field.text.startswith(label):
            field.find_element("css selector", "select").send_keys(choice)
            return
    raise AssertionError(label)


def marks(browser: Any, plot: str, kind: str) -> int:
    return len(browser.find_elements("css selector", f"{plot} svg {kind}"))


def said_at(browser: Any, plot: str, *keys: str) -> str:
    """What the plot says once these keys are pressed in it."""
    drawn = browser.find_element("css selector", f"{plot} svg")
    browser.execute_script("arguments[0].focus()", drawn)
    drawn.send_keys(*keys)
    return browser.find_element("css selector", f"{plot} .plot output").text


UP, RIGHT, ENTER = "\ue013", "\ue014", "\ue007"


def test_a_sweep_is_a_map_over_its_two_keys_and_lines_where_asked(browser, sweep):
    browser.get_log("browser")
    requests(browser)
    at(browser, sweep, 1200)
    assert "Sweep of arm" in browser.find_element("css selector", "h1").text
    spans = [li.text for li in browser.find_elements("css selector", "#spans li")]
    assert spans[0] == "tool.mass, 10 values from 0 to 1.286 kg"
    assert spans[1] == "targets.0.frequency, 5 values from 12 to 16 Hz"
    nearest = browser.find_element("css selector", "#nearest").text
    assert nearest.startswith("Nearest to its target is case 1, 0.1 % off at worst: tool.mass 0 kg")
    cells = "rect[fill^=rgb][stroke]"
    assert marks(browser, "#over", cells) == 50
    select(browser, "#over", "as", "lines")
    assert marks(browser, "#over", cells) == 0
    assert marks(browser, "#over", "path[fill=none][stroke-width='2']") == 5
    select(browser, "#over", "over", "targets")
    assert marks(browser, "#over", "path[fill=none][stroke-width='2']") == 10
    select(browser, "#over", "show", "width")
    assert "width [mm]" in browser.find_element("css selector", "#over svg").text
    assert [e for e in browser.get_log("browser") if e["level"] == "SEVERE"] == []
    assert requests(browser) == [sweep.as_uri()]


def test_points_are_named_under_the_pointer_and_by_keys_and_open_their_report(browser, sweep):
    at(browser, sweep, 1200)
    select(browser, "#cloud", "against", "tool.mass")
    assert marks(browser, "#cloud", "path") == 50
    assert said_at(browser, "#cloud", RIGHT).startswith("case 1\ntool.mass 0 kg\n")
    assert said_at(browser, "#cloud", RIGHT).startswith("case 7\n")
    assert said_at(browser, "#cloud", UP).endswith("worst error: 2.6 %\nReached")
    point = browser.find_elements("css selector", "#cloud svg path")[23]
    webdriver.ActionChains(browser).move_to_element(point).perform()
    hovered = browser.find_element("css selector", "#cloud .plot output").text
    assert hovered.startswith("case 24\ntool.mass 0.5714 kg\ntargets.0.frequency 15 Hz\n")
    assert said_at(browser, "#over", RIGHT, RIGHT).splitlines()[1:3] == [
        "tool.mass 0.1429 kg",
        "targets.0.frequency 12 Hz",
    ]
    browser.find_element("css selector", "#over svg").send_keys(ENTER)
    assert browser.title == "one"


def test_plots_show_what_the_filter_leaves(browser, sweep):
    at(browser, sweep, 1200)
    browser.find_element("css selector", "[data-word=Reached]").click()
    reached = len(names(browser))
    assert marks(browser, "#cloud", "path") == reached < 50
    browser.find_element("css selector", "input").send_keys("nothing of this kind")
    assert "no case that is shown" in browser.find_element("css selector", "#over .plot").text
    assert "no case that is shown" in browser.find_element("css selector", "#cloud .plot").text


def test_fields_have_labels_and_headings_are_in_order(browser, sweep):
    at(browser, sweep, 1200)
    fields = browser.find_elements("css selector", "select, input")
    assert len(fields) == 7
    assert all(field.accessible_name for field in fields)
    levels = "return [...document.querySelectorAll('h1, h2, h3')].map((h) => +h.tagName[1])"
    assert browser.execute_script(levels) == [1, 2, 2]
    assert all(svg.accessible_name for svg in browser.find_elements("css selector", "svg"))


# --- The page of a chart


def test_a_chart_begins_with_its_plot_and_draws_the_rest_where_it_is_reached(browser, pages):
    browser.get_log("browser")
    at(browser, pages["chart"], 1200)
    first = browser.find_element("css selector", ".plot")
    assert first.get_attribute("data-figure") == "plane"
    said = browser.find_element("css selector", ".verdict").text
    assert said.startswith("The paper's method")
    assert "Write order: 1 under expansion" in said
    assert len(browser.find_elements("css selector", "#answer .plot")) == 1
    time.sleep(2.0)
    assert browser.find_elements("css selector", "#answer .main-svg")
    last = browser.find_elements("css selector", ".plot")[-1]
    assert last.find_elements("css selector", ".main-svg") == []
    drawn(browser)
    assert [e for e in browser.get_log("browser") if e["level"] == "SEVERE"] == []
