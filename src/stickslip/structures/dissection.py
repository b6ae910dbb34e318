"""Nested dissection: an order of unknowns in which a sparse matrix is factored with little fill.

Parts are cut along levels of breadth-first searches [1].

References
----------
.. [1] A. George and J. W.-H. Liu, An automatic nested dissection algorithm for irregular finite
   element problems, SIAM J. Numer. Anal. 15 (1978).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from stickslip.arrays import Array

_LEAF = 96  # number of unknowns of a part that is not divided further
# number of neighbours, relative to the square root of the number of unknowns, above which level
# structures fail
_MANY = 10.0


@dataclass
class _Graph:
    """The part of a graph that is not dissected yet.

    Attributes
    ----------
    edges : sparse array
        Between vertices that are in no block yet.
    weight : array of int
        Unknowns of each vertex.
    part : array of int
        Of which connected part a vertex is; -1 if it is in a block.
    """

    edges: Any
    weight: Array
    part: Array

    def without(self, left: Array) -> None:
        """Keep only edges between vertices that are left."""
        from scipy.sparse import csr_array

        e, n = self.edges, len(left)
        rows = np.repeat(np.arange(n), np.diff(e.indptr))
        some = left[rows] & left[e.indices]
        starts = np.concatenate([[0], np.cumsum(np.bincount(rows[some], minlength=n))])
        parts = (e.data[some], e.indices[some], starts.astype(e.indptr.dtype))
        self.edges = csr_array(parts, shape=(n, n))


def dissected(matrix: Any) -> Array:
    """The block of each unknown, shape (n,): blocks are eliminated in their order.

    Parameters
    ----------
    matrix : sparse array, shape (n, n)
        In compressed columns, with a symmetric pattern.
    """
    from scipy.sparse import csr_array
    from scipy.sparse.csgraph import connected_components

    group, weight, edges = _compressed(matrix)
    n = len(weight)
    graph = _Graph(csr_array(edges), weight, np.full(n, -1))
    block, depth = np.full(n, -1), list[int]()
    left = np.diff(graph.edges.indptr) <= 40 + _MANY * np.sqrt(n)

    def put(vertices: Array, labels: Array, level: int) -> None:
        _, labels = np.unique(labels, return_inverse=True)
        block[vertices] = len(depth) + labels
        depth.extend([level] * (int(labels.max(initial=-1)) + 1))
        left[vertices] = False

    hubs = np.flatnonzero(~left)  # such as masters of rigid connections
    put(hubs, np.zeros(len(hubs), dtype=int), 0)
    side, ends, level = np.zeros(n, dtype=int), None, 0
    while left.any():
        level += 1
        graph.without(left)
        _, part = connected_components(graph.edges, directed=False)
        small = left & (np.bincount(part, weights=weight * left)[part] <= _LEAF)
        few = np.flatnonzero(small)
        few = few[np.lexsort((part[few], side[few]))]
        packed = np.cumsum(weight[few]) // _LEAF
        put(few, side[few] * (packed.max(initial=0) + 1) + packed, n)
        graph.part = np.full(n, -1)
        rest = np.flatnonzero(left)
        if not len(rest):
            break
        graph.part[rest] = np.unique(part[rest], return_inverse=True)[1]
        cut, side, ends = _cut(graph, rest, ends)
        put(cut, graph.part[cut], level)
    rank = np.empty(len(depth), dtype=int)
    rank[np.argsort(-np.array(depth), kind="stable")] = np.arange(len(depth))
    return rank[block][group]


def _compressed(matrix: Any) -> tuple[Array, Array, Any]:
    """Unknowns with the same neighbours, such as those of a node, as one vertex: the vertex of each
    unknown, how many each has, and edges."""
    from scipy.sparse import csc_array

    n = matrix.shape[0]
    ones = csc_array((np.ones(matrix.nnz, dtype=np.int64), matrix.indices, matrix.indptr), (n, n))
    # hash: different sets have different sums
    marks = np.random.default_rng(0).integers(1, 2**62, n)
    _, first, group = np.unique(ones @ marks, return_index=True, return_inverse=True)
    edges = ones if len(first) == n else ones[first][:, first].tocsc()
    if len(first) == n:
        group = np.arange(n)
    return group, np.bincount(group), edges


def _depths(graph: _Graph, starts: Array) -> Array:
    """Distance, in edges, of each vertex from the nearest of given vertices; −1 if there is no
    path."""
    from scipy.sparse import csr_array
    from scipy.sparse.csgraph import breadth_first_order

    e, n = graph.edges, graph.edges.shape[0]
    indices = np.concatenate([e.indices, starts.astype(e.indices.dtype)])
    indptr = np.append(e.indptr, e.indptr[-1] + len(starts)).astype(e.indices.dtype)
    all_ways = csr_array((np.ones(len(indices), dtype=np.int8), indices, indptr), (n + 1, n + 1))
    order, before = breadth_first_order(all_ways, n)
    reached = np.zeros(n + 1, dtype=bool)
    reached[order] = True
    before = np.where(reached, before, n)
    before[n] = n
    depth = np.where(np.arange(n + 1) != n, 1, 0)
    while np.any(before != n):  # each round takes twice as many steps back
        depth += depth[before]
        before = before[before]
    return np.where(reached, depth - 1, -1)[:n]


def _cut(graph: _Graph, rest: Array, ends: Array | None) -> tuple[Array, Array, Array]:
    """Separators of all parts, a label of each side, and vertices at ends of parts."""
    part, weight = graph.part, graph.weight
    label = part[rest]
    parts = int(label.max()) + 1

    def farthest(depth: Array) -> tuple[Array, Array]:
        top = np.full(parts, -1)
        np.maximum.at(top, label, depth[rest])
        all_of = rest[depth[rest] == top[label]]
        return all_of, all_of[np.unique(part[all_of], return_index=True)[1]]

    _, starts = farthest(np.zeros(len(part), dtype=int) if ends is None else ends)
    far, single = farthest(_depths(graph, starts))
    tried: list[tuple[Array, Array]] = []
    best = np.full(parts, np.inf)
    chosen = np.zeros(parts, dtype=int)
    first = np.zeros(0)
    # Level sets from an entire end give plane cuts across long parts; from single vertices they are
    # small if a part is as wide as long.
    for number, begin in enumerate((far, single)):
        first = _depths(graph, begin)
        second = _depths(graph, farthest(first)[number])
        side = _halves(first - second, graph, rest, parts)
        cut = _border(graph, side, parts)
        size = np.bincount(part[cut], weights=weight[cut], minlength=parts).astype(float)
        beyond = np.bincount(label, weights=weight[rest] * (side[rest] == 2), minlength=parts)
        whole = np.flatnonzero(beyond == 0)  # all at the same distance: this part is a block
        size[whole] = np.inf
        chosen[size < best] = number
        best = np.minimum(size, best)
        tried.append((cut, side))
    chosen[np.isinf(best)] = -1
    cuts = [cut[chosen[part[cut]] == number] for number, (cut, _) in enumerate(tried)]
    cuts.append(rest[chosen[label] == -1])
    side = np.where(chosen[part] == 0, tried[0][1], tried[1][1])
    return np.concatenate(cuts), 3 * part + side, first


def _halves(place: Array, graph: _Graph, rest: Array, parts: int) -> Array:
    """Side 1 or 2 of each vertex, by a level that halves its part; 0 of others."""
    part = graph.part
    order = rest[np.lexsort((place[rest], part[rest]))]
    label, weight = part[order], graph.weight[order]
    total = np.bincount(label, weights=weight, minlength=parts)
    before = np.concatenate([[0.0], np.cumsum(total)])[:-1]
    share = (np.cumsum(weight) - before[label]) / total[label]
    turns = (np.diff(place[order], append=0) != 0) | (np.diff(label, append=-1) != 0)
    last = np.flatnonzero(turns)
    near = last[np.lexsort((np.abs(share[last] - 0.5), label[last]))]
    best = near[np.unique(label[near], return_index=True)[1]]
    side = np.zeros(len(part), dtype=int)
    side[rest] = 1 + (place[rest] > place[order[best]][part[rest]])
    return side


def _border(graph: _Graph, side: Array, parts: int) -> Array:
    """For each part, the boundary vertices of the side that has fewer of them."""
    e, part = graph.edges, graph.part
    rows = np.repeat(np.arange(len(side)), np.diff(e.indptr))
    some = (side[rows] == 1) & (side[e.indices] == 2)
    first, second = np.unique(rows[some]), np.unique(e.indices[some])
    sizes = [
        np.bincount(part[ends], weights=graph.weight[ends], minlength=parts)
        for ends in (first, second)
    ]
    fewer = sizes[0] <= sizes[1]
    return np.concatenate([first[fewer[part[first]]], second[~fewer[part[second]]]])
