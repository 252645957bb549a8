"""Contact laws of mechanisms whose geometry makes the normal stress depend on the motion.

Each docstring gives geometry, sign convention and the equivalent coefficients B0...B3 of eq. 12 (theory 3), which
the tests derive from `coupling`. Sketches: docs/explanation/contacts.md.
"""

from __future__ import annotations

from collections.abc import Iterator

import sympy as sp

from steadyslip.core.domains import Condition, acute, angle, line, nonnegative, positive, real, turn
from steadyslip.core.errors import Problem
from steadyslip.core.records import option, parameter
from steadyslip.laws.contact.law import ContactInputs, ContactLaw, Expression, PreloadedContact, Shape


class InclinedSpring(PreloadedContact, name="inclined-spring"):
    """A spring pulling at an angle ψ to the surface (eqs 22-24): σ = σ0 − T tan ψ.

    ψ > 0 pulls the block out of the surface, ψ < 0 presses it in. k and T are components along the
    sliding direction: a spring of axial stiffness k_s has k = k_s cos²ψ.
    B0...B3 = 0, c tan ψ, tan ψ, 0 with c a dashpot beside the spring. Lock-up: ψ <= −arccot μss (eq. 27).
    """

    lock_up = "the spring angle must be above −arccot μss = -{angle} deg (eq. 27)"

    angle: float = parameter("rad", line, "spring angle ψ, positive when it pulls out of the surface", letter="psi")

    def coupling(self, motion: ContactInputs) -> Expression:
        return -motion.spring * sp.tan(self.angle)

    def sliding_stiffness(self, axial_stiffness: Expression) -> Expression:
        return axial_stiffness * sp.cos(self.angle) ** 2

    def shape(self) -> Shape:
        return Shape(rise=self.angle)


class Transmitted(ContactLaw, name="transmitted"):
    """A gear, screw or guide that is pressed by the load it carries: σ = σ0 + g |T|.

    T is the pull on the body, or with `loaded_by` the force of one link (torque over radius where it turns). While T
    drives the body, T > 0, g is `transmitted`; while the load drives it backwards through the gear, T < 0, g is
    `transmitted_back`, the same unless given. Steady sliding with T > 0 is an inclined spring with tan ψ = −g:
    B0...B3 = 0, −c g, −g, 0, and it locks up where g μss >= 1 (where T is the pull of the drive itself).
    """

    lock_up = "the transmitted share must be below 1/μss = {inverse}"

    preload: float = parameter(
        "Pa", nonnegative, "normal stress σ0 without load", default=0.0, kind="normal stress", letter="sigma_0"
    )
    transmitted: float = parameter("1", nonnegative, "share g of the load that presses the contact, T > 0")
    transmitted_back: float | None = parameter(
        "1", nonnegative, "the same for T < 0; that for T > 0 unless given", default=None
    )

    def load(self) -> Expression | None:
        return self.preload

    def coupling(self, motion: ContactInputs) -> Expression:
        back = self.transmitted if self.transmitted_back is None else self.transmitted_back
        pull = motion.spring
        return (self.transmitted + back) / 2 * sp.Abs(pull) + (self.transmitted - back) / 2 * pull

    def shape(self) -> Shape:
        return Shape(rise=-0.3)


class SliderCrank(PreloadedContact, name="slider-crank"):
    """The slider of a crank mechanism, held at one crank angle: a rod at angle ψ, σ = σ0 − T tan ψ.

    The slide line passes through the crank centre; the crank pin stands at `crank_angle` from the slide
    line, on the side away from the surface for angles in (0, 180°). sin of the rod's inclination is
    (crank_radius/rod_length) sin(crank_angle). A rod that pulls a slider towards the crank lifts it
    (ψ > 0), a rod that pushes it away presses it in (ψ < 0). B0...B3 = 0, c tan ψ, tan ψ, 0.
    """

    lock_up = "tan of the pushing rod's inclination must be below 1/μss = {inverse}"

    crank_angle: float = parameter("rad", turn, "crank angle from the slide line")
    crank_radius: float = parameter("m", positive, "crank radius")
    rod_length: float = parameter("m", positive, "connecting-rod length, longer than the crank")
    stroke: str = option("pull", "push", doc="whether the rod pulls the slider or pushes it", default="pull")

    def conditions(self) -> Iterator[Condition]:
        longer = self.rod_length > self.crank_radius
        message = "got {}; allowed: more than crank_radius {}"
        yield Condition("rod_length", longer, message, (self.rod_length, self.crank_radius))

    def _tangent(self) -> Expression:
        """Tangent of the rod angle ψ, from the crank's geometry."""
        sine = self.crank_radius / self.rod_length * sp.sin(self.crank_angle)
        tangent = sine / sp.sqrt(1 - sine**2)
        return tangent if self.stroke == "pull" else -tangent

    def coupling(self, motion: ContactInputs) -> Expression:
        return -motion.spring * self._tangent()

    def sliding_stiffness(self, axial_stiffness: Expression) -> Expression:
        return axial_stiffness / (1 + self._tangent() ** 2)

    def shape(self) -> Shape:
        return Shape(rise=0.3 if self.stroke == "pull" else -0.3, part="crank")


class Triaxial(ContactLaw, name="triaxial"):
    """Saw cut in a triaxial press at constant confining pressure: σ = P_c + T tan θ.

    The cut stands at `angle` θ to the loading axis; the differential stress Q gives T = Q sin θ cos θ.
    The press has an axial stiffness K (differential stress per axial shortening, Pa/m) and
    k = K sin θ cos²θ along the cut. B0...B3 = 0, −c tan θ, −tan θ, 0. Lock-up: tan θ >= 1/μss.
    """

    lock_up = "the saw-cut angle must be below arccot μss = {angle} deg"

    angle: float = parameter("rad", acute, "angle θ between saw cut and loading axis", letter="theta")
    confining_pressure: float | None = parameter("Pa", positive, "confining pressure P_c", default=None, letter="P_c")
    steady_normal_stress: float | None = parameter(
        "Pa",
        positive,
        "normal stress σ_n in steady sliding, instead of confining_pressure",
        default=None,
        letter="sigma_n",
    )

    def inconsistencies(self) -> Iterator[Problem]:
        if (self.confining_pressure is None) == (self.steady_normal_stress is None):
            yield Problem("confining_pressure", "give exactly one of confining_pressure and steady_normal_stress")

    def load(self) -> Expression | None:
        return self.confining_pressure

    def steady_stress(self) -> Expression | None:
        return self.steady_normal_stress

    def coupling(self, motion: ContactInputs) -> Expression:
        return motion.spring * sp.tan(self.angle)

    def sliding_stiffness(self, axial_stiffness: Expression) -> Expression:
        return axial_stiffness * sp.sin(self.angle) * sp.cos(self.angle) ** 2

    def shape(self) -> Shape:
        return Shape(rise=-self.angle, load="P")


class SelfEnergising(PreloadedContact, name="self-energising"):
    """A wedge or self-energising guide: friction itself adds to the normal stress, σ = σ0 + γτ.

    Give the gain γ, or the geometry behind it: `wedge_angle` of a wedge that friction drags into its gap
    under a frictionless roof (γ = cot), or `lead_angle` of a thread (γ = tan; see `LeadScrew` for signs
    and load). γ < 0 releases the contact. B0...B3 = −γm, −γ(c + η), −γ, 0 (and B4 = γq). Needs γ f1 < 1
    and γ μss < 1; with γ μss >= 1 it locks up.
    """

    lock_up = "the gain must be below 1/μss = {inverse}"

    gain: float | None = parameter("1", real, "gain γ of friction on normal stress", default=None, letter="gamma")
    wedge_angle: float | None = parameter("rad", acute, "wedge angle, γ = cot(wedge_angle)", default=None)
    lead_angle: float | None = parameter("rad", angle, "lead angle of a thread, γ = tan(lead_angle)", default=None)

    def inconsistencies(self) -> Iterator[Problem]:
        yield from super().inconsistencies()
        if [self.gain, self.wedge_angle, self.lead_angle].count(None) != 2:
            yield Problem("gain", "give exactly one of gain, wedge_angle and lead_angle")

    def _gain(self) -> Expression:
        if self.gain is not None:
            return self.gain
        return 1 / sp.tan(self.wedge_angle) if self.wedge_angle is not None else sp.tan(self.lead_angle)

    def coupling(self, motion: ContactInputs) -> Expression:
        return self._gain() * motion.friction

    def shape(self) -> Shape:
        return Shape(part="wedge", load="")


class LeadScrew(ContactLaw, name="lead-screw"):
    """The thread of a lead screw under axial load W: σ = W/cos β ± τ tan β, β the lead angle.

    + when the screw raises the load, − when it lowers it. Load and friction are per unit thread area;
    slip is measured along the thread. With γ = ± tan β: B0...B3 = −γm, −γ(c + η), −γ, 0.
    """

    lock_up = "raising needs a lead angle below arccot μss = {angle} deg"

    lead_angle: float = parameter("rad", acute, "lead angle β of the thread", letter="beta")
    axial_load: float = parameter("Pa", positive, "axial load W per unit thread area", letter="W")
    direction: str = option("raising", "lowering", doc="whether the screw raises or lowers the load", default="raising")

    def load(self) -> Expression | None:
        return self.axial_load / sp.cos(self.lead_angle)

    def coupling(self, motion: ContactInputs) -> Expression:
        gain = sp.tan(self.lead_angle) * (1 if self.direction == "raising" else -1)
        return gain * motion.friction

    def shape(self) -> Shape:
        return Shape(tilt=self.lead_angle, load="W")


class DilatingLayer(PreloadedContact, name="dilating-layer"):
    """Double direct shear with a compliant normal ram: σ = σ0 + k_n e ln(v/v_ref).

    The sheared layer thickens by e ln(v/v_ref) at once when slip speeds up, against a ram of normal
    stiffness k_n (Pa per metre of thickening; with two layers between the blocks, twice the ram's own).
    e > 0 dilates. `preload` is the normal stress at v_ref. B0...B3 = 0, k_n e/v0, 0, 0.
    """

    ram_stiffness: float = parameter("Pa/m", nonnegative, "normal stiffness k_n of the ram", letter="k_n")
    dilatancy: float = parameter("m", real, "thickening e of the layer per e-fold of velocity", letter="e")
    v_ref: float = parameter("m/s", positive, "velocity at which the normal stress is the preload")

    def coupling(self, motion: ContactInputs) -> Expression:
        return self.ram_stiffness * self.dilatancy * sp.log(motion.velocity / self.v_ref)

    def shape(self) -> Shape:
        return Shape(between="layer")


class Lift(PreloadedContact, name="lift"):
    """A guide whose lubricant lifts the block as it speeds up: σ = σ0 − l (v − v_ref).

    `preload` is the normal stress at v_ref; l >= 0. B0...B3 = 0, −l, 0, 0.
    """

    lift: float = parameter("Pa s/m", nonnegative, "loss of normal stress per unit velocity, l", letter="l")
    v_ref: float = parameter("m/s", positive, "velocity at which the normal stress is the preload")

    def coupling(self, motion: ContactInputs) -> Expression:
        return -self.lift * (motion.velocity - self.v_ref)

    def shape(self) -> Shape:
        return Shape(between="film")


class SlopedGuide(PreloadedContact, name="sloped-guide"):
    """A guide of normal stiffness k_n that follows a surface sloping at β: σ = σ0 + k_n x tan β.

    β > 0 rises in the direction of sliding. The law is local in x. B0...B3 = 0, 0, 0, k_n tan β.
    """

    guide_stiffness: float = parameter("Pa/m", nonnegative, "normal stiffness k_n of the guide", letter="k_n")
    slope: float = parameter("rad", angle, "slope β of the surface along the slide", letter="beta")

    def coupling(self, motion: ContactInputs) -> Expression:
        return self.guide_stiffness * motion.lead * sp.tan(self.slope)

    def shape(self) -> Shape:
        return Shape(tilt=self.slope)
