"""Who is served by the explorer's server, and what is understood."""

from __future__ import annotations

import contextlib
import urllib.error
import urllib.request

import pytest
from served_pages import Page, connected
from websockets.exceptions import ConnectionClosed, InvalidStatus
from websockets.sync.client import connect

from cellmap.explorer import Explorer
from cellmap.explorer.server import MOST_SESSIONS, same_origin


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
