"""A compiled heap of rows, cheapest first: column 0 the cost, column 1 the row."""

from __future__ import annotations

from ..jit import kernel


@kernel
def push(heap, size, score, row):
    """Put a row on the heap, cheapest first; its new size, the same if it is full."""
    if size == len(heap):
        return size
    k = size
    while k > 0 and heap[(k - 1) // 2, 0] > score:
        heap[k, 0], heap[k, 1] = heap[(k - 1) // 2, 0], heap[(k - 1) // 2, 1]
        k = (k - 1) // 2
    heap[k, 0], heap[k, 1] = score, row
    return size + 1


@kernel
def pop(heap, size):
    """The cheapest row; its place is taken by the last, which sinks."""
    row, size = int(heap[0, 1]), size - 1
    score, last, k = heap[size, 0], heap[size, 1], 0
    while 2 * k + 1 < size:
        child = 2 * k + 1
        if child + 1 < size and heap[child + 1, 0] < heap[child, 0]:
            child += 1
        if heap[child, 0] >= score:
            break
        heap[k, 0], heap[k, 1] = heap[child, 0], heap[child, 1]
        k = child
    heap[k, 0], heap[k, 1] = score, last
    return row
