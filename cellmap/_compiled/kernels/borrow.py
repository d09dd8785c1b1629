"""Views of arrays that count no references."""

from __future__ import annotations

from ..loops import operation


@operation
def borrowed(typing_context, array):
    """Return a view that does not keep its memory alive; its owner must outlive it.

    Handing an array to an inlined function counts references up and down, atomically; a view without an owner does not.
    """
    from numba.core import cgutils

    def generate(context, builder, signature, arguments):
        view = context.make_array(signature.args[0])(context, builder, arguments[0])
        view.meminfo = cgutils.get_null_value(view.meminfo.type)
        view.parent = cgutils.get_null_value(view.parent.type)
        return view._getvalue()

    return array(array), generate
