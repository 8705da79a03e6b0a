"""Links of mechanisms, and contacts given by their inverse effective mass alone."""

from __future__ import annotations

import itertools
import math
import random
from decimal import Decimal
from fractions import Fraction as F

import numpy as np
import pytest
from collisions import EVERY_LAW
from refusals import refused
from robot_arm import LINKS, TIP, V, robot_arm

from collision_response import (
    Adjustment,
    Body,
    Contact,
    Geometry,
    ImpactError,
    ImpactModel,
    Law,
    Precision,
    Regime,
    StatusCode,
    resolve,
    resolve_contact,
    resolve_scene,
)
from collision_response.impact import NEEDS_FREE_SLIP
from collision_response.physics.effective_mass import ContactKinematics
from collision_response.physics.orientation import Quaternion

each_law = pytest.mark.parametrize("law", EVERY_LAW, ids=lambda law: law.name)

NORMAL = np.array([0.6, -0.48, 0.64])
RADIUS, BALL = 0.05, 0.4
MOMENT = 0.4 * BALL * RADIUS**2
DIGITS = 2e-12
"""The accuracy of the reference values."""

ARM = robot_arm()


def tip() -> Body:
    twist = ARM.J @ V
    return Body.articulated(ARM.inverse_inertia(), ARM.tip, twist[:3], twist[3:])


def ball() -> Body:
    return Body.dynamic(
        BALL,
        (MOMENT, 0, 0, MOMENT, 0, MOMENT),
        ARM.tip - RADIUS * NORMAL,
        None,
        (0.289520859636, -0.291186592097, 1.419473269682),
        (3.0, -5.0, 2.0),
    )


def joints_after(impulse) -> np.ndarray:
    return V + np.linalg.solve(ARM.M, ARM.J[:3].T @ np.array(impulse))


REFERENCE = {
    "FRICTIONLESS": (
        Law.FRICTIONLESS, 0.0, (0.292660820065, -0.234128656052, 0.312171541403),
        (
            0.416775764480, -0.768787866911, 0.192244153905, 0.831931330103,
            -3.054617803250, -7.059533201356, 3.727394859650,
        ),
        (-0.442131190527, 0.294135048034, 0.639044416175), -0.109747807524,
    ),
    "COULOMB sticks": (
        Law.COULOMB, 1.0, (0.345572656439, -0.191719994065, 0.303443911025),
        (
            0.411759493074, -0.759004141293, 0.216805406972, 0.787521306348,
            -3.293838985727, -6.912052206130, 3.886536216348,
        ),
        (-0.574410781462, 0.188113393066, 0.660863492120), -0.131219489430,
    ),
    "COULOMB slides": (
        Law.COULOMB, 0.1, (0.330872370672, -0.203502224524, 0.305868673978),
        (
            0.413153143875, -0.761722315000, 0.209981651389, 0.799859567214,
            -3.227377112830, -6.953026266445, 3.842322604025,
        ),
        (-0.537660067046, 0.217568969214, 0.654801584737), -0.129562148140,
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", REFERENCE)
def test_an_arm_strikes_a_ball(name):
    law, friction, impulse, joints, velocity, lost = REFERENCE[name]
    impact = resolve(tip(), ball(), Contact.of(ARM.tip, NORMAL, 0.7, friction), ImpactModel(law))
    assert impact.impulse == pytest.approx(impulse, abs=DIGITS)
    assert joints_after(impact.impulse) == pytest.approx(joints, abs=20 * DIGITS)
    assert impact.twist_b.linear == pytest.approx(velocity, abs=DIGITS)
    change = impact.kinetic_energy_after - impact.kinetic_energy_before
    assert change == pytest.approx(lost, abs=DIGITS)
    assert impact.energy_lost_restitution + impact.energy_lost_friction == pytest.approx(-lost, abs=DIGITS)
    assert impact.adjustments == Adjustment.ENERGY_CHANGE_ONLY
    by_python = resolve(
        tip(), ball(), Contact.of(ARM.tip, NORMAL, 0.7, friction), ImpactModel(law, tolerance=1e-17)
    )
    assert by_python.adjustments == Adjustment.ENERGY_CHANGE_ONLY
    assert impact.error_bound < 1e-12
    # the energies of the joints and of the ball, computed without this package
    after, spin = joints_after(impact.impulse), np.array(impact.twist_b.angular)
    energies = [
        v @ ARM.M @ v / 2 + BALL * np.array(u) @ np.array(u) / 2 + MOMENT * np.array(w) @ np.array(w) / 2
        for v, u, w in ((V, ball().velocity, ball().angular_velocity), (after, impact.twist_b.linear, spin))
    ]
    assert energies[1] - energies[0] == pytest.approx(change, abs=1e-14)
    assert np.array(impact.twist_a.linear) == pytest.approx(ARM.J[:3] @ after, abs=1e-12)
    assert np.array(impact.twist_a.angular) == pytest.approx(ARM.J[3:] @ after, abs=1e-12)


def test_the_arm_behind_the_last_link_counts():
    """The effective mass at the tip is 3.5 times that of the last link alone."""
    contact = Contact.of(ARM.tip, NORMAL)
    mass, com, moments = LINKS[-1][2:]
    R = ARM.last
    w = math.sqrt(1 + np.trace(R)) / 2
    q = Quaternion(
        *[(R[(i + 2) % 3, (i + 1) % 3] - R[(i + 1) % 3, (i + 2) % 3]) / 4 / w for i in range(3)], w
    )
    inertia = (moments[0], 0, 0, moments[1], 0, moments[2])
    link = Body.dynamic(mass, inertia, ARM.tip, q, com=np.array(com) - TIP)
    moving = [body._replace(velocity=(-0.6, 0.48, -0.64)) for body in (tip(), link)]
    whole, alone = (resolve(body, Body.static(), contact).effective_mass for body in moving)
    assert whole == pytest.approx(0.366583042049, abs=1e-12)
    assert whole / alone == pytest.approx(3.5, abs=0.05)


@each_law
def test_a_rigid_body_given_by_its_inverse_inertia(law):
    """Struck off-centre, it must answer as the same body given by mass and inertia does."""
    rigid = Body.dynamic(
        2.0, (0.03, 0.002, -0.001, 0.05, 0.003, 0.06), (0.1, 0.2, 0.9), None, (0.5, -0.3, -1.2), (1, -2, 0.5)
    )
    inertia = np.array([[0.03, 0.002, -0.001], [0.002, 0.05, 0.003], [-0.001, 0.003, 0.06]])
    matrix = np.zeros((6, 6))
    matrix[:3, :3], matrix[3:, 3:] = np.eye(3) / 2, np.linalg.inv(inertia)
    same = Body.articulated(matrix, rigid.position, rigid.velocity, rigid.angular_velocity)
    other = Body.dynamic(3.0, (0.08, 0, 0, 0.07, 0, 0.09), (-0.05, 0.1, -0.8), None, (-0.1, 0.2, 0.4))
    contact = Contact.of((0.02, 0.05, 0.1), (0.1, -0.2, 1), 0.7, 0.2)
    for one, two, swap in ((rigid, same, False), (rigid, same, True)):
        pairs = [(a, other) if not swap else (other, a) for a in (one, two)]
        touch = contact._replace(normal=-contact.normal) if swap else contact
        expected, found = (resolve(*pair, touch, ImpactModel(law)) for pair in pairs)
        assert found.impulse == pytest.approx(expected.impulse, rel=1e-10)
        for mine, theirs in ((found.twist_a, expected.twist_a), (found.twist_b, expected.twist_b)):
            assert np.ravel(mine) == pytest.approx(np.ravel(theirs), abs=1e-10)
        changes = [x.kinetic_energy_after - x.kinetic_energy_before for x in (expected, found)]
        assert changes[0] == pytest.approx(changes[1], abs=1e-10)
        assert found.regime is expected.regime
        assert found.adjustments & Adjustment.ENERGY_CHANGE_ONLY


def test_the_reference_point_of_a_link_may_be_anywhere():
    """Moved by ``d``, ``Lambda^-1`` becomes ``X Lambda^-1 X^T``."""
    d = np.array([0.1, -0.3, 0.2])
    X = np.eye(6)
    X[:3, 3:] = -np.array([[0, -d[2], d[1]], [d[2], 0, -d[0]], [-d[1], d[0], 0]])
    moved = X @ ARM.J @ V
    elsewhere = Body.articulated(X @ ARM.inverse_inertia() @ X.T, ARM.tip + d, moved[:3], moved[3:])
    contact = Contact.of(ARM.tip, NORMAL, 0.7, 0.1)
    first, second = (resolve(body, ball(), contact) for body in (tip(), elsewhere))
    assert second.impulse == pytest.approx(first.impulse, rel=1e-12)
    assert second.twist_a.angular == pytest.approx(first.twist_a.angular, rel=1e-11)


def test_two_links_of_one_arm_need_their_relative_jacobian():
    """A pincer: two fingers with a joint each, on a common body. The matrices of the single fingers leave out
    how one moves the other, so their sum is four times too large.
    """
    M = np.diag([2 / 3, 0.5, 0.5])
    J_a, J_b = np.array([[1.0, 0.5, 0.0]]), np.array([[1.0, 0.0, 0.5]])
    relative = J_a - J_b
    right = (relative @ np.linalg.solve(M, relative.T)).item()
    apart = sum((J @ np.linalg.solve(M, J.T)).item() for J in (J_a, J_b))
    assert apart == pytest.approx(4 * right, rel=1e-13)
    K = np.diag([0.0, 0.0, right])
    impact = resolve_contact(K, (0, 0, -1), (0, 0, 1), 0.5)
    rates = np.linalg.solve(M, relative.T)[:, 0] * impact.impulse.z
    assert (relative @ rates).item() == pytest.approx(1.5, rel=1e-13)


@each_law
def test_resolve_contact_agrees_with_resolve(law):
    a = Body.dynamic(2.0, (0.3, 0, 0, 0.5, 0, 0.6), (0.1, 0.2, 0.9), None, (0.5, -0.3, -1.2), (1, -2, 0.5))
    b = Body.dynamic(
        3.0, (0.8, 0, 0, 0.7, 0, 0.9), (-0.05, 0.1, -0.8), None, (-0.1, 0.2, 0.4), (0.3, 0.7, -1)
    )
    contact = Contact.of((0.02, 0.05, 0.1), (0.1, -0.2, 1), 0.7, 0.2)
    seen = ContactKinematics.of(a, b, contact)
    k = seen.inverse_effective_mass()
    K = [[k.xx, k.xy, k.xz], [k.xy, k.yy, k.yz], [k.xz, k.yz, k.zz]]
    whole = resolve(a, b, contact, ImpactModel(law))
    alone = resolve_contact(K, seen.u, contact.normal, 0.7, 0.2, ImpactModel(law))
    assert alone.impulse == pytest.approx(whole.impulse, rel=1e-11)
    assert alone.energy_change == pytest.approx(
        whole.kinetic_energy_after - whole.kinetic_energy_before, abs=1e-12
    )
    assert alone.regime is whole.regime
    assert alone.velocity_after.dot(contact.normal) / contact.normal.norm() == pytest.approx(
        whole.normal_velocity_after, abs=1e-12
    )
    assert alone.adjustments is Adjustment.NONE
    assert alone.model.law is whole.model.law


def test_resolve_contact_in_extended_is_right_to_the_last_digit():
    """Against COULOMB's sticking impulse ``P = (1 + e) P_I + D`` in fractions."""
    K, u, e = [[F(7, 2), F(1, 2), 0], [F(1, 2), 3, F(1, 4)], [0, F(1, 4), 1]], [F(1, 8), F(0), F(-1)], F(1, 2)
    model = ImpactModel(Law.COULOMB, precision=Precision.EXTENDED)
    found = resolve_contact(
        [[float(x) for x in row] for row in K], list(map(float, u)), (0, 0, 1), 0.5, 5.0, model
    )
    j = -u[2] / K[2][2]
    plastic = [u[i] + K[i][2] * j for i in range(3)]
    D = _solve(K, [-x for x in plastic])
    P = [D[0], D[1], (1 + e) * j + D[2]]
    assert found.regime is Regime.STICKING
    assert all(abs(F(x) - y) <= abs(y) * F(1, 2**52) for x, y in zip(found.impulse, P, strict=True))
    assert found.error_bound <= 2.0**-52


def _solve(K, v):
    """By Cramer's rule."""

    def det(m):
        return sum(
            m[0][i] * (m[1][(i + 1) % 3] * m[2][(i + 2) % 3] - m[1][(i + 2) % 3] * m[2][(i + 1) % 3])
            for i in range(3)
        )

    return [
        det([[v[r] if c == i else K[r][c] for c in range(3)] for r in range(3)]) / det(K) for i in range(3)
    ]


PLANE = np.array([[2.5, -1.5, 0], [-1.5, 2.5, 0], [0, 0, 0]])


@each_law
def test_a_planar_mechanism(law):
    """K has rank 2. The answer must be the one for a third direction with any mobility."""
    whole = PLANE + np.diag([0, 0, 4.0])
    flat, full = (
        resolve_contact(K, (1, -1, 0), (0, 1, 0), 0.5, 0.3, ImpactModel(law)) for K in (PLANE, whole)
    )
    assert flat.impulse == pytest.approx(full.impulse, abs=1e-10)
    assert flat.error_bound < 1e-9
    assert flat.impulse.z == 0


@pytest.mark.parametrize("law", [Law.FRICTIONLESS, Law.COULOMB])
def test_a_stretched_arm(law):
    """K has rank 1 and its range is oblique to the normal: the frictionless impulse already stops such a
    contact.
    """
    k = np.array([0.5, -0.2, 0.7])
    impact = resolve_contact(np.outer(k, k), -k, (0, 0, 1), 0.5, 0.3, ImpactModel(law))
    assert np.array(impact.velocity_after) == pytest.approx(0.5 * k, abs=1e-13)
    assert impact.impulse == pytest.approx((0, 0, 1.5 / 0.7), abs=1e-12)


@pytest.mark.parametrize("decades", range(1, 13))
def test_a_nearly_stretched_arm(decades):
    """Two joints in a plane. The straighter the arm, the nearer ``J M^-1 J^T`` is to a lower rank. Its
    rounding by NumPy must not matter, whatever the direction of the arm.
    """
    elbow = 10.0**-decades
    for shoulder in np.linspace(-3.0, 3.0, 25):
        first, second = (np.array([math.cos(x), math.sin(x), 0]) for x in (shoulder, shoulder + elbow))
        across = np.cross([0, 0, 1], [first, second])
        J = np.zeros((6, 2))
        J[:3, 0], J[:3, 1], J[5] = across.sum(axis=0), across[1], 1
        inner = math.cos(elbow) / 2
        M = np.array([[5 / 3 + 2 * inner, 1 / 3 + inner], [1 / 3 + inner, 1 / 3]])  # thin links, 1 kg and 1 m
        speeds, n = np.array([1.0, -3.0]), across[1]
        link = Body.articulated(J @ np.linalg.solve(M, J.T), first + second, *np.split(J @ speeds, 2))
        impact = resolve(link, Body.static(), Contact.of(first + second, n))
        row = n @ J[:3]
        kick = np.linalg.solve(M, row)
        after = J @ (speeds - 2 * kick * (row @ speeds) / (row @ kick))
        assert [*impact.twist_a.linear, *impact.twist_a.angular] == pytest.approx(after, abs=1e-12)


def frame(seed: int) -> np.ndarray:
    """Three perpendicular unit vectors."""
    return np.linalg.qr(np.random.default_rng(seed).normal(size=(3, 3)))[0].T


@each_law
@pytest.mark.parametrize("elbow", [1e-2, 1e-3, 1e-4, 1e-5])
@pytest.mark.parametrize("kind", ["contact", "link"])
def test_a_nearly_stretched_arm_may_slip_in_its_plane(law, elbow, kind):
    """Across the plane it is locked. The rounding of ``J M^-1 J^T`` turns that direction by up to 1e-5."""
    model = ImpactModel(law)
    for seed in range(8):
        x, y, axis = frame(seed)
        first, second = x, math.cos(elbow) * x + math.sin(elbow) * y
        across, tip = np.cross(axis, [first, second]), first + second
        J = np.zeros((6, 2))
        J[:3, 0], J[:3, 1], J[3:] = across.sum(axis=0), across[1], axis[:, None]
        inner = math.cos(elbow) / 2
        M = np.array([[5 / 3 + 2 * inner, 1 / 3 + inner], [1 / 3 + inner, 1 / 3]])
        twist = J @ [1.0, -3.0]
        n = -across[1] * np.sign(across[1] @ twist[:3])
        if kind == "contact":
            K = J[:3] @ np.linalg.solve(M, J[:3].T)
            answer = resolve_contact(K, twist[:3], n, 0.5, 0.3, model)
        else:
            link = Body.articulated(J @ np.linalg.solve(M, J.T), tip, *np.split(twist, 2))
            answer = resolve(link, Body.static(), Contact.of(tip, n, 0.5, 0.3), model)
        P = np.array(answer.impulse)
        assert np.linalg.norm(P - n * (P @ n)) <= 0.3 * (P @ n) * (1 + 1e-9)
        assert answer.energy_lost_restitution + answer.energy_lost_friction >= 0


@pytest.mark.parametrize("locked", [0.0, 1e-16, 1e-12, 5e-10])
def test_a_locked_component_that_is_rounding_changes_nothing(locked):
    """Next to a direction that is hardly movable, it would cost an impulse 1e8 times as large."""
    K, n = np.diag([1.0, 1e-8, 0.0]), (1.0, 0.0, 0.1)
    found, clean = (resolve_contact(K, (-1.0, 3e-9, u), n, 0.5, 0.3) for u in (locked, 0.0))
    assert found.impulse == pytest.approx(clean.impulse, rel=locked + 1e-15)


@each_law
@pytest.mark.parametrize("friction", [0.0, 0.3])
@pytest.mark.parametrize("joints", [1, 2])
def test_a_direction_with_mobility_from_rounding_only_is_locked(law, friction, joints):
    """An arm along an axis: ``cos(pi / 2)`` gives 6e-17 instead of 0."""
    clean = np.array([[0.0, 0.0], [1.0, 0.5], [0.0, 2.0]])[:, :joints]
    rounded = clean + np.array([[6e-17, 1.8e-16], [0, 0], [0, 0]])[:, :joints]
    rounded = np.column_stack([rounded, [2.4e-16, 0, 0]])
    exact, found = (
        resolve_contact(J @ J.T, -J[:, :joints].sum(axis=1), (1, 2, 3), 0.5, friction, ImpactModel(law))
        for J in (clean, rounded)
    )
    assert found.impulse == pytest.approx(exact.impulse, rel=1e-9)
    assert (found.status, found.adjustments) == (exact.status, exact.adjustments)


@each_law
@pytest.mark.parametrize("precision", [Precision.AUTO, Precision.EXTENDED])
@pytest.mark.parametrize("friction", [0.0, 0.3, 2.0])
def test_a_contact_point_at_rest_up_to_rounding_gets_no_impulse(law, friction, precision):
    """A stretched arm turns about its tip, so the velocity of the tip is rounding, also along locked
    directions. The reference point is next to the tip, so that no entry is exactly 0.
    """
    tip, offset = np.array([math.cos(math.pi / 2) * 2, 2.0, 0.0]), np.array([0.5, -0.25, 0.0])
    J = np.zeros((6, 2))
    J[:3] = np.array([-tip, -tip / 2])[:, [1, 0, 2]].T * [[1], [-1], [1]]
    J[5] = 1
    J[:3] += np.cross(J[3:].T, offset).T
    M = np.array([[8 / 3, 5 / 6], [5 / 6, 1 / 3]])
    link = Body.articulated(J @ np.linalg.solve(M, J.T), tip + offset, *np.split(J @ [1.0, -2.0], 2))
    for n in [(1, 1, 0), (-1, -1, 0), (1, 2, 3), (-1, -2, -3), (1, 0, 0), (-1, 0, 0)]:
        contact = Contact.of(tip, n, 0.5, friction)
        impact = resolve(link, Body.static(), contact, ImpactModel(law, precision=precision))
        assert impact.impulse == pytest.approx((0, 0, 0), abs=1e-15)


def test_a_singular_contact_gets_the_impulse_of_least_norm():
    """K has rank 2 and the normal is not in its range. Expected: the pseudo-inverse."""
    z = np.array([0.6, 0.0, 0.8])
    A = np.array([[1.0, 0.2, 0.3], [0.2, 2.0, -0.1], [0.3, -0.1, 1.5]])
    project = np.eye(3) - np.outer(z, z)
    K = project @ A @ project
    u = K @ np.array([0.3, -0.2, -1.0])
    e, n = 0.5, np.array([0, 0, 1.0])
    impact = resolve_contact(K, u, n, e, 50.0, ImpactModel(Law.COULOMB))
    j = -u[2] / K[2, 2]
    expected = (1 + e) * j * n - np.linalg.pinv(K, rcond=1e-9) @ (u + K[:, 2] * j)
    assert impact.impulse == pytest.approx(expected, abs=1e-12)
    assert impact.velocity_after.z == pytest.approx(-e * u[2], abs=1e-12)


RATIOS = [10.0**k for k in (-12, -6, 0, 6, 12)]


@each_law
@pytest.mark.parametrize("ratio", RATIOS)
def test_huge_ratios_of_mobility(law, ratio):
    """Heavy one way and light another, with the strongest possible coupling: the energy must not grow and the
    impulse must push.
    """
    for shear in (0.0, 0.5, -0.999):
        K = np.array([[ratio, shear * math.sqrt(ratio), 0], [shear * math.sqrt(ratio), 1, 0], [0, 0, 1.0]])
        u = np.array([0.25 * math.sqrt(ratio), 0.125, -1.0])
        try:
            impact = resolve_contact(K, u, (0, 0, 1), 0.5, 0.3, ImpactModel(law))
        except ImpactError as error:
            assert error.code is StatusCode.PATH_TOO_LONG
            continue
        assert impact.energy_change <= 1e-12
        assert impact.impulse.z > 0
        assert impact.velocity_after.z > 0


def resolve_with(K=np.eye(3), u=(0.1, 0, -1), n=(0, 0, 1), e=0.5, mu=0.3, model=ImpactModel()):  # noqa: B008
    return resolve_contact(K, u, n, e, mu, model)


BAD = {
    "not symmetric": (StatusCode.INVALID_INERTIA, "K", {"K": [[1, 0.5, 0], [0, 1, 0], [0, 0, 1]]}),
    "indefinite": (StatusCode.INVALID_INERTIA, "K", {"K": [[1, 2, 0], [2, 1, 0], [0, 0, 1]]}),
    "slightly indefinite": (StatusCode.INVALID_INERTIA, "K", {"K": [[1, 1, 0], [1, 1 - 1e-8, 0], [0, 0, 1]]}),
    "negative": (StatusCode.INVALID_INERTIA, "K", {"K": np.diag([1, -1e-3, 1])}),
    "2x2": (StatusCode.INVALID_INERTIA, "K", {"K": np.eye(2)}),
    "nan": (StatusCode.NOT_FINITE, "K", {"K": np.diag([1, math.nan, 1])}),
    "zero": (StatusCode.NO_DYNAMIC_BODY, "K", {"K": np.zeros((3, 3))}),
    "normal does not move": (StatusCode.INVALID_NORMAL, "n", {"K": np.diag([1, 1, 0])}),
    "slip does not move": (StatusCode.INVALID_COEFFICIENT, "friction", {"K": np.diag([0, 1, 1])}),
    "no normal": (StatusCode.INVALID_NORMAL, "n", {"n": (0, 0, 0)}),
    "infinite slip": (StatusCode.NOT_FINITE, "u", {"u": (math.inf, 0, -1)}),
    "restitution": (StatusCode.INVALID_COEFFICIENT, "restitution", {"e": 1.5}),
    "friction": (StatusCode.INVALID_COEFFICIENT, "friction", {"mu": -0.1}),
    "geometry": (
        StatusCode.INVALID_MODEL,
        "model.geometry",
        {"model": ImpactModel(geometry=Geometry.PLANAR)},
    ),
}


@pytest.mark.parametrize("name", BAD)
def test_invalid_contacts_are_refused(name):
    code, field, given = BAD[name]
    with refused(code, field):
        resolve_with(**given)


def test_without_friction_the_slip_may_be_in_a_locked_direction():
    impact = resolve_contact(np.diag([0, 1, 1]), (0.1, 0, -1), (0, 0, 1), 0.5)
    assert impact.velocity_after == pytest.approx((0.1, 0, 0.5), abs=1e-15)


@pytest.mark.parametrize("wrong", [None, 3.0, [1, 2, 3]])
def test_arguments_of_the_wrong_shape_are_refused(wrong):
    with pytest.raises((TypeError, ImpactError), match="K: must be 3 x 3 numbers"):
        resolve_contact(wrong, (0, 0, -1), (0, 0, 1))
    with pytest.raises(TypeError, match=r"n: must be \(x, y, z\)"):
        resolve_contact(np.eye(3), (0, 0, -1), 3.0)
    with pytest.raises(ImpactError, match=r"positive semi-definite; is \[\[-1, 0, 0\], "):
        resolve_contact([[-1, 0, 0], [0, 1, 0], [0, 0, 1]], (0, 0, -1), (0, 0, 1))


def test_invalid_inverse_inertias_are_refused():
    for no_matrix in (None, 1.0):
        with pytest.raises(TypeError, match=r"^inverse_inertia: must be 6 x 6 numbers, is "):
            Body.articulated(no_matrix)
    with refused(StatusCode.INVALID_INERTIA, "inverse_inertia"):
        Body.articulated(np.eye(5))
    with refused(StatusCode.INVALID_INERTIA, "inverse_inertia"):
        Body.articulated([1.0] * 35)
    skew = np.eye(6)
    skew[0, 4] = 1e-3
    with refused(StatusCode.INVALID_INERTIA, "inverse_inertia"):
        Body.articulated(skew)
    with refused(StatusCode.NOT_FINITE, "inverse_inertia"):
        Body.articulated(np.full((6, 6), np.inf))
    indefinite = np.eye(6)
    indefinite[0, 4] = indefinite[4, 0] = 1.1
    contact = Contact.of((0, 0, 0), (0, 0, 1))
    body = Body.articulated(indefinite, velocity=(0, 0, -1))
    with refused(StatusCode.INVALID_INERTIA, "body_a.inverse_inertia"):
        resolve(body, Body.static(), contact)
    nothing = Body.articulated(np.zeros(36), velocity=(0, 0, -1))
    with refused(StatusCode.NO_DYNAMIC_BODY, "body_a"):
        resolve(nothing, Body.static(), contact)


@pytest.mark.parametrize("wrong", [*itertools.combinations(range(6), 2)])
@pytest.mark.parametrize("others", [0.0, 1.0, 1e308])
def test_an_inverse_inertia_whose_trace_is_beyond_float64_is_checked(wrong, others):
    matrix = np.diag([others] * 6)
    matrix[wrong, wrong] = -1e308
    with refused(StatusCode.INVALID_INERTIA, "body_a.inverse_inertia"):
        resolve(
            Body.articulated(matrix, velocity=(0, 0, -1)), Body.static(), Contact.of((0, 0, 0), (0, 0, 1))
        )


@pytest.mark.parametrize("unit", [2.0**-20, 1.0, 2.0**20])
def test_the_check_of_the_matrix_does_not_depend_on_units(unit):
    """In other units of length the angular rows grow by ``unit``, and the angular block by its square."""
    X = np.diag([1, 1, 1, unit, unit, unit])
    matrix = X @ ARM.inverse_inertia() @ X
    body = Body.articulated(matrix, velocity=-NORMAL)
    contact = Contact.of((0, 0, 0), NORMAL)
    assert resolve(body, Body.static(), contact).effective_mass == pytest.approx(0.366583042049, abs=1e-11)
    matrix[0, 3] = matrix[3, 0] = 1.01 * math.sqrt(matrix[0, 0] * matrix[3, 3])
    broken = Body.articulated(matrix, velocity=-NORMAL)
    with refused(StatusCode.INVALID_INERTIA, "body_a.inverse_inertia"):
        resolve(broken, Body.static(), contact)


def test_one_joint_at_the_origin_of_the_frame():
    """The linear rows of the matrix are 0."""
    matrix = np.zeros((6, 6))
    matrix[5, 5] = 2.0
    door = Body.articulated(matrix, angular_velocity=(0, 0, -1.0))
    impact = resolve(door, Body.static(), Contact.of((0.5, 0, 0), (0, 1, 0), 0.5))
    assert impact.twist_a.angular.z == pytest.approx(0.5, abs=1e-15)
    assert impact.effective_mass == pytest.approx(2.0, rel=1e-15)
    assert impact.error_bound < 1e-14


@pytest.mark.parametrize("e", [0.0, 0.5])
def test_restitution_may_be_a_function(e):
    by_function, by_number = (resolve_with(e=given) for given in (lambda speed: e * speed, e))
    assert by_function.impulse == pytest.approx(by_number.impulse, rel=1e-14)


def test_very_large_and_very_small_matrices():
    for scale in (1e-140, 1e140):
        impact = resolve_contact(np.diag([3.5, 3.5, 1.0]) * scale, (0.2, 0, -1), (0, 0, 1), 0.5, 0.3)
        assert np.array(impact.impulse) * scale == pytest.approx((-0.2 / 3.5, 0, 1.5), rel=1e-13)


def test_scenes_refuse_articulated_bodies():
    contact = Contact.of((0, 0, 0), (0, 0, 1))
    with refused(StatusCode.INVALID_INERTIA, "bodies[0].inverse_inertia"):
        resolve_scene([tip(), Body.static()], [(0, 1)], [contact])


NUMBERS = (0.0, 0.0, 1.0, -1.0, 0.5, 0.25, 0.1, 0.3, 3.0, -0.7)
"""Entries of Jacobians. Decimals make ``J J^T`` round, so that its rank may differ from that of ``J``."""


def contacts_of_mechanisms(freedoms, count):
    """Yield links of random mechanisms, their Jacobians and joint speeds, and a contact at which they
    approach.
    """
    draw = random.Random(f"{freedoms} freedoms")
    while count:
        J = np.array([[draw.choice(NUMBERS) for _ in range(freedoms)] for _ in range(6)])
        speeds = np.array([draw.choice((1.0, -1.0, 0.5, 0.3)) for _ in range(freedoms)])
        at, n = ([draw.choice(NUMBERS) for _ in range(3)] for _ in range(2))
        moves = J[:3] + np.cross(J[3:].T, at).T
        seen = np.abs(np.array(n) @ moves).max()
        if seen < 1e-3 or abs(np.array(n) @ moves @ speeds) < 1e-3:
            continue
        if np.array(n) @ moves @ speeds > 0:
            speeds = -speeds
        contact = Contact.of(at, n, draw.choice((0.0, 0.5, 1.0)), draw.choice((0.0, 0.3, 0.5, 1.0, 2.0)))
        yield Body.articulated(J @ J.T, (0, 0, 0), *np.split(J @ speeds, 2)), J, speeds, contact
        count -= 1


@each_law
@pytest.mark.parametrize("precision", [Precision.AUTO, Precision.EXTENDED])
def test_a_door_has_one_degree_of_freedom(law, precision):
    """Restitution scales its whole motion. Slip stops when the approach does."""
    for door, J, (speed,), contact in contacts_of_mechanisms(1, 60):
        impact = resolve(door, Body.static(), contact, ImpactModel(law, precision=precision))
        assert impact.status is StatusCode.OK
        after = -contact.restitution * speed
        assert [*impact.twist_a.linear, *impact.twist_a.angular] == pytest.approx(after * J[:, 0], abs=1e-12)
        gained = impact.kinetic_energy_after - impact.kinetic_energy_before
        assert gained == pytest.approx((after**2 - speed**2) / 2, abs=1e-12)


@each_law
@pytest.mark.parametrize("precision", [Precision.AUTO, Precision.EXTENDED])
@pytest.mark.parametrize("frame", [(0.1, 0.7), (0.3, -0.2), (0.7, 0.3)])
def test_a_door_answers_alike_wherever_its_frame_is(law, precision, frame):
    """It strikes along an axis, so every other entry of ``K`` at the contact is rounding of terms that
    cancel.
    """
    moment, speed, e = 0.9, -1.3, 0.5
    for hinge, reach in itertools.product([(0.0, 0.0), (0.3, 0.1)], [0.5, 0.7, 1.3]):
        J = np.array([hinge[1] - frame[1], frame[0] - hinge[0], 0, 0, 0, 1])
        door = Body.articulated(np.outer(J, J) / moment, (*frame, 0), *np.split(J * speed, 2))
        at = (hinge[0] + reach, hinge[1], 0)
        for n, friction in itertools.product([(0, 1, 0), (3, 4, 0), (0, 3, 4), (1, 1, 1)], [0.0, 0.3, 1.5]):
            contact = Contact.of(at, n, e, friction)
            impact = resolve(door, Body.static(), contact, ImpactModel(law, precision=precision))
            assert impact.status is StatusCode.OK
            assert impact.twist_a.angular == pytest.approx((0, 0, -e * speed), abs=1e-12)
            assert impact.impulse.y == pytest.approx(-(1 + e) * speed * moment / reach, rel=1e-12)
        with refused(StatusCode.INVALID_NORMAL, "contact.normal"):
            resolve(door, Body.static(), Contact.of(at, (1, 0, 0)))


@each_law
@pytest.mark.parametrize("precision", [Precision.AUTO, Precision.EXTENDED])
@pytest.mark.parametrize("axis", [0, 1, 2])
def test_a_flap_that_strikes_along_an_axis_of_the_world_stops_its_slip(axis, precision, law):
    """The contact moves along one axis of the world, so all other entries of ``K`` are rounding, of either
    sign. The impulse without friction ends the slip, too.
    """
    random, moment, e = np.random.default_rng(axis), 0.9, 0.5

    def turned(vector):
        return np.roll(vector, axis)

    for _ in range(200):
        angle, frame = random.uniform(0, 2 * math.pi), random.normal(size=3)
        hinge, at, n = np.array([math.cos(angle), math.sin(angle), 0]), *random.normal(size=(2, 3))
        at[2] = 0
        arm = np.cross(hinge, at)
        if abs(arm[2]) < 0.2 or abs(n[2]) < 0.3 * np.linalg.norm(n):
            continue
        speed = -math.copysign(1.0, arm[2] * n[2])
        J = np.concatenate([turned(np.cross(hinge, frame)), turned(hinge)])
        flap = Body.articulated(np.outer(J, J) / moment, turned(frame), *np.split(J * speed, 2))
        contact = Contact.of(turned(at), turned(n), e, 0.9)
        impact = resolve(flap, Body.static(), contact, ImpactModel(law, precision=precision))
        right = turned(n) * (-(1 + e) * speed * moment / (n[2] * arm[2]))
        assert impact.status is StatusCode.OK
        assert np.linalg.norm(np.array(impact.impulse) - right) <= 1e-11 * np.linalg.norm(right)


@pytest.mark.parametrize("precision", [Precision.DOUBLE, Precision.AUTO, Precision.EXTENDED])
@pytest.mark.parametrize("digits", [24, 28, 29, 30, 31, 32, 36, 40, 50])
def test_a_locked_direction_next_to_the_tangent_plane_is_within_the_bound(digits, precision):
    """``K = J J^T`` is singular and exact. The contact sticks, so the impulse is known in fractions: that of
    the approach, and the least one that stops the slip.
    """
    J = [[F(1), F(0)], [F(1, 2), F(1)], [F(0), F(1, 2**digits)]]  # locked is about (d / 2, -d, 1)
    K = [[sum(a * b for a, b in zip(r, s, strict=True)) for s in J] for r in J]
    u = [r[0] / 4 - r[1] * 5 / 4 for r in J]
    j = -u[1] / K[1][1]
    slip = [x + row[1] * j for x, row in zip(u, K, strict=True)]

    def solved(v):  # (J^T J)^-1 v
        (a, b), (_, c) = [[sum(r[i] * r[k] for r in J) for k in range(2)] for i in range(2)]
        return [(c * v[0] - b * v[1]) / (a * c - b * b), (a * v[1] - b * v[0]) / (a * c - b * b)]

    y = solved(solved([sum(r[i] * x for r, x in zip(J, slip, strict=True)) for i in range(2)]))
    right = [-(r[0] * y[0] + r[1] * y[1]) for r in J]
    right[1] += 2 * j
    model = ImpactModel(Law.COULOMB, precision=precision)
    floats = [[float(x) for x in row] for row in K]
    found = resolve_contact(floats, [float(x) for x in u], (0, 1, 0), 1.0, 2.0, model)
    off = sum((F(x) - y) ** 2 for x, y in zip(found.impulse, right, strict=True))
    assert found.regime is Regime.STICKING
    if found.error_bound == math.inf:  # float64 does not tell whether it counts as tangential
        assert (digits, precision) == (30, Precision.DOUBLE)
        return
    assert off <= F(found.error_bound) ** 2 * sum(x * x for x in right)
    assert found.error_bound < 1e-8


@pytest.mark.parametrize("law", NEEDS_FREE_SLIP, ids=lambda law: law.name)
@pytest.mark.parametrize("e", [0.5, 1.0])
@pytest.mark.parametrize(("n", "mu"), [((2, 2, 0), 1.0), ((4, 3, 0), 0.75)])
def test_a_locked_direction_on_the_edge_of_the_cone_is_in_it(n, mu, e, law):
    """However the axes of the world are turned, which rounds it to either side."""
    K, u = np.diag([0.0, 18.0, 2.0]), (0.0, -1.5, -1.5)
    turns = [Quaternion(*q).rotation()[:3] for q in np.random.default_rng(1).normal(size=(100, 4)).tolist()]
    for turn in map(np.array, turns):
        turned = turn @ K @ turn.T
        request = (turned + turned.T) / 2, turn @ u, turn @ n, e, mu
        found, coulomb = (resolve_contact(*request, ImpactModel(one)) for one in (law, Law.COULOMB))
        assert found.adjustments == Adjustment.LAW_FALLBACK | coulomb.adjustments
        assert found.impulse == pytest.approx(coulomb.impulse, rel=1e-9)


@each_law
@pytest.mark.parametrize("precision", [Precision.AUTO, Precision.EXTENDED])
@pytest.mark.parametrize("freedoms", [2, 3])
def test_mechanisms_with_few_degrees_of_freedom_gain_no_energy(freedoms, law, precision):
    """They must not be refused for the rounding of their matrix either."""
    sure = 0
    for link, _, speeds, contact in contacts_of_mechanisms(freedoms, 60):
        try:
            impact = resolve(link, Body.static(), contact, ImpactModel(law, precision=precision))
        except ImpactError as refusal:
            assert refusal.code is StatusCode.PATH_TOO_LONG
            continue
        gained = impact.kinetic_energy_after - impact.kinetic_energy_before
        assert gained <= 1e-12 * speeds @ speeds
        sure += impact.status is StatusCode.OK
    without_bound = law is Law.COMPLIANT and freedoms == 2
    assert sure >= (60 if law in (Law.FRICTIONLESS, Law.COULOMB) else 0 if without_bound else 40)


COMPONENTS = (0.0, 1.0, -1.0, 2.0, -0.5, 0.25, 3.0)
SLANTED = [(0, 0, 1), (0, 0, -1), (1, 0, 0), (0, 0.6, 0.8), (0, 3, 4), (1, 1, 1), (1, -2, 0.5)]


def contacts_in_a_plane(count):
    """Yield ``K`` of rank 2, ``u`` in its range, ``n`` out of it, ``e``, ``mu``, and the tangent of the angle
    between ``n`` and the locked direction.
    """
    draw = random.Random("in a plane")
    while count:
        ways = np.array([[draw.choice(COMPONENTS) for _ in range(3)] for _ in range(2)])
        K, idle, n = ways.T @ ways, np.cross(*ways), np.array(draw.choice(SLANTED), float)
        u = K @ [draw.choice(COMPONENTS) for _ in range(3)]
        if abs(n @ idle) < 1e-9 or abs(n @ u) < 1e-9 or not n @ K @ n > 1e-3 * np.trace(K):
            continue
        e, mu = draw.choice((0.0, 0.0, 0.5, 1.0)), draw.choice((0.1, 0.3, 0.5, 1.0, 2.0))
        slant = np.linalg.norm(np.cross(n, idle)) / abs(n @ idle)
        if abs(slant - mu) > 1e-9:
            yield K, -u if n @ u > 0 else u, n, e, mu, slant
            count -= 1


@pytest.mark.parametrize("precision", [Precision.AUTO, Precision.EXTENDED])
def test_moreau_with_one_locked_direction(precision):
    """Slip and approach depend on each other there: a contact that sticks has stopped altogether."""
    seen = set()
    for K, u, n, e, mu, slant in contacts_in_a_plane(300):
        impact = resolve_contact(K, u, n, e, mu, ImpactModel(Law.MOREAU, precision=precision))
        fell_back, P = Adjustment.LAW_FALLBACK in impact.adjustments, np.array(impact.impulse)
        seen.add((impact.regime, fell_back))
        if slant < mu:
            assert fell_back
        assert impact.status is StatusCode.OK
        unit, after = n / np.linalg.norm(n), u + K @ P
        speed, size = np.linalg.norm(np.abs(K) @ np.abs(P) + np.abs(u)), np.linalg.norm(P)
        near = 4 * impact.error_bound + 1e-13
        assert unit @ after == pytest.approx(-e * unit @ u, abs=near * speed)
        lost = impact.energy_lost_restitution + impact.energy_lost_friction
        assert lost == pytest.approx(-P @ (u + after) / 2, abs=near * speed * size)
        if fell_back:
            continue
        P_n = unit @ P
        P_t, slip = P - P_n * unit, after - unit @ after * unit
        if impact.regime is Regime.STICKING:
            assert e == 0
            assert np.linalg.norm(slip) <= near * speed
            assert np.linalg.norm(P_t) <= mu * P_n + near * size
        else:
            assert np.linalg.norm(P_t) == pytest.approx(mu * P_n, abs=near * size)
            opposed = -np.linalg.norm(P_t) * np.linalg.norm(slip)
            assert P_t @ slip == pytest.approx(opposed, abs=near * size * speed)
    ways = {(regime, False) for regime in (Regime.STICKING, Regime.SLIDING, Regime.REVERSED)}
    assert seen >= ways


@pytest.mark.parametrize("law", [Law.MOREAU, Law.ROUTH_POISSON, Law.ROUTH_STRONGE, Law.COMPLIANT])
def test_a_wedged_contact_falls_back_to_coulomb(law):
    """The friction cone contains the locked direction, so the impulse can grow without end."""
    wedged = 0
    for K, u, n, e, mu, slant in contacts_in_a_plane(300):
        if slant < mu:
            wedged += 1
            found, wanted = (resolve_contact(K, u, n, e, mu, ImpactModel(one)) for one in (law, Law.COULOMB))
            assert Adjustment.LAW_FALLBACK in found.adjustments
            assert found.status is StatusCode.OK
            assert found.impulse == pytest.approx(wanted.impulse, rel=1e-12)
    assert wedged > 30


@pytest.mark.parametrize("turn", np.linspace(0.1, 3.1, 11))
@pytest.mark.parametrize("law", [Law.FRICTIONLESS, Law.COULOMB])
def test_a_normal_along_a_stretched_arm_is_refused(turn, law):
    """``n.K n`` is rounding only."""
    n = np.array([math.cos(turn), math.sin(turn), 0])
    across = np.array([-n[1], n[0], 0])
    with refused(StatusCode.INVALID_NORMAL, "n"):
        resolve_with(np.outer(across, across) * 3.4, across, n, mu=0.0, model=ImpactModel(law))


@pytest.mark.parametrize("eps", [F(1, 10**6), F(1, 10**12), F(1, 10**14)])
@pytest.mark.parametrize("precision", Precision)
def test_the_bound_covers_the_rounding_of_fractions_to_floats(eps, precision):
    """The terms of ``n.K n`` cancel."""
    K = [[F(1, 3) + eps, 0, -F(1, 3)], [0, 1, 0], [-F(1, 3), 0, F(1, 3) + eps]]
    impact = resolve_contact(K, (-1, 0, -1), (1, 0, 1), 1, model=ImpactModel(precision=precision))
    exact = 2 / eps  # -(1 + e) n.u / n.Kn
    assert abs(F(impact.impulse.x) - exact) <= F(min(impact.error_bound, 1e300)) * exact


@pytest.mark.parametrize("number", [10**400, F(10) ** 400, -(10**400)])
def test_matrix_entries_beyond_float64_are_refused(number):
    K = [[number, 0, 0], [0, 1, 0], [0, 0, 1]]
    with refused(StatusCode.NOT_FINITE, "K"):
        resolve_contact(K, (0, 0, -1), (0, 0, 1))
    whole = [[number, *[0] * 5], *[[0] * 6] * 5]
    with refused(StatusCode.NOT_FINITE, "inverse_inertia"):
        Body.articulated(whole)


@pytest.mark.parametrize(
    "wrong", ["3", "x", None, 1j, True, np.True_, np.array(True), Decimal("sNaN"), np.void(b"1")], ids=repr
)
def test_matrix_entries_that_are_not_numbers_are_refused(wrong):
    with pytest.raises(TypeError, match=r"^K: "):
        resolve_contact([[wrong, 0, 0], [0, 1, 0], [0, 0, 1]], (0, 0, -1), (0, 0, 1))


@pytest.mark.parametrize("number", [np.int8, np.uint8, np.float16, np.longdouble, Decimal, F])
def test_matrix_entries_may_be_of_any_type(number):
    """Also of NumPy's integers, whose differences and absolute values overflow."""
    K = [[127, 100, 0], [100, 127, 0], [0, 0, 1]]
    found = resolve_contact([list(map(number, row)) for row in K], (0, 0, -1), (0, 0, 1), 0.5, 0.25)
    assert found == resolve_contact(K, (0, 0, -1), (0, 0, 1), 0.5, 0.25)


def test_matrix_entries_may_be_of_several_types():
    K, u, up = (
        [[Decimal("3.5"), 0.25, F(1, 2)], [F(1, 4), 3, 0], [np.float32(0.5), Decimal(0), 1]],
        (1, 2, -3),
        (0, 0, 1),
    )
    assert resolve_contact(K, u, up) == resolve_contact([[3.5, 0.25, 0.5], [0.25, 3, 0], [0.5, 0, 1]], u, up)


def test_the_least_matrix_entries_keep_their_digits():
    least = Body.articulated(np.eye(6) * 5e-324).inverse_inertia
    assert (least.xx, least.xy, least.cc) == (5e-324, 0, 5e-324)


LENGTHS = [5e-324, 1e-310, 1e-200, 1.0, 1e200, 1e308, 1.7e308]


@pytest.mark.parametrize("friction", [0.0, 0.3])
@pytest.mark.parametrize("normal", [(0, 0, 1), (1, 0, 1), (1, 1, 1), (-1, 1, 0)])
@pytest.mark.parametrize("length", LENGTHS)
def test_normals_may_have_any_length_except_0(length, normal, friction):
    """Also where the sum of the components, or of their squares, is out of range."""
    K, u = [[3.5, 0, 0], [0, 3.5, 0], [0, 0, 1]], (0.25, -0.5, -1)
    wanted = resolve_contact(K, u, normal, 0.5, friction)
    found = resolve_contact(K, u, tuple(length * x for x in normal), 0.5, friction)
    assert found.status is StatusCode.OK
    assert found.impulse == pytest.approx(wanted.impulse, rel=1e-14, abs=1e-15)


SOUND = {"K": [[3.5, 0, 0], [0, 3.5, 0], [0, 0, 1]], "u": (0.2, 0, -1), "n": (0, 0, 1)}


@pytest.mark.parametrize(
    ("argument", "value", "named"),
    [
        ("u", "abc", "u.x"),
        ("u", (0, None, 1), "u.y"),
        ("u", (0, 0, True), "u.z"),
        ("u", (0, 0), "u"),
        ("u", None, "u"),
        ("n", "xyz", "n.x"),
        ("n", (0, 0, 1j), "n.z"),
        ("n", 3.0, "n"),
        ("K", None, "K"),
        ("K", [[None] * 3] * 3, "K"),
        ("restitution", "a", "restitution"),
        ("restitution", None, "restitution"),
        ("restitution", lambda _: None, r"restitution\(approach_speed\)"),
        ("friction", "a", "friction"),
        ("friction", True, "friction"),
        ("friction", lambda _: "a", r"friction\(slip_speed\)"),
        ("model", Law.COULOMB, "model"),
    ],
)
def test_arguments_of_wrong_types_are_refused_by_name(argument, value, named):
    with pytest.raises(TypeError, match=f"^{named}: must be "):
        resolve_contact(**{**SOUND, argument: value})


def test_an_error_in_a_restitution_function_is_raised_unchanged():
    def broken(speed):
        raise TypeError("contact.py is broken")

    with pytest.raises(TypeError, match=r"^contact\.py is broken$") as raised:
        resolve_contact(**SOUND, restitution=broken)
    assert raised.traceback[-1].name == "broken"


@pytest.mark.parametrize("great", [10**400, -(10**400), F(10**400)])
@pytest.mark.parametrize("argument", ["K", "u", "n", "restitution", "friction"])
def test_numbers_beyond_float64_are_refused_and_quoted_as_given(argument, great):
    given = {"K": [[great, 0, 0], [0, 1, 0], [0, 0, 1]], "u": (great, 0, 0), "n": (great, 0, 0)}
    with refused(StatusCode.NOT_FINITE, argument, f"^{argument}: must be finite; is .*{10**400}"):
        resolve_contact(**{**SOUND, argument: given.get(argument, great)})


def test_integers_too_long_to_print_are_refused_by_name():
    for argument, value in (("friction", 10**5000), ("K", [[10**5000] * 3] * 3), ("u", (0, 0, 10**5000))):
        with pytest.raises(
            ImpactError, match=f"^{argument}: must be finite; is of more digits than are shown"
        ):
            resolve_contact(**{**SOUND, argument: value})


def test_a_zero_matrix_is_refused_by_name():
    with refused(StatusCode.NO_DYNAMIC_BODY, match=r"^K: must not be 0$"):
        resolve_contact(**{**SOUND, "K": [[0] * 3] * 3})


@pytest.mark.parametrize("power", [20, 30, 36, 40, 44, 50])
def test_a_velocity_that_no_impulse_stops_is_refused_however_little_the_contact_moves_across(power):
    """Little mobility turns the locked directions by rounding, but not as far as ``u`` is off."""
    K = [[4, 0, -2], [0, 2.0**-power, 0], [-2, 0, 1]]
    with pytest.raises(ImpactError, match="friction: must be 0 if a contact that approaches slips"):
        resolve_contact(K, (0.25048828125, 0, -0.1240234375), (0, 0, 1), 1.0, 1.0)


def test_a_velocity_that_no_impulse_stops_is_no_fault_of_a_contact_that_separates():
    K = [[1, 0, 0], [0, 0, 0], [0, 0, 1]]
    assert resolve_contact(K, (0.3, 0.1, 1.0), (0, 0, 1), 0.5, 0.3).status is StatusCode.SEPARATING
    with refused(StatusCode.INVALID_COEFFICIENT, "friction"):
        resolve_contact(K, (0.3, 0.1, -1.0), (0, 0, 1), 0.5, 0.3)


@pytest.mark.parametrize("delta", [1e-3, 1e-5, 1e-7, 1e-9])
@pytest.mark.parametrize("seed", range(10))
def test_next_to_a_wedge_motion_and_energy_are_those_of_the_joints(seed, delta):
    """There MOREAU presses up to 1e11 times as hard as needed, in the direction that is locked."""
    draw = np.random.default_rng(seed)
    jacobian, n, rates = (draw.normal(size=size) for size in ((3, 2), 3, 2))
    rates *= -np.sign(n @ jacobian @ rates)
    locked = np.cross(*jacobian.T)
    along = abs(locked @ n) / np.linalg.norm(locked) / np.linalg.norm(n)
    mu = math.sqrt(1 - along**2) / along * (1 - delta)
    model = ImpactModel(Law.MOREAU)
    answer = resolve_contact(jacobian @ jacobian.T, jacobian @ rates, n, 1.0, mu, model)
    rates_after = rates + jacobian.T @ np.array(answer.impulse)
    rounding = 1e-14 * np.linalg.norm(answer.impulse) * np.linalg.norm(jacobian) ** 2 + 1e-12
    np.testing.assert_allclose(answer.velocity_after, jacobian @ rates_after, rtol=0, atol=rounding)
    change = (rates_after @ rates_after - rates @ rates) / 2
    assert answer.energy_change == pytest.approx(change, abs=10 * rounding)
    assert answer.energy_change <= rounding


@each_law
@pytest.mark.parametrize("heavy", [1e-200, 1e-300])
def test_energies_beyond_float64_beside_a_restitution_threshold_are_refused(law, heavy):
    """The energy of the mechanism is a fraction there, too."""
    spinning = Body.dynamic(
        1.0, (0.4, 0, 0, 0.5, 0, 0.6), velocity=(0, 0, -3.0), angular_velocity=(0, 1e155, 0)
    )
    tip = Body.articulated((np.eye(6) * heavy).ravel().tolist())
    with refused(StatusCode.OUT_OF_RANGE, "result"):
        resolve(
            spinning, tip, Contact.of((0, 0, 0), (0, 0, 1), 0.5), ImpactModel(law, restitution_threshold=1e-8)
        )


def test_halves_of_a_matrix_in_numbers_of_different_types_are_averaged():
    matrix = [[1, Decimal("0.1"), 0], [0.1, F(1), 0], [0, 0, 1]]
    mixed, floats = (
        resolve_contact(given, (0, 0, -1.0), (0, 0.6, 0.8))
        for given in (matrix, [[1, 0.1, 0], [0.1, 1, 0], [0, 0, 1]])
    )
    assert mixed.impulse == pytest.approx(floats.impulse, abs=1e-15)  # 0.1 is rounded in one of them


@pytest.mark.parametrize("law", [law for law in Law if law not in (Law.AUTO, Law.COMPLIANT)], ids=str)
@pytest.mark.parametrize("precision", [Precision.DOUBLE, Precision.EXTENDED], ids=str)
@pytest.mark.parametrize("e", [0.0, 0.5, 1.0])
@pytest.mark.parametrize("u", [(0.0, 0.0, -1.0), (0.0, -4.0, -1.0)])
def test_without_friction_a_velocity_that_no_impulse_stops_counts_in_the_energy(u, e, precision, law):
    """Impulses along (0, 3, 4) move nothing; this ``u`` has a component along it, which stays."""
    K = [[25.0, 0.0, 0.0], [0.0, 16.0, -12.0], [0.0, -12.0, 9.0]]
    impact = resolve_contact(K, u, (0, 0, 1), e, 0.0, ImpactModel(law, precision=precision))
    assert impact.status is StatusCode.OK
    assert impact.impulse == pytest.approx((0.0, 0.0, (1 + e) / 9))
    assert impact.velocity_after == pytest.approx((0.0, u[1] - 12 * (1 + e) / 9, e))
    assert impact.energy_change == pytest.approx((e * e - 1) / 18)
    assert impact.energy_lost_restitution == pytest.approx((1 - e * e) / 18)


@pytest.mark.parametrize("e", [0.0, 0.5, 1.0])
def test_a_moving_wall_strikes_a_link_that_is_guided_on_an_incline(e):
    """The wall moves as the link cannot, so the relative velocity has a component that stays."""
    J = np.array([[1.0, 0.0], [0.0, 0.8], [0.0, -0.6]])
    M = np.zeros((6, 6))
    M[:3, :3] = J @ J.T
    wall, contact = Body.kinematic(velocity=(0.0, 0.0, 1.0)), Contact.of((0, 0, 0), (0, 0, 1), e)
    impact = resolve(Body.articulated(M), wall, contact)
    assert impact.normal_velocity_after == pytest.approx(e, abs=1e-15)
    assert impact.twist_a.linear.z - impact.twist_b.linear.z == pytest.approx(e, abs=1e-15)


@pytest.mark.parametrize("law", [Law.COULOMB, Law.MOREAU, Law.ROUTH_POISSON, Law.ROUTH_STRONGE], ids=str)
@pytest.mark.parametrize("precision", [Precision.AUTO, Precision.EXTENDED], ids=str)
@pytest.mark.parametrize("approach", [0.0, 2.0**-18, 2.0**-10, 1.0])
@pytest.mark.parametrize("friction", [1e-9, 0.3, 2.0])
def test_a_small_locked_part_of_a_slow_approach_is_in_the_bound(friction, approach, precision, law):
    """It passes for rounding of a fast slip, though it may be half of the normal velocity.

    Impulses along (1, 0, -1) move nothing, so none stops that part.
    """
    locked = 2.0**-21
    K, u = [[1, 0, 1], [0, 2.0**30, 0], [1, 0, 1]], (-approach, 1.0, -approach - 2 * locked)
    part = locked / (approach + 2 * locked)
    impact = resolve_contact(K, u, (0, 0, 1), 0.5, friction, ImpactModel(law, precision=precision))
    assert impact.error_bound >= part
    frictionless = resolve_contact(K, u, (0, 0, 1), 0.5, 0.0, ImpactModel(law, precision=precision))
    assert frictionless.error_bound < 1e-14
