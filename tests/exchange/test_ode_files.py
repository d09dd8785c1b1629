"""Files of XPP.  Numbers printed to seven digits are those of XPPAUT 6.11, Runge-Kutta with steps of 0.001."""

from collections.abc import Callable
from math import exp, pi, sin
from pathlib import Path

import pytest

from cellmap import PointMap, stroboscopic_map
from cellmap.exchange import OdeFile, read_ode


def read(tmp_path: Path, text: str) -> OdeFile:
    path = tmp_path / "model.ode"
    path.write_text(text)
    return read_ode(path)


def test_a_driven_pendulum() -> None:
    model = read_ode(Path(__file__).with_name("pendulum.ode"), period=2 * pi)
    assert [c.name for c in model.system.axes] == ["x", "y"]
    assert model.system.params == {"f": 0.1, "w": 1.0, "a": 1.0}
    assert model.ignored == ("aux energy=y^2/2",)
    strobe = stroboscopic_map(model.system)
    assert strobe.unknown_formulas == ""
    assert strobe(model.initial_condition) == pytest.approx((-3.1548331, 0.27554515), abs=1e-6)


@pytest.mark.parametrize(
    ("formula", "expected"),
    [
        ("-x^2+max(x,-.5e0)+PI", lambda x, t: -(x**2) + x + pi),
        ("2^x^2", lambda x, t: (2**x) ** 2),  # operations of one precedence go from the left
        ("x>0+1", lambda x, t: 2.0),  # comparisons bind as powers do
        ("if(x>.2&t<3)then(heav(x)/4)else(x)", lambda x, t: 0.25),
        ("if(x==.3|x!=.3)then(k)else(0)", lambda x, t: 2.0),
        ("mod(-x,1)+flr(x)-sign(x)", lambda x, t: 0.7 - 1.0),
        ("g(x,.5)-c", lambda x, t: sin(0.3 * 0.5) + 2.0 - 4.0),
    ],
)
def test_formulas(tmp_path: Path, formula: str, expected: Callable[[float, float], float]) -> None:
    system = read(tmp_path, f"p k=2\nc=k*e\n!e=k\ng(a,b)=sin(a*b)+k\nx'={formula}\nd\nx'=no").system
    assert system.derivative(0.5, (0.3,))[0] == pytest.approx(expected(0.3, 0.5), rel=1e-14)


def test_events_reset_the_state(tmp_path: Path) -> None:
    model = read(tmp_path, "v'=-v+i\nn'=0\npar i=1.2\nglobal 1 v-1 {v=-.5;n=n+1}\ndone\n")
    # From -0.5 to 1 takes log(1.7 / 0.2): of 5 units of time the first spike takes log(1.2 / 0.2).
    left = 5.0 - 1.791759469228055 - 2.1400661634962708
    assert stroboscopic_map(model.system).iterate((0.0, 0.0), 5).points == pytest.approx(
        (1.2 - 1.7 * exp(-left), 2.0), abs=1e-7
    )


def test_groups_maps_and_angles(tmp_path: Path) -> None:
    ring = read(tmp_path, "%[0..2]\nx[j]'=y[j]-x[j]\ny[j]'=2*x[j]\n%\nx[0..2](0)=.5\nz[1..2]'=z[j]+x[j-1]\n")
    assert [c.name for c in ring.system.axes] == ["x0", "y0", "x1", "y1", "x2", "y2", "z1", "z2"]
    assert ring.initial_condition == (0.5, 0.0, 0.5, 0.0, 0.5, 0.0, 0.0, 0.0)
    assert ring.system.derivative(0.0, (1, 2, 3, 4, 5, 6, 7, 8)) == (1, 2, 1, 6, 1, 10, 8, 11)
    henon = read(tmp_path, "x'=1-a*x^2+y\ny'=.3*x\nparams a=1.4\n@ meth=discrete\n").system
    assert isinstance(henon, PointMap)
    assert henon([0.5, 0.1]) == pytest.approx([0.75, 0.15])
    circle = read(tmp_path, "th'=1+lambda*sin(th)\np lambda=.2\n@ fold=th\n")
    assert circle.system.axes[0].is_angle
    assert circle.ignored == ("lambda is called lambda_",)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (
            "x'=-x+delay(x,2)\nwiener w\n",
            r"line 1, x'=-x\+delay\(x,2\): delays cannot be read; line 2, wiener w: random",
        ),
        ("table w % 3 0 1 t\nx'=w(x)\n", "line 1, table w .*: tables cannot be read"),
        ("x'=__import__*x\n", "not understood"),
        ("# decay\nx'=-k*x\npar a=1\n", r"line 2, x'=-k\*x: k is not defined"),
        ("x'=f(x)\nf(u)=u*h\npar a=1\n", r"line 2, f\(u\)=u\*h: h is not defined"),
        ("x'=c\nc=d+1\nd=c\n", r"line 2, c=d\+1: c is defined by itself"),
        ("x'=1\nglobal 1 x-1 {k=2}\npar k=1\n", "global sets k, which is no variable"),
        ("n(t+1)=n+t\n", "the map depends on t"),
        ("x'=-x+cos(t)\n", "period=1.0"),
    ],
)
def test_what_cannot_be_read_is_named(tmp_path: Path, text: str, words: str) -> None:
    with pytest.raises(ValueError, match=words):
        read(tmp_path, text)
