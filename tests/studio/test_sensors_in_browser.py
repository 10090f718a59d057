"""A phone, a gamepad and a hand draw in the studio in Chromium."""

from __future__ import annotations

import json
import runpy
import sys
import time
from collections import namedtuple
from contextlib import contextmanager
from types import ModuleType, SimpleNamespace

import numpy as np
import pytest
from browser_samples import ANSWERED, PIXELS, SHOWN, Hand, center, letters, make_letters, settle, wait_for_text
from studio_samples import BEARER, ROOT

import kineme
from browsing import violations_in_both, wait_until

FIRST = ".rank:first-child .rank-name"
REACH = 1.6  # of the phone as a wand, heights of the canvas for a turn by 1 rad


@pytest.fixture
def allowed():
    """The server of the phone, too."""
    return "https://127.0.0.1:", "data:"


@pytest.fixture
def opened(opened, studio, tmp_path):
    """A studio of letters and its page."""
    served = studio(make_letters(tmp_path / "letters"))
    return served, opened(served)


def _path(n=40, shape="GShape"):
    """A letter (n, 2), as high as a canvas is, from the origin."""
    positions = letters(shape)[SHOWN].positions
    picked = positions[np.linspace(0, len(positions) - 1, n).astype(int)]
    return (picked - picked[0]) / np.ptp(picked, axis=0).max()


@pytest.fixture
def phone(opened, pages):
    """The page that a phone opens when it has scanned the code."""
    pytest.importorskip("segno", reason="segno is not installed")
    _, page = opened
    page.click("#live-source summary")
    page.click("#draw-phone")
    wait_for_text(page, "#phone-go", "Connect a phone")
    assert page.is_hidden("#phone-picture")
    page.click("#phone-ask summary")
    page.fill("#phone-host", "127.0.0.1")
    page.press("#phone-host", "Enter")
    wait_for_text(page, "#phone-go", "Disconnect")
    assert page.evaluate("document.getElementById('phone-picture').complete")
    before = "getComputedStyle(document.querySelector('#phone-code li'), '::before').content"
    assert page.evaluate(before) == "none"  # circles with numbers are those of the first steps
    page.click("#phone-code summary")
    address = page.inner_text("#phone-address")
    assert len(page.inner_text("#phone-fingerprint").split(":")) == 32
    options = {"has_touch": True, "is_mobile": True, "ignore_https_errors": True, "tolerated": ["ERR_CONNECTION"]}
    phone = pages.new(width=390, height=844, kind="phone", **options)
    phone.goto(address)
    wait_for_text(phone, "#wand-note", "Draw below with a finger")
    assert "token" not in phone.url
    wait_for_text(page, "#sources .source-name", "Live source connected: phone")
    assert page.is_hidden("#phone")  # what was to be scanned has been
    return phone


def _touch(page, points, seconds=1.5):
    """Draw through points of the window with a finger."""
    fingers, now = page.context.new_cdp_session(page), time.time()
    for k, (x, y) in enumerate(points):
        event = {"type": "touchMove" if k else "touchStart", "timestamp": now + seconds * k / len(points)}
        fingers.send("Input.dispatchTouchEvent", {**event, "touchPoints": [{"x": float(x), "y": float(y)}]})
    fingers.send("Input.dispatchTouchEvent", {"type": "touchEnd", "touchPoints": []})


def test_a_finger_on_a_phone_draws_in_the_studio(opened, phone):
    _, page = opened
    x, y = center(phone, "#wand-canvas")
    _touch(phone, np.array([x + 60, y - 60]) + _path() * [150, -150])
    wait_until(page, ANSWERED)
    assert page.inner_text(FIRST) == "GShape"
    assert page.evaluate("document.activeElement.id") != "naming-name"  # nobody asked for it
    wait_until(phone, "document.getElementById('wand-note').textContent.endsWith('GShape')")
    _touch(phone, np.array([x + 60, y - 60]) + _path(shape="Angle") * [150, -150])  # the next one follows
    wait_until(page, f"document.querySelector('{FIRST}').textContent === 'Angle'")
    late = []  # the answer to what is asked when the dialog opens: the phone still draws
    page.route("**/api/wand", lambda route: late.append(route) if route.request.method == "GET" else route.continue_())
    page.click("#draw-phone")
    wait_until(page, "window.unanswered === 1")
    page.click("#phone-go")
    wait_for_text(page, "#phone-go", "Connect a phone")
    late[0].fulfill(json={"address": phone.url, "picture": "data:,", "fingerprint": ""})
    settle(page)
    assert page.inner_text("#phone-go") == "Connect a phone"
    wait_until(page, "document.querySelectorAll('#sources li').length === 0")
    wait_until(phone, "document.getElementById('wand-note').textContent.startsWith('No longer connected')")


#: Turn the phone, so many directions [degrees], while its button is held.
TURN = """async (angles) => {
  for (const [alpha, beta] of angles) {
    window.dispatchEvent(new DeviceOrientationEvent("deviceorientation", { alpha, beta, gamma: 5 }));
    await new Promise((done) => setTimeout(done, 20));
  }
}"""


def test_a_phone_that_is_turned_draws_like_a_wand(opened, phone, tmp_path):
    _, page = opened
    path = 0.6 * _path()
    beta = np.arcsin(path[:, 1] / REACH)
    alpha = -np.arcsin(path[:, 0] / (REACH * np.cos(beta)))
    finger = phone.context.new_cdp_session(phone)
    x, y = center(phone, "#wand-hold")
    for north, first, name in ((0, "GShape", "by a wand"), (215, "by a wand", "from elsewhere")):
        angles = np.column_stack((np.degrees(alpha) + north, np.degrees(beta)))
        phone.evaluate(TURN, [[40, 40]] * 3)  # not held: nothing moves
        finger.send("Input.dispatchTouchEvent", {"type": "touchStart", "touchPoints": [{"x": x, "y": y}]})
        wait_until(phone, "document.getElementById('wand-hold').classList.contains('held')")
        phone.evaluate(TURN, angles.tolist())
        finger.send("Input.dispatchTouchEvent", {"type": "touchEnd", "touchPoints": []})
        wait_until(page, ANSWERED)
        assert page.inner_text(FIRST) == first
        page.fill("#naming-name", name)
        page.press("#naming-name", "Enter")
        wait_for_text(page, "#verdict-kind", "Learned")
        with kineme.ActionLibrary(tmp_path / "letters", read_only=True) as library:
            learned = library.movements(name)[0].positions
        np.testing.assert_allclose(learned - learned[0], 100 * path, atol=1e-4)  # 100 is the height of the canvas


def test_a_phone_without_sensors_says_so_and_breaks_no_rule_of_accessibility(opened, phone):
    phone.context.grant_permissions(["accelerometer", "gyroscope", "magnetometer"])  # not every browser does by itself
    x, y = center(phone, "#wand-hold")
    _touch(phone, [(x, y)])
    wait_for_text(phone, "#wand-note", "Now hold the button and move", seconds=60)  # the browser allows it
    _touch(phone, [(x, y)])
    wait_for_text(phone, "#wand-note", "This phone does not tell how it turns. Draw with a finger", seconds=60)
    _, page = opened
    page.click("#draw-phone")
    wait_for_text(page, "#phone-go", "Disconnect")
    for shown in (page, phone):
        shown.emulate_media(reduced_motion="reduce")  # colors change at once
        assert violations_in_both(shown) == []
    phone.context.clear_permissions()


#: A gamepad whose stick is pushed once around, with a button held.
CONNECT = """() => {
  window.pad = { axes: [0, 0, 0, 0], buttons: Array.from({ length: 17 }, () => ({ pressed: false })) };
  navigator.getGamepads = () => [null, window.pad];
  window.dispatchEvent(new Event("gamepadconnected"));
}"""
CIRCLE = """async ([button, seconds]) => {
  const began = performance.now();
  window.pad.buttons[button].pressed = true;
  for (let share = 0; share < 1; share = (performance.now() - began) / 1000 / seconds) {
    window.pad.axes = [Math.cos(2 * Math.PI * share), -Math.sin(2 * Math.PI * share), 0, 0];
    await new Promise(requestAnimationFrame);
  }
  window.pad.axes = [0.1, 0, 0, 0];
  window.pad.buttons[button].pressed = false;
}"""


def test_a_gamepad_draws_while_it_is_connected(opened, tmp_path):
    _, page = opened
    t = np.linspace(0, 1, 80)
    circle = kineme.Trajectory(2 * t, 30 * np.column_stack((np.sin(2 * np.pi * t), 1 - np.cos(2 * np.pi * t))))
    before = page.inner_text("#library-count")
    with kineme.ActionLibrary(tmp_path / "letters") as library:
        library.learn([circle], ["circle"])
    wait_until(page, "before => document.getElementById('library-count').textContent !== before", before)
    assert page.locator("#sources li").count() == 0
    page.evaluate(CONNECT)
    wait_for_text(page, "#sources .source-name", "Live source connected: gamepad (hold a button to draw)")
    page.evaluate(CIRCLE, [9, 0.3])  # the button of menus: the pen only moves
    assert page.text_content("#verdict-kind") == "Nothing drawn yet"  # which is not shown
    page.evaluate(CIRCLE, [0, 1])
    wait_until(page, ANSWERED)
    assert page.inner_text(FIRST) == "circle"
    page.click("#draw-clear")
    page.get_by_role("button", name="Ignore gamepad").click()
    page.evaluate(CIRCLE, [0, 0.3])
    assert page.text_content("#verdict-kind") == "Nothing drawn yet"  # which is not shown
    page.evaluate("() => { window.pad = null; }")
    wait_until(page, "document.querySelectorAll('#sources li').length === 0")


def _hand(tip, is_pinched, aspect=4 / 3, palm=0.2):
    """Landmarks (21, 3) of a hand as fractions of a picture; `tip` is the index finger's, in heights, y up."""
    fingers = np.radians([150, 112, 94, 78, 62])[:, None]  # from the palm, the thumb first
    along = np.array([0.45, 0.75, 1.0, 1.2]) * palm
    joints = np.concatenate((np.zeros((1, 2)), *(
        np.column_stack((along * np.cos(angle), along * np.sin(angle))) for angle in fingers
    )))  # fmt: skip
    joints[4] = joints[8] + ([0.1 * palm, 0] if is_pinched else [-0.8 * palm, 0])
    points = joints - joints[8] + tip
    fractions = np.column_stack((points[:, 0] / aspect + 0.5, 1 - points[:, 1], np.zeros(21)))
    return {"points": fractions.tolist(), "aspect": aspect}


def _hands(path):
    """A hand that comes open, draws a path (n, 2), and opens again, as messages without times."""
    shown = [(path[0], False)] * 5 + [(point, True) for point in path] + [(path[-1], False)] * 5
    return [_hand(tip, is_pinched) for tip, is_pinched in shown]


def test_a_hand_before_a_camera_draws_while_it_pinches(opened):
    studio, page = opened
    path = 0.5 * _path() + [0.2, 0.7]
    empty = page.evaluate(PIXELS)
    with Hand(studio, "camera") as camera:
        for k, hand in enumerate(_hands(path)):
            camera._tell({"hand": hand | {"time": 100 + 0.03 * k}})
            if k == 2:
                wait_until(page, f"before => ({PIXELS})() !== before", empty)  # the hand is seen
                assert page.text_content("#verdict-kind") == "Nothing drawn yet"  # which is not shown
            time.sleep(0.03)  # a camera's pace: pages that paint once a frame get the newest one
        wait_until(page, ANSWERED)
    assert page.inner_text(FIRST) == "GShape"
    wait_until(page, "document.querySelectorAll('#sources li').length === 0")


SEE = """async (hands) => {
  for (const [k, hand] of hands.entries())
    window.dispatchEvent(new CustomEvent("kineme-hand", { detail: { ...hand, time: k / 30 } }));
}"""


def test_landmarks_of_a_program_in_the_page_draw_and_a_hand_that_goes_ends_the_drawing(opened, tmp_path):
    _, page = opened
    path = 0.5 * _path() + [0.2, 0.7]
    page.evaluate(SEE, _hands(path)[:-5])  # it goes while it pinches
    wait_until(page, ANSWERED)
    assert page.inner_text(FIRST) == "GShape"
    page.fill("#naming-name", "by a hand")
    page.press("#naming-name", "Enter")
    wait_for_text(page, "#verdict-kind", "Learned")
    with kineme.ActionLibrary(tmp_path / "letters", read_only=True) as library:
        learned = library.movements("by a hand")[0]
    np.testing.assert_allclose(learned.positions - learned.positions[0], 100 * (path - path[0]), atol=1e-4)
    np.testing.assert_allclose(np.diff(learned.times), 1 / 30, atol=1e-6)


def test_landmarks_that_are_none_are_refused_in_a_sentence(opened):
    from websockets.sync.client import connect

    studio, _ = opened
    right = _hand(np.zeros(2), is_pinched=False) | {"time": 1.0}
    wrong = [None, [], {}, right | {"time": None}, right | {"aspect": 0}, right | {"points": right["points"][:20]}]
    wrong += [right | {"points": [[0.0]] * 21}, right | {"points": "many"}, right | {"time": float("inf")}]
    with connect(studio.address.replace("http", "ws") + "/api/live", additional_headers=BEARER) as camera:
        camera.send(json.dumps({"hand": right}))
        for hand in wrong:
            camera.send(json.dumps({"hand": hand}))
            assert "21 points" in json.loads(camera.recv(60))["error"]


class Camera:
    """Stands for OpenCV and MediaPipe: pictures of nothing, in which hands are seen that the test has made."""

    def __init__(self, hands):
        self.hands = iter(hands)
        self.shown = None

    def modules(self):
        point = namedtuple("point", "x y z")
        options, tracker = SimpleNamespace, self

        def detect(image, milliseconds):
            time.sleep(0.03)
            return SimpleNamespace(hand_landmarks=[[point(*landmark) for landmark in tracker.shown["points"]]])

        @contextmanager
        def create(_):
            yield SimpleNamespace(detect_for_video=detect)

        landmarker = SimpleNamespace(create_from_options=create)
        vision = ModuleType("vision")
        vars(vision).update(
            RunningMode=SimpleNamespace(VIDEO="video"), HandLandmarkerOptions=options, HandLandmarker=landmarker
        )
        cv2, mediapipe, tasks, python = (ModuleType(name) for name in ("cv2", "mediapipe", "tasks", "python"))
        vars(cv2).update(
            VideoCapture=lambda _: self, waitKey=lambda _: -1, flip=lambda picture, _: picture, COLOR_BGR2RGB=4,
            imshow=lambda *_: None, cvtColor=lambda picture, _: picture,
        )  # fmt: skip
        vars(mediapipe).update(Image=options, ImageFormat=SimpleNamespace(SRGB=1))
        vars(python).update(BaseOptions=options, vision=vision)
        names = ("cv2", "mediapipe", "mediapipe.tasks", "mediapipe.tasks.python")
        return dict(zip(names, (cv2, mediapipe, tasks, python), strict=True))

    def read(self):
        self.shown = next(self.hands, None)
        return self.shown is not None, np.zeros((480, 640, 3), dtype=np.uint8)


def test_the_example_with_a_camera_draws(opened, monkeypatch):
    studio, page = opened
    for name, module in Camera(_hands(0.5 * _path() + [0.2, 0.7])).modules().items():
        monkeypatch.setitem(sys.modules, name, module)
    monkeypatch.setenv("KINEME_STUDIO_TOKEN", studio.token)
    example = runpy.run_path(str(ROOT / "examples" / "camera_hand.py"))
    example["main"]("hand_landmarker.task", studio.address.removeprefix("http://"))
    wait_until(page, ANSWERED)
    assert page.inner_text(FIRST) == "GShape"
