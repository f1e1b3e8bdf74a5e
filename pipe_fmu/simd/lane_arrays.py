"""Lanes in memory: entries of arrays, and scratch on the stack.

In a kernel:

    at = group(first)           the entries first, first + 1, ... of the last axis of a C-contiguous array
    a[k, at]                    their Lanes, read or written; all WIDTH of them must be there
    a[k, six(0)]                the same of six entries: lanes too, for the rows of a node's block
    row(7), grid(7, 9)          scratch of Lanes, of a size given in literal numbers: out[k, i] is Lanes, out[k] a row
    lane(out, 3)                the same scratch as the numbers in lane 3; of Lanes, the number
"""

import math
import operator
from typing import Any

from numba import types
from numba.core import cgutils
from numba.core.typing.templates import AbstractTemplate, infer_global, signature
from numba.extending import intrinsic, lower_builtin, models, register_model

from .lanes import DOUBLE, INDEX, WIDTH, Lanes, lanes, number_in

sextet = Lanes(6)
_BYTES = 8  # of a double, all the alignment that is asked for


class _Group(types.Type):
    """The first of consecutive entries."""

    def __init__(self, taken: Lanes) -> None:
        self.taken = taken
        super().__init__(name=f"Group of {taken}")


class _Scratch(types.Type):
    """Array of Lanes, or of the numbers in one lane of them, of fixed shape."""

    def __init__(self, item: Any, shape: tuple[int, ...]) -> None:
        self.item, self.shape = item, shape
        super().__init__(name=f"Scratch{WIDTH}({item}, {shape})")


@register_model(_Group)
class _GroupModel(models.PrimitiveModel):
    def __init__(self, dmm: Any, fe_type: Any) -> None:
        super().__init__(dmm, fe_type, INDEX)


@register_model(_Scratch)
class _ScratchModel(models.PrimitiveModel):
    def __init__(self, dmm: Any, fe_type: Any) -> None:
        super().__init__(dmm, fe_type, DOUBLE.as_pointer())


@intrinsic
def group(typingctx, first):
    """The WIDTH entries from `first` on."""
    return _Group(lanes)(first), lambda context, builder, sig, args: context.cast(builder, args[0], sig.args[0], types.intp)


@intrinsic
def six(typingctx, first):
    """Six entries from `first` on."""
    return _Group(sextet)(first), lambda context, builder, sig, args: context.cast(builder, args[0], sig.args[0], types.intp)


@intrinsic(prefer_literal=True)
def row(typingctx, n):
    """Scratch of n Lanes, n a literal number; it lives as long as the function that asks for it."""
    return _Scratch(lanes, (n.literal_value,))(n), _stack


@intrinsic(prefer_literal=True)
def rows_of_six(typingctx, n):
    """Scratch of n rows of six numbers, as `row` is one of n Lanes."""
    return _Scratch(sextet, (n.literal_value,))(n), _stack


@intrinsic(prefer_literal=True)
def grid(typingctx, m, n):
    """Scratch of m x n Lanes, m and n literal numbers; it lives as long as the function that asks for it."""
    return _Scratch(lanes, (m.literal_value, n.literal_value))(m, n), _stack


def _stack(context: Any, builder: Any, sig: Any, args: Any) -> Any:
    with builder.goto_entry_block():
        place = builder.alloca(lanes.machine, INDEX(math.prod(sig.return_type.shape)))
    place.align = WIDTH * _BYTES
    return builder.bitcast(place, DOUBLE.as_pointer())


def _index(count: int, last: Any) -> Any:
    """Type of an index of `count` numbers and, if it is not None, `last`."""
    parts = [types.intp] * count + ([] if last is None else [last])
    return types.Tuple(parts) if len(parts) > 1 else parts[0]


def _item(target: Any, index: Any) -> Any:
    """(what an index takes, its type as an index): lanes, a number, or a row of scratch; None where it does not fit."""
    parts: Any = index if isinstance(index, types.BaseTuple) else (index,)
    *rest, last = parts
    if not all(isinstance(part, types.Integer) for part in rest):
        return None
    if isinstance(target, types.Array) and target.layout == "C" and target.dtype == types.float64:
        fits = isinstance(last, _Group) and len(rest) + 1 == target.ndim
        return (last.taken, _index(len(rest), last)) if fits else None
    if not isinstance(target, _Scratch) or not isinstance(last, types.Integer) or len(rest) >= len(target.shape):
        return None
    left = target.shape[len(rest) + 1 :]
    return _Scratch(target.item, left) if left else target.item, _index(len(rest) + 1, None)


def _place(context: Any, builder: Any, item: Any, target: Any, value: Any, kind: Any, index: Any) -> Any:
    """Address of an item."""
    flat, *numbers = cgutils.unpack_tuple(builder, index) if isinstance(kind, types.BaseTuple) else [index]
    if isinstance(target, types.Array):
        array = context.make_array(target)(context, builder, value)
        sizes, start = cgutils.unpack_tuple(builder, array.shape)[1:], array.data
    else:
        sizes, start = [INDEX(n) for n in (*target.shape[1:], WIDTH)], value
        numbers += [INDEX(0)] * (len(sizes) - len(numbers))
    for number, size in zip(numbers, sizes, strict=True):
        flat = builder.add(builder.mul(flat, size), number)
    return builder.bitcast(builder.gep(start, [flat]), (item.machine if isinstance(item, Lanes) else DOUBLE).as_pointer())


@infer_global(operator.getitem)
class _GetItem(AbstractTemplate):
    def generic(self, args: Any, kws: Any) -> Any:
        found = _item(*args)
        return None if found is None else signature(found[0], args[0], found[1])


@infer_global(operator.setitem)
class _SetItem(AbstractTemplate):
    def generic(self, args: Any, kws: Any) -> Any:
        found = _item(*args[:2])
        if found is None or isinstance(found[0], _Scratch) or not (args[2] == found[0] or isinstance(args[2], types.Number)):
            return None
        return signature(types.none, args[0], found[1], found[0])


def _get_item(context: Any, builder: Any, sig: Any, args: Any) -> Any:
    place = _place(context, builder, sig.return_type, sig.args[0], args[0], sig.args[1], args[1])
    return place if isinstance(sig.return_type, _Scratch) else builder.load(place, align=_BYTES)


def _set_item(context: Any, builder: Any, sig: Any, args: Any) -> Any:
    place = _place(context, builder, sig.args[2], sig.args[0], args[0], sig.args[1], args[1])
    builder.store(args[2], place, align=_BYTES)


for _count in range(4):
    for _taken in (lanes, sextet):
        lower_builtin(operator.getitem, types.Array, _index(_count, _Group(_taken)))(_get_item)
        lower_builtin(operator.setitem, types.Array, _index(_count, _Group(_taken)), _taken)(_set_item)
    if _count:
        lower_builtin(operator.getitem, _Scratch, _index(_count, None))(_get_item)
        lower_builtin(operator.setitem, _Scratch, _index(_count, None), types.Any)(_set_item)


@intrinsic
def lane(typingctx, a, k):
    """The number in lane k of Lanes; scratch as the numbers in its lane k."""

    def numbers(context, builder, sig, args):
        return builder.gep(args[0], [context.cast(builder, args[1], sig.args[1], types.intp)])

    if isinstance(a, _Scratch) and isinstance(a.item, Lanes):
        return _Scratch(types.float64, a.shape)(a, k), numbers
    return (types.float64(a, k), number_in) if isinstance(a, Lanes) else None
