"""The explorer in a browser of this machine: frames while a parameter is dragged, and what the server costs at rest."""

from __future__ import annotations

import itertools
import os
import shutil
import time
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from playwright.sync_api import sync_playwright

from cellmap.explorer.explored import load_gallery
from cellmap.explorer.serving import serve

PROGRAM = os.environ.get("CELLMAP_BROWSER") or shutil.which("chromium") or shutil.which("google-chrome")
SECONDS = float(os.environ.get("CELLMAP_BENCH_SECONDS", "10"))

LOG = """
window.drawn = []; window.asked = new Map();
const send = WebSocket.prototype.send;
WebSocket.prototype.send = function (text) {
  const message = JSON.parse(text);
  if (message.type === "view") window.asked.set(message.request, performance.now());
  send.call(this, text);
};
document.addEventListener("drawn", ({ detail: { request, complete } }) => {
  window.drawn.push({ complete, time: performance.now(), since: performance.now() - window.asked.get(request) });
});
"""

OPEN = """([name, cells]) => {
  location.hash = `#schema=1&system=${name}${cells ? `&cells=${cells},${cells}` : ""}`;
}"""

DRAG = """async ([label, seconds]) => {
  const slider = document.querySelector(`input[aria-label="${label}, slider"]`);
  const [low, high] = [Number(slider.min), Number(slider.max)];
  const begin = performance.now();
  window.drawn.length = 0;
  const steps = [];
  await new Promise((done) => {
    const step = () => {
      const t = (performance.now() - begin) / 1000;
      steps.push(performance.now());
      if (t > seconds) return done();
      slider.valueAsNumber = (low + high) / 2 + 0.1 * (high - low) * Math.sin(t);
      slider.dispatchEvent(new Event("input"));
      requestAnimationFrame(step);
    };
    step();
  });
  const end = performance.now();
  while (!window.drawn.some((f) => f.complete && f.time > end)) await new Promise((r) => setTimeout(r, 10));
  return [begin, end, window.drawn, steps];
}"""


@pytest.mark.skipif(PROGRAM is None, reason="no Chromium on this machine: install one, or name it in CELLMAP_BROWSER")
def test_dragging_a_parameter(say: Callable[[str], None]) -> None:
    """For ten seconds each: frames a second, from event to pixels, and the whole image after the last event."""
    with serve(load_gallery("systems.gallery"), open_page=False) as explorer, sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=PROGRAM, args=["--no-sandbox"])
        page = browser.new_page(viewport={"width": 1200, "height": 900})
        page.add_init_script(LOG)
        page.goto(explorer.address)
        systems = ("driven_pendulum", "amplitude"), ("duffing_oscillator", "forcing"), ("two_well_duffing", "forcing")
        for (name, parameter), cells in itertools.product(systems, (500, None)):
            page.evaluate("window.drawn = []")
            page.evaluate(OPEN, [name, cells])
            while not page.evaluate("window.drawn.some((f) => f.complete)"):
                page.wait_for_timeout(50)
            size = page.evaluate("document.getElementById('image').width")
            began = time.process_time()
            begin, end, frames, steps = page.evaluate(DRAG, [parameter, SECONDS])
            spent = time.process_time() - began
            told = f"page {1000 * len(steps) / (steps[-1] - steps[0]):.0f} steps/s, {_summary(begin, end, frames)}"
            say(f"explorer, {name}, {size}^2: {told}; {spent:.1f} CPU seconds of the server")
        page.wait_for_timeout(1000)
        began = time.process_time()
        page.wait_for_timeout(5000)
        say(f"explorer, at rest: {100 * (time.process_time() - began) / 5:.2f} % of a core, this program included")
        browser.close()


def _summary(begin: float, end: float, frames: list[dict[str, Any]]) -> str:
    during = [f["since"] for f in frames if f["time"] <= end]
    full = next(f["time"] for f in frames if f["complete"] and f["time"] > end) - end
    half, most = np.percentile(during, [50, 95])
    return (
        f"{1000 * len(during) / (end - begin):.1f} frames/s, event to pixels {half:.0f} ms (p50) {most:.0f} ms (p95), "
        f"whole image {full:.0f} ms after the last event"
    )
