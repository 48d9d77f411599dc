"""References by refinement: chains of settings, each with half the size of the one before, as far as they are needed.

A chain is followed until what it tends to is known well enough, or the budget refuses its next level. Of several
schemes the one is refined that promises to get there soonest: a reference costs what the accuracy asked for calls for.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from math import ceil

from rotfem import registry
from rotfem.commands.cost.chain import MOST_FAILURES, MOST_LEVELS, Chain, Get
from rotfem.commands.cost.prediction import order
from rotfem.commands.cost.reference import Limit, Reference, combined, distance, unlike
from rotfem.commands.cost.settings import HIGHEST_DEGREE, Elements, Setting, cells, samples_every, scaled

#: A step whose error is below this is fine enough to refine meshes with.
FINE_ENOUGH = 0.03

#: A scheme of no higher order is refined too if its error is below this part of the other's.
MORE_EXACT = 0.3

#: Part of the wanted uncertainty that the product of both errors may have for a coarser mesh to serve in time.
MIXED_SHARE = 0.25

#: Parts of the share that a mesh may take in the long steps with which meshes are first looked at, and in those that
#: have turned out to be needed: without them nothing is known.
LOOK, NEEDED = 0.5, 2.0

#: Cells from which a mesh is large: what its steps take is told from the coarsest one before any of them is made, and
#: none may take more than a part of the share, as more of them are to follow.
LARGE, FIRST_LOOK = 128, 0.25


@dataclass
class Plan:
    """What chains begin with.

    Attributes:
        own: the scene's setting, on the mesh that steps are refined on.
        each: see `distance`.
        first_step: the longest step tried, s; None outside a history.
        interval: between samples, s.
        least_step: the reference has one at most this long, s; None where the uncertainty alone decides.
        least_mesh: likewise, the coarsest mesh at the end of a chain.
        schemes: that may be refined.
        warming: returns the longest CPU time (s) so far of what comes before a first computation, as compilation.
    """

    own: Setting
    each: bool
    first_step: float | None = None
    interval: float = 0.0
    least_step: float | None = None
    least_mesh: Elements = None
    schemes: Sequence[str] = ()
    warming: Callable[[], float] = lambda: 0.0


class Refinement:
    """References of theories.

    Args:
        plan: what chains begin with.
        get: computes settings.

    Attributes:
        meshes: theory ↦ settings of its meshes, and the error of each one's mesh.
        base, errors: theory ↦ a setting of its chains, and about its error.
        reasons: theory ↦ why it has no reference.
    """

    def __init__(self, plan: Plan, get: Get):
        self.plan, self.get = plan, get
        self.meshes: dict[str, list[tuple[Setting, float]]] = {}
        self.base: dict[str, Setting] = {}
        self.errors: dict[str, float] = {}
        self.reasons: dict[str, str] = {}
        self._chains: dict[str, list[Chain]] = {}

    def to_take(self, theory: str, goal: float) -> float:
        """Return about how long (s) the chains of a theory's reference would take to be known to a goal, together."""
        chains = self._chains.get(theory, [])
        return sum(chain.to_take(goal / len(chains)) for chain in chains)

    def settled(self, theory: str, goal: float) -> bool:
        """Return whether each chain of a theory's reference is known to a goal, or its levels show an order."""
        limits = [chain.limit() for chain in self._chains.get(theory, [])]
        return all(found.order is not None or found.uncertainty <= goal for found in limits)

    def reference(self, theory: str, goal: float, share: float, schemes: Sequence[str] = ()) -> Reference | None:
        """Return the reference of a theory; None where no level could be computed, with the reason in `reasons`.

        Args:
            theory: whose.
            goal: uncertainty, relative, at which no level is added any more.
            share: of the time left that each level may take.
            schemes: that may be refined besides the scene's.
        """
        if self.plan.first_step is None:
            chain = self._meshes(replace(self.plan.own, theory=theory), goal, share)
            if not chain.samples:
                self.reasons[theory] = chain.reason
                return None
            found, self._chains[theory] = chain.limit(), [chain]
            base = self.base[theory] = min(chain.settings[-2:], key=lambda s: cells(s.elements) + s.degree)
            self.errors[theory] = dict(self.meshes[theory])[base]
            return Reference(found.samples, found.uncertainty, found.order, {"mesh": found.uncertainty})
        return self._history(theory, goal, share, schemes)

    def _history(self, theory: str, goal: float, share: float, schemes: Sequence[str]) -> Reference | None:
        own = replace(self.plan.own, theory=theory)
        scout = self._scout(own, share)
        if not scout.samples:
            self.reasons[theory] = scout.reason
            return None
        base, error = scout.settings[-1], min(scout.limit().error, 1.0)
        self.base[theory], self.errors[theory] = base, error
        meshes = self._meshes(base, goal / 2, LOOK * share)
        if not meshes.samples:
            self.reasons[theory] = meshes.reason
            return None
        space = meshes.limit()
        chain = self._cheaper(scout, meshes, space, goal, error)
        best = self._refined(chain, schemes, goal / 2, share)
        self._chains[theory] = [best, meshes]
        near = self._close(best, MIXED_SHARE * goal)
        mixed = self._unlike(near, best, meshes, share)
        if mixed > MIXED_SHARE * goal or space.uncertainty > goal / 2:
            again = self._meshes(replace(near, elements=own.elements), goal / 2, NEEDED * share, near.elements)
            if len(again.samples) > 1 and again.limit().uncertainty < space.uncertainty + mixed:
                space, base, error, mixed = again.limit(), near, min(error, goal), 0.0
        there = self.get(replace(base, elements=best.settings[0].elements), share)
        if there is None or there.samples is None:
            return None
        return combined(best.limit(), there.samples, space, error, self.plan.each, mixed)

    def _scout(self, own: Setting, share: float) -> Chain:
        """Return the chain of steps to an error that meshes can be refined at, on the own mesh or a coarser one.

        A coarser one serves where the steps of a large mesh would take too much of the time.
        """
        meshes = [own, *reversed([s for s in finer_meshes(own) if cells(s.elements) < cells(own.elements)])]
        if cells(own.elements) >= LARGE and len(meshes) > 1:
            self._steps(meshes[-1]).extend(self.get, share)
        else:
            del meshes[1:]
        for mesh in meshes:
            chain, most = self._steps(mesh), share if mesh is meshes[-1] else FIRST_LOOK * share
            while not chain.ended and (len(chain.samples) < 2 or chain.limit().error > FINE_ENOUGH):
                chain.extend(self.get, most)
            if len(chain.samples) > 1:
                break
        return chain

    def _close(self, chain: Chain, goal: float) -> Setting:
        """Return the longest of a chain's steps whose error is within a goal, the shortest if none is."""
        known, levels = chain.limit().samples, zip(chain.settings, chain.samples, strict=True)
        near = (s for s, samples in levels if distance(samples, known, self.plan.each) <= goal)
        return next(near, chain.settings[-1])

    def _unlike(self, fine: Setting, chain: Chain, meshes: Chain, share: float) -> float:
        """Return by how much a finer mesh changes less or more in short steps of a chain than in those of meshes.

        What steps do not resolve moves otherwise on every mesh, by more than the product of both errors says. 0 where
        it cannot be known.
        """
        pairs = list(zip(meshes.settings, meshes.samples, strict=True))
        rough = next((x for s, x in pairs if s.elements == fine.elements), None)
        finer = next(((s, x) for s, x in pairs if cells(s.elements) > cells(fine.elements)), None)
        if rough is None or finer is None or (fine.scheme, fine.step) == (finer[0].scheme, finer[0].step):
            return 0.0
        here = self.get(replace(fine, elements=finer[0].elements), share)
        if here is None or here.samples is None:
            return 0.0
        return unlike(
            (dict(zip(chain.settings, chain.samples, strict=True))[fine], here.samples),
            (rough, finer[1]),
            self.plan.each,
        )

    def _refined(self, first: Chain, schemes: Sequence[str], goal: float, share: float) -> Chain:
        """Refine whatever chain promises to reach the goal soonest; return the one whose limit is known best.

        Schemes of higher order start before others, and these only where none of those is more exact. From the second
        one on, a scheme that may have to be compiled first must have more to save than that takes.
        """
        while not first.ended and (len(first.samples) < 3 or not self._long_enough(first)):
            first.extend(self.get, share)
        able, own, late = [first], first.settings[0], sorted(schemes, key=self._rank(order(first.settings[0])))
        for i, scheme in enumerate(late):
            lower = registry.schemes[scheme].order <= order(own)
            if (lower and any(self._more_exact(chain, first) for chain in able[1:])) or (
                i > 0 and min(chain.to_go(goal) for chain in able) < self.plan.warming()
            ):
                break
            chain = self._steps(replace(own, scheme=scheme))
            if self._promising(chain, first, share):
                able.append(chain)
        while True:
            best = min(able, key=lambda chain: chain.limit().uncertainty)
            soonest = min(able, key=lambda chain: chain.to_go(goal))
            if best.limit().uncertainty <= goal or soonest.to_go(goal) == float("inf"):
                return self._agreed(best, able)
            soonest.extend(self.get, share)

    @staticmethod
    def _rank(own: int) -> Callable[[str], tuple[bool, int]]:
        """Return the key by which schemes start: those of higher order than the own one first, the lowest of them."""
        return lambda scheme: (registry.schemes[scheme].order <= own, registry.schemes[scheme].order)

    def _agreed(self, best: Chain, others: Sequence[Chain]) -> Chain:
        """Return the best chain, as uncertain as its limit is off from what the other schemes claim to know."""
        known = best.limit().samples
        for chain in others:
            if chain is not best and len(chain.samples) > 2:
                other = chain.limit()
                best.doubt = max(best.doubt, distance(other.samples, known, self.plan.each) - other.uncertainty)
        return best

    def _promising(self, chain: Chain, first: Chain, share: float) -> bool:
        """Start another chain, and go on if its scheme is of higher order or more exact; return whether it is."""
        chain.extend(self.get, share)
        if not chain.samples:
            return False
        if not self._more_exact(chain, first) and order(chain.settings[0]) <= order(first.settings[0]):
            return False
        while len(chain.samples) < 2 and not chain.ended:
            chain.extend(self.get, share)
        return True

    def _more_exact(self, chain: Chain, first: Chain) -> bool:
        """Return whether a chain is much more exact than the first one in steps of the same length."""
        known, each = first.limit().samples, self.plan.each
        return distance(chain.samples[0], known, each) < MORE_EXACT * distance(first.samples[0], known, each)

    def _long_enough(self, chain: Chain) -> bool:
        least = self.plan.least_step
        return least is None or (chain.settings[-1].step or 0.0) <= least * (1 + 1e-9)

    def _cheaper(self, scout: Chain, meshes: Chain, space: Limit, goal: float, error: float) -> Chain:
        """Return the chain of steps on the coarsest mesh that the answer allows; what it saves must count."""
        if self.plan.least_step is not None or scout.to_go(goal) < 1.0:
            return scout
        for setting, samples in zip(meshes.settings, meshes.samples, strict=True):
            if setting.elements == scout.settings[0].elements:
                return scout
            if distance(samples, space.samples, self.plan.each) * error <= MIXED_SHARE * goal:
                chain = self._steps(replace(setting, step=None))
                while not chain.ended and len(chain.samples) < len(scout.samples):
                    chain.extend(self.get, 1.0)
                return chain if chain.samples else scout
        return scout

    def _meshes(self, base: Setting, goal: float, share: float, first: Elements = None) -> Chain:
        """Return the chain of meshes with the other values of a setting, from a first one on if that is given."""
        chain = Chain((s for s in finer_meshes(base) if cells(s.elements) >= cells(first)), self.plan.each)
        while not chain.ended:
            chain.extend(self.get, share)
            if len(chain.samples) >= 3 and chain.limit().uncertainty <= goal and self._fine_enough(chain):
                break
        if chain.samples:
            space, known = chain.limit(), self.meshes.get(base.theory, [])
            errors = [distance(samples, space.samples, self.plan.each) for samples in chain.samples]
            coarser = [(s, e) for s, e in known if cells(s.elements) < cells(first)]
            self.meshes[base.theory] = [*coarser, *zip(chain.settings, errors, strict=True)]
        return chain

    def _fine_enough(self, chain: Chain) -> bool:
        least, reached = self.plan.least_mesh, chain.settings[-1].elements
        return least is None or reached is None or cells(reached) >= cells(least)

    def _steps(self, own: Setting) -> Chain:
        """Return the chain of steps with the other values of a setting."""
        step, interval = self.plan.first_step, self.plan.interval
        assert step is not None
        halved = (step / 2**i for i in range(MOST_LEVELS + MOST_FAILURES))
        levels = (replace(own, step=h, tolerance=None, every=samples_every(interval, h)) for h in halved)
        return Chain(levels, self.plan.each)


def finer_meshes(base: Setting) -> list[Setting]:
    """Return settings on finer and finer meshes, from one that the own one is refined from, where it is.

    Odd numbers of a plate's elements are halved to the next larger ones. A mesh from a file cannot be refined: its
    degree is raised instead.
    """
    if base.elements is None:
        return [replace(base, degree=degree) for degree in range(base.degree, HIGHEST_DEGREE + 1)]
    down, counts = 0, base.elements if isinstance(base.elements, tuple) else (base.elements,)
    # One element cannot be shared among processes.
    while down < 2 and all(n > 2 ** (down + 1) and (len(counts) > 1 or n % 2 ** (down + 1) == 0) for n in counts):
        down += 1
    coarser = [[ceil(n / 2**i) for n in counts] for i in range(down, 0, -1)]
    meshes: list[Elements] = [(n[0], n[1]) if len(n) > 1 else n[0] for n in coarser]
    meshes += [scaled(base.elements, 2.0**i) for i in range(MOST_LEVELS - down)]
    return [replace(base, elements=elements) for elements in meshes]
