"""Episodes as strips in Chromium: looked at, found, corrected, played with their video, saved."""

from __future__ import annotations

import base64
import csv

import pytest
from browser_samples import FILM, HOSTILE, ROW, center, settle, wait_for_text
from episode_samples import CAMERA, write_drawings
from studio_samples import Served, make_library

from browsing import violations_in_both, wait_until

#: The last span of the second episode, as the server has it.
KEPT = "async () => (await (await fetch('/api/episodes')).json()).episodes[1].spans.at(-1)"
NAMED = "document.querySelectorAll('#spans tbody tr').length"


@pytest.fixture(scope="module")
def film(pages):
    """Bytes of a video."""
    page = pages.new()
    video = base64.b64decode(page.evaluate(FILM))
    pages.leave("about:")
    return video


@pytest.fixture
def opened(opened, studio):
    """A function that opens a studio of recordings, in a window that has room for strips and a timeline."""

    def open_page(library, recordings, **options):
        Served.left.clear()  # a browser keeps the videos of an address for an hour
        options = {"width": 1440, "height": 900} | options
        page = opened(studio(library, recordings=recordings), "recordings", **options)
        wait_until(page, "!document.getElementById('episodes').hidden")
        settle(page)
        return page

    return open_page


def test_episodes_are_found_corrected_played_and_saved(opened, film, tmp_path):
    kinds = [(0, 1), (2, 0, 4), *[(1,)] * 21]
    demos = write_drawings(tmp_path / "demos", *kinds, video=film)
    (demos / f"videos/chunk-000/{CAMERA}/episode_000002.mp4").write_bytes(b"\0\0\0\x20ftypisom" + bytes(500))
    page = opened(make_library(tmp_path / "actions"), demos)
    assert page.inner_text("#episodes-facts") == "1 to 20 of 23 episodes"
    assert page.is_disabled("#save-corrections")
    page.locator(".strip").nth(1).click()
    wait_for_text(page, "#recording-name", "Episode 1: Wave")
    checked = page.eval_on_selector_all("#channels input:checked", "boxes => boxes.map((box) => box.value)")
    assert checked == ["x", "y"]  # as many as the library's movements have, of the state
    page.click("#spot")
    wait_until(page, f"{NAMED} === 3")
    names = [page.input_value(ROW.format(k, "input[type=text]")) for k in (1, 2, 3)]
    assert names == ["kind 2", "kind 0", ""]
    page.fill(ROW.format(3, "input[type=text]"), "a new one")  # unknown is named
    page.locator(ROW.format(3, "input[type=text]")).press("Tab")
    assert page.inner_text(ROW.format(3, "td:nth-child(4)")) == "–"
    settle(page)
    span = page.evaluate(KEPT)
    assert (span["label"], span["p"], span["confidence"]) == ("a new one", None, 1)
    before = float(page.input_value(ROW.format(3, "td:nth-child(2) input")))
    x, y = center(page, "[data-key='edge end']")
    page.mouse.move(x, y)
    page.mouse.down()
    page.mouse.move(x - 40, y, steps=4)
    page.mouse.up()
    assert float(page.input_value(ROW.format(3, "td:nth-child(2) input"))) < before
    assert page.inner_text(ROW.format(2, "td:nth-child(4)")) != "–"
    page.locator(ROW.format(2, "input[type=text]")).focus()
    page.locator("[data-key='edge end']").press("ArrowLeft")
    assert page.inner_text(ROW.format(2, "td:nth-child(4)")) == "–"  # it was that of the stretch that was found
    settle(page)
    assert "a new one" in page.locator(".strip-symbols").nth(1).inner_text()
    assert "corrected" in page.locator(".strip-symbols").nth(1).inner_text()
    page.click("#save-corrections")
    wait_until(
        page, "document.getElementById('toasts').textContent.includes('3 spans written to demos-corrections.csv')"
    )
    rows = list(csv.DictReader((tmp_path / "demos-corrections.csv").read_text().splitlines()))
    assert [(row["place"], row["symbol"]) for row in rows] == [
        ("episode 1", name) for name in (*names[:2], "a new one")
    ]
    page.click("#learn-spans")
    wait_until(page, "[...document.querySelectorAll('#names option')].some((option) => option.value === 'a new one')")
    page.click("#episodes-next")
    wait_for_text(page, "#episodes-facts", "21 to 23 of 23 episodes")
    assert page.locator(".strip:visible").count() == 3
    page.fill("#episodes-from", "2")
    page.locator("#episodes-from").press("Enter")
    wait_for_text(page, "#episodes-facts", "2 to 21 of 23 episodes")
    assert "a new one" in page.locator(".strip-symbols").nth(0).inner_text()


def test_a_playhead_goes_with_the_video_and_without_it(opened, film, tmp_path):
    demos = write_drawings(tmp_path / "demos", (0, 1), (2,), video=film)
    (demos / f"videos/chunk-000/{CAMERA}/episode_000001.mp4").write_bytes(b"\0\0\0\x20ftypisom" + bytes(500))
    page = opened(make_library(tmp_path / "actions"), demos)
    page.locator(".strip").nth(0).click()
    wait_until(page, "document.getElementById('video').videoWidth === 64")
    page.locator("#playhead").focus()
    page.keyboard.press("ArrowRight")
    page.keyboard.press("ArrowRight")
    assert page.inner_text("#playhead-text").startswith("0.20 of ")
    assert page.evaluate("video.currentTime") == pytest.approx(0.2, abs=0.06)
    assert page.evaluate("document.querySelector('.playhead').getBoundingClientRect().x > 0")
    page.locator("#timeline-canvas").focus()
    page.keyboard.press(" ")
    wait_for_text(page, "#play-recording", "Pause")
    wait_until(page, "document.getElementById('video').currentTime > 0.4")
    page.keyboard.press(" ")
    wait_for_text(page, "#play-recording", "Play")
    at, filmed = page.evaluate("[Number(playhead.value), video.currentTime]")
    assert at == pytest.approx(filmed, abs=0.2)
    page.keyboard.press("Shift+ArrowRight")
    assert page.evaluate("Number(playhead.value)") == pytest.approx(at + 1, abs=0.05)
    page.locator(".strip").nth(1).click()
    wait_until(page, "document.getElementById('video-note').textContent.includes('cannot play')")
    assert "(vp9)" in page.inner_text("#video-note")
    assert page.is_hidden("#video")
    page.click("#play-recording")
    wait_until(page, "Number(document.getElementById('playhead').value) > 0.3")  # the signals go on
    page.click("#play-recording")


def test_a_page_of_episodes_is_looked_through_and_what_was_corrected_stays(opened, tmp_path):
    demos = write_drawings(tmp_path / "demos", (0,), (1,), (2,))
    page = opened(make_library(tmp_path / "actions"), demos)
    page.locator(".strip").nth(1).click()
    wait_until(page, "!document.getElementById('recording').hidden")
    assert page.is_hidden("#video-part")
    page.click("#add-span")
    page.fill(ROW.format(1, "input[type=text]"), "by hand")
    page.locator(ROW.format(1, "input[type=text]")).press("Tab")
    page.click("#spot-page")
    wait_for_text(page, "#episodes-state", "Looked through 2 episodes.")
    said = [text.strip() for text in page.locator(".strip:visible .strip-symbols").all_inner_texts()]
    assert [said[0], said[2]] == ["kind 0", "kind 2"]
    assert "by hand" in said[1]
    page.click("#spot")  # asks first
    page.click("#ask button[value=no]")
    assert page.input_value(ROW.format(1, "input[type=text]")) == "by hand"
    page.reload()
    wait_until(page, "!document.getElementById('episodes').hidden")
    settle(page)
    assert "by hand" in page.locator(".strip-symbols").nth(1).inner_text()  # the server has kept it
    page.locator(".strip").nth(0).focus()
    page.keyboard.press("ArrowDown")
    assert page.evaluate("document.activeElement.dataset.key") == "episode-1"


def test_episodes_that_cannot_be_searched_stop_no_others(opened, tmp_path):
    demos = write_drawings(tmp_path / "demos", (0,), (1,), (2,))
    page = opened(make_library(tmp_path / "actions"), demos, tolerated=("400",))
    refusal = {"status": 400, "content_type": "application/json", "body": '{"error": "expected other stamps"}'}
    page.route("**/recordings/episode-1/spotted", lambda route: route.fulfill(**refusal))
    page.click("#spot-page")
    wait_for_text(page, "#episodes-state", "Looked through 2 episodes.")
    assert "Episode 1: expected other stamps" in page.inner_text("#toasts")
    page.route("**/spotted", lambda route: None)  # one that takes long
    page.click("#spot-page")
    wait_for_text(page, "#spot-page", "Cancel")
    page.click("#spot-page")
    wait_for_text(page, "#episodes-state", "Canceled after 0 episodes.")


def test_a_table_that_others_wrote_is_replaced_when_that_is_said(opened, tmp_path):
    demos = write_drawings(tmp_path / "demos", (0,))
    page = opened(make_library(tmp_path / "actions"), demos, tolerated=("409",))
    page.locator(".strip").nth(0).click()
    wait_until(page, "!document.getElementById('recording').hidden")
    page.click("#add-span")
    table = tmp_path / "demos-corrections.csv"
    table.write_text("theirs")
    page.click("#save-corrections")
    wait_for_text(page, "#ask-title", "Replace demos-corrections.csv?")
    assert table.read_text() == "theirs"
    page.click("#ask-yes")
    wait_until(page, "document.getElementById('toasts').textContent.includes('1 span written')")
    assert "episode 0" in table.read_text()


def test_strips_are_accessible_and_names_are_text(opened, tmp_path):
    demos = write_drawings(tmp_path / "demos", (0, 1), (2,), tasks=HOSTILE[:2])
    page = opened(make_library(tmp_path / "actions"), demos)
    page.locator(".strip").nth(0).click()
    wait_for_text(page, "#recording-name", f"Episode 0: {HOSTILE[0]}".strip())
    page.click("#spot")
    wait_until(page, f"{NAMED} === 2")
    for width in (390, 1440):
        page.set_viewport_size({"width": width, "height": 900})
        settle(page)
        assert page.evaluate("document.documentElement.scrollWidth") <= width
        assert violations_in_both(page) == [], width
