"""Reports in a real browser: no error, no request, nothing too wide, sliders and keys that work."""

from __future__ import annotations

import json
import shutil
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from eigassign.cli import main
from eigassign.output import CaseOutcome, to_line, write_files

webdriver = pytest.importorskip("selenium.webdriver", reason="selenium is not installed")
BROWSER, DRIVER = shutil.which("chromium"), shutil.which("chromedriver")
pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(not (BROWSER and DRIVER), reason="no Chromium with its driver installed"),
]
CASES = ("two_link", "arm_6r", "milling_column")
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
    """Scroll through the page until every plot on it is there."""
    boxes = browser.find_elements("css selector", ".plot")
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


@pytest.mark.parametrize("width", WIDTHS)
def test_nothing_is_wider_than_the_window(browser, reports, width):
    at(browser, reports["two_link"], width)
    drawn(browser)
    assert browser.execute_script("return document.documentElement.scrollWidth") <= width


def test_sliders_move_the_mechanism_by_keys_too(browser, reports):
    at(browser, reports["two_link"], 1200)
    drawn(browser)
    player = browser.find_element("css selector", "[data-moving]")
    browser.execute_script("arguments[0].scrollIntoView()", player)
    button = player.find_element("css selector", ".tools button")
    time.sleep(0.5)
    if button.text == "Pause":
        button.click()
    said = player.find_element("css selector", "output")
    slider = player.find_element("css selector", "input[name=time]")
    browser.execute_script(
        "arguments[0].value = 0; arguments[0].dispatchEvent(new Event('input'))", slider
    )
    before = said.text
    slider.send_keys("\ue010")  # End
    assert before.startswith("0.00 s")
    assert said.text.startswith("1.00 s")
    assert slider.get_attribute("aria-valuetext") == said.text
    curve = "return arguments[0].querySelector('.plot').data.find((t) => t.name === 'mode 1').x[5]"
    there = browser.execute_script(curve, player)
    phase = player.find_element("css selector", "input[name=phase]")
    phase.send_keys("\ue011")  # Home
    assert browser.execute_script(curve, player) != there


def test_what_a_plot_says_under_the_pointer_is_the_frequency(browser, reports):
    at(browser, reports["two_link"], 1200)
    drawn(browser)
    box = browser.find_element("css selector", ".plot[data-figure=assignment_mode_1]")
    browser.execute_script(
        "arguments[0].scrollIntoView(); Plotly.Fx.hover(arguments[0], {xval: 1})", box
    )
    said = box.find_element("css selector", ".hoverlayer").text
    final = json.loads((reports["two_link"].parent / "results.json").read_text())
    assert f"{final['frequencies']['exact_hz'][-1]:.5g}"[:5] in said


def test_without_motion_wanted_nothing_moves(browser, reports):
    quiet = [{"name": "prefers-reduced-motion", "value": "reduce"}]
    browser.execute_cdp_cmd("Emulation.setEmulatedMedia", {"features": quiet})
    at(browser, reports["two_link"], 1200)
    drawn(browser)
    time.sleep(0.5)
    assert browser.find_element("css selector", "[data-moving] .tools button").text == "Play"
    browser.execute_cdp_cmd("Emulation.setEmulatedMedia", {"features": []})


@pytest.fixture(scope="module")
def batch(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder, rows = tmp_path_factory.mktemp("batch"), []
    for k in range(450):
        status = "failed" if k % 100 == 7 else "ok"
        values = {"mechanism.bodies.tool.mass": f"{(k * 7) % 450} g"}
        run = "run" if k == 0 else None
        row = CaseOutcome(f"tool={k}", "arm.yaml", status, 0.1, run_folder=run, values=values)
        rows.append(to_line(replace(row, index=k)))
    (folder / "run" / "figures").mkdir(parents=True)
    shutil.copy(Path(__file__).parents[2] / "cases" / "two_link.png", folder / "run" / "figures")
    (folder / "run" / "figures" / "two_link.png").rename(
        folder / "run" / "figures" / "frequencies.png"
    )
    write_files(folder, rows, len(rows), ("mechanism.bodies.tool.mass",))
    return folder / "index.html"


def names(browser: Any) -> list[str]:
    return browser.execute_script(
        "return [...document.querySelectorAll('td.case')].map((cell) => cell.textContent)"
    )


def test_rows_of_a_batch_sort_by_size_and_filter_by_words_and_status(browser, batch):
    browser.get_log("browser")
    at(browser, batch, 1200)
    assert names(browser)[:2] == ["tool=0", "tool=1"]
    mass = browser.find_element("css selector", "[data-column='tool.mass']")
    mass.find_element("css selector", "button").click()
    assert names(browser)[1] == "tool=193"  # 193 · 7 = 1351 = 3 · 450 + 1
    mass.find_element("css selector", "button").click()
    assert mass.get_attribute("aria-sort") == "descending"
    assert len(names(browser)) == 200
    browser.find_element("css selector", ".more button").click()
    assert len(names(browser)) == 400
    browser.find_element("css selector", "[data-status=failed]").click()
    assert sorted(names(browser)) == [f"tool={k}07" if k else "tool=7" for k in (1, 2, 3, 4, 0)]
    browser.find_element("css selector", "input").send_keys("tool=3")
    assert names(browser) == ["tool=307"]
    assert [e for e in browser.get_log("browser") if e["level"] == "SEVERE"] == []


def test_a_batch_shows_small_pictures_and_is_no_wider_than_the_window(browser, batch):
    for width in WIDTHS:
        at(browser, batch, width)
        assert browser.execute_script("return document.documentElement.scrollWidth") <= width
    time.sleep(0.5)
    wide = browser.execute_script("return document.querySelector('td img').naturalWidth")
    assert wide > 0
