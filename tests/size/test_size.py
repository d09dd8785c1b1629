"""Lines of code are those that have code on them."""

from __future__ import annotations

from tests.size.run import code_lines, functions

TEXT = '''"""Docstring
of two lines."""

import math  # counts


def area(radius):
    """One more."""
    # Not this one.
    return (
        math.pi

        * radius**2  # and this
    )


WIDTH = 3
"""What WIDTH is."""
'''


def test_docstrings_comments_and_blanks_are_no_code(tmp_path):
    path = tmp_path / "area.py"
    path.write_text(TEXT, encoding="utf-8")
    assert code_lines(path) == len(["import", "def", "return (", "math.pi", "radius", ")", "WIDTH"])


def test_functions_count_without_their_docstring(tmp_path):
    path = tmp_path / "area.py"
    path.write_text(TEXT, encoding="utf-8")
    ((lines, arguments, where),) = functions(path)
    assert (lines, arguments, where.endswith("area.py:7 area")) == (6, 1, True)
