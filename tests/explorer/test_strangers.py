"""Who is served by the explorer's server, and what is understood; strangers who hold connections keep nobody out."""

import contextlib
import http.client
import json
import resource
import socket
import subprocess
import sys
import time
import urllib.error
import urllib.request
from collections.abc import Callable, Iterator

import pytest
from served_pages import GALLERY, Page, connected
from websockets.exceptions import ConnectionClosed, InvalidStatus
from websockets.sync.client import connect

from cellmap.explorer import Explorer
from cellmap.explorer.server import MOST_SESSIONS, same_origin
from cellmap.explorer.serving import serve


def test_nothing_is_served_without_the_token(explorer: Explorer) -> None:
    base = explorer.address.rsplit("/", 2)[0]
    with urllib.request.urlopen(explorer.address) as answer:
        assert b"cellmap explorer" in answer.read()
        assert answer.headers["Referrer-Policy"] == "no-referrer"
        assert "default-src 'self'" in answer.headers["Content-Security-Policy"]
    for address in (f"{base}/", f"{base}/main.js", f"{base}/{'x' * 32}/", f"{explorer.address}../server.py"):
        with pytest.raises(urllib.error.HTTPError, match="404"):
            urllib.request.urlopen(address)
    with pytest.raises(InvalidStatus):
        connect(f"{base.replace('http', 'ws')}/connection")


def test_no_other_page_is_served(explorer: Explorer) -> None:
    for origin in ("http://example.org", "null", None, "http://127.0.0.1", "https://" + explorer.address.split("/")[2]):
        with pytest.raises((InvalidStatus, ConnectionClosed)), connected(explorer, origin=origin):
            pass
    request = urllib.request.Request(explorer.address, headers={"Host": "example.org"})
    with pytest.raises(urllib.error.HTTPError, match="400"):
        urllib.request.urlopen(request)
    assert not same_origin("http://example.org:80", "example.org:80")


GARBAGE = [
    ("", "send JSON"),
    ("{", "send JSON"),
    ("[1, 2]", "send an object with a type"),
    ('{"type": 3}', "send an object with a type"),
    ('{"type": "view", "request": NaN}', "NaN is no number"),
    ("[" * 5000, "send JSON"),
    ('{"type": "destroy"}', "type='destroy': this is none of drawn, view"),
    ('{"type": "view"}', "request=None: give a whole number"),
    ('{"type": "view", "request": 1, "view": 7}', "view=7: give an object"),
    ('{"type": "view", "request": 1, "view": {"colour": 1}}', "view has no ['colour']"),
    ('{"type": "view", "request": 1, "view": {"params": {"mass": 1}}}', "params has no ['mass']"),
    ('{"type": "view", "request": 1, "view": {"params": {"keep": "1"}}}', "params['keep']='1': give one real number"),
    ('{"type": "view", "request": 1, "view": {"params": {"keep": 1e999}}}', "give a finite number"),
    ('{"type": "view", "request": 1, "view": {"cells": [4000, 4000]}}', "give at most 4,000,000 initial conditions"),
    ('{"type": "view", "request": 1, "view": {"axes": [0, 0]}}', "axes=(0, 0): choose different coordinates"),
    ('{"type": "view", "request": 1, "view": {"axes": [0, 9]}}', "axes=9: give a whole number of at most 1"),
    ('{"type": "view", "request": 1, "view": {"lower": [3, 3]}}', "the window is empty or inverted"),
    ('{"type": "view", "request": 1, "view": {"lower": [[0], 1]}}', "lower"),
    ('{"type": "view", "request": 1, "view": {"nodes": 5}}', "nodes=5"),
    ('{"type": "system", "name": "os"}', "name='os': choose one of wells, duffing"),
    ('{"type": "system", "text": 4}', "text=4: give a string"),
    ('{"type": "orbit", "point": [1]}', ""),
    ('{"type": "verify", "n_samples": 1e9}', ""),
    (b"\x00\x01", "message of bytes: send text"),
]


def test_garbage_is_answered_with_an_error_and_the_page_lives_on(page: Page) -> None:
    page.image()
    for garbage, message in GARBAGE:
        page.socket.send(garbage)
        answer = page.receive()
        assert answer["type"] == "error", (garbage, answer)
        assert message in answer["message"], (garbage, answer)
    assert page.image()[0]["complete"]


def test_too_much_ends_the_connection(explorer: Explorer) -> None:
    with connected(explorer) as page, pytest.raises(ConnectionClosed):
        page.socket.send("x" * 200_000)
        page.receive()
    with connected(explorer) as page, pytest.raises(ConnectionClosed) as closed:
        for _ in range(2000):
            page.socket.send('{"type": "drawn", "frame": 0}')
        page.receive()
    assert "messages a second" in str(closed.value)


def test_a_number_of_pages_is_the_limit(explorer: Explorer) -> None:
    with contextlib.ExitStack() as open_pages:
        for _ in range(MOST_SESSIONS):
            open_pages.enter_context(connected(explorer))
        with pytest.raises(ConnectionClosed, match="close one of them"), connected(explorer):
            pass


SERVER = """
import resource, sys
limit = int(sys.argv[1])
resource.setrlimit(resource.RLIMIT_NOFILE, (limit, resource.getrlimit(resource.RLIMIT_NOFILE)[1]))
sys.path.insert(0, "tests/explorer")
from served_pages import GALLERY
from cellmap.explorer.serving import serve
explorer = serve(GALLERY[:1], open_page=False, watchers=5, host="127.0.0.1")
print(explorer.address, explorer.watch_address, flush=True)
sys.stdin.read()
"""


@contextlib.contextmanager
def served(limit: int) -> Iterator[tuple[str, str]]:
    """Run a server in a process that may open so many files."""
    pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "stderr": subprocess.PIPE}
    with subprocess.Popen([sys.executable, "-c", SERVER, str(limit)], text=True, **pipes) as process:  # type: ignore[call-overload]
        assert process.stdout is not None
        own, watch = process.stdout.readline().split()
        yield own, watch
        _, told = process.communicate()
    assert told == ""


@contextlib.contextmanager
def strangers(place: str, said: bytes, many: int) -> Iterator[Callable[[], int]]:
    """Hold many connections, which are as slow to be made as the server makes them; yield how many it has closed."""
    host, port = place.split(":")
    with contextlib.ExitStack() as stack:
        held = [stack.enter_context(socket.create_connection((host, int(port)), timeout=5.0)) for _ in range(many)]
        for one in held:
            with contextlib.suppress(OSError):  # closed already
                one.sendall(said)
        yield lambda: sum(is_closed(one) for one in held)


def is_closed(one: socket.socket) -> bool:
    """Whether nothing more will come, after what has come."""
    one.setblocking(False)
    try:
        while one.recv(2**16):
            pass
    except BlockingIOError:
        return False
    except OSError:
        pass
    return True


def answered(address: str) -> float:
    """Return how long a page takes to be there, with its connection."""
    began = time.monotonic()
    _, _, place, token, *_ = address.split("/")
    with contextlib.closing(http.client.HTTPConnection(place, timeout=5.0)) as connection:
        connection.request("GET", f"/{token}/")
        assert connection.getresponse().status == 200
    with connect(f"ws://{place}/{token}/connection", origin=f"http://{place}", compression=None) as page:
        assert json.loads(page.recv(5.0))["type"] in ("hello", "welcome")
    return time.monotonic() - began


@pytest.mark.parametrize(("limit", "said"), [pytest.param(1024, b"", marks=pytest.mark.thorough), (256, b"GET /")])
def test_the_page_and_those_who_watch_are_answered(limit: int, said: bytes) -> None:
    (soft, hard), many = resource.getrlimit(resource.RLIMIT_NOFILE), 2 * limit
    with served(limit) as (own, watch):
        resource.setrlimit(resource.RLIMIT_NOFILE, (max(soft, many + 200), hard))
        try:
            for address in (watch, own):
                with strangers(address.split("/")[2], said, many) as closed:
                    assert max(answered(own), answered(watch)) < 5.0
                    assert many - limit // 8 <= closed() < many
        finally:
            resource.setrlimit(resource.RLIMIT_NOFILE, (soft, hard))


def test_the_head_of_a_request_has_its_time(shared: Explorer, monkeypatch: pytest.MonkeyPatch) -> None:
    """Of the first one and of those that follow it on the same connection; a page may be silent for longer."""
    monkeypatch.setattr("cellmap.explorer.connections._PATIENCE", 0.3)
    address = str(shared.watch_address)
    host, port = address.split("/")[2].split(":")
    place = (host, int(port))
    with connect(address.replace("http", "ws") + "connection", origin=f"http://{host}:{port}") as page:
        for whole in (b"", b"GET / HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n"):
            with socket.create_connection(place, timeout=5.0) as one:
                one.sendall(whole)
                if whole:
                    assert b"404" in one.recv(4096)
                began = time.monotonic()
                with contextlib.suppress(ConnectionError):
                    for byte in b"GET / HTTP/1.1\r\nHost: nobody-in-a-hurry.example.org":
                        one.sendall(bytes([byte]))
                        time.sleep(0.05)
                with pytest.raises(ConnectionError):
                    one.sendall(b"x")
                    assert one.recv(1) == b""
                    one.sendall(b"x")
                assert time.monotonic() - began < 3.0
        assert json.loads(page.recv(5.0))["type"] == "welcome"
        page.ping().wait(5.0)


def test_somebody_with_the_address_of_watchers_takes_no_more_than_these_may(shared, monkeypatch):
    """Beyond 2 watchers there are as many who are told that they are too many, and need not listen, as guests."""
    monkeypatch.setattr("cellmap.explorer.connections.open_files", lambda: 64)
    place, token = str(shared.watch_address).split("/")[2:4]
    head = f"GET /{token}/connection HTTP/1.1\r\nHost: {place}\r\nOrigin: http://{place}\r\nUpgrade: websocket\r\n"
    head += "Connection: Upgrade\r\nSec-WebSocket-Key: AAAAAAAAAAAAAAAAAAAAAA==\r\nSec-WebSocket-Version: 13\r\n\r\n"
    with strangers(place, head.encode(), 40) as closed:
        assert answered(shared.address) < 5.0
        until = time.monotonic() + 5.0
        while closed() < 40 - (2 + 8) and time.monotonic() < until:
            time.sleep(0.05)
        assert closed() == 40 - (2 + 8)


def test_more_watchers_than_files_are_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("cellmap.explorer.serving.open_files", lambda: 256)
    with pytest.raises(ValueError, match=r"watchers=200: .* 256 files.* for 64; raise .*-n 528"):
        serve(GALLERY[:1], open_page=False, watchers=200, host="127.0.0.1")
