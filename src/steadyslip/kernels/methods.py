"""Integration methods: explicit and Rosenbrock pairs, checked against their order conditions.

An explicit Runge-Kutta step is y1 = y0 + h Σ b_i k_i with k_i = f(y0 + h Σ a_ij k_j); a Rosenbrock step in
the form of Hairer & Wanner (Solving ODEs II, IV.7) solves (1/(hγ) − J) u_i = f(y0 + Σ A_ij u_j) +
Σ (C_ij/h) u_j and gives y1 = y0 + Σ m_i u_i. A tableau is accepted only if every rooted tree up to its order
(of the result, the embedded error estimate and the dense output) satisfies its condition.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cache, cached_property

import numpy as np

from steadyslip.kernels import dop853 as table

Tree = tuple["Tree", ...]
_ROUNDING = 2e-9  # largest accepted violation of an order condition; coefficients are published with ten digits or more


@cache
def rooted_trees(order: int) -> tuple[Tree, ...]:
    """All rooted trees with `order` nodes, each as the sorted tuple of its branches."""
    if order == 1:
        return ((),)
    return tuple(sorted({tuple(sorted(branches)) for branches in _forests(order - 1, order - 1)}))


def _forests(nodes: int, largest: int) -> Iterator[Tree]:
    if nodes == 0:
        yield ()
    for size in range(1, min(nodes, largest) + 1):
        for first in rooted_trees(size):
            for rest in _forests(nodes - size, size):
                yield (first, *rest)


def _nodes(tree: Tree) -> int:
    return 1 + sum(map(_nodes, tree))


def _density(tree: Tree) -> int:
    product = _nodes(tree)
    for branch in tree:
        product *= _density(branch)
    return product


Known = dict[Tree, np.ndarray]


def _weights(tree: Tree, alpha: np.ndarray, beta: np.ndarray, known: Known) -> np.ndarray:
    """Elementary weight of a tree for each stage; nodes with one branch use β (with the linear part), other nodes α."""
    if tree not in known:
        through = beta if len(tree) == 1 else alpha
        product = np.ones(len(alpha))
        for branch in tree:
            product = product * (through @ _weights(branch, alpha, beta, known))
        known[tree] = product
    return known[tree]


def order_defect(
    b: np.ndarray, alpha: np.ndarray, beta: np.ndarray, order: int, theta: float = 1.0, known: Known | None = None
) -> float:
    """Largest violation of the order conditions up to `order` by the weights b, for the result at t0 + theta h."""
    worst, known = 0.0, {} if known is None else known
    for nodes in range(1, order + 1):
        for tree in rooted_trees(nodes):
            defect = float(b @ _weights(tree, alpha, beta, known)) - theta**nodes / _density(tree)
            worst = max(worst, abs(defect))
    return worst


@dataclass(frozen=True, eq=False)
class Method:
    """Coefficients (tableau) of an integration method.

    Attributes
    ----------
    name : str
    order, error_order, dense_order : int
        Order of the result, of the embedded result, and of the dense output.
    a, c : tuple of tuple of float
        Explicit: a_ij (the last row gives y1), and c is empty. Rosenbrock: A_ij and C_ij; after the last row of A, the
        argument of each stage, and y1, is the previous argument plus the newest stage. An explicit method may have
        rows after that of y1, for stages that only its dense output needs.
    error : tuple of float
        Weights of the stages in the error estimate.
    lower_error : tuple of float
        Weights of the stages in a second error estimate e of lower order; the error is then E² / sqrt(E² + e²/100)
        with the first estimate E, as in DOP853. Empty for none.
    lower_order : int
        Order of the second embedded result.
    dense : tuple of tuple of float
        Explicit: b_i(θ) = Σ_j dense[i][j] θ^(j+1), extra stages included. Rosenbrock: rows of the polynomial
        (1−θ) y0 + θ (y1 + (1−θ)(r_1 + θ (r_2 + ...))) with r_j = Σ dense[j][i] u_i.
    gamma : float
        Diagonal of a Rosenbrock method, 0 if explicit.
    """

    name: str
    order: int
    error_order: int
    dense_order: int
    a: tuple[tuple[float, ...], ...]
    c: tuple[tuple[float, ...], ...]
    error: tuple[float, ...]
    dense: tuple[tuple[float, ...], ...]
    gamma: float = 0.0
    lower_error: tuple[float, ...] = ()
    lower_order: int = 0

    def __post_init__(self) -> None:
        b, embedded, alpha, beta = self._canonical()
        known: Known = {}

        def violated(weights: np.ndarray, order: int, theta: float = 1.0) -> float:
            return order_defect(weights, alpha, beta, order, theta, known)

        checks = {"result": violated(b, self.order), "error estimate": violated(embedded, self.error_order)}
        if self.lower_error:
            checks["lower estimate"] = violated(b - self._padded(self.lower_error), self.lower_order)
        for theta in (0.25, 0.6):
            checks[f"dense output at {theta}"] = violated(self.dense_weights(theta), self.dense_order, theta)
        for what, defect in checks.items():
            if not defect < _ROUNDING:
                raise ValueError(f"{self.name}: {what} violates an order condition by {defect:.3g}")

    @property
    def implicit(self) -> bool:
        return self.gamma != 0

    @property
    def stages(self) -> int:
        """Number of stages of a step."""
        return len(self.error)

    @property
    def all_stages(self) -> int:
        """Number of stages, including those that only dense output needs."""
        return self.stages if self.implicit else len(self.a)

    @cached_property
    def dense_stages(self) -> tuple[int, ...]:
        """Indices of the stages on which dense output depends."""
        if self.implicit:
            return tuple(range(self.stages))
        rows = self._full(list(self.a))[self.stages :]
        weights = np.vstack([np.array(self.dense).T, rows])
        return tuple(i for i in range(self.stages) if weights[:, i].any())

    def arguments(self) -> list[tuple[float, ...]]:
        """Weights of the earlier stages in the argument of each stage, and in the result (last row)."""
        rows = [tuple(row) for row in self.a]
        while self.implicit and len(rows) <= self.stages:
            rows.append((*rows[-1], *(0.0,) * (len(rows) - 1 - len(rows[-1])), 1.0))
        return rows

    @cached_property
    def _lower(self) -> np.ndarray:
        """Matrix Γ of a Rosenbrock method, with stages u = Γ k (without h)."""
        matrix = np.eye(self.stages) / self.gamma
        for i, row in enumerate(self.c):
            matrix[i, : len(row)] -= row
        return np.linalg.inv(matrix)

    def _full(self, rows: list[tuple[float, ...]]) -> np.ndarray:
        matrix = np.zeros((len(rows), self.all_stages))
        for i, row in enumerate(rows):
            matrix[i, : len(row)] = row
        return matrix

    def _padded(self, weights: tuple[float, ...]) -> np.ndarray:
        return np.pad(np.array(weights), (0, self.all_stages - len(weights)))

    def _canonical(self) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """b, embedded b, α and β in the notation of the order conditions."""
        rows = self._full(self.arguments())
        error = self._padded(self.error)
        if not self.implicit:
            return rows[self.stages - 1], rows[self.stages - 1] - error, rows, rows
        gamma = self._lower
        alpha = rows[: self.stages] @ gamma
        b = rows[self.stages] @ gamma
        return b, b - error @ gamma, alpha, alpha + gamma

    def dense_weights(self, theta: float) -> np.ndarray:
        """b(θ) in the notation of the order conditions."""
        if not self.implicit:
            powers = theta ** np.arange(1, len(self.dense[0]) + 1)
            return np.asarray(np.array(self.dense) @ powers)
        inner = np.zeros(self.stages)
        for row in reversed(self.dense):
            inner = theta * inner + np.array(row)
        last = np.array(self.arguments()[self.stages])
        return np.asarray(theta * (last + (1 - theta) * inner) @ self._lower)

    @cached_property
    def nodes(self) -> tuple[float, ...]:
        """Fraction of the step at which each stage evaluates the inputs."""
        alpha = self._canonical()[2]
        return tuple(float(x) for x in np.round(alpha.sum(axis=1), 14))

    @cached_property
    def time_weights(self) -> tuple[float, ...]:
        """Weight of h ∂f/∂t in each stage of a Rosenbrock method."""
        return tuple(float(x) for x in np.round(self._lower.sum(axis=1), 14))


@cache
def explicit() -> Method:
    """Tsitouras (2011), order 5(4), with its free dense output of order 4."""
    return Method(
        name="tsit5",
        order=5,
        error_order=4,
        dense_order=4,
        a=(
            (),
            (0.161,),
            (-0.008480655492356989, 0.335480655492357),
            (2.8971530571054935, -6.359448489975075, 4.3622954328695815),
            (5.325864828439257, -11.748883564062828, 7.4955393428898365, -0.09249506636175525),
            (5.86145544294642, -12.92096931784711, 8.159367898576159, -0.071584973281401, -0.028269050394068383),
            (
                0.09646076681806523, 0.01, 0.4798896504144996, 1.379008574103742, -3.290069515436081, 2.324710524099774,
            ),
        ),
        c=(),
        error=(
            -0.00178001105222577714, -0.0008164344596567469, 0.007880878010261995, -0.1447110071732629,
            0.5823571654525552, -0.45808210592918697, 1 / 66,
        ),
        dense=(
            (1.0, -2.763706197274826, 2.9132554618219126, -1.0530884977290216),
            (0.0, 0.13169999999999998, -0.2234, 0.1017),
            (0.0, 3.9302962368947516, -5.941033872131505, 2.490627285651253),
            (0.0, -12.411077166933676, 30.33818863028232, -16.548102889244902),
            (0.0, 37.50931341651104, -88.1789048947664, 47.37952196281928),
            (0.0, -27.896526289197286, 65.09189467479366, -34.87065786149661),
            (0.0, 1.5, -4.0, 2.5),
        ),
    )  # fmt: skip


@cache
def rodas4() -> Method:
    """RODAS of Hairer & Wanner (1996), order 4(3), stiffly accurate, dense output of order 3."""
    return Method(
        name="rodas4",
        order=4,
        error_order=3,
        dense_order=3,
        gamma=0.25,
        a=(
            (),
            (1.544,),
            (0.9466785280815826, 0.2557011698983284),
            (3.314825187068521, 2.896124015972201, 0.9986419139977817),
            (1.221224509226641, 6.019134481288629, 12.53708332932087, -0.687886036105895),
        ),
        c=(
            (),
            (-5.6688,),
            (-2.430093356833875, -0.2063599157091915),
            (-0.1073529058151375, -9.594562251023355, -20.47028614809616),
            (7.496443313967647, -10.24680431464352, -33.99990352819905, 11.70890893206160),
            (8.083246795921522, -7.981132988064893, -31.52159432874371, 16.31930543123136, -6.058818238834054),
        ),
        error=(0.0, 0.0, 0.0, 0.0, 0.0, 1.0),
        dense=(
            (10.12623508344586, -7.487995877610167, -34.80091861555747, -7.992771707568823, 1.025137723295662, 0.0),
            (-0.6762803392801253, 6.087714651680015, 16.43084320892478, 24.76722511418386, -6.594389125716872, 0.0),
        ),
    )


@cache
def rodas5p() -> Method:
    """Rodas5P of Steinebach (2023), order 5(4), stiffly accurate, dense output of order 4."""
    return Method(
        name="rodas5p",
        order=5,
        error_order=4,
        dense_order=4,
        gamma=0.21193756319429014,
        a=(
            (),
            (3.0,),
            (2.849394379747939, 0.45842242204463923),
            (-6.954028509809101, 2.489845061869568, -10.358996098473584),
            (2.8029986275628964, 0.5072464736228206, -0.3988312541770524, -0.04721187230404641),
            (
                -7.502846399306121, 2.561846144803919, -11.627539656261098, -0.18268767659942256, 0.030198172008377946,
            ),
        ),
        c=(
            (),
            (-14.155112264123755,),
            (-17.97296035885952, -2.859693295451294),
            (147.12150275711716, -1.41221402718213, 71.68940251302358),
            (165.43517024871676, -0.4592823456491126, 42.90938336958603, -5.961986721573306),
            (
                24.854864614690072, -3.0009227002832186, 47.4931110020768, 5.5814197821558125, -0.6610691825249471,
            ),
            (
                30.91273214028599, -3.1208243349937974, 77.79954646070892, 34.28646028294783, -19.097331116725623,
                -28.087943162872662,
            ),
            (
                37.80277123390563, -3.2571969029072276, 112.26918849496327, 66.9347231244047, -40.06618937091002,
                -54.66780262877968, -9.48861652309627,
            ),
        ),
        error=(0.0,) * 7 + (1.0,),
        dense=(
            (
                25.948786856663858, -2.5579724845846235, 10.433815404888879, -2.3679251022685204, 0.524948541321073,
                1.1241088310450404, 0.4272876194431874, -0.17202221070155493,
            ),
            (
                -9.91568850695171, -0.9689944594115154, 3.0438037242978453, -24.495224566215796, 20.176138334709044,
                15.98066361424651, -6.789040303419874, -6.710236069923372,
            ),
            (
                11.419903575922262, 2.8879645146136994, 72.92137995996029, 80.12511834622643, -52.072871366152654,
                -59.78993625266729, -0.15582684282751913, 4.883087185713722,
            ),
        ),
    )  # fmt: skip


@cache
def dop853() -> Method:
    """DOP853 of Hairer, Nørsett & Wanner (1993), order 8(5,3), with its dense output of order 7."""
    first, last = np.zeros(len(table.DENSE[0])), np.zeros(len(table.DENSE[0]))
    result = np.pad(table.STEP[-1], (0, len(first) - len(table.STEP[-1])))
    first[0], last[len(table.STEP) - 1] = 1.0, 1.0
    terms = [result, first - result, 2 * result - first - last, *np.array(table.DENSE)]
    dense = np.zeros((len(first), len(terms) + 1))  # polynomials in θ, lowest power first
    for i, weights in enumerate(reversed(terms)):  # θ (f0 + (1-θ) (f1 + θ (f2 + (1-θ) (...))))
        dense[:, 0] += weights
        by_theta = np.roll(dense, 1, axis=1)
        dense = dense - by_theta if i % 2 else by_theta
    return Method(
        name="dop853", order=8, error_order=5, dense_order=7, a=table.STEP + table.EXTRA, c=(), error=table.ERROR,
        dense=tuple(map(tuple, dense[:, 1:].tolist())), lower_error=table.LOWER_ERROR, lower_order=3,
    )  # fmt: skip


METHODS: dict[str, Callable[[], Method]] = {"tsit5": explicit, "dop853": dop853, "rodas4": rodas4, "rodas5p": rodas5p}
