"""The command: started, killed, started again, beside other browsers and commands."""

from __future__ import annotations

import json
import os
import re
import shutil
import signal
import socket
import subprocess
import sys
import threading
from contextlib import suppress

import httpx
import pytest
from click.testing import CliRunner
from episode_samples import write_drawings
from studio_samples import BEARER, ROOT, TOKEN, Running, drawing, make_library, request_of, running, samples
from websockets.exceptions import ConnectionClosed, InvalidStatus
from websockets.sync.client import connect

from kineme import ActionLibrary, Trajectory
from kineme.cli import main
from kineme.errors import SpecificationError
from kineme.studio.server import serve
from soaking import SOAK, slow


@pytest.fixture(scope="module")
def studio(tmp_path_factory):
    with running(make_library(tmp_path_factory.mktemp("shared") / "actions")) as studio:
        yield studio


def _live(studio, **headers):
    return connect(f"{studio.address.replace('http', 'ws')}/api/live", additional_headers=BEARER | headers)


def _get(studio, path="/api/library"):
    return httpx.get(studio.address + path, headers=BEARER).json()


def _kineme(*words):
    environment = os.environ | {"PYTHONPATH": str(ROOT / "src")}
    command = [sys.executable, "-m", "kineme", *map(str, words)]
    return subprocess.run(command, env=environment, capture_output=True, text=True, timeout=120, check=False)


def test_it_says_where_it_is_and_how_to_stop_it_and_ends_at_once_without_a_traceback(folder):
    studio = Running(folder)
    assert (studio.address.startswith("http://127.0.0.1:"), studio.token) == (True, TOKEN)
    with _live(studio) as client:
        client.send(json.dumps({"watch": True}))
        code, out, err = studio.end()
    assert "stop it with Ctrl-C" in out
    assert (code, err) in {(0, ""), (1, "")}


def test_only_the_loopback_listens(studio):
    port = int(studio.address.rpartition(":")[2])
    own = {address[4][0] for address in socket.getaddrinfo(socket.gethostname(), None, socket.AF_INET)}
    for address in own - {"127.0.0.1"}:
        with pytest.raises(ConnectionRefusedError):
            socket.create_connection((address, port), 0.5)


def test_a_real_websocket_is_guarded(studio):
    with pytest.raises(InvalidStatus) as refused:
        _live(studio, Origin="http://evil.example")
    assert refused.value.response.status_code == 403
    with pytest.raises(InvalidStatus):
        _live(studio, Authorization="Bearer x")
    with _live(studio) as client:
        client.send(json.dumps({"samples": samples(2)}))
        assert json.loads(client.recv())["state"]["ranked"][0]["label"] == "kind 2"


NODE = ["node", "--experimental-websocket"]  # node 20 has it under this option
HAS_WEBSOCKET = shutil.which("node") is not None and (
    subprocess.run([*NODE, "-e", "WebSocket"], capture_output=True, check=False).returncode == 0
)
PROGRAMS = dict(
    re.findall(r"```(py|js)\n(.*?)```", (ROOT / "docs" / "guide" / "studio-network.md").read_text(), re.DOTALL)
)


@pytest.mark.parametrize("language", ["py", "js"])
def test_the_programs_of_the_page_run_and_are_shown(studio, language):
    if language == "js" and not HAS_WEBSOCKET:
        pytest.skip("this machine has no node with websockets")
    assert len(PROGRAMS[language].strip().splitlines()) < 13
    program = PROGRAMS[language].replace("127.0.0.1:8420", studio.address.removeprefix("http://"))
    command = [sys.executable, "-c", program] if language == "py" else [*NODE, "-e", program]
    with _live(studio) as page:
        page.send(json.dumps({"watch": True}))
        done = subprocess.run(
            command,
            env=os.environ | {"KINEME_STUDIO_TOKEN": TOKEN},
            capture_output=True,
            text=True,
            timeout=300,
            check=False,
        )
        assert done.returncode == 0, done.stderr
        assert "answer" in done.stdout.splitlines()[-1]
        shown = [json.loads(page.recv(300))]
        while not shown[-1].get("source", {}).get("gone"):
            shown.append(json.loads(page.recv(300)))
    sources = [message["source"] for message in shown if "source" in message]
    assert {source["name"] for source in sources if source.get("samples")} == {"hand tracker"}
    assert sum(len(source.get("samples", [])) for source in sources) == 100
    assert "label" in sources[-2]["ended"]["answer"]


def test_messages_of_many_megabytes_end_their_websocket_alone(studio):
    with _live(studio) as client:
        with suppress(ConnectionClosed):
            client.send("[" + "0," * 2_000_000 + "0]")
        with pytest.raises(ConnectionClosed):
            client.recv()
    assert _get(studio)["n_movements"] >= 12


def test_raw_nonsense_is_survived(studio):
    port = int(studio.address.rpartition(":")[2])
    for data in (b"\x16\x03\x01\x02", b"GET\r\n\r\n", b"POST / HTTP/1.1\r\nContent-Length: -5\r\n\r\n", b"A" * 200_000):
        with socket.create_connection(("127.0.0.1", port)) as client:
            client.sendall(data)
            client.settimeout(2)
            with suppress(OSError):
                client.recv(1000)
    assert _get(studio)["n_movements"] >= 12


def test_killed_at_any_time_nothing_that_was_answered_is_lost(folder):
    stored = []
    for round_ in range(0 if SOAK else 1, 9 if SOAK else 2):
        with running(folder) as studio:
            stop = threading.Timer(0.03 + 0.15 * round_, studio.process.kill)
            with suppress(httpx.HTTPError, json.JSONDecodeError):
                for k in range(1000):
                    if k == 2:
                        stop.start()
                    body = request_of(100 + 1000 * round_ + k, label=f"new {round_} {k}")
                    answer = httpx.post(f"{studio.address}/api/library/movements", json=body, headers=BEARER)
                    stored.append((answer.json()["ids"][0], body["label"]))
            stop.join()
    assert len(stored) >= 2
    with ActionLibrary(folder) as library:
        assert library.verify() == []
        for key, name in stored:
            assert key in library[name].members


@pytest.mark.soak
def test_two_browsers_the_command_line_and_python_write_side_by_side(folder):
    names = []

    def write(studio, who):
        with httpx.Client(headers=BEARER) as client:
            for k in range(5):
                body = request_of(1000 * who + k, label=f"{who} {k}")
                answer = client.post(f"{studio.address}/api/library/movements", json=body)
                assert answer.status_code == 200, answer.text
                names.append(body["label"])

    with running(folder) as studio, _live(studio) as page, ActionLibrary(folder) as library:
        page.send(json.dumps({"watch": True}))
        writers = [threading.Thread(target=write, args=(studio, who)) for who in (1, 2, 3)]
        for writer in writers:
            writer.start()
        for k in range(5):
            library.learn([Trajectory(*drawing(9000 + k))], [f"python {k}"])
        renamed = _kineme("library", "rename", "kind 0", "renamed", "-l", folder)
        assert renamed.returncode == 0, renamed.stderr
        for writer in writers:
            writer.join()
        library.rename("kind 1", "elsewhere")  # the last change is that of another process than the studio
        version = 0
        while version < library.version:
            version = json.loads(page.recv(timeout=300))["changed"]
        shown = {symbol["name"] for symbol in _get(studio)["symbols"]}
        assert shown == {"renamed", "elsewhere", "kind 2", "kind 3", *names, *(f"python {k}" for k in range(5))}
        assert len(names) == 15


def test_fifty_clients_draw_at_once(studio):
    answers = {}

    def draw(who):
        rows = samples(who % 4, seed=who)
        with _live(studio) as client:
            for start in range(0, 60, 6):
                client.send(json.dumps({"samples": rows[start : start + 6]}))
                while "state" not in (message := json.loads(client.recv(timeout=300))):
                    assert "changed" in message, message
            client.send(json.dumps({"finish": True}))
            answers[who] = json.loads(client.recv(timeout=300))["answer"]["ranked"][0]["label"]

    threads = [threading.Thread(target=draw, args=(who,)) for who in range(50)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert answers == {who: f"kind {who % 4}" for who in range(50)}


REFUSED = [
    (["--read-only"], 1, "expected a library in"),
    (["--port", "0"], 2, "0 is not in the range"),
    (["--host", "nowhere.invalid"], 1, "correct --host and --port"),
    (["--recordings", "nowhere"], 1, "found nothing at 'nowhere'"),
]


def _refused(folder, *options):
    """Exit code of a studio that does not begin, and what it says."""
    done = CliRunner().invoke(main, ["studio", "--no-open", "-l", str(folder), *map(str, options)])
    assert isinstance(done.exception, SystemExit), done.exception
    return done.exit_code, done.output


def test_without_a_library_it_opens_that_of_the_folder_actions(monkeypatch):
    monkeypatch.delenv("KINEME_LIBRARY", raising=False)
    served = []
    monkeypatch.setattr("kineme.studio.server.serve.serve", lambda options, ready: served.append(options))
    assert CliRunner().invoke(main, ["studio", "--no-open"]).exit_code == 0
    assert str(served[0].folder) == "actions"


@pytest.mark.parametrize(("options", "code", "words"), REFUSED, ids=str)
def test_what_cannot_be_served_is_refused_in_one_line(tmp_path, options, code, words):
    exit_code, said = _refused(tmp_path / "x", *options)
    assert exit_code == code
    assert words in said
    assert "Traceback" not in said


def test_a_damaged_data_set_is_refused_before_a_library_is_made(tmp_path):
    demos = write_drawings(tmp_path / "demos", (0,))
    (demos / "meta" / "info.json").write_text("{")
    code, said = _refused(tmp_path / "actions", "--recordings", demos)
    assert (code, "meta/info.json" in said, (tmp_path / "actions").exists()) == (1, True, False)


@pytest.mark.soak
def test_recordings_are_opened_by_a_path_of_the_command_line(folder, tmp_path):
    demos = write_drawings(tmp_path / "demos", (0, 1), (2,))
    with running(folder, "--recordings", demos) as studio:
        page = _get(studio, "/api/episodes")
    assert (page["name"], [item["task"] for item in page["episodes"]]) == ("demos", ["Draw", "Wave"])


def test_a_port_that_is_taken_is_refused(folder):
    with socket.create_server(("127.0.0.1", 0)) as taken:
        code, said = _refused(folder, "--port", taken.getsockname()[1])
    assert (code, "choose another --port" in said) == (1, True)


@pytest.mark.parametrize("token", ["", "a" * 15, "a" * 1001, "\u00e4" * 20, "a token with spaces in it"])
def test_tokens_are_long_enough_and_fit_into_a_cookie(monkeypatch, token):
    monkeypatch.setenv("KINEME_STUDIO_TOKEN", token)
    with pytest.raises(SpecificationError, match="at most 1,000"):
        serve.token_of_server()


def test_an_empty_host_is_not_every_address():
    with pytest.raises(SpecificationError, match="an empty --host"):
        serve.listening_at("", None)


@pytest.mark.skipif(not socket.has_dualstack_ipv6(), reason="no socket here listens for IPv6 and IPv4")
def test_every_address_of_ipv6_is_every_address_of_ipv4_too():
    with serve.listening_at("::", None) as listening:
        port = listening.getsockname()[1]
        for address in ("::1", "127.0.0.1"):
            socket.create_connection((address, port), 5).close()


def test_a_token_that_is_too_short_is_refused(folder, monkeypatch):
    monkeypatch.setenv("KINEME_STUDIO_TOKEN", "short")
    code, said = _refused(folder)
    assert (code, "at least 16 letters" in said) == (1, True)


def test_on_a_network_and_for_reading_only_it_says_so_and_leaves_nothing_with_a_terminal_that_closes(
    folder, tmp_path, monkeypatch
):
    monkeypatch.setenv("TMPDIR", str(tmp_path))
    before = signal.signal(signal.SIGHUP, signal.SIG_DFL)  # a terminal that closes is passed over after nohup
    studio = Running(folder, "--host", "0.0.0.0", "--read-only")
    signal.signal(signal.SIGHUP, before)
    assert "for reading only" in studio.line
    port = studio.address.rpartition(":")[2]
    assert httpx.post(f"http://127.0.0.1:{port}/api/library/undo", headers=BEARER).status_code == 403
    assert list(tmp_path.glob("kineme-studio-*"))
    _, _, err = studio.end(signal.SIGHUP)
    assert "give it to those you trust" in err
    assert not list(tmp_path.glob("kineme-studio-*"))


@pytest.mark.soak
@pytest.mark.parametrize("busy", [slow("_prepare"), "close"])
def test_it_ends_soon_whatever_still_runs(folder, busy):
    """Recognition is being compiled, by threads that Python joins, or closing waits: neither holds it up for long."""
    program = f"""
import time
from concurrent.futures import ThreadPoolExecutor

from kineme.cli import main
from kineme.studio.server.studio import Studio

Studio.{busy} = lambda self: ThreadPoolExecutor(1).submit(time.sleep, 3600).result()
main()
"""
    with running(folder, program=program) as studio:
        assert studio.end()[0] == 0
