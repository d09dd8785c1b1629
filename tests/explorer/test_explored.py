"""What the explorer offers: every reference system, with equations that are typeset as they are computed."""

import inspect
import json
import math
import re
from typing import Any, get_type_hints
from xml.etree import ElementTree

import numpy as np
import pytest
from matplotlib.colors import to_rgb

import systems
from cellmap import CellGrid, ForcedSystem, PointMap, discrete_map, stroboscopic_map
from cellmap.attractors.settling.labels import Label
from cellmap.explorer import Explored, ExploredScene
from cellmap.explorer.equations import typed_system
from cellmap.explorer.explored import explored_of, load_gallery
from cellmap.explorer.images import Images, basin_image, described
from cellmap.explorer.mathematics import equations, named
from cellmap.explorer.protocol import LOWEST, pixels
from cellmap.explorer.server import PAGE
from cellmap.explorer.view import SCHEMA, View
from cellmap.plot._colours import CODE_COLOURS, COLOURS
from systems import two_well_duffing
from systems.gallery import GALLERY


def test_the_gallery_offers_every_reference_system() -> None:
    found = set()
    for name in systems.__all__:
        function = getattr(systems, name)
        if not inspect.isfunction(function) or get_type_hints(function).get("return") not in (ForcedSystem, PointMap):
            continue
        if all(a.default is not a.empty for a in inspect.signature(function).parameters.values()):
            found.add(name)
    gallery = [e for e in load_gallery("systems.gallery") if isinstance(e, Explored)]
    assert {e.name for e in gallery} == found
    for explored in gallery:
        first = View.first(explored)
        assert View.of({}, explored).params == first.params
        assert np.prod(first.cells) <= 250_000
        names: dict[str, object] = {}
        exec(explored.source, names)
        assert repr(names["system"]) == repr(explored.system)
    with pytest.raises(ValueError, match="gallery='math': give a module with a list GALLERY"):
        load_gallery("math")


def test_the_scene_has_the_parameters_of_its_parts_alone() -> None:
    (scene,) = (e for e in load_gallery("systems.gallery") if isinstance(e, ExploredScene))
    for body in scene.bodies:
        for effects in ((), scene.effects[:2], *((effect,) for effect in scene.effects)):
            explored = scene.explored((body, *effects))
            assert explored.parts == (body, *effects)
            names: dict[str, object] = {}
            exec(explored.source, names)
            assert repr(names["system"]) == repr(explored.system)
            assert View.of({}, explored).others == View.first(explored).others
            for effect in ("damping", "friction", "stiffness", "torque"):
                has = any(name.startswith(effect) for name in explored.system.params)
                assert has == any(
                    effect in part.replace("spring", "stiffness") for part in effects if "constant" not in part
                )


def test_colours_of_the_page_are_those_of_the_figures(request: pytest.FixtureRequest) -> None:
    """`pytest --update-reference` writes the colours of cellmap.plot into the page."""
    page = PAGE / "colours.js"
    codes = {int(code): [round(255 * part) for part in to_rgb(colour)] for code, colour in CODE_COLOURS.items()}
    lines = [
        f"const {name} = {json.dumps(value)};"
        for name, value in (("COLOURS", COLOURS), ("CODES", codes), ("ENDED", int(Label.ENDED)))
    ]
    kept = page.read_text(encoding="utf-8")
    wanted = re.sub(r"^const (COLOURS|CODES|ENDED) = .*$", lambda _: lines.pop(0), kept, flags=re.MULTILINE)
    if request.config.getoption("--update-reference"):
        page.write_text(wanted, encoding="utf-8")
    assert page.read_text(encoding="utf-8") == wanted


def test_the_page_knows_the_schema_and_its_modules_are_short() -> None:
    assert f"const SCHEMA = {SCHEMA};" in (PAGE / "address.js").read_text(encoding="utf-8")
    for path in PAGE.glob("*.js"):
        assert len(path.read_text(encoding="utf-8").splitlines()) <= 350, path.name


def test_labels_beyond_a_byte_are_sent_in_two() -> None:
    for highest, kind in ((255 + LOWEST, "uint8"), (256 + LOWEST, "uint16")):
        raster = np.array([[LOWEST, highest]], np.int16)
        name, data = pixels(raster)
        assert name == kind
        assert (np.frombuffer(data, kind).astype(int) + LOWEST).tolist() == raster.ravel().tolist()


NAMES = {"sgn": np.sign, **{n: getattr(math, n) for n in ("sin", "cos", "exp", "sqrt", "tanh")}}
SIGNS = {"−": "-", "+": "+", "(": "(", ")": ")", ",": ","}


def read(element: Any) -> str:
    """Return MathML as Python, with v[...] for names: what stands side by side is multiplied."""
    tag, parts = element.tag, list(element)
    if tag == "mn":
        return f"({element.text})"
    if tag in ("mi", "mover") or (tag == "msub" and parts[0].tag == "mi"):
        text = ElementTree.tostring(element, encoding="unicode")
        return "math.pi" if text == "<mi>π</mi>" else element.text if element.text in NAMES else f"v[{text!r}]"
    if tag == "mo":
        return SIGNS[element.text]
    if tag == "msup":
        return f"(({read(parts[0])})**({read(parts[1])}))"
    if tag == "mfrac":
        return f"(({read(parts[0])})/({read(parts[1])}))"
    if tag == "msqrt":
        return f"math.sqrt({side_by_side(parts)})"
    return f"({side_by_side(parts)})"


def side_by_side(parts: list[Any]) -> str:
    written, applied = "", False
    for part in parts:
        if part.tag == "mspace":
            continue
        if part.text == "\u2061":
            applied = True
            continue
        text = read(part)
        leads = text[0] not in "+-,)" or part.tag != "mo"
        if written and leads and not applied and written[-1] not in "+-,(":
            written += "*"
        written += f"({text})" if applied else text
        applied = False
    return written


def values(system: ForcedSystem | PointMap, t: float, state: Any) -> dict[str, float]:
    """The left sides of the equations, by their names, with the parts that are named on the way."""
    lines = equations(system)
    assert lines is not None
    coordinates = system.axes if isinstance(system, ForcedSystem) else system.coordinates
    known = {named("t"): t}
    known |= {named(c.name): float(x) for c, x in zip(coordinates, state, strict=True)}
    known |= {named(k): v for k, v in system.params.items()}
    found: dict[str, float] = {}
    for left, *terms in len(lines) * lines:  # parts may be named below
        tree = ElementTree.fromstring(f"<mrow>{''.join(terms)}</mrow>")
        name = left[: left.rindex("<mo>")]
        try:
            found[name] = eval(side_by_side(list(tree)), {"math": math, "v": {**found, **known}, **NAMES})
        except KeyError:
            continue  # of a part that comes later
    return found


@pytest.mark.parametrize("entry", GALLERY, ids=lambda entry: entry.name)
def test_what_is_typeset_is_computed(entry: Any) -> None:
    explored = explored_of(entry)
    system = explored.system
    assert explored.about.endswith(".")
    random = np.random.default_rng(1)
    state = random.uniform(0.1, 0.9, len(explored.coordinates))
    if isinstance(system, ForcedSystem):
        rates = system.derivative(0.3, state)
        second = {c.name[:-1] for c in system.axes if c.name.endswith("'")}
        expected = {}
        for c, rate in zip(system.axes, rates, strict=True):
            if c.name not in second:
                dots = (c.name[:-1], "¨") if c.name.endswith("'") else (c.name, "˙")
                expected[f"<mover>{named(dots[0])}<mo>{dots[1]}</mo></mover>"] = rate
    else:
        expected = {named(c.name): x for c, x in zip(system.coordinates, system(state), strict=True)}
    found = values(system, 0.3, state)
    for left, value in expected.items():
        period = next((c.period for c in explored.coordinates if named(c.name) == left), None)
        apart = found[left] - value
        assert apart - (round(apart / period) * period if period else 0.0) == pytest.approx(
            0.0, abs=1e-4 * max(1, abs(value))
        )


def test_names_sums_and_branches() -> None:
    assert named("theta1'") == "<mover><msub><mi>θ</mi><mn>1</mn></msub><mo>˙</mo></mover>"
    assert named("belt_speed") == "<mi>belt speed</mi>"
    assert named("a<b") == "<mi>a&lt;b</mi>"
    typed = typed_system("x -> -(a + x)*(a - x)/2 - (-x)**3 + 0*x\na = 2\n").system
    assert values(typed, 0.0, [0.5])[named("x")] == pytest.approx(typed([0.5])[0])
    (line,) = equations(typed_system("x -> x if x > 0 else -x/2").system) or []
    assert "<mtext>if</mtext>" in line[1]
    assert "<mo>&gt;</mo>" in line[1]
    assert equations(stroboscopic_map(two_well_duffing())) is None


def test_ends_have_their_names_in_images() -> None:
    """x' = 3/2 x leaves the window for the end "over": all beyond the unstable point at 0 do."""
    grown = discrete_map(lambda x, p: (1.5 * x[0], 0.5 * x[1]), {}, ("x", "y"), ends={"over": lambda x, p: x[0] - 2})
    explored = Explored("ending", lambda: grown, CellGrid((-1, -1), (1, 1), (16, 16)))
    view, images = View.first(explored), Images(explored)
    *_, last = images.frames(view)
    told, _ = basin_image(view, last)
    assert told["others"]["over"] == pytest.approx(0.5)
    assert described(explored)["codes"]["over"] == -8
