"""The explorer without a server: sessions behind messages of a host, the page in one file, the notebooks' widget."""

import base64
import json
import queue
import re
import threading
from collections.abc import Iterator
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from browser_pages import LOG, launched
from served_pages import GALLERY, WELLS, WINDOW, assert_same_image, numbers_of, upright

from cellmap import find_basins
from cellmap.explorer import explorer_widget
from cellmap.explorer.channels import Channels
from cellmap.explorer.one_file import page_of_one_file
from cellmap.explorer.protocol import unpacked
from cellmap.explorer.server import MOST_SESSIONS, PAGE

Sent = queue.Queue[tuple[dict[str, Any], Any]]


@pytest.fixture
def sent() -> Sent:
    return queue.Queue()


@pytest.fixture
def channels(sent: Sent) -> Iterator[Channels]:
    before = threading.active_count()
    made = Channels({e.name: e for e in GALLERY}, lambda message, data: sent.put((message, data)))
    yield made
    made.close()
    made.close()
    assert not made._thread.is_alive()
    assert threading.active_count() <= before + 1


def test_sessions_have_their_own_messages(channels: Channels, sent: Sent) -> None:
    for page in "ab":
        channels.receive({"page": page, "opened": True})
    greeted = [sent.get(timeout=10)[0] for _ in range(2)]
    assert {message["page"] for message in greeted} == {"a", "b"}
    assert json.loads(greeted[0]["text"])["type"] == "hello"
    channels.receive({"page": "b", "text": json.dumps({"type": "view", "request": 1, "view": {}})})
    while True:
        message, data = sent.get(timeout=20)
        assert message == {"page": "b"}
        facts, pixels = unpacked(data[0])
        channels.receive({"page": "b", "text": json.dumps({"type": "drawn", "frame": facts["frame"]})})
        if facts["complete"]:
            break
    frame = {**facts, "data": pixels}
    assert_same_image(frame, numbers_of(frame), find_basins(WELLS, WINDOW), upright)


def test_garbage_and_too_many_pages(channels: Channels, sent: Sent) -> None:
    for garbage in (None, 3, {}, {"page": 1}, {"page": "unknown", "text": "{}"}):
        channels.receive(garbage)
    channels.receive({"page": "a", "opened": True})
    assert "hello" in sent.get(timeout=10)[0]["text"]
    channels.receive({"page": "a", "text": "{"})
    assert "send JSON" in sent.get(timeout=10)[0]["text"]
    channels.receive({"page": "a", "closed": True})
    for k in range(MOST_SESSIONS + 1):
        channels.receive({"page": str(k), "opened": True})
    answers = [sent.get(timeout=10)[0] for _ in range(MOST_SESSIONS + 1)]
    assert sum("close one of them" in answer.get("closed", "") for answer in answers) == 1


def test_the_page_of_one_file_asks_for_no_other() -> None:
    alone = {"watch.js", "family.js"}  # each is the first module of another page
    for page, others in ((page_of_one_file(), alone), (page_of_one_file("family.html"), {"main.js", "watch.js"})):
        assert "href=" not in page
        assert "src=" not in page
        inside = {path.name for path in PAGE.glob("*.js") if f'"cellmap/{path.name}": "data:' in page}
        assert not inside & others
        for name in inside:
            used = re.findall(r'from "\./(\w+\.js)"', (PAGE / name).read_text(encoding="utf-8"))
            assert inside.issuperset(used)
    assert {path.name for path in PAGE.glob("*.js")} - alone <= set(
        re.findall(r'"cellmap/(\w+\.js)"', page_of_one_file())
    )


HOST = """
window.handlers = new Set();
window.model = {
  get: (name) => ({ page: window.pageOfOneFile, height: 700 })[name],
  send: (message) => window.toKernel(message),
  on: (_, handler) => window.handlers.add(handler),
  off: (_, handler) => window.handlers.delete(handler),
};
window.deliver = (message, data) => {
  const buffers = !data ? [] : [new DataView(Uint8Array.from(atob(data), (c) => c.charCodeAt(0)).buffer)];
  for (const handler of window.handlers) handler(message, buffers);
};
"""


@pytest.mark.thorough
def test_the_page_in_a_frame_of_a_notebook(channels: Channels, sent: Sent) -> None:
    """A host with the interface of anywidget; what the canvas shows is what the library finds."""
    with launched() as browser:
        page = browser.new_page()
        said: list[str] = []
        page.on("console", lambda message: said.append(message.text) if message.type in ("error", "warning") else None)
        page.on("pageerror", lambda error: said.append(str(error)))
        page.route("http://notebook.test/", lambda route: route.fulfill(body="<main></main>", content_type="text/html"))
        page.add_init_script(LOG)
        page.expose_function("toKernel", channels.receive)
        page.goto("http://notebook.test/")
        page.evaluate(HOST)
        page.evaluate("(text) => { window.pageOfOneFile = text; }", page_of_one_file())
        module = base64.b64encode((PAGE / "widget.mjs").read_bytes()).decode()
        page.evaluate(
            f"import('data:text/javascript;base64,{module}').then((m) => {{ window.leave = "
            "m.default.render({ model, el: document.querySelector('main') }); })"
        )
        frame = page.frames[-1]
        for _ in range(1000):
            while not sent.empty():
                message, data = sent.get()
                page.evaluate(
                    "([m, d]) => deliver(m, d)", [message, base64.b64encode(data[0]).decode() if data else None]
                )
            if frame.evaluate("window.frames.some?.((f) => f.complete) && document.getElementById('preview').hidden"):
                break
            page.wait_for_timeout(10)
        assert frame.inner_text("#state") == ""
        assert frame.is_hidden("#link")
        image = frame.evaluate(
            "(() => { const c = document.getElementById('image');"
            "return Array.from(c.getContext('2d').getImageData(0, 0, c.width, c.height).data); })()"
        )
        colours = np.reshape(image, (48, 64, 4))[..., 0]
        labels = find_basins(WELLS, WINDOW).labels.T[::-1]
        assert len(set(zip(colours.ravel().tolist(), labels.ravel().tolist(), strict=True))) == 2
        page.evaluate("leave()")
        assert page.evaluate("handlers.size") == 0
        assert said == []


def test_the_widget_answers_its_pages_or_says_what_to_install() -> None:
    """Of the extra `notebook`, which tests do not need."""
    if find_spec("anywidget") is None:
        with pytest.raises(ModuleNotFoundError, match=r"pip install 'cellmap-dynamics\[notebook\]'"):
            explorer_widget(WELLS)
        return
    widget = explorer_widget(WELLS, WINDOW)
    told: Sent = queue.Queue()
    widget.send = lambda message, data: told.put((message, data))
    widget._handle_custom_msg({"page": "a", "opened": True}, [])
    assert "hello" in told.get(timeout=10)[0]["text"]
    assert Path(PAGE / "widget.mjs").read_text(encoding="utf-8") == str(widget._esm)
    widget.close()
