"""Steps of a lattice by the first term S_h = hH of the Hamilton–Jacobi series.

A step is a composition of stages. A stage is the implicit step of order 2 that a bi-realisation (α, β) gives. With p =
h∇H(y), the stage solves α(y, p) = x for y on the whole lattice. Its result is β(y, p). At each site, α and β are
formulas in the values at the site and around it.
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
    """Plan of a step by the series: the bi-realisation, and the composition of stages of order 2.

    ``fractions`` are the durations of the stages in units of the step. A stage solves α(y, h∇H(y)) = x for y.
    ``middle`` has the formula for y at a site, by field. The formula contains x at the site (the symbols `initial`),
    and y at the site and around it. ``increment`` has the increment of x in the stage, by field. The symbol `TIME` is
    the duration of the stage.
    """

    realisation: CellRealisation
    order: Order
    composition: str
    fractions: tuple[float, ...]
    middle: Mapping[str, Expression]
    increment: Mapping[str, Expression]
    since: str = field(default="", kw_only=True)  # the reason why the series is used for an H that splits

    #: The name of the scheme in specs. A plan by the series has no flows: each stage solves an equation.
    scheme = "series"
    is_implicit, weak_order = True, 1
    flows: ClassVar[tuple[CellFlow, ...]] = ()
    negative: ClassVar[int | None] = None

    @property
    def label(self) -> str:
        """The kind of the method as text for users."""
        return f"{self.kind}, on a lattice"

    @property
    def kind(self) -> str:
        """The kind of the bi-realisation."""
        return self.realisation.kind

    @property
    def site_kind(self) -> str | None:
        """The kind of the bi-realisation if it belongs to the system of a single site, else None."""
        return self.kind if self.realisation.site else None

    @property
    def colouring(self) -> Colouring:
        """The colouring with one colour: all sites are updated together."""
        return Colouring()

    @property
    def by_colour(self) -> tuple[bool, ...]:
        """Always (): a step by the series has no flows that could belong to the colours of a graph."""
        return ()

    @property
    def facts(self) -> list[str]:
        """The lines about the method in the header of generated files."""
        count = len(self.fractions)
        composed = [f"composition: {self.composition}, {count} stages of order 2"] if count > 1 else []
        step = "step: implicit, solved by sweeps over the sites until the solution no longer changes"
        since = [f"scheme: series, since {self.since}"] if self.since else []
        return [
            *since,
            f"bi-realisation (alpha, beta): {self.realisation.kind}, symmetric; steps from alpha(y, p) to beta(y, p)",
            "generating function: p = grad S_h(y), S_h = h S_1",
            step,
            *composed,
        ]

    def acting(self, forces: SpecForces) -> str:
        """Return a text for the header of generated files that says how forces act.

        Covector forces ζ are added to ∇H. Half of the impulse hf of a vector force f acts before a stage, and half
        after it.
        """
        return "p = h (grad H + zeta)" + ", and half of the impulse h f before and after a stage" * bool(forces.vector)

    def flows_named(self, cell: Cell) -> Iterator[tuple[CellFlow, str]]:
        """Yield nothing: a step by a series has no flows."""
        yield from ()

    def equation(self, cell: Cell, coefficients: Coefficients, *, tangent: bool) -> Equation:
        """Return the kernels of a stage and, if ``tangent``, the kernels of its derivative."""
        size = len(self.middle)
        values = coefficients.hoist([*self.middle.values(), *self.increment.values()])
        relax = site_kernel(
            cell,
            "relax",
            "at each site, one fixed-point iteration for the solution y of a stage that starts at x",
            values[:size],
            "y",
            coefficients,
            Role.RELAX,
        )
        purpose = "at each site, the increment of x in a stage with the solution y"
        advance = site_kernel(cell, "increment", purpose, values[size:], "change", coefficients, Role.ADVANCE)
        slopes = coefficients.hoist(along(cell, values[:size]))
        slope = site_kernel(
            cell,
            "slope",
            "at each site, the derivative of the iteration for y along a variation of y",
            slopes,
            "v",
            coefficients,
            Role.SLOPE,
        )
        if not tangent:
            return Equation(relax, advance, slope)
        starts, ends = (coefficients.hoist(e) for e in (along_start(values[:size]), along(cell, values[size:])))
        side = site_kernel(
            cell,
            "side",
            "at each site, the derivative of the iteration for y along a variation of x",
            starts,
            "v",
            coefficients,
            Role.SIDE,
        )
        purpose = "at each site, the derivative of the increment of x along a variation of y"
        follow = site_kernel(cell, "follow", purpose, ends, "v", coefficients, Role.FOLLOW)
        return Equation(relax, advance, slope, (side, follow))

    def either(self, splitting: Callable[[SplittingPlan], T], series: Callable[[SeriesPlan], T]) -> T:
        """Return ``series(self)``. A caller passes one function for each class of plans, and the plan chooses between
        them.
        """
        return series(self)

    def schedule(self) -> Schedule:
        """Return the order of the stages in a step, with the stages as flows of a single part."""
        return Schedule(self.fractions, len(self.fractions) - 1, ((0, 0),))


def plan_series(cell: Cell, spec: Spec) -> SeriesPlan:
    """Return the plan of a step by the series, which exists for any H.

    Raises `SpecError` if phigen knows no bi-realisation for π, and for orders and options that lattices lack.
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
    """Return the formulas ``maps``, by field, with expressions in place of the covectors p at all sites.

    ``maps`` has formulas with symbols for p, for instance the formula for the increment of x in a stage. The
    expressions that replace p are p = h(∇H + ζ) + Σ ΔW σ∇g, with the covector force ζ. The sum is over the sources of
    noise, with their increments ΔW, amplitudes σ and Hamiltonians g.
    """
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
    """Return two sets of formulas, by field, for a stage with a vector force f: for y, and for the increment of x.

    Half of the impulse hf acts before the stage, and half after it.
    """
    site_fields, one_half = SiteFields(cell), number(Fraction(1, 2))
    impulse = {f: symbol(TIME) * site_fields.impulse(f) for f in cell.fields}
    start: dict[str, Expression] = {initial(f): symbol(initial(f)) + one_half * e for f, e in impulse.items()}
    middle = dict(zip(realisation.middle, substitute(list(realisation.middle.values()), start), strict=True))
    return middle, {f: e + impulse[f] for f, e in realisation.increment.items()}


def _stages(spec: Spec) -> tuple[Order, str, tuple[float, ...]]:
    """Return the order of the composition, its name, and the durations of its stages in units of the step.

    An odd order in the spec is rounded up. Raises `SpecError` if the composition does not exist at the order.
    """
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
