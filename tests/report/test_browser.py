"""The page in a real browser: nothing to complain about, every figure drawn, hover and pick work, on a desk
and on a telephone, light and dark.

It takes Debian's `chromium` and `chromium-driver`, and skips where they are not installed.
"""

from __future__ import annotations

import shutil
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from helpers.real_sets import classic
from orthoscope.evaluation.evaluate import Evaluation, evaluate
from orthoscope.files.images import names_of, photographs, write_image
from orthoscope.methods.fccm import fccm
from orthoscope.report.page import write_report
from orthoscope.report.pictures import pictures_of

CHROMIUM = next(
    (path for name in ("chromium", "chromium-browser", "google-chrome") if (path := shutil.which(name))), ""
)
DRIVER = shutil.which("chromedriver") or ""
pytestmark = pytest.mark.skipif(
    not (CHROMIUM and DRIVER), reason="no browser: apt-get install chromium chromium-driver"
)
WIDE, PHONE = (1280, 860), (390, 844)
KINDS = ("ordinary", "suspicious", "fisheye", "single", "unheld", "misshapen", "shaped")


class Browser:
    """A headless Chromium that looks at one page after the other."""

    def __init__(self, driver: Any) -> None:
        self.driver = driver

    def open(self, path: Path, size: tuple[int, int] = WIDE, *, dark: bool = False) -> None:
        """Shows a page of a file, drawn to the end."""
        width, height = size
        metrics = {"width": width, "height": height, "deviceScaleFactor": 1, "mobile": width < 500}
        scheme = [{"name": "prefers-color-scheme", "value": "dark" if dark else "light"}]
        self.driver.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", metrics)
        self.driver.execute_cdp_cmd("Emulation.setEmulatedMedia", {"features": scheme})
        self.driver.get(path.as_uri())
        for _ in range(100):
            if not self.run(
                "return [...document.querySelectorAll('figure canvas')].filter(c => !c.dataset.drawn).length"
            ):
                return
            time.sleep(0.05)
        raise AssertionError("some figures were never drawn")

    def run(self, script: str, *arguments: Any) -> Any:
        return self.driver.execute_script(script, *arguments)

    @property
    def complaints(self) -> list[str]:
        """What the console has said since it was last asked."""
        return [entry["message"] for entry in self.driver.get_log("browser")]

    def point(self, selector: str, x: float, y: float, kind: str = "pointermove") -> None:
        """A pointer event at a place of a canvas, as shares of its width and height."""
        self.run(
            "const c = document.querySelector(arguments[0]), b = c.getBoundingClientRect();"
            " const at = {clientX: b.left + arguments[1] * b.width, clientY: b.top + arguments[2] * b.height,"
            " bubbles: true, pointerId: 1}; c.setPointerCapture = () => {};"
            " for (const kind of arguments[3]) c.dispatchEvent(new PointerEvent(kind, at));",
            selector,
            x,
            y,
            ["pointerdown", "pointerup"] if kind == "click" else [kind],
        )

    @property
    def sideways(self) -> int:
        """By how many pixels the page is wider than the window."""
        return self.run("const e = document.documentElement; return e.scrollWidth - e.clientWidth")

    @property
    def tip(self) -> str:
        """What stands beside the pointer."""
        return self.run("const t = document.getElementById('tip'); return t.hidden ? '' : t.textContent")

    @property
    def picked(self) -> list[int]:
        """The photographs that are picked."""
        return self.run(
            "return [...document.querySelectorAll('.shot.picked')].map(s => Number(s.dataset.view))"
        )


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    from selenium import webdriver

    options = webdriver.ChromeOptions()
    options.binary_location = CHROMIUM
    for argument in ("--headless=new", "--no-sandbox", "--disable-gpu", "--disable-dev-shm-usage"):
        options.add_argument(argument)
    options.set_capability("goog:loggingPrefs", {"browser": "ALL"})
    driver = webdriver.Chrome(options=options, service=webdriver.ChromeService(DRIVER))
    yield Browser(driver)
    driver.quit()


@pytest.fixture(scope="module")
def folder(every_evaluation, tmp_path_factory) -> Path:
    """The pages of evaluations made by hand, `ordinary` with photographs."""
    folder = tmp_path_factory.mktemp("pages")
    for name, evaluation in every_evaluation.items():
        write_report(evaluation, folder / f"{name}.html")
    ordinary = every_evaluation["ordinary"]
    write_report(ordinary, folder / "ordinary.html", pictures=shown(ordinary, folder))
    return folder


def shown(evaluation: Evaluation, folder: Path):
    """Pictures of all views: a ramp, for want of photographs."""
    width, height = evaluation.calibration.camera.image_size
    ramp = (np.add.outer(np.arange(height), np.arange(width)) / (width + height) * 255).astype(np.uint8)
    files = {view.image: folder / view.image for view in evaluation.calibration.detections.views}
    for path in files.values():
        write_image(path, ramp)
    return pictures_of(evaluation.calibration, files)


def assert_drawn(browser: Browser) -> None:
    """No complaint, every canvas has marks of more than one colour, and no text is smaller than 12 px."""
    assert browser.complaints == []
    blank = browser.run(
        "return [...document.querySelectorAll('figure canvas')].filter(c => {"
        " const d = c.getContext('2d').getImageData(0, 0, c.width, c.height).data, seen = new Set();"
        " for (let i = 0; i < d.length; i += 4) seen.add(d[i] << 24 | d[i+1] << 16 | d[i+2] << 8 | d[i+3]);"
        " return seen.size < 4; }).map(c => c.closest('figure').id)"
    )
    assert blank == []
    small = browser.run(
        "return [...document.querySelectorAll('body *')].filter(e => e.offsetParent && [...e.childNodes]"
        ".some(n => n.nodeType === 3 && n.data.trim()) && parseFloat(getComputedStyle(e).fontSize) < 12)"
        ".map(e => e.outerHTML.slice(0, 80))"
    )
    assert small == []


@pytest.mark.parametrize("kind", KINDS)
def test_every_figure_is_drawn_and_the_console_is_silent(browser, folder, kind):
    browser.open(folder / f"{kind}.html")
    assert_drawn(browser)


@pytest.mark.parametrize("dark", [False, True])
def test_on_a_telephone_nothing_scrolls_sideways(browser, folder, dark):
    for kind in ("ordinary", "shaped"):
        browser.open(folder / f"{kind}.html", PHONE, dark=dark)
        assert browser.sideways == 0
        assert_drawn(browser)


def test_words_stand_out_from_what_is_behind_them_in_the_light_and_in_the_dark(browser, folder):
    for dark in (False, True):
        browser.open(folder / "suspicious.html", dark=dark)
        contrast = browser.run(CONTRAST)
        assert min(contrast.values()) >= 4.5, contrast  # WCAG 2.1, AA


def test_the_pointer_is_told_the_value_and_a_photograph_picked_in_one_figure_is_picked_in_all(
    browser, folder
):
    browser.open(folder / "ordinary.html")
    assert browser.picked == []
    browser.point("#by-view canvas", 0.5, 0.55)
    assert "rms" in browser.tip
    number = int(browser.tip.split()[0])
    before = browser.run(PIXELS)
    browser.point("#by-view canvas", 0.5, 0.55, "click")
    assert browser.picked == [number - 1]
    time.sleep(0.3)
    after = browser.run(PIXELS)
    assert {name for name in ("by-view", "vectors", "poses") if before[name] == after[name]} == set()
    browser.point("#by-view canvas", 0.5, 0.55, "click")
    assert browser.picked == []


def test_by_keyboard_photographs_are_gone_through_and_opened(browser, folder):
    from selenium.webdriver.common.by import By
    from selenium.webdriver.common.keys import Keys

    browser.open(folder / "ordinary.html")
    canvas = browser.driver.find_element(By.CSS_SELECTOR, "#vectors canvas")
    canvas.send_keys(Keys.ARROW_RIGHT, Keys.ARROW_RIGHT)
    assert browser.picked == [1]
    assert "left02.jpg" in browser.run("return document.querySelector('[role=status]').textContent")
    canvas.send_keys(Keys.ENTER)
    assert browser.run("return document.querySelector('dialog').open")
    browser.driver.switch_to.active_element.send_keys(Keys.ARROW_RIGHT)
    assert browser.run("return document.querySelector('dialog h2').textContent") == "3 left03.jpg"
    browser.driver.switch_to.active_element.send_keys(Keys.ESCAPE)
    assert not browser.run("return document.querySelector('dialog').open")
    canvas.send_keys(Keys.ESCAPE)
    assert browser.picked == []
    assert browser.complaints == []


def test_a_photograph_left_out_leaves_the_figures_and_the_command_is_told(browser, folder):
    browser.open(folder / "ordinary.html")
    assert browser.run("return document.getElementById('left-out').hidden")
    before = browser.run(PIXELS)
    for view in (4, 1):
        browser.run(f"document.querySelector('[data-view=\"{view}\"] .leave-out').click()")
    time.sleep(0.3)
    told = browser.run("return document.querySelector('#left-out code').textContent")
    assert told == "orthoscope calibrate detections.json --without left02.jpg --without left05.jpg"
    assert browser.run(PIXELS)["by-place"] != before["by-place"]


def test_zoom_by_keys_and_back(browser, folder):
    from selenium.webdriver.common.by import By

    browser.open(folder / "ordinary.html")
    canvas = browser.driver.find_element(By.CSS_SELECTOR, "#displacement canvas")
    whole = browser.run(PIXELS)["displacement"]
    canvas.send_keys("++")
    time.sleep(0.3)
    assert browser.run(PIXELS)["displacement"] != whole
    canvas.send_keys("0")
    time.sleep(0.3)
    assert browser.run(PIXELS)["displacement"] == whole


def test_on_narrower_paper_figures_keep_their_shape(browser, folder):
    """A printer lays the page out anew and asks nobody to draw again."""
    browser.open(folder / "ordinary.html")
    stretched = browser.run(
        "document.body.style.width = '640px';"
        " return [...document.querySelectorAll('figure canvas')].filter(c => c.clientWidth)"
        ".map(c => c.clientWidth / c.clientHeight / (c.width / c.height));"
    )
    assert len(stretched) > 5
    assert stretched == pytest.approx([1.0] * len(stretched), abs=0.02)  # whole pixels


def test_tabs_show_the_camera_for_each_tool_and_it_is_copied(browser, folder):
    browser.open(folder / "ordinary.html")
    browser.run(
        "window.copied = []; Object.defineProperty(navigator, 'clipboard', {value: {writeText: async t =>"
        " copied.push(t)}}); document.getElementById('tab-2').click(); document.querySelector('.camera"
        " .copy').click();"
    )
    time.sleep(0.1)
    (text,) = browser.run("return window.copied")
    assert text.startswith("import numpy as np\n\nK = np.array([[536.1")
    assert browser.run("return [...document.querySelectorAll('[role=tabpanel]')].map(p => p.hidden)") == [
        True,
        True,
        False,
    ]


def test_every_picture_and_control_has_a_name_for_those_who_hear_the_page(browser, folder):
    browser.open(folder / "ordinary.html")
    nameless = browser.run(
        "return [...document.querySelectorAll('canvas, button, select, input')].filter(e =>"
        " !(e.getAttribute('aria-label') || e.textContent.trim() || e.closest('label') &&"
        " e.closest('label').textContent.trim())).map(e => e.outerHTML.slice(0, 90))"
    )
    assert nameless == []
    assert browser.run("return document.querySelectorAll('h1').length") == 1


@pytest.mark.slow
def test_two_hundred_photographs_make_a_page_below_six_megabytes_that_is_soon_there(
    browser, two_hundred, tmp_path
):
    path = tmp_path / "many.html"
    write_report(two_hundred, path, pictures=shown(two_hundred, tmp_path))
    assert path.stat().st_size < 6_000_000
    for size in (WIDE, PHONE):
        browser.open(path, size)
        assert_drawn(browser)
        assert browser.sideways == 0


@pytest.mark.slow
@pytest.mark.datasets
@pytest.mark.parametrize("name", ["opencv-left", "calibrel", "fisheye-180"])
def test_pages_of_real_photographs_are_drawn(browser, datasets, tmp_path, name):
    evaluation = evaluate(fccm(classic(datasets, name)))
    files = photographs(datasets / name)
    pictures = pictures_of(evaluation.calibration, dict(zip(names_of(files), files, strict=True)))
    write_report(evaluation, tmp_path / "page.html", pictures=pictures)
    assert len(pictures.small) == len(evaluation.views)
    assert (tmp_path / "page.html").stat().st_size < 75_000 * max(len(files), 20)  # 1.5 MB for 20 photographs
    for size, dark in ((WIDE, False), (PHONE, True)):
        browser.open(tmp_path / "page.html", size, dark=dark)
        assert_drawn(browser)
        assert browser.sideways == 0
    browser.run("document.querySelector('.shot .open').click()")
    time.sleep(0.3)
    browser.point("#shot canvas", 0.5, 0.5)
    assert browser.complaints == []


PIXELS = (
    "return Object.fromEntries([...document.querySelectorAll('figure canvas')].map(c =>"
    " [c.closest('figure').id, c.toDataURL()]))"
)
CONTRAST = """
const light = c => { const v = c.map(x => { x /= 255;
  return x <= .04045 ? x / 12.92 : ((x + .055) / 1.055) ** 2.4; });
  return .2126 * v[0] + .7152 * v[1] + .0722 * v[2]; };
const numbers = c => c.match(/[\\d.]+/g).map(Number);
const behind = e => { for (; e; e = e.parentElement) { const c = numbers(getComputedStyle(e).backgroundColor);
  if (c.length < 4 || c[3] === 1) return c.slice(0, 3); } return [255, 255, 255]; };
const found = {};
for (const e of document.querySelectorAll('body *')) {
  if (!e.offsetParent || ![...e.childNodes].some(n => n.nodeType === 3 && n.data.trim())) continue;
  if (e.closest('.open')) continue;  // over a photograph, on its own dark ground
  const a = light(numbers(getComputedStyle(e).color).slice(0, 3)), b = light(behind(e));
  const ratio = (Math.max(a, b) + .05) / (Math.min(a, b) + .05), what = e.tagName + '.' + e.className;
  found[what] = Math.min(found[what] ?? 21, ratio);
}
return found;
"""
