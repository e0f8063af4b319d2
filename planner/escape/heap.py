"""A compiled heap of rows, cheapest first; see `tree_arrays.HEAP` for its columns."""

from __future__ import annotations

from ..jit import inlined, kernel
from .tree_arrays import HEAP


@inlined
def _put(heap, k, cost, row):
    heap[k, HEAP.cost], heap[k, HEAP.row] = cost, row


@kernel
def push(heap, size, score, row):
    """Put a row on the heap; returns its new size, the old one if the heap is full.

    Args:
        heap: (n, 3) the heap.
        size: number of its entries.
        score: cost of the row.
        row: number of the row.
    """
    if size == len(heap):
        return size
    k = size
    while k > 0 and heap[(k - 1) // 2, HEAP.cost] > score:
        _put(heap, k, heap[(k - 1) // 2, HEAP.cost], heap[(k - 1) // 2, HEAP.row])
        k = (k - 1) // 2
    _put(heap, k, score, row)
    return size + 1


@kernel
def pop(heap, size):
    """Remove the cheapest row and return it.

    Args:
        heap: (n, 3) the heap.
        size: number of its entries, one less afterwards.
    """
    row, size = int(heap[0, HEAP.row]), size - 1
    score, last, k = heap[size, HEAP.cost], heap[size, HEAP.row], 0
    while 2 * k + 1 < size:
        child = 2 * k + 1
        if child + 1 < size and heap[child + 1, HEAP.cost] < heap[child, HEAP.cost]:
            child += 1
        if heap[child, HEAP.cost] >= score:
            break
        _put(heap, k, heap[child, HEAP.cost], heap[child, HEAP.row])
        k = child
    _put(heap, k, score, last)
    return row
