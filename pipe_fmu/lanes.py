"""Several numbers at once: what the kernels write for one element or node is done for WIDTH of them in the registers of the processor.

`Lanes` is a numba type of WIDTH doubles with the arithmetic of a number, so that a formula of `so3` or `element` takes either. In a kernel:

    at = group(first)           the entries first, first + 1, ... of the last axis of a C-contiguous array
    a[k, at]                    their Lanes, read or written; all WIDTH of them must be there
    a[k, six(0)]                the same of six entries: lanes too, for the rows of a node's block
    row(7), grid(7, 9)          scratch of Lanes on the stack, of a size given in literal numbers: out[k, i] is Lanes, out[k] a row
    lane(out, 3)                the same scratch as the numbers in lane 3; of Lanes, the number

`below` asks whether all lanes are below a bound (for a series), `above` is 1 in the lanes above it and 0 elsewhere, `lane_by_lane` takes a
function to the lanes that no series will do for, `total` and `largest` reduce lanes to a number. All of them take plain numbers too.
"""

import math
import operator
from typing import Any

from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.core.typeconv import Conversion
from numba.core.typing.templates import AbstractTemplate, infer_global, signature
from numba.extending import intrinsic, lower_builtin, lower_cast, models, overload, register_jitable, register_model

WIDTH = 8

_I64 = ir.IntType(64)
_DOUBLE = ir.DoubleType()
_BYTES = 8  # of a double


class _Lanes(types.Type):
    """Doubles side by side."""

    def __init__(self, width: int) -> None:
        self.width = width
        self.machine = ir.VectorType(_DOUBLE, width)
        super().__init__(name=f"Lanes{width}")

    def can_convert_from(self, typingctx: Any, other: Any) -> Any:
        return Conversion.unsafe if isinstance(other, types.Number) else None

    def unify(self, typingctx: Any, other: Any) -> Any:
        return self if isinstance(other, types.Number) else None


class _Group(types.Type):
    """The first of consecutive entries."""

    def __init__(self, taken: _Lanes) -> None:
        self.taken = taken
        super().__init__(name=f"Group of {taken}")


class _Scratch(types.Type):
    """Array of Lanes, or of the numbers in one lane of them, of fixed shape."""

    def __init__(self, item: Any, shape: tuple[int, ...]) -> None:
        self.item, self.shape = item, shape
        super().__init__(name=f"Scratch{WIDTH}({item}, {shape})")


lanes, sextet = _Lanes(WIDTH), _Lanes(6)


@register_model(_Lanes)
class _LanesModel(models.PrimitiveModel):
    def __init__(self, dmm: Any, fe_type: Any) -> None:
        super().__init__(dmm, fe_type, fe_type.machine)


@register_model(_Group)
class _GroupModel(models.PrimitiveModel):
    def __init__(self, dmm: Any, fe_type: Any) -> None:
        super().__init__(dmm, fe_type, _I64)


@register_model(_Scratch)
class _ScratchModel(models.PrimitiveModel):
    def __init__(self, dmm: Any, fe_type: Any) -> None:
        super().__init__(dmm, fe_type, _DOUBLE.as_pointer())


def _splat(builder: Any, kind: _Lanes, value: Any) -> Any:
    one = builder.insert_element(ir.Constant(kind.machine, ir.Undefined), value, _I64(0))
    return builder.shuffle_vector(one, one, ir.Constant(ir.VectorType(ir.IntType(32), kind.width), [0] * kind.width))


@lower_cast(types.Number, _Lanes)
def _number_to_lanes(context: Any, builder: Any, fromty: Any, toty: Any, value: Any) -> Any:
    return _splat(builder, toty, context.cast(builder, value, fromty, types.float64))


# Arithmetic


def _arithmetic(function: Any, count: int, build: Any) -> None:
    """`function` of `count` numbers or lanes, at least one of them lanes, built by `build(builder, *vectors)`."""

    @infer_global(function)
    class _Typing(AbstractTemplate):
        def generic(self, args: Any, kws: Any) -> Any:
            kinds = {a for a in args if isinstance(a, _Lanes)}
            fits = len(args) == count and len(kinds) == 1 and all(isinstance(a, _Lanes | types.Number) for a in args)
            return signature(*[*kinds] * (count + 1)) if fits else None

    lower_builtin(function, *[_Lanes] * count)(lambda context, builder, sig, args: build(builder, *args))


def _named(name: str) -> Any:
    """Builder of a call of LLVM's function `name` of vectors."""

    def build(builder: Any, *args: Any) -> Any:
        kind = args[0].type
        declared = ir.FunctionType(kind, [kind] * len(args))
        return builder.call(cgutils.get_or_insert_function(builder.module, declared, f"llvm.{name}.v{kind.count}f64"), args)

    return build


for _name, _build in (("add", "fadd"), ("sub", "fsub"), ("mul", "fmul"), ("truediv", "fdiv")):
    for _operator in (getattr(operator, _name), getattr(operator, f"i{_name}")):
        _arithmetic(_operator, 2, lambda builder, a, b, build=_build: getattr(builder, build)(a, b))
_arithmetic(operator.neg, 1, lambda builder, a: builder.fneg(a))
_arithmetic(math.sqrt, 1, _named("sqrt"))
_arithmetic(math.fabs, 1, _named("fabs"))
_arithmetic(math.copysign, 2, _named("copysign"))
_arithmetic(max, 2, _named("maxnum"))
_arithmetic(min, 2, _named("minnum"))


# Entries of arrays and of scratch


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
        place = builder.alloca(lanes.machine, _I64(math.prod(sig.return_type.shape)))
    place.align = WIDTH * _BYTES
    return builder.bitcast(place, _DOUBLE.as_pointer())


def _index(count: int, last: Any) -> Any:
    """Type of an index of `count` numbers and, if it is not None, `last`."""
    parts = [types.intp] * count + ([] if last is None else [last])
    return types.Tuple(parts) if len(parts) > 1 else parts[0]


def _item(target: Any, index: Any) -> Any:
    """(what an index takes, its type as an index): lanes, a number, or a row of scratch; None where it does not fit."""
    *rest, last = tuple(index) if isinstance(index, types.BaseTuple) else (index,)
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
        sizes, start = [_I64(n) for n in (*target.shape[1:], WIDTH)], value
        numbers += [_I64(0)] * (len(sizes) - len(numbers))
    for number, size in zip(numbers, sizes, strict=True):
        flat = builder.add(builder.mul(flat, size), number)
    return builder.bitcast(builder.gep(start, [flat]), (item.machine if isinstance(item, _Lanes) else _DOUBLE).as_pointer())


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

    def number(context, builder, sig, args):
        return builder.extract_element(args[0], context.cast(builder, args[1], sig.args[1], types.intp))

    def numbers(context, builder, sig, args):
        return builder.gep(args[0], [context.cast(builder, args[1], sig.args[1], types.intp)])

    if isinstance(a, _Scratch) and isinstance(a.item, _Lanes):
        return _Scratch(types.float64, a.shape)(a, k), numbers
    return (types.float64(a, k), number) if isinstance(a, _Lanes) else None


# Lanes one by one


@intrinsic
def _put_lane(typingctx, out, k, value):
    """`out` with `value`, a number or a tuple of them, in lane k; `out` None: in all lanes."""
    many = isinstance(value, types.BaseTuple)

    def build(context, builder, sig, args):
        k = context.cast(builder, args[1], sig.args[1], types.intp)
        numbers = cgutils.unpack_tuple(builder, args[2]) if many else [args[2]]
        if sig.args[0] == types.none:
            made = [_splat(builder, lanes, number) for number in numbers]
        else:
            before = cgutils.unpack_tuple(builder, args[0]) if many else [args[0]]
            made = [builder.insert_element(vector, number, k) for vector, number in zip(before, numbers, strict=True)]
        return context.make_tuple(builder, sig.return_type, made) if many else made[0]

    return (types.UniTuple(lanes, value.count) if many else lanes)(out, k, value), build


def lane_by_lane(function: Any) -> Any:
    """A compiled function of one number, giving a number or a tuple of numbers, for use in kernels on a number or on lanes."""

    def either(a):
        raise NotImplementedError("in kernels only")

    @overload(either)
    def _either(a):
        if a != lanes:
            return lambda a: function(a)

        def one_by_one(a):
            out = _put_lane(None, 0, function(lane(a, 0)))
            for k in range(1, WIDTH):
                out = _put_lane(out, k, function(lane(a, k)))
            return out

        return one_by_one

    return either


def total(a):
    """Sum of the lanes."""
    raise NotImplementedError("in kernels only")


def largest(a):
    """Largest of the lanes; NaN if one is."""
    raise NotImplementedError("in kernels only")


def below(a, bound):
    """Whether a number, or all lanes, are below a bound (number)."""
    raise NotImplementedError("in kernels only")


def above(a, bound):
    """1 where a number, or a lane, is above a bound (number), 0 elsewhere."""
    raise NotImplementedError("in kernels only")


def _reduction(function: Any, fold: Any) -> None:
    @overload(function)
    def _reduce(a):
        if a != lanes:
            return lambda a: a

        def folded(a):
            out = lane(a, 0)
            for k in range(1, WIDTH):
                out = fold(out, lane(a, k))
            return out

        return folded


@register_jitable
def _sum(a, b):
    return a + b


@register_jitable
def _larger(a, b):
    return a if a >= b or a != a else b


_reduction(total, _sum)
_reduction(largest, _larger)


@overload(below)
def _below(a, bound):
    if a == lanes:
        return lambda a, bound: largest(a) < bound
    return lambda a, bound: a < bound


@overload(above)
def _above(a, bound):
    return (lambda a, bound: _exceeds(a, bound)) if a == lanes else (lambda a, bound: 1.0 if a > bound else 0.0)


@intrinsic
def _exceeds(typingctx, a, bound):
    def build(context, builder, sig, args):
        return builder.uitofp(builder.fcmp_ordered(">", *args), lanes.machine)

    return lanes(lanes, lanes), build
