"""From loops written in Python to LLVM modules: a small compiler for a small language.

The language is what loops over arrays need of Python.  Numbers are ``int64``, ``uint64``, ``float64`` and ``bool``; a
variable that receives both whole numbers and others is a float64 throughout.  Arrays have known types and dimensions;
they are indexed (by numbers that are not negative, or by negative constants), sliced, filled, and made by ``np.empty``
and its like, to last until the function returns.  Tuples and named tuples hold any of these, and each other; a named
tuple is made by its class, ``Point(x, y=2.0)``, and again with other fields by ``point._replace(x=1.0)``.  They are
kept in registers, and cost nothing.  There are ``for`` over ranges, arrays and tuples of constants, ``while``, ``if``,
and calls of other such functions, of functions at an address, and of those of mathematics.  Everything around a
function that is not an argument is a constant.

Divisions by zero are those of NumPy: no exception is raised, and a whole number divided by zero is zero.
"""
