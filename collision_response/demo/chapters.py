"""The parts of the demo: each plays something through the service, prints it, and says what is wrong."""

from __future__ import annotations

import math
import time
from collections.abc import Collection, Iterator, Mapping
from operator import attrgetter

from builtin_interfaces.msg import Time

from ..msg import BodyState, CollisionResult
from ..physics.body import Body
from ..physics.vector import Vec3
from ..srv import ResolveCollision
from .billiards import Break, cushion_bodies, rack
from .books import EnergyBook
from .client import Client
from .messages import answer_of, contact_of, state_of, time_of
from .progress import Progress
from .scene import Answer, Encounter
from .systems import System, all_systems
from .tumbling_rod import FALL, Tumbling

DIFFERENCE = 1e-14
"""Greatest relative difference from a closed form, and relative error of a book."""

ROWS = 4
"""Quantities of one system to be printed."""

BURST = 500

BREAK_LASTS = 4.0
BOUNCES = 10
PAUSE = 1.0
"""Seconds of a scene's time."""

ROD_FALLS_AT = Vec3(-0.5, -1.5, 0.0)


def systems(client: Client) -> Iterator[str]:
    """S1 to S8 against their closed forms."""
    print("1. Eight systems with known answers. Their bodies are published; the requests name them.\n")
    print(f"{'system':34} {'quantity':17} {'closed form':>17} {'service':>17} {'rel. diff.':>10}")
    worst, quantities = 0.0, 0
    for system in all_systems():
        result = _resolve_system(client, system)
        title, unseen = f"{system.name} {system.title}", 0.0
        for row, (quantity, expected) in enumerate(system.expected.items(), start=1):
            answer = attrgetter(quantity)(result)
            difference = abs(answer - expected) / (abs(expected) or 1.0)
            worst, quantities = max(worst, difference), quantities + 1
            if row < ROWS or len(system.expected) == ROWS:
                print(f"{title:34} {quantity:17} {expected:17.13g} {answer:17.13g} {difference:10.1e}")
            else:
                unseen = max(unseen, difference)
            title = ""
        if len(system.expected) > ROWS:
            more = f"and {len(system.expected) - ROWS + 1} more"
            print(f"{'':34} {more:17} {'':17} {'':17} {unseen:10.1e}")
    print(f"{f'largest difference of {quantities}':88} {worst:10.1e}\n")
    if not worst <= DIFFERENCE:
        yield f"a difference from a closed form is {worst:.1e}, above {DIFFERENCE:g}"


def _resolve_system(client: Client, system: System) -> CollisionResult:
    stamp = time_of(client.now())
    names = f"{system.name}_a", f"{system.name}_b"
    states = [
        state_of(name, body, stamp) for name, body in zip(names, (system.body_a, system.body_b), strict=True)
    ]
    client.publish(states)
    request = ResolveCollision.Request(contact=contact_of(system.contact, stamp))
    request.body_a, request.body_b = (BodyState(name=name) for name in names)
    return client.call(request, *states)


def burst(client: Client) -> Iterator[str]:
    """Many requests at once."""
    system = all_systems()[2]
    stamp = time_of(client.now())
    bodies = system.body_a, system.body_b
    request = ResolveCollision.Request(contact=contact_of(system.contact, stamp))
    request.body_a, request.body_b = (
        state_of(name, body, stamp) for name, body in zip("ab", bodies, strict=True)
    )
    start = time.monotonic()
    answers = client.call_all([request] * BURST)
    took = time.monotonic() - start
    print(f"{BURST} requests at once: {len(answers)} answers, {BURST / took:.0f} a second\n")
    if any(answer.impulse != answers[0].impulse for answer in answers):
        yield "equal requests got different answers"


class Stage:
    """Where scenes are played: their impacts go to the service, their bodies to the state topic.

    What stands still is published once, and named from then on. A moving body is put into the request
    as it is at the moment of the impact; its last published state would be a frame behind.
    """

    def __init__(self, client: Client, begin: int, fixed: Mapping[str, Body]) -> None:
        self._client = client
        self._begin = begin
        self._fixed = {name: state_of(name, body, self._stamp(0.0)) for name, body in fixed.items()}
        self.published = 0
        self._publish(self._fixed.values())

    def resolve(self, encounter: Encounter) -> Answer:
        """The service's answer."""
        stamp = self._stamp(encounter.time)
        request = ResolveCollision.Request(contact=contact_of(encounter.contact, stamp))
        request.body_a = state_of(encounter.name_a, encounter.body_a, stamp)
        if encounter.body_b is not None:
            request.body_b = state_of(encounter.name_b, encounter.body_b, stamp)
            return answer_of(self._client.call(request))
        request.body_b = BodyState(name=encounter.name_b)
        return answer_of(self._client.call(request, self._fixed[encounter.name_b]))

    def show(self, now: float, bodies: Mapping[str, Body]) -> None:
        """Publish where everything is."""
        stamp = self._stamp(now)
        self._publish([state_of(name, body, stamp) for name, body in bodies.items()])

    def _publish(self, states: Collection[BodyState]) -> None:
        self._client.publish(states)
        self.published += len(states)

    def _stamp(self, now: float) -> Time:
        return time_of(self._begin + round(now * 1e9))


def break_shot(client: Client, begin: int) -> Iterator[str]:
    """A rack of balls, broken."""
    scene = Break(rack())
    stage = Stage(client, begin, cushion_bodies())
    print(f"2. A break shot: 16 balls, 4 cushions, {BREAK_LASTS:g} s on the table. This process finds each")
    print("   contact; the node resolves it, the ball inline in the request, the cushion by name.\n")
    start = time.monotonic()
    with Progress() as progress:
        for impacts in scene.run(stage.resolve, stage.show, BREAK_LASTS):
            progress.say(f"{scene.time:.2f} s on the table, {impacts} impacts")
    took = time.monotonic() - start
    print(
        f"   impacts             {scene.impacts:9d}     in {took:.2f} s: {scene.impacts / took:.0f} a second,"
    )
    print(f"   states published    {stage.published:9d}     in between")
    _print_energy(scene.energy)
    momentum, spin = scene.momentum_error(), scene.spin_error()
    print(f"   momentum of balls and cushions, kept to {momentum:.1e}; angular momentum, to {spin:.1e}\n")
    yield from _check("break shot", scene.energy)
    if not max(momentum, spin) <= DIFFERENCE:
        yield f"break shot: the books of momentum are open by {max(momentum, spin):.1e}"


def tumbling_rod(client: Client, begin: int) -> Iterator[str]:
    """A rod on a rough floor."""
    scene = Tumbling(ROD_FALLS_AT)
    stage = Stage(client, begin, {"floor": Body.static(ROD_FALLS_AT)})
    print(f"3. A rod of 1 m falls {FALL:g} m onto a rough floor (e = 0.9, mu = 0.3) and tumbles on. From its")
    print("   first impact engines that settle friction at the end of an impact gain energy.\n")
    print(f"   {'time [s]':>8} {'angle [deg]':>11}  {'friction':8} {'lost to it [J]':>14}", end="")
    print(f" {'to restitution':>14} {'energy [J]':>10} {'turning [rad/s]':>15}")
    for bounce in scene.run(stage.resolve, stage.show, BOUNCES):
        answer = bounce.answer
        print(
            f"   {bounce.time:8.4f} {math.degrees(bounce.angle):11.1f}  {answer.regime.name.lower():8}"
            f" {answer.lost_friction:14.6f} {answer.lost_restitution:14.6f}"
            f" {bounce.energy:10.6f} {bounce.spin:15.4f}"
        )
    print()
    _print_energy(scene.energy)
    print()
    yield from _check("tumbling rod", scene.energy)


def _print_energy(book: EnergyBook) -> None:
    print(f"   energy at the start {book.first:9.6f} J")
    print(f"   lost to restitution {book.lost_restitution:9.6f} J")
    print(f"   lost to friction    {book.lost_friction:9.6f} J")
    rise = f"rises by {book.rise:.1e} J" if book.relative_rise() > DIFFERENCE else "never rises"
    print(f"   energy at the end   {book.last:9.6f} J   it {rise}; the book closes to {book.error():.1e}")


def _check(scene: str, book: EnergyBook) -> Iterator[str]:
    if not book.error() <= DIFFERENCE:
        yield f"{scene}: the book of energy is open by {book.error():.1e}"
    if not book.relative_rise() <= DIFFERENCE:
        yield f"{scene}: the energy rises by {book.rise:.1e} J"
