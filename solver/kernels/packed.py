"""Rows of form factors in 16 bits each, and products with them.

A code is what remains of a single precision number: 5 bits of its exponent and 11 of its mantissa,
so that rounding is at most 2⁻¹² of each factor. Shifted back by 12 bits it is a number again, and
the scale of its row brings it to its size. 0 is nothing.

One thread owns one row, or one piece of the result: the numbers do not depend on how many
threads there are.
"""

import math

import numba as nb
import numpy as np

from .compiled import inlined, parallel, reordered

#: Bits of the mantissa that are left out, half of the last one kept, and the code of the smallest
#: number: those of no exponent would take a processor long.
_SHIFT, _HALF, _LEAST = 12, 1 << 11, 1 << 11
#: Exponent one above that of the largest factor of a row, and bias of exponents.
_TOP, _BIAS = 31, 127
#: Smallest factor, against the scale of its row, that may get a code.
_FAINT = 2.0**-126 * (1.0 - 2.0**-11)
#: Columns at a time: their numbers and light stay in the processor's nearest cache.
_PIECE = 1024
#: Rows whose products are added one by one, in each sum over rows of scattered factors.
_SUMS = 8


@parallel
def count_codes(factors, scales, counts):
    """How many factors of each row (m, n) are large enough for a code, and scales (m,) of rows."""
    for i in nb.prange(factors.shape[0]):
        row = factors[i]
        most = np.float32(0.0)
        for j in range(row.shape[0]):
            most = max(most, row[j])
        scales[i] = 2.0 ** (math.frexp(most)[1] + _BIAS - _TOP) if most > 0.0 else 0.0
        least = scales[i] * _FAINT
        count = 0
        for j in range(row.shape[0]):
            count += 1 if row[j] >= least and row[j] > 0.0 else 0
        counts[i] = count


@inlined
def _code(value, inverse, one, bits):
    """Code of a factor; ``one`` and ``bits`` are the same memory."""
    one[0] = np.float32(value * inverse)
    code = (bits[0] + np.uint32(_HALF)) >> np.uint32(_SHIFT)
    return np.uint16(code) if code >= _LEAST else np.uint16(0)


@parallel
def pack_full(factors, scales, codes):
    """Codes (m, n) of all factors; ``scales`` (m,) become such that rows keep their sums."""
    for i in nb.prange(factors.shape[0]):
        bits = np.empty(2, dtype=np.uint32)
        one = bits.view(np.float32)
        before = after = 0.0
        inverse = 1.0 / scales[i] if scales[i] > 0.0 else 0.0
        for j in range(factors.shape[1]):
            codes[i, j] = _code(factors[i, j], inverse, one, bits)
            bits[1] = np.uint32(codes[i, j]) << np.uint32(_SHIFT)
            before += factors[i, j]
            after += one[1]
        scales[i] = before / after if after > 0.0 else 0.0


@parallel
def pack_some(factors, scales, start, columns, codes):
    """The same of factors that are not 0: rows begin at ``start`` (m + 1,) of both arrays."""
    for i in nb.prange(factors.shape[0]):
        bits = np.empty(2, dtype=np.uint32)
        one = bits.view(np.float32)
        before = after = 0.0
        at = start[i]
        inverse = 1.0 / scales[i] if scales[i] > 0.0 else 0.0
        for j in range(factors.shape[1]):
            before += factors[i, j]
            code = _code(factors[i, j], inverse, one, bits)
            if code > 0 and at < start[i + 1]:
                bits[1] = np.uint32(code) << np.uint32(_SHIFT)
                after += one[1]
                columns[at], codes[at] = j, code
                at += 1
        # A count that rounding made one too large.
        for k in range(at, start[i + 1]):
            columns[k], codes[k] = 0, 0
        scales[i] = before / after if after > 0.0 else 0.0


@reordered
def multiply_full(codes, scales, light, out):
    """Products of all factors and columns of light (b, n) into ``out`` (m, b)."""
    m, n = codes.shape
    for i in nb.prange(m):
        bits = np.empty(_PIECE, dtype=np.uint32)
        numbers = bits.view(np.float32)
        row = codes[i]
        out[i, :] = 0.0
        for first in range(0, n, _PIECE):
            size = min(_PIECE, n - first)
            some = row[first : first + size]
            for j in range(size):
                bits[j] = np.uint32(some[j]) << np.uint32(_SHIFT)
            for column in range(light.shape[0]):
                lit = light[column, first : first + size]
                total = 0.0
                for j in range(size):
                    total += numbers[j] * lit[j]
                out[i, column] += total
        for column in range(light.shape[0]):
            out[i, column] *= scales[i]


@reordered
def multiply_some(start, columns, codes, scales, light, out):
    """The same for rows of factors that are not 0; ``light`` is (n, b)."""
    b = light.shape[1]
    for i in nb.prange(len(scales)):
        bits = np.empty(_PIECE, dtype=np.uint32)
        numbers = bits.view(np.float32)
        out[i, :] = 0.0
        for first in range(start[i], start[i + 1], _PIECE):
            size = min(_PIECE, start[i + 1] - first)
            some = codes[first : first + size]
            places = columns[first : first + size]
            for j in range(size):
                bits[j] = np.uint32(some[j]) << np.uint32(_SHIFT)
            if b == 1:
                total = 0.0
                for j in range(size):
                    total += numbers[j] * light[places[j], 0]
                out[i, 0] += total
            else:
                for j in range(size):
                    number, lit = np.float64(numbers[j]), light[places[j]]
                    for column in range(b):
                        out[i, column] += number * lit[column]
        for column in range(b):
            out[i, column] *= scales[i]


@parallel
def add_full(codes, values, out):
    """Add products of the columns and ``values`` (b, m), times the scales, to ``out`` (b, n)."""
    m, n = codes.shape
    for piece in nb.prange((n + _PIECE - 1) // _PIECE):
        bits = np.empty(_PIECE, dtype=np.uint32)
        numbers = bits.view(np.float32)
        first = piece * _PIECE
        size = min(_PIECE, n - first)
        for i in range(m):
            some = codes[i, first : first + size]
            for j in range(size):
                bits[j] = np.uint32(some[j]) << np.uint32(_SHIFT)
            for column in range(values.shape[0]):
                value, sums = values[column, i], out[column, first : first + size]
                for j in range(size):
                    sums[j] += value * numbers[j]


@parallel
def add_some(start, columns, codes, values, out):
    """The same for rows of factors that are not 0; ``out`` is (n, b), ``values`` (m, b)."""
    n, b = out.shape
    m = values.shape[0]
    parts = np.zeros((_SUMS, n, b))
    size = (m + _SUMS - 1) // _SUMS
    for part in nb.prange(_SUMS):
        bits = np.empty(1, dtype=np.uint32)
        number = bits.view(np.float32)
        sums = parts[part]
        for i in range(part * size, min(m, (part + 1) * size)):
            for k in range(start[i], start[i + 1]):
                bits[0] = np.uint32(codes[k]) << np.uint32(_SHIFT)
                j = columns[k]
                for column in range(b):
                    sums[j, column] += values[i, column] * number[0]
    for j in nb.prange(n):
        for part in range(_SUMS):
            for column in range(b):
                out[j, column] += parts[part, j, column]


@parallel
def unpack_full(codes, scales, out):
    """Factors (m, n) of codes into ``out``."""
    for i in nb.prange(codes.shape[0]):
        bits = np.empty(1, dtype=np.uint32)
        number = bits.view(np.float32)
        for j in range(codes.shape[1]):
            bits[0] = np.uint32(codes[i, j]) << np.uint32(_SHIFT)
            out[i, j] = scales[i] * number[0]


@parallel
def unpack_some(start, columns, codes, scales, out):
    """The same for rows of factors that are not 0."""
    for i in nb.prange(len(scales)):
        bits = np.empty(1, dtype=np.uint32)
        number = bits.view(np.float32)
        out[i, :] = 0.0
        for k in range(start[i], start[i + 1]):
            bits[0] = np.uint32(codes[k]) << np.uint32(_SHIFT)
            if codes[k] > 0:
                out[i, columns[k]] = scales[i] * number[0]


@parallel
def sum_groups(values, group, out):
    """Sums of the columns of each group (n,) of ``values`` (m, n) into ``out`` (m, g)."""
    for i in nb.prange(values.shape[0]):
        out[i, :] = 0.0
        for j in range(values.shape[1]):
            out[i, group[j]] += values[i, j]


@reordered
def add_products(matrix, values, out):
    """Add products of the columns of a matrix (m, n) and ``values`` (b, m) to ``out`` (b, n)."""
    m, n = matrix.shape
    for piece in nb.prange((n + _PIECE - 1) // _PIECE):
        first = piece * _PIECE
        size = min(_PIECE, n - first)
        for i in range(m):
            some = matrix[i, first : first + size]
            for column in range(values.shape[0]):
                value, sums = values[column, i], out[column, first : first + size]
                for j in range(size):
                    sums[j] += value * some[j]
