"""The parts of the demo: each calls the service, prints answers, and yields a message for each error."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator, Mapping
from itertools import cycle
from operator import attrgetter, mul

from std_msgs.msg import Header

from ..model import ImpactModel
from ..msg import BodyState, CollisionResult, SceneResult
from ..physics.body import Body
from ..physics.energy import kinetic_energy
from ..physics.laws import Law, Regime
from ..physics.vector import Vec3
from ..ros.convert import contact_message, state_message, twist_of
from ..ros.scene_client import pack
from ..srv import ResolveCollision
from .billiards import Break, cushion_bodies, rack
from .client import Client, header_at
from .simulation import FRAMES, Collision, EnergyBalance
from .simultaneous import (
    ContactScene,
    cradle,
    flat_box,
    is_approaching,
    mirror_pairs,
    moved_freely,
    tight_rack,
)
from .systems import System, all_systems
from .tumbling_rod import FALL, TumblingRod

DIFFERENCE = 1e-14
"""Largest allowed relative difference from a closed form, and relative error of a balance."""

BREAK_DURATION, ROD_DURATION, SIMULTANEOUS_DURATION = 4.0, 3.5, 1.5
BOUNCES = 10
STRIKE = 0.5
"""Time of the impacts of the last chapter [s]."""
PAUSE = 1.0
"""Time between two chapters in the recording [s]."""

ROD_FALLS_AT = Vec3(-0.5, -1.5, 0.0)
CRADLES_AT, RACK_AT = Vec3(-0.8, 1.0, 0.05), Vec3(0.6, -1.5, 0.05)
FLOORS = {"floor_at_once": Vec3(0.5, 1.2, 0.0), "floor_in_turn": Vec3(1.2, 1.2, 0.0)}
"""Positions at which the two boxes of the last chapter land."""

CRADLES = {
    Law.FRICTIONLESS: ("the shock goes through", (0.0, 0.0, 1.0), DIFFERENCE),
    Law.MOREAU: ("as time steppers do", (-1 / 3, 2 / 3, 2 / 3), DIFFERENCE),
    Law.ROUTH_STRONGE: ("Hertzian springs", (-0.070952353651, 0.07640303907, 0.994549314581), 1e-9),
}
"""For each law: a description, the speeds of the balls of a cradle after the impact, the allowed error."""


def systems(client: Client) -> Iterator[str]:
    """Compare the answers to S1 to S8 with their closed forms."""
    print("1. Eight systems with known answers. The bodies are published; the requests give them by name.\n")
    head = f"{'system':34} {'quantity':17} {'closed form':>17} {'service':>17}"
    print(f"{head} {'compared':>9} {'largest diff.':>14}")
    for system in all_systems():
        result = _resolve_system(client, system)
        answers = {name: attrgetter(name)(result) for name in system.expected}
        largest = max(abs(answers[name] - x) / (abs(x) or 1.0) for name, x in system.expected.items())
        name, expected = [*system.expected.items()][-1]
        title = f"{system.name} {system.title}"
        line = f"{title:34} {name:17} {expected:17.13g} {answers[name]:17.13g}"
        print(f"{line} {len(answers):9d} {largest:14.1e}")
        if not largest <= DIFFERENCE:
            yield f"{title}: a difference from the closed form is {largest:.1e}, above {DIFFERENCE:g}"
    print()


def _resolve_system(client: Client, system: System) -> CollisionResult:
    header = header_at(client.now())
    bodies = {f"{system.name}_a": system.body_a, f"{system.name}_b": system.body_b}
    client.publish(state_message(name, body, header) for name, body in bodies.items())
    request = ResolveCollision.Request(not_before=header.stamp)
    request.contact = contact_message(system.contact, header)
    request.contact.body_a, request.contact.body_b = bodies
    return client.call(request)


Chapter = Callable[[Client, int], Iterator[str]]
"""Called with the client and the time at which its scene begins [ns]."""


class Stage:
    """Sends the impacts of a scene to the service, and publishes the states of its bodies.

    Static bodies are published once; requests give them by name. Moving bodies are part of the request, with
    their state at the moment of the impact: the last published state would be up to a frame old.
    """

    def __init__(self, client: Client, begin: int, static: Mapping[str, Body]) -> None:
        self._client = client
        self._begin = begin
        self.published = 0
        self.show(0.0, static)

    def resolve(self, collision: Collision) -> CollisionResult:
        """Answer of the service to a collision of two bodies."""
        header = self._header(collision.time)
        request = ResolveCollision.Request(contact=contact_message(collision.contact, header))
        request.body_a = state_message(collision.name_a, collision.body_a, header)
        if collision.body_b is None:
            request.body_b, request.not_before = BodyState(name=collision.name_b), self._header(0.0).stamp
        else:
            request.body_b = state_message(collision.name_b, collision.body_b, header)
        return self._client.call(request)

    def resolve_scene(self, scene: ContactScene, time: float, tolerance: float = 0.0) -> SceneResult:
        """Answer of the service to several contacts at once."""
        bodies, static_names, pairs, contacts, law = scene
        names, model = (*bodies, *static_names), ImpactModel(law, tolerance=tolerance)
        request = pack([*bodies.values()], pairs, contacts, model, names=names)
        request.header, request.not_before = self._header(time), self._header(0.0).stamp
        return self._client.call(request)

    def show(self, now: float, bodies: Mapping[str, Body]) -> None:
        """Publish the states of bodies at a time of the scene [s]."""
        header = self._header(now)
        self._client.publish(state_message(name, body, header) for name, body in bodies.items())
        self.published += len(bodies)

    def _header(self, now: float) -> Header:
        return header_at(self._begin + round(now * 1e9))


def break_shot(client: Client, begin: int) -> Iterator[str]:
    """Play a break shot."""
    simulation = Break(rack())
    stage = Stage(client, begin, cushion_bodies())
    print(f"2. A break shot: 16 balls, 4 cushions, {BREAK_DURATION:g} s. This process finds each contact,")
    print("   and the node resolves it. Requests contain the balls, and give the cushions by name.\n")
    start = time.monotonic()
    simulation.run(stage.resolve, stage.show, BREAK_DURATION)
    took = time.monotonic() - start
    rate = simulation.impacts / took
    print(f"   impacts             {simulation.impacts:9d}     in {took:.2f} s: {rate:.0f} per second")
    print(f"   states published    {stage.published:9d}     between them")
    yield from _check("break shot", simulation.energy)


def tumbling_rod(client: Client, begin: int) -> Iterator[str]:
    """Drop a rod on a rough floor."""
    simulation = TumblingRod(ROD_FALLS_AT)
    stage = Stage(client, begin, {"floor": Body.static(ROD_FALLS_AT)})
    print(
        f"3. A rod of 1 m falls {FALL:g} m onto a rough floor (e = 0.9, mu = 0.3) and tumbles. Engines that"
    )
    print("   apply friction at the end of an impact create energy in its first impact.\n")
    print(f"   {'time [s]':>8} {'angle [deg]':>11}  {'regime':8} {'lost to friction':>16}", end="")
    print(f" {'to restitution':>14} {'energy [J]':>10} {'spin [rad/s]':>15}")
    for bounce in simulation.run(stage.resolve, stage.show, BOUNCES):
        answer, regime = bounce.answer, Regime(bounce.answer.regime).name.lower()
        print(
            f"   {bounce.time:8.4f} {math.degrees(bounce.angle):11.1f}  {regime:8}"
            f" {answer.energy_lost_friction:16.6f} {answer.energy_lost_restitution:14.6f}"
            f" {bounce.energy:10.6f} {bounce.spin:15.4f}"
        )
    print()
    yield from _check("tumbling rod", simulation.energy)


def simultaneous_contacts(client: Client, begin: int) -> Iterator[str]:
    """Resolve scenes with several contacts: a cradle by three laws, a box that lands flat, a tight rack."""
    stage = Stage(client, begin, {name: Body.static(at) for name, at in FLOORS.items()})
    print("4. Several contacts at once. Each line is one request to ~/resolve_scene, except where noted.\n")
    yield from _cradles(stage)
    yield from _flat_boxes(stage)
    yield from _tight_rack(stage)


def _cradles(stage: Stage) -> Iterator[str]:
    what = "three balls in a row, the first at 1 m/s, e = 1"
    print(f"   {what:47} {'speeds after [m/s]':>30} {'diff.':>10}")
    for place, (law, (what, expected, limit)) in enumerate(CRADLES.items()):
        scene = cradle(law, CRADLES_AT + Vec3(0.0, 0.2 * place, 0.0))
        _, moved = _strike(stage, scene, 0.0 if limit == DIFFERENCE else limit)
        speeds = [ball.velocity.x for ball in moved.values()]
        difference = max(abs(x - y) for x, y in zip(speeds, expected, strict=True))
        print(f"   {law.name:14} {what:32} {''.join(f'{x:10.6f}' for x in speeds)} {difference:10.1e}")
        if not difference <= limit:
            yield f"cradle, {law.name}: a speed differs by {difference:.1e}, above {limit:g}"
    print()


def _flat_boxes(stage: Stage) -> Iterator[str]:
    """Resolve one box by a scene, the other one corner after another."""
    at_once, in_turn = (flat_box(floor.replace("floor", "box"), floor, at) for floor, at in FLOORS.items())
    _, moved = _strike(stage, at_once)
    ((name, other),) = in_turn.bodies.items()
    for contact in cycle(in_turn.contacts):
        if is_approaching(other, contact):
            collision = Collision(STRIKE, name, in_turn.static_names[0], other, None, contact)
            other = other.with_twist(twist_of(stage.resolve(collision).twist_a))
        elif not any(is_approaching(other, corner) for corner in in_turn.contacts):
            break
    _play(stage, in_turn.bodies, {name: other})
    (box,) = moved.values()
    print(f"   {'a box lands flat on a floor at 1 m/s, e = 1':47} {'up [m/s]':>14} {'spin [rad/s]':>15}")
    for what, body in (
        ("four corners at once", box),
        ("one corner after another (~/resolve_collision)", other),
    ):
        print(f"   {what:47} {body.velocity.z:14.6f} {body.angular_velocity.norm():15.6f}")
    print()
    difference = max((box.velocity - Vec3(0.0, 0.0, 1.0)).norm(), box.angular_velocity.norm())
    if not difference <= DIFFERENCE:
        yield f"flat box: its twist differs by {difference:.1e}, above {DIFFERENCE:g}"


def _tight_rack(stage: Stage) -> Iterator[str]:
    scene = tight_rack(RACK_AT)
    result, moved = _strike(stage, scene)
    balls = [*moved.values()]
    balance = EnergyBalance(result.kinetic_energy_before)
    balance.add_impact(math.fsum(map(kinetic_energy, balls)), result)
    mirror = Vec3(1.0, -1.0, 1.0)
    asymmetry = max(
        math.dist(balls[i].velocity, map(mul, balls[k].velocity, mirror)) for i, k in mirror_pairs()
    )
    contacts, (left, right) = len(scene.contacts), (balls[i].velocity for i in (-1, -5))
    print(f"   a tight rack of 15 balls, struck head on at 1 m/s: {contacts} contacts, e = 0.95")
    print(f"   the balls at the far corners leave at ({left.x:.6f}, {left.y:.6f}) m/s")
    print(f"   and ({right.x:.6f}, {right.y:.6f}) m/s")
    print(f"   left and right are mirror images to {asymmetry:.1e}\n")
    yield from _check("rack", balance)
    if not asymmetry <= DIFFERENCE:
        yield f"rack: left and right differ by {asymmetry:.1e}"


def _strike(stage: Stage, scene: ContactScene, tolerance: float = 0.0) -> tuple[SceneResult, dict[str, Body]]:
    """Resolve a scene and publish its motion; return the answer and the bodies after the impact."""
    result = stage.resolve_scene(scene, STRIKE, tolerance)
    after = {
        name: body.with_twist(twist_of(twist))
        for (name, body), twist in zip(scene.bodies.items(), result.twists, strict=False)
    }
    _play(stage, scene.bodies, after)
    return result, after


def _play(stage: Stage, before: Mapping[str, Body], after: Mapping[str, Body]) -> None:
    """Publish the free motion of bodies before and after the impact."""
    for frame in range(int(SIMULTANEOUS_DURATION * FRAMES) + 1):
        time = frame / FRAMES
        stage.show(time, moved_freely(before if time <= STRIKE else after, time - STRIKE))


RECORDED: tuple[tuple[Chapter, float], ...] = (
    (break_shot, BREAK_DURATION),
    (tumbling_rod, ROD_DURATION),
    (simultaneous_contacts, SIMULTANEOUS_DURATION),
)
"""The chapters that are recorded, with the durations of their scenes [s]."""


def _check(name: str, balance: EnergyBalance) -> Iterator[str]:
    """Print the energy balance of a simulation; yield a message for each error."""
    print(f"   energy at the start {balance.initial:9.6f} J")
    print(f"   lost to restitution {balance.lost_restitution:9.6f} J")
    print(f"   lost to friction    {balance.lost_friction:9.6f} J")
    rise = f"rises by {balance.largest_rise:.1e} J" if balance.relative_rise() > DIFFERENCE else "never rises"
    error = f"the balance is correct to {balance.error():.1e}"
    print(f"   energy at the end   {balance.current:9.6f} J   it {rise}; {error}\n")
    if not balance.error() <= DIFFERENCE:
        yield f"{name}: the energy balance has a relative error of {balance.error():.1e}"
    if not balance.relative_rise() <= DIFFERENCE:
        yield f"{name}: the energy rises by {balance.largest_rise:.1e} J"
