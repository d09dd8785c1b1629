"""Long sums of products as one operation of the compiler."""

from __future__ import annotations

from numba import types
from numba.core import cgutils
from numba.extending import intrinsic


@intrinsic
def dot(typing_context, *factors):
    """Return a b + c d + ... of the numbers a, b, c, d, ..., in two chains of multiply-adds side by side.

    A link of a chain waits for the one before; and to the compiler's front end, which spends most of its time on a
    right-hand side of many terms, the whole sum is one step.
    """

    def generate(context, builder, signature, arguments):
        numbers = cgutils.unpack_tuple(builder, arguments[0])
        chains = [None, None]
        for k in range(0, len(numbers), 2):
            product = builder.fmul(numbers[k], numbers[k + 1], flags=("contract",))
            chain = chains[k // 2 % 2]
            chains[k // 2 % 2] = product if chain is None else builder.fadd(chain, product, flags=("contract",))
        return chains[0] if chains[1] is None else builder.fadd(*chains, flags=("contract",))

    return types.float64(types.StarArgTuple(factors)), generate
