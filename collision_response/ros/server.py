"""The services of the node: requests are noted as they arrive, and answered in turns.

So nobody waits for all that another client has asked for, or for one long request; a client that has left
is not waited for; and an answer that cannot be sent harms nobody.
"""

from __future__ import annotations

import time
import traceback
import warnings
from collections import Counter
from collections.abc import Callable, Generator
from functools import partial
from typing import Any, NamedTuple, Protocol

from rclpy.node import Node
from rclpy.qos import HistoryPolicy, QoSProfile, ReliabilityPolicy, qos_profile_system_default
from rclpy.service import Service
from rclpy.service_introspection import ServiceIntrospectionState

from ..status import ImpactError, StatusCode
from .clients import Presence, client_of
from .intake import Intake, OutOfReach, RCLError, by_the_intake
from .tally import Tally
from .turns import Job, Parts, Turns

SERVICE_QOS = QoSProfile(history=HistoryPolicy.KEEP_LAST, depth=8_000, reliability=ReliabilityPolicy.RELIABLE)
"""All that arrives is taken every few milliseconds, so the depth is what a client that has stopped reading
may have waiting. With KEEP_ALL its answers would fill the history, and nobody's could be sent any more. When
the slowest client goes, Fast DDS drops what it has kept for it, and holds all others for a time that grows as
the square of that."""

POLL = 0.2
"""How often [s] clients are looked for that have left."""

DISCOVERY = 2.0
"""Longest wait [s] for a client to be discovered, after it has sent a request."""

PATIENCE = 0.01
"""How often [s] it is looked whether a request has waited long enough for a state."""

QUIET = 0.1
"""Time [s] without a request after which none is on its way any more."""

THROTTLE = 5.0
"""The same warning is logged no more often than this [s]."""

MOST_UNCONFIRMED = 10_000
"""Clients of which it is remembered how many answers they have not confirmed."""

LINGER = 0.5
"""Time [s] for DDS to hand over the last answers, which it forgets with the interfaces."""

CYCLE = 0.01
"""Time [s] of serving after which the node sees to its other business."""

Work = Generator[float | None, None, Any]
"""The work for a request: yields as :data:`Parts`, returns the response, raises :class:`ImpactError`."""


class Kind(Protocol):
    """A service of the node.

    Attributes:
        interface: its type.
        name: its name.
    """

    interface: Any
    name: str

    def answer(self, request: Any) -> Work:
        """The work for a request."""

    def refusal(self, request: Any, error: ImpactError) -> Any:
        """The response that says why there is no answer."""

    def code(self, response: Any) -> StatusCode:
        """How the request ended."""


class Call(NamedTuple):
    """One request to a service.

    Attributes:
        kind, service: that was asked.
        presence: of the clients of that service.
        client, header: who asked, and what DDS knows of it.
        taken: when [s], by ``time.perf_counter``.
    """

    kind: Kind
    service: Service[Any, Any]
    presence: Presence
    client: bytes
    header: Any
    taken: float


class Server:
    """Several services, with one order of turns.

    Args:
        node: that offers them.
        kinds: of services.
        tally: counts what happens.
        over_budget: given the computing time [s] of a request: the error to end it with, or ``None``.
        introspection: what of each call is published.
    """

    def __init__(
        self,
        node: Node,
        kinds: tuple[Kind, ...],
        tally: Tally,
        over_budget: Callable[[float], ImpactError | None],
        introspection: ServiceIntrospectionState,
    ) -> None:
        self._log = node.get_logger()
        self._tally = tally
        self._turns = Turns(over_budget)
        self._unconfirmed: Counter[bytes] = Counter()
        self._presences: list[Presence] = []
        self._intakes: list[Intake] = []
        self._more = node.create_guard_condition(self._work)
        self._patience = node.create_timer(PATIENCE, self._wake_late)
        self._patience.cancel()
        node.create_timer(POLL, self._forget_departed)
        group = OutOfReach()
        for kind in kinds:
            service = node.create_service(
                kind.interface, kind.name, by_the_intake, qos_profile=SERVICE_QOS, callback_group=group
            )
            if introspection is not ServiceIntrospectionState.OFF:
                service.configure_introspection(node.get_clock(), qos_profile_system_default, introspection)
            presence = Presence(node, service.service_name)
            note = partial(self._note, kind, service, presence)
            self._presences.append(presence)
            self._intakes.append(Intake(node, service, note, self._work, self._cannot_read))

    def waiting(self) -> int:
        """How many requests are not answered yet."""
        return len(self._turns)

    def wake(self) -> None:
        """States have arrived: requests that wait for them may go on."""
        if self._turns.is_waiting:
            self._turns.wake(all_of_them=True)
            self._work()

    def drain(self, answering: float, refusing: float) -> int:
        """Answer what has been received, and what arrives meanwhile; how many are left without an answer.

        Args:
            answering: the time [s] in which requests are answered.
            refusing: that in which those that are left are then refused, however late that begins.
        """
        clock, answers = time.perf_counter, self._tally.answers.total()
        start = last = clock()
        while clock() - start < answering and (self._turns or clock() - last < QUIET):
            if sum(intake.take_all() for intake in self._intakes):
                last = clock()
            self._turns.wake(all_of_them=False)
            if not self._turns.is_ready:
                time.sleep(PATIENCE)
            self._turns.work()
        reason = "is shutting down: ask again when it is back, or another node"
        left = self._turns.end(ImpactError(StatusCode.SHUTTING_DOWN, "node", reason), clock() + refusing)
        if self._tally.answers.total() > answers:
            time.sleep(min(LINGER, refusing))
        return left

    def _note(
        self, kind: Kind, service: Service[Any, Any], presence: Presence, request: Any, header: Any
    ) -> None:
        client = client_of(header)
        self._unconfirmed.pop(client, None)  # it is alive
        self._tally.requests += 1
        call = Call(kind, service, presence, client, header, time.perf_counter())

        def refuse(error: ImpactError) -> None:
            self._send(call, kind.refusal(request, error))

        self._turns.add(client, Job(self._parts(call, request), refuse))

    def _parts(self, call: Call, request: Any) -> Parts:
        """Answer a client that is still there. No exception may leave this: it would end ``spin()``."""
        kind, presence, client, taken = call.kind, call.presence, call.client, call.taken
        until = taken + DISCOVERY
        while not presence.is_there(client) and time.perf_counter() < until:
            yield min(until, time.perf_counter() + PATIENCE)
        if presence.has_left(client, taken):
            self._tally.dropped += 1
            return
        try:
            response = yield from kind.answer(request)
        except ImpactError as error:
            response = kind.refusal(request, error)
        except MemoryError:
            reason = "needs more memory than the parameter memory_limit allows"
            response = kind.refusal(request, ImpactError(StatusCode.BUDGET_EXCEEDED, "request", reason))
        except Exception as error:
            self._log.error(traceback.format_exc(), throttle_duration_sec=THROTTLE)
            fault = ImpactError(StatusCode.INTERNAL_ERROR, type(error).__name__, str(error))
            response = kind.refusal(request, fault)
        self._send(call, response)

    def _work(self) -> None:
        """Serve for a while, then leave the rest for later."""
        end = time.perf_counter() + CYCLE
        while self._turns.is_ready and time.perf_counter() < end:
            self._turns.work()
            for intake in self._intakes:
                intake.take_all()
        if self._turns.is_ready:
            self._more.trigger()
        if self._turns.is_waiting and self._patience.is_canceled():  # a reset puts off a timer that runs
            self._patience.reset()

    def _wake_late(self) -> None:
        self._turns.wake(all_of_them=False)
        if not self._turns.is_waiting:
            self._patience.cancel()
        self._work()

    def _send(self, call: Call, response: Any) -> None:
        if not _sent(call.service, response, call.header):
            call.presence.missed(call.client)
            self._tally.unsent += 1
            self._log.warning(
                "an answer could not be sent: its client does not take any, or has left",
                throttle_duration_sec=THROTTLE,
            )
            return
        call.presence.reached(call.client)
        self._unconfirmed[call.client] += 1
        if len(self._unconfirmed) > MOST_UNCONFIRMED:  # nobody says of all of them that they have left
            del self._unconfirmed[next(iter(self._unconfirmed))]
        self._tally.answers[call.kind.code(response)] += 1
        self._tally.latencies.append(time.perf_counter() - call.taken)

    def _forget_departed(self) -> None:
        for presence in self._presences:
            for client in presence.departed():
                dropped, at_risk = self._turns.drop(client), self._unconfirmed.pop(client, 0)
                self._tally.dropped += dropped
                self._tally.at_risk += at_risk
                if dropped or at_risk > 1:  # nobody who has what he asked for confirms it
                    self._log.warning(
                        f"a client has left, or was silent for too long: {dropped} of its requests were "
                        f"dropped, and of {at_risk} answers it is not known whether they arrived",
                        throttle_duration_sec=THROTTLE,
                    )

    def _cannot_read(self, error: Exception) -> None:
        self._tally.unreadable += 1
        self._log.warning(f"a request could not be read: {error}", throttle_duration_sec=THROTTLE)


def _sent(service: Service[Any, Any], response: Any, header: Any) -> bool:
    """Send a response, if the middleware takes it; of one that it could not send in time rclpy only warns."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        try:
            service.send_response(response, header)
        except RCLError:
            return False
    return not caught
