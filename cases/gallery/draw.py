"""Draw the first screen of the report of every shipped case.

    python cases/gallery/draw.py              all of them: a quarter of an hour
    python cases/gallery/draw.py two_link     these

The screens need Chromium with its driver, and selenium (`pip install '.[dev]'`).
"""

from __future__ import annotations

import io
import shutil
import sys
import tempfile
from contextlib import closing
from pathlib import Path
from typing import Any

from PIL import Image

import eigassign as ea
from eigassign.cli import main as eigassign

HERE = Path(__file__).parent
WINDOW, WIDTH = (1240, 900), 660  # pixels of the window, and of the picture of it
COLOURS = 128  # of a picture: all of them are 2 MB at most
QUIET = ("--headless=new", "--no-sandbox", "--no-first-run", "--disable-background-networking",
         "--disable-component-update", "--disable-sync", "--hide-scrollbars")  # fmt: skip


def main(names: list[str]) -> None:
    """A PNG a case, beside this file."""
    paths = [path for path in sorted(HERE.parent.glob("*.yaml")) if not names or path.stem in names]
    with tempfile.TemporaryDirectory() as folder, closing(Browser()) as browser:
        for path in paths:
            out = Path(folder, path.stem)
            command = "update" if ea.load_case(path).file.measurements else "optimize"
            eigassign([command, str(path), "--out", str(out), "--figures", "png", "--quiet"])
            (HERE / f"{path.stem}_report.png").write_bytes(browser.screen(out / "report.html"))


class Browser:
    """Chromium without a window."""

    def __init__(self) -> None:
        from selenium import webdriver

        options = webdriver.ChromeOptions()
        options.binary_location = shutil.which("chromium") or ""
        for argument in QUIET:
            options.add_argument(argument)
        service = webdriver.ChromeService(shutil.which("chromedriver"))
        self.driver: Any = webdriver.Chrome(options=options, service=service)

    def screen(self, page: Path) -> bytes:
        """The first screen of a page, at rest and in the middle of its motion, as PNG."""
        still = [{"name": "prefers-reduced-motion", "value": "reduce"}]
        self.driver.execute_cdp_cmd("Emulation.setEmulatedMedia", {"features": still})
        size = {"width": WINDOW[0], "height": WINDOW[1], "deviceScaleFactor": 1, "mobile": False}
        self.driver.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", size)
        self.driver.get(page.resolve().as_uri())
        self.driver.implicitly_wait(20)
        self.driver.find_element("css selector", ".plot .main-svg")
        middle = """const t = document.querySelector("[name=time]");
          if (t) { t.value = t.max / 2; t.dispatchEvent(new Event("input")); }"""
        self.driver.execute_script(middle)
        shot = Image.open(io.BytesIO(self.driver.get_screenshot_as_png())).convert("RGB")
        small = shot.resize(
            (WIDTH, round(WIDTH * shot.height / shot.width)), Image.Resampling.LANCZOS
        )
        data = io.BytesIO()
        small.quantize(COLOURS).save(data, "PNG", optimize=True)
        return data.getvalue()

    def close(self) -> None:
        """End it."""
        self.driver.quit()


if __name__ == "__main__":
    main(sys.argv[1:])
