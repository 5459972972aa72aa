"""Steps of a lattice by the series S_h = hH: a stage is the implicit step of order 2 of a bi-realisation; a step is a
composition of stages.

A stage solves y = x − (α − x)(y, h∇H(y)) for y on the whole lattice; then x is updated by (β − α)(y, h∇H(y)). With the
covectors written out, both are formulas of a site and its neighbourhood, for all H and π.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from fractions import Fraction
from typing import TYPE_CHECKING, ClassVar, TypeVar

from phigen.errors import Diagnostic, SpecError
from phigen.lattice.cell import Cell
from phigen.lattice.cell_realisation import CellRealisation, realise_cell
from phigen.lattice.graphs import sums_by_field
from phigen.lattice.site_kernels import site_kernel
from phigen.lattice.site_parts import CellFlow, Colouring, SiteFields
from phigen.lattice.variations import along, along_start
from phigen.scheme.alternation import Schedule
from phigen.scheme.composition import find, orders
from phigen.scheme.kernel import Role
from phigen.scheme.order import Order
from phigen.scheme.staging import Coefficients
from phigen.scheme.steps import Equation
from phigen.spec.model import Spec, SpecForces
from phigen.splitting.ring import TIME
from phigen.symbolic.expression import Expression, number, substitute, symbol, symbols_of
from phigen.symbolic.symbols import MOMENTUM, Symbol, initial

if TYPE_CHECKING:
    from phigen.lattice.sweep_plans import SplittingPlan

T = TypeVar("T")


@dataclass(frozen=True)
class SeriesPlan:
    """Plan of a step by the series: the bi-realisation, and the stages of order 2, each a fraction of the step in
    ``fractions``.

    ``middle`` is y at a site, as a formula of y in its neighbourhood and of x at the site (`initial`); ``increment`` is
    the increment of x. Both have an entry for each field, with the step of the stage as `TIME`.
    """

    realisation: CellRealisation
    order: Order
    composition: str
    fractions: tuple[float, ...]
    middle: Mapping[str, Expression]
    increment: Mapping[str, Expression]
    since: str = field(default="", kw_only=True)  # reason for using the series although H splits

    #: The scheme, as in specs. A stage of this scheme solves an equation, and H is not split.
    scheme = "series"
    is_implicit, weak_order = True, 1
    flows: ClassVar[tuple[CellFlow, ...]] = ()
    negative: ClassVar[int | None] = None

    @property
    def label(self) -> str:
        """The kind of the method, for display."""
        return f"{self.kind}, on a lattice"

    @property
    def kind(self) -> str:
        """The kind of the bi-realisation."""
        return self.realisation.kind

    @property
    def site_kind(self) -> str | None:
        """The kind of the bi-realisation if it is one of a single site, else None."""
        return self.kind if self.realisation.site else None

    @property
    def colouring(self) -> Colouring:
        """The colouring with one colour: all sites are updated together."""
        return Colouring()

    @property
    def by_colour(self) -> tuple[bool, ...]:
        """Whether each flow belongs to one colour: empty, since there are no flows."""
        return ()

    @property
    def facts(self) -> list[str]:
        """Lines about the method in the header of generated files."""
        count = len(self.fractions)
        composed = [f"composition: {self.composition}, {count} stages of order 2"] if count > 1 else []
        step = "step: implicit, by sweeps over the sites until they change nothing"
        since = [f"scheme: series, since {self.since}"] if self.since else []
        return [
            *since,
            f"bi-realisation: {self.realisation.kind}, symmetric",
            "generating function: S_1",
            step,
            *composed,
        ]

    def acting(self, forces: SpecForces) -> str:
        """Words about forces in the header of generated files: forces enter the covector, or are applied in halves."""
        return "p = h (grad H + zeta)" + ", impulse h f by halves before and after" * bool(forces.vector)

    def flows_named(self, cell: Cell) -> Iterator[tuple[CellFlow, str]]:
        """Yield nothing: a step by a series has no flows."""
        yield from ()

    def equation(self, cell: Cell, coefficients: Coefficients, *, tangent: bool) -> Equation:
        """Return the kernels of a stage and, if ``tangent``, those of its derivative."""
        size = len(self.middle)
        values = coefficients.hoist([*self.middle.values(), *self.increment.values()])
        relax = site_kernel(
            cell, "relax", "y at a site from x there and y around it", values[:size], "y", coefficients, Role.RELAX
        )
        purpose = "increment of x at a site by a stage, from y at the site and its neighbours"
        advance = site_kernel(cell, "increment", purpose, values[size:], "change", coefficients, Role.ADVANCE)
        slopes = coefficients.hoist(along(cell, values[:size]))
        slope = site_kernel(
            cell, "slope", "derivative of y at a site along a variation of y", slopes, "v", coefficients, Role.SLOPE
        )
        if not tangent:
            return Equation(relax, advance, slope)
        starts, ends = (coefficients.hoist(e) for e in (along_start(values[:size]), along(cell, values[size:])))
        side = site_kernel(
            cell, "side", "derivative of y at a site along a variation of x", starts, "v", coefficients, Role.SIDE
        )
        purpose = "derivative of the increment of x at a site along a variation of y"
        follow = site_kernel(cell, "follow", purpose, ends, "v", coefficients, Role.FOLLOW)
        return Equation(relax, advance, slope, (side, follow))

    def either(self, splitting: Callable[[SplittingPlan], T], series: Callable[[SeriesPlan], T]) -> T:
        """Return the result of ``series``, the function for this class of plans."""
        return series(self)

    def schedule(self) -> Schedule:
        """Return the stages of a step, as flows of one part."""
        return Schedule(self.fractions, len(self.fractions) - 1, ((0, 0),))


def plan_series(cell: Cell, spec: Spec) -> SeriesPlan:
    """Return the plan for any H.

    Raises `SpecError` where no bi-realisation is known, and for orders that are not offered.
    """
    stages = _stages(spec)
    if cell.noise and len(stages[-1]) > 1:
        message = "noise: steps are not composed, since some stages of a composition go back in time"
        raise SpecError([Diagnostic(message, spec.locations.get(("noise",)), "order: 2")])
    if cell.bond_bracket:
        message = "scheme series: brackets along bonds are not offered"
        raise SpecError([Diagnostic(message, spec.locations.get(("poisson",)))])
    form = spec.poisson if cell.is_local else None
    try:
        realisation = realise_cell(cell, form, spec.birealisation)
    except SpecError as error:
        place = spec.locations.get(("birealisation",)) or spec.locations.get(("poisson",))
        raise SpecError([Diagnostic(d.message, d.location or place, d.hint) for d in error.diagnostics]) from None
    maps = _with_impulse(cell, realisation) if cell.forces.vector else (realisation.middle, realisation.increment)
    return SeriesPlan(realisation, *stages, *(_at_covectors(cell, m) for m in maps))


def _at_covectors(cell: Cell, maps: Mapping[str, Expression]) -> dict[str, Expression]:
    """Return α and β by field, with the covectors p = h(∇H + ζ) + Σ ΔW σ∇g inserted at all sites."""
    site_fields = SiteFields(cell, sums_by_field(cell))
    covectors: dict[str, Expression] = {}
    for name in symbols_of(*maps.values()):
        if isinstance(name, Symbol) and name.kind == MOMENTUM:
            field, offset = cell.place(str(name.key[0]))
            slope = site_fields.slope(field, offset)
            slope = slope + site_fields.push(field, offset) if cell.forces else slope
            covectors[name] = symbol(TIME) * slope + site_fields.noise(field, offset)
    return dict(zip(maps, substitute(list(maps.values()), covectors), strict=True))


def _with_impulse(cell: Cell, realisation: CellRealisation) -> tuple[dict[str, Expression], dict[str, Expression]]:
    """Return y and the increment of x, with half of the impulse hf of the vector force before the motion and half after
    it."""
    site_fields, one_half = SiteFields(cell), number(Fraction(1, 2))
    impulse = {f: symbol(TIME) * site_fields.impulse(f) for f in cell.fields}
    start: dict[str, Expression] = {initial(f): symbol(initial(f)) + one_half * e for f, e in impulse.items()}
    middle = dict(zip(realisation.middle, substitute(list(realisation.middle.values()), start), strict=True))
    return middle, {f: e + impulse[f] for f, e in realisation.increment.items()}


def _stages(spec: Spec) -> tuple[Order, str, tuple[float, ...]]:
    """Return the order, the name and the stage fractions of the composition for the order of a spec; odd orders round
    up."""
    order, composition = spec.wanted_order, spec.composition
    even_order = order + order % 2
    note = "" if even_order == order else f"order {order} was asked for; a symmetric method has even order"
    if even_order == 2 and composition in ("auto", "none"):
        return Order(2, 1, note), "none", (1.0,)
    method = find(composition, even_order)
    if method is None:
        place = spec.locations.get(("composition",)) or spec.locations.get(("order",))
        offered_orders = orders(composition) if composition != "none" else []
        order_list = (
            ", ".join(map(str, [2, *offered_orders] if composition in ("auto", "none") else offered_orders)) or "none"
        )
        offering = (
            "the series on lattices offers" if composition in ("auto", "none") else f"composition {composition} offers"
        )
        message = f"scheme series: {offering} the orders {order_list}, not {even_order}"
        raise SpecError([Diagnostic(message, place, "composition: auto" * (composition != "auto"))])
    return Order(even_order, 1, note), method.name, method.fractions
