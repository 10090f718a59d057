"""A plain recording in Chromium: asked how it is read, named on the timeline, played beside a video, exported."""

from __future__ import annotations

import csv

import numpy as np
import pytest
from browser_samples import FILM, ROW, center, settle, wait_for_text
from episode_samples import drawn
from studio_samples import make_library

from browsing import violations_in_both, wait_until

#: How many pixels of the picture of the shape are painted.
INKED = """() => {
  const canvas = document.getElementById("shape");
  const pixels = canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height).data;
  return pixels.reduce((sum, value, k) => sum + (k % 4 === 3 && value > 0 ? 1 : 0), 0);
}"""
PICTURE = """(id) => document.getElementById(id).toDataURL()"""
SPANS = "document.querySelectorAll('#spans tbody tr').length"


@pytest.fixture
def opened(opened, studio, tmp_path):
    """A function that opens the view Recordings of a studio."""

    def open_page(**options):
        page = opened(
            studio(make_library(tmp_path / f"actions{len(list(tmp_path.iterdir()))}")), "recordings", **options
        )
        settle(page)
        return page

    return open_page


def _file(name, *kinds, heads="", times=False):
    """A file of drawings with rests, as a browser sends it; without times 40 samples are a second."""
    rows, _ = drawn(*kinds)
    rows = np.column_stack((np.arange(len(rows)) / 40, rows)) if times else rows
    lines = [heads] if heads else []
    text = "\n".join([*lines, *(",".join(f"{value:.6f}" for value in row) for row in rows)])
    return {"name": name, "mimeType": "text/csv", "buffer": text.encode()}


def test_a_table_without_times_is_asked_for_them_and_opens(opened):
    page = opened()
    page.set_input_files("#file", _file("drawn.csv", 0, 2))
    wait_for_text(page, "#importing-title", "How is drawn.csv read?")
    assert page.inner_text("#importing-text").startswith("The columns of this file have no names.")
    assert page.locator("#importing-rows tbody tr").count() == 8
    assert page.is_checked("#importing input[name=time][value='']")
    assert page.locator("#importing input[name=columns]:checked").count() == 2
    assert page.is_hidden("#importing select[name=units]")  # there are no times to have one
    page.check("#importing input[name=time][value='column 1']")
    assert page.is_visible("#importing select[name=units]")
    assert page.is_hidden("#importing input[name=rate]")
    page.check("#importing input[name=time][value='']")
    page.fill("#importing input[name=rate]", "40")
    page.select_option("#importing select[name=measured_in]", "mm")
    page.keyboard.press("Escape")
    wait_for_text(page, "#drop-state", "drawn.csv was not opened.")
    page.set_input_files("#file", _file("drawn.csv", 0, 2))
    wait_until(page, "document.getElementById('importing').open")
    page.fill("#importing input[name=rate]", "40")
    page.select_option("#importing select[name=measured_in]", "mm")
    page.click("#importing .main")
    wait_for_text(page, "#recording-name", "drawn.csv")
    assert "40 samples a second" in page.inner_text("#recording-facts")
    assert "mm" in page.inner_text("#channels")
    assert page.is_hidden('[aria-label="What was found"]')  # nothing was, and nothing takes the focus
    duration = page.inner_text("#playhead-text").split(" of ")[1]
    wait_for_text(page, "#shape-name", f"0.00 to {duration}: no annotation")  # no longer than the recording
    page.click("text=How it was read")
    assert "--units 0.025" in page.inner_text("#shell")
    assert "--measured-in mm" in page.inner_text("#shell")
    page.click("#read-as")
    page.fill("#importing input[name=rate]", "80")
    page.click("#importing .main")
    wait_until(page, "document.getElementById('recording-facts').textContent.includes('80 samples')")


def test_what_is_refused_in_the_dialog_is_said_there(opened):
    page = opened(tolerated=("400",))
    page.set_input_files("#file", _file("drawn.csv", 0, heads="x,y"))
    wait_until(page, "document.getElementById('importing').open")
    page.check("#importing input[name=time][value=x]")
    page.uncheck("#importing input[name=columns][value=x]")
    page.click("#importing .main")
    wait_until(page, "document.getElementById('importing-wrong').textContent.includes('strictly increasing')")
    assert page.evaluate("document.getElementById('importing').open")


def test_annotations_are_added_renamed_moved_removed_undone_and_exported_by_the_keyboard(opened, tmp_path):
    page = opened()
    page.set_input_files("#file", _file("drawn.csv", 0, 2, 1, heads="t,x,y", times=True))
    wait_for_text(page, "#recording-name", "drawn.csv")
    assert page.is_hidden("#save-part")
    assert page.is_disabled("#undo-span")
    page.click("#spot")
    wait_until(page, f"{SPANS} === 3")
    settle(page)
    assert [page.inner_text(ROW.format(k, "td:nth-child(4)")) for k in (1, 2, 3)] == [
        "looks like"
    ] * 3  # three of each are too few to be sure
    page.locator("#timeline-canvas").focus()
    page.keyboard.press("ArrowDown")
    page.keyboard.press("ArrowDown")
    before = page.evaluate(PICTURE, "timeline-canvas")
    begin = page.input_value(ROW.format(2, "td:nth-child(1) input"))
    page.locator("[data-key='edge begin']").press("ArrowLeft")
    settle(page)
    assert page.evaluate(PICTURE, "timeline-canvas") != before
    moved = page.input_value(ROW.format(2, "td:nth-child(1) input"))
    assert float(moved) < float(begin)
    page.locator("[data-key='edge begin']").press("Delete")
    assert page.evaluate(SPANS) == 2
    page.keyboard.press("Control+z")
    assert page.evaluate(SPANS) == 3
    assert page.input_value(ROW.format(2, "td:nth-child(1) input")) == moved
    page.keyboard.press("Control+z")
    assert page.input_value(ROW.format(2, "td:nth-child(1) input")) == begin
    assert page.inner_text(ROW.format(2, "td:nth-child(4)")) == "looks like"
    page.keyboard.press("Control+Shift+Z")
    assert page.input_value(ROW.format(2, "td:nth-child(1) input")) == moved
    page.locator("#timeline-canvas").focus()
    page.keyboard.press("Shift+ArrowRight")
    page.keyboard.press("Insert")
    page.keyboard.type("by hand")
    page.keyboard.press("Tab")
    assert page.is_disabled("#redo-span")  # what was taken back is gone
    settle(page)
    page.select_option("#save-format", "csv")
    with page.expect_download() as download:
        page.click("#save-spans")
    assert download.value.suggested_filename == "drawn_csv-labels.csv"
    download.value.save_as(tmp_path / "labels.csv")
    rows = list(csv.DictReader((tmp_path / "labels.csv").read_text().splitlines()))
    assert sorted(row["symbol"] for row in rows) == ["by hand", "kind 0", "kind 1", "kind 2"]
    assert [row["symbol"] for row in rows if not row["p_value"]] == ["by hand", "kind 2"]
    for _ in range(8):
        page.click("#undo-span") if page.is_enabled("#undo-span") else None
    assert page.evaluate(SPANS) == 0


def test_a_time_that_is_typed_stays_in_the_recording_and_on_its_side_of_the_other(opened):
    page = opened()
    page.set_input_files("#file", _file("drawn.csv", 0, heads="t,x,y", times=True))
    wait_for_text(page, "#recording-name", "drawn.csv")
    end = float(page.inner_text("#playhead-text").split(" of ")[1].removesuffix(" s"))
    page.click("#add-span")
    shown = []
    for part, text in (("begin", "1"), ("end", "0.2"), ("end", "900"), ("begin", "-3"), ("begin", "0.5"), ("end", "")):
        page.fill(f"[data-key='span 0 {part}']", text)
        page.keyboard.press("Tab")
        shown.append([page.input_value(f"[data-key='span 0 {part}']") for part in ("begin", "end")])
    last = f"{end:.2f}"
    assert shown == [
        ["1.00", last],
        ["1.00", "1.02"],
        ["1.00", last],
        ["0.00", last],
        ["0.50", last],
        ["0.50", last],
    ]


def test_a_finger_drags_an_edge_and_the_shape_follows(opened):
    page = opened(width=390, height=844, has_touch=True)
    page.set_input_files("#file", _file("drawn.csv", 0, 2, heads="t,x,y", times=True))
    wait_for_text(page, "#recording-name", "drawn.csv")
    page.click("#spot")
    wait_until(page, f"{SPANS} === 2")
    settle(page)
    page.locator("#spans tbody tr").nth(0).locator("td").nth(3).evaluate("cell => cell.click()")
    page.locator("[data-key='edge end']").scroll_into_view_if_needed()
    x, y = center(page, "[data-key='edge end']")
    end = float(page.input_value(ROW.format(1, "td:nth-child(2) input")))
    finger = page.context.new_cdp_session(page)
    for kind, at in (("touchStart", x), ("touchMove", x + 10), ("touchMove", x + 20), ("touchEnd", None)):
        points = [] if at is None else [{"x": at, "y": y}]
        finger.send("Input.dispatchTouchEvent", {"type": kind, "touchPoints": points})
    settle(page)
    assert float(page.input_value(ROW.format(1, "td:nth-child(2) input"))) > end
    assert page.evaluate("document.documentElement.scrollWidth") <= 390


def test_a_marker_goes_along_the_shape_and_a_video_of_the_person_beside_it(opened, pages, tmp_path):
    page = opened()
    (tmp_path / "film.webm").write_bytes(
        bytes(page.evaluate(f"async () => [...Uint8Array.from(atob(await ({FILM})()), (c) => c.charCodeAt(0))]"))
    )
    page.set_input_files("#file", _file("drawn.csv", 0, 2, heads="t,x,y", times=True))
    wait_for_text(page, "#recording-name", "drawn.csv")
    settle(page)
    wait_until(page, f"({INKED})() > 200")
    page.click("#spot")
    wait_until(page, f"{SPANS} === 2")
    page.locator("#playhead").fill("1.2")
    settle(page)
    wait_until(page, "document.getElementById('shape-name').textContent.endsWith(': kind 0')")
    first = page.evaluate(PICTURE, "shape")
    page.locator("#playhead").press("ArrowRight")
    wait_until(page, "first => document.getElementById('shape').toDataURL() !== first", first)
    assert page.is_hidden("#video-part")
    page.set_input_files("#own-video", tmp_path / "film.webm")
    wait_until(page, "document.getElementById('video').videoWidth === 64")
    page.fill("#video-start", "-1")
    page.locator("#playhead").fill("1.5")
    wait_until(page, "Math.abs(document.getElementById('video').currentTime - 0.5) < 0.06")
    page.locator("#playhead").fill("0.6")
    page.click("#play-recording")  # the video begins when the recording is at 1 s
    wait_until(page, "Number(document.getElementById('playhead').value) > 0.8")
    wait_until(page, "document.getElementById('video').currentTime > 0.2")
    at, film = page.evaluate("[Number(playhead.value), document.getElementById('video').currentTime]")
    assert at == pytest.approx(film + 1, abs=0.25)
    page.click("#play-recording")
    page.set_input_files("#file", _file("other.csv", 1, heads="t,x,y", times=True))
    wait_for_text(page, "#recording-name", "other.csv")
    assert page.is_hidden("#video-part")  # it was of the other recording


def test_the_view_and_its_dialog_are_accessible_and_few_controls_are_offered_at_first(opened):
    page = opened()
    enabled = """[...document.querySelectorAll("button, input, select, textarea, a[href], summary")]
      .filter((part) => part.checkVisibility() && !part.disabled).length"""
    assert page.evaluate(enabled) <= 20
    page.set_input_files("#file", _file("drawn.csv", 0, 2, heads="x,y"))
    wait_until(page, "document.getElementById('importing').open")
    for width in (390, 1440):
        page.set_viewport_size({"width": width, "height": 900})
        settle(page)
        assert page.evaluate("document.documentElement.scrollWidth") <= width
        assert violations_in_both(page) == [], width
    page.click("#importing .main")
    wait_for_text(page, "#recording-name", "drawn.csv")
    assert page.evaluate(enabled) <= 20
    page.click("#add-span")
    settle(page)
    assert violations_in_both(page) == []
