"""Frequencies of the beam's own finite elements in 50 decimal digits: what round-off alone makes of the double ones.

Planar Timoshenko cantilever at rest, transverse: cubic Lagrange functions for u and α at evenly spaced nodes, internal
energy ∫ ½ EI α'² + ½ GA (u' − α)² by three Gauss points, kinetic energy exactly. Written with `decimal` and banded
elimination; nothing of rotfem is used.
"""

from __future__ import annotations

from decimal import Decimal, localcontext

DIGITS = 50
D = Decimal
#: βL of the Euler–Bernoulli cantilever: (βL)² is where the frequencies are looked for.
BETA = ("1.8751040687119611664", "4.6940911329741745764", "7.8547574382376125649")
NODES = [D(i) / 3 for i in range(4)]

Matrix = list[dict[int, Decimal]]


def _gauss(n: int) -> list[tuple[Decimal, Decimal]]:
    """Return (place on [0, 1], weight) of the rule with three or four points."""
    if n == 3:
        x = (D(3) / 5).sqrt()
        points = [(-x, D(5) / 9), (D(0), D(8) / 9), (x, D(5) / 9)]
    else:
        root, third = (D(6) / 5).sqrt(), D(30).sqrt()
        a, b = ((D(3) / 7 - s * D(2) / 7 * root).sqrt() for s in (1, -1))
        wa, wb = ((18 + s * third) / 36 for s in (1, -1))
        points = [(-b, wb), (-a, wa), (a, wa), (b, wb)]
    return [((1 + x) / 2, w / 2) for x, w in points]


def _shape(x: Decimal) -> tuple[list[Decimal], list[Decimal]]:
    """Return values and derivatives of the four cubic functions at x."""
    values, slopes = [], []
    for i, xi in enumerate(NODES):
        others = [xj for j, xj in enumerate(NODES) if j != i]
        below = (xi - others[0]) * (xi - others[1]) * (xi - others[2])
        a, b, c = (x - o for o in others)
        values.append(a * b * c / below)
        slopes.append((a * b + b * c + a * c) / below)
    return values, slopes


def _matrices(elements: int, EI: Decimal, GA: Decimal, inertia: Decimal) -> tuple[Matrix, Matrix]:
    """Return K and M of unit length and mass per length, rows as {column: entry}; unknowns u, α node by node."""
    h, size = D(1) / elements, 2 * (3 * elements + 1)
    K: Matrix = [{} for _ in range(size)]
    M: Matrix = [{} for _ in range(size)]

    def add(A: Matrix, e: int, row: list[Decimal], factor: Decimal) -> None:
        for i, a in enumerate(row):
            for j, b in enumerate(row):
                if a and b:
                    r, c = 6 * e + i, 6 * e + j
                    A[r][c] = A[r].get(c, D(0)) + factor * a * b

    zero = D(0)
    for e in range(elements):
        for x, w in _gauss(3):
            N, dN = _shape(x)
            bend = [v for d in dN for v in (zero, d / h)]
            shear = [v for n, d in zip(N, dN, strict=True) for v in (d / h, -n)]
            add(K, e, bend, EI * w * h)
            add(K, e, shear, GA * w * h)
        for x, w in _gauss(4):
            N, _ = _shape(x)
            add(M, e, [v for n in N for v in (n, zero)], w * h)
            add(M, e, [v for n in N for v in (zero, n)], inertia * w * h)
    return tuple([{c - 2: v for c, v in row.items() if c > 1} for row in A[2:]] for A in (K, M))  # type: ignore[return-value]


def _solve(A: Matrix, b: list[Decimal]) -> list[Decimal]:
    """Return x with A x = b for a symmetric banded A, which is destroyed."""
    n, x = len(b), list(b)
    for i in range(n):
        pivot = A[i][i]
        for r in [r for r in A[i] if r > i]:
            factor = A[r].get(i, D(0)) / pivot
            if factor:
                for c, v in A[i].items():
                    if c > i:
                        A[r][c] = A[r].get(c, D(0)) - factor * v
                x[r] -= factor * x[i]
    for i in reversed(range(n)):
        x[i] = (x[i] - sum((v * x[c] for c, v in A[i].items() if c > i), D(0))) / A[i][i]
    return x


def _times(A: Matrix, x: list[Decimal]) -> list[Decimal]:
    return [sum((v * x[c] for c, v in row.items()), D(0)) for row in A]


def frequencies(elements: int, slenderness: float, count: int = 3) -> list[float]:
    """Return the first ω of EI = L = m = 1, GA = 0.4/s², I_ρ = s², to double precision; s is the slenderness r/L."""
    with localcontext() as context:
        context.prec = DIGITS
        s = D(slenderness)
        K, M = _matrices(elements, D(1), D("0.4") / s**2, s**2)
        out = []
        for beta in BETA[:count]:
            square = D(beta) ** 4
            x = [D(1 + i % 7) for i in range(len(K))]
            for _ in range(14):
                shifted = [{c: v - square * M[r].get(c, D(0)) for c, v in row.items()} for r, row in enumerate(K)]
                y = _solve(shifted, _times(M, x))
                size = max(abs(v) for v in y)
                y = [v / size for v in y]
                Ky, My = _times(K, y), _times(M, y)
                new = sum(a * b for a, b in zip(y, Ky, strict=True)) / sum(a * b for a, b in zip(y, My, strict=True))
                done, x, square = abs(new - square) < D("1e-30") * new, y, new
                if done:
                    break
            out.append(float(square.sqrt()))
        return out
