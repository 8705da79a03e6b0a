"""The server of the node's services: takes requests as they arrive, and answers the clients in turns.

Taking turns keeps a client with many requests, or with a long one, from holding up the others. Requests of a
client that has left are dropped, and an answer that cannot be sent does not affect the other clients.
"""

from __future__ import annotations

import time
import traceback
import warnings
from collections import Counter
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from functools import cached_property, partial
from typing import Any, NamedTuple, Protocol

from rclpy.callback_groups import MutuallyExclusiveCallbackGroup
from rclpy.node import Node
from rclpy.qos import HistoryPolicy, QoSProfile, ReliabilityPolicy, qos_profile_system_default
from rclpy.service import Service
from rclpy.service_introspection import ServiceIntrospectionState

from ..status import ImpactError, StatusCode
from .clients import ConnectedClients, client_id
from .diagnostics import Counters
from .parameters import LatestParameters
from .process import create_steady_timer
from .round_robin import Job, RoundRobin, Steps
from .take_all import MAX_TIME, InvalidHandle, RCLError, TakeAllWaitable, error_in_rclpy
from .throttled_warnings import WARNING_INTERVAL

SERVICE_QOS = QoSProfile(history=HistoryPolicy.KEEP_LAST, depth=8_000, reliability=ReliabilityPolicy.RELIABLE)
"""Requests are taken every few milliseconds, so the depth matters for answers: it is how many may wait for a
client that has stopped reading. With KEEP_ALL such answers would fill the history, and no client could be
answered any more. When the slowest client leaves, Fast DDS drops the answers it has kept for it, which blocks
all others for a time that grows as the square of their number."""

UPKEEP_INTERVAL = 0.2
"""Time [s] between two searches for clients that have left, and for work that is left after sending."""

MAX_DISCOVERY_TIME = 2.0
"""Longest time [s] to wait until the client that sent a request is discovered."""

TRY_INTERVAL = 1.0
"""Time [s] between two tries to answer clients that are not discovered, if one has failed: each failure costs
all others a tenth of a second."""

MAX_TIME_TO_TRY = 10.0
"""Longest time [s] to wait for such a try after ``MAX_DISCOVERY_TIME``."""

WAIT_CHECK_INTERVAL = 0.01
"""Time [s] between two searches for requests that have waited for a state until their deadline."""

SERVING_TIME_OF_DRAIN = 0.1
"""Time [s] of serving between two looks for new requests at the end. On a busy machine, taking all of a burst
first would leave no time to answer it."""

LEAST_MEASURED_TIME = 0.5
"""Time of serving [s] before which its share of computing is not judged: a single send may be blocked."""

QUIET_TIME = 0.1
"""If no request arrives for this time [s], none is under way any more."""

MAX_UNCONFIRMED_CLIENTS = 10_000
"""Number of clients whose unconfirmed answers are counted."""

DELIVERY_TIME = 0.5
"""Time [s] to let DDS deliver the last answers: it drops them when the service is destroyed."""

MAX_SERVING_TIME = 0.01
"""Time [s] of serving after which the executor may run the node's other callbacks."""

AT_SHUTDOWN = ImpactError(
    StatusCode.SHUTTING_DOWN, "node", "is shutting down: ask again when it is back, or ask another node"
)
"""The refusal of requests for which there is no time at the end."""


class NodeService(Protocol):
    """One of the services of the node, with its type and its name, not yet resolved."""

    interface: Any
    name: str
    has_budget: bool
    """Whether the parameter ``budget.time`` limits the requests."""

    def answer(self, request: Any) -> Steps[tuple[StatusCode, Any]]:
        """Compute the response to a request, with its status code, or raise an :class:`ImpactError`."""

    def refusal(self, request: Any, error: ImpactError) -> Any:
        """Return the response that says why there is no answer."""


@dataclass(frozen=True)
class Endpoint:
    """A service of the node: what answers it, what rclpy knows of it, and its clients."""

    node_service: NodeService
    service: Service[Any, Any]
    clients: ConnectedClients

    def refusal(self, request: Any, error: ImpactError) -> Any:
        """Return the response that says why there is no answer: at shutdown the same for all requests."""
        if error is AT_SHUTDOWN:
            return self._refusal_at_shutdown
        return self.node_service.refusal(request, error)

    @cached_property
    def _refusal_at_shutdown(self) -> Any:
        """Made, published and recorded once: there may be thousands, and little time."""
        return self.node_service.refusal(self.node_service.interface.Request(), AT_SHUTDOWN)


class Call(NamedTuple):
    """A request, with the header that identifies it to DDS, and when it was received [s]."""

    endpoint: Endpoint
    client: bytes
    request: Any
    header: Any
    received: float


class Server:
    """Serves the services of a node, with one round robin for all their clients.

    ``after_sending`` is called after each response and a few times a second, for work that no client should
    wait for. ``introspection`` says what to publish of each call.
    """

    def __init__(
        self,
        node: Node,
        node_services: tuple[NodeService, ...],
        counters: Counters,
        parameters: LatestParameters,
        after_sending: Callable[[], None],
        introspection: ServiceIntrospectionState,
    ) -> None:
        self._node = node
        self._log = node.get_logger()
        self._counters = counters
        self._parameters = parameters
        self._after_sending = after_sending
        self._jobs = RoundRobin(self._over_budget, self._wake)
        self._unconfirmed: Counter[bytes] = Counter()
        self._next_try = 0.0  # time [s] of the next try to answer a client that is not discovered
        self._endpoints: dict[str, Endpoint] = {}
        self._waitables: list[TakeAllWaitable] = []
        self._more = node.create_guard_condition(self._serve)
        self._overdue_timer = create_steady_timer(node, WAIT_CHECK_INTERVAL, self._serve_overdue)
        self._overdue_timer.cancel()
        create_steady_timer(node, UPKEEP_INTERVAL, self._upkeep)
        for node_service in node_services:
            service = node.create_service(
                node_service.interface,
                node_service.name,
                partial(self._receive, node_service.name),
                qos_profile=SERVICE_QOS,
                callback_group=MutuallyExclusiveCallbackGroup(),
            )
            service.configure_introspection(node.get_clock(), qos_profile_system_default, introspection)
            clients = ConnectedClients(node, service.service_name)
            self._endpoints[node_service.name] = Endpoint(node_service, service, clients)
            self._waitables.append(TakeAllWaitable(node, service, self._serve, self._count_unreadable))
        self._unshared = {endpoint.service.service_name for endpoint in self._endpoints.values()}

    def waiting(self) -> int:
        """Number of requests that are not answered yet."""
        return len(self._jobs)

    def states_arrived(self) -> None:
        """Go on with the requests that wait for states."""
        if self._jobs.is_waiting:
            self._jobs.resume()
            self._serve()

    def states_taken(self) -> None:
        """Go on with the requests that wait for states, after the present one, which has taken some."""
        self._jobs.resume_after_slice()

    def drain(self, limit: float, reserve: float) -> int:
        """Answer all requests that have arrived, and those that arrive meanwhile; then refuse the rest.

        This takes at most ``limit`` [s]. Refusals begin when only ``reserve`` [s] is left to compute: earlier
        on a machine that is busy with other work. Return how many requests are left without an answer.
        """
        answers_before, unread = self._counters.answers.total(), 0
        start = time.perf_counter()
        end = start + limit
        with suppress(InvalidHandle):  # of a node that is destroyed, as after its context was shut down
            self._serve_until(end, reserve)
            self._jobs.refuse_all(AT_SHUTDOWN, end)
            while self._refuse_unread(start, end):
                pass
            for waitable in self._waitables:
                unread += sum(1 for _ in waitable.take_unread(time.perf_counter() + MAX_TIME))
            if self._counters.answers.total() > answers_before:
                time.sleep(min(DELIVERY_TIME, 0.2 * limit))
        return len(self._jobs) + unread

    def _serve_until(self, end: float, reserve: float) -> None:
        """Answer requests until no more arrive, or only ``reserve`` [s] is left to compute before ``end``."""
        clock, computing_time = time.perf_counter, time.thread_time
        spent, computed, last_arrival = 0.0, 0.0, clock()
        while self._jobs or clock() - last_arrival < QUIET_TIME:
            share = computed / spent if spent > LEAST_MEASURED_TIME else 1.0
            if (end - clock()) * share < reserve:
                return
            turn, computed_before = clock(), computing_time()
            if self._take_requests():
                last_arrival = clock()
            self._jobs.resume(overdue_only=True)
            end_of_turn = min(end, clock() + SERVING_TIME_OF_DRAIN)
            while self._jobs.is_ready and clock() < end_of_turn:
                self._jobs.run_slice()
            spent, computed = spent + clock() - turn, computed + computing_time() - computed_before
            if not self._jobs.is_ready:
                time.sleep(WAIT_CHECK_INTERVAL)

    def _refuse_unread(self, start: float, end: float) -> int:
        """Refuse the requests that wait, until a time [s], and return how many there were.

        They are not read: that would take longer than the refusal. ``start`` is when the shutdown began [s].
        """
        number = 0
        for endpoint, waitable in zip(self._endpoints.values(), self._waitables, strict=True):
            for header in waitable.take_unread(end):
                number += 1
                self._counters.requests += 1
                self._refuse(Call(endpoint, client_id(header), None, header, start), AT_SHUTDOWN)
        return number

    def _take_requests(self) -> int:
        """Take the requests that wait, for a limited time, and return how many there were."""
        return sum(waitable.take_all() for waitable in self._waitables)

    def _receive(self, name: str, request: Any, header: Any) -> None:
        client = client_id(header)
        self._unconfirmed.pop(client, None)  # the request is a sign of life
        self._counters.requests += 1
        call = Call(self._endpoints[name], client, request, header, time.perf_counter())
        has_budget = call.endpoint.node_service.has_budget
        self._jobs.add(client, Job(self._steps(call), partial(self._refuse, call), has_budget))

    def _steps(self, call: Call) -> Steps[None]:
        """Answer a request, unless its client has left.

        No exception but ``InvalidHandle`` may leave this method: it would end ``spin()``.
        """
        clients, client = call.endpoint.clients, call.client
        deadline = call.received + MAX_DISCOVERY_TIME
        while not clients.is_connected(client):
            now = time.perf_counter()
            try_at = min(max(deadline, self._next_try), deadline + MAX_TIME_TO_TRY)
            if now >= try_at:
                break
            yield min(try_at, now + WAIT_CHECK_INTERVAL) if now < deadline else try_at
        if self._is_dropped(call):
            return
        try:
            status, response = yield from call.endpoint.node_service.answer(call.request)
            self._send(call, status, response)
        except InvalidHandle:  # of a node that another thread destroys meanwhile
            raise
        except Exception as error:
            self._refuse(call, self._as_refusal(error))

    def _is_dropped(self, call: Call) -> bool:
        """Whether a request is dropped, because its client has left.

        A client that is not discovered seems to have left, too, if another such client could not be reached
        just now.
        """
        clients = call.endpoint.clients
        has_left = clients.has_left(call.client, call.received) or (
            time.perf_counter() < self._next_try and not clients.is_connected(call.client)
        )
        self._counters.dropped += has_left
        return has_left

    def _refuse(self, call: Call, error: ImpactError) -> None:
        if self._is_dropped(call):
            return
        if error.code is StatusCode.BUDGET_EXCEEDED:
            self._log.warning(f"a request was refused: {error}", throttle_duration_sec=WARNING_INTERVAL)
        self._send(call, error.code, call.endpoint.refusal(call.request, error))

    def _as_refusal(self, error: Exception) -> ImpactError:
        if isinstance(error, ImpactError):
            return error
        if isinstance(error, MemoryError):
            reason = "needs more memory than the parameter memory_limit allows"
            return ImpactError(StatusCode.BUDGET_EXCEEDED, "request", reason)
        self._log.error(traceback.format_exc(), throttle_duration_sec=WARNING_INTERVAL)
        return ImpactError(StatusCode.INTERNAL_ERROR, type(error).__name__, str(error))

    def _over_budget(self, spent: float) -> ImpactError | None:
        limit = self._parameters.values.budget_time
        if not limit or spent <= limit:
            return None
        reason = (
            f"was stopped after {spent:.3g} s of computing; budget.time is {limit:g} s: send fewer contacts"
        )
        return ImpactError(StatusCode.BUDGET_EXCEEDED, "request", reason)

    def _serve(self) -> None:
        """Serve clients for ``MAX_SERVING_TIME``, and have the executor call this again for the rest."""
        end = time.perf_counter() + MAX_SERVING_TIME
        with suppress(InvalidHandle):  # of a node that another thread destroys meanwhile
            try:
                self._jobs.run_slice()
                while self._jobs.is_ready and time.perf_counter() < end:
                    self._take_requests()
                    self._jobs.run_slice()
            finally:  # a KeyboardInterrupt may end this
                if self._jobs.is_ready:
                    self._more.trigger()
            if self._jobs.is_waiting and self._overdue_timer.is_canceled():  # a reset delays a running timer
                self._overdue_timer.reset()

    def _wake(self) -> None:
        """Have the executor call :meth:`_serve`; any thread may call this."""
        with suppress(InvalidHandle):  # of a node that is destroyed meanwhile
            self._more.trigger()

    def _serve_overdue(self) -> None:
        self._jobs.resume(overdue_only=True)
        if not self._jobs.is_waiting:
            self._overdue_timer.cancel()
        self._serve()

    def _send(self, call: Call, status: StatusCode, response: Any) -> None:
        if _try_to_send(call.endpoint.service, response, call.header):
            self._note_sent(call, status)
        else:
            call.endpoint.clients.note_unreachable(call.client)
            if not call.endpoint.clients.is_connected(call.client):
                self._next_try = time.perf_counter() + TRY_INTERVAL
            self._counters.unsent += 1
            self._log.warning(
                "an answer could not be sent: its client does not read answers, or has left",
                throttle_duration_sec=WARNING_INTERVAL,
            )
        self._work_after_sending()

    def _work_after_sending(self) -> None:
        try:
            self._after_sending()
        except InvalidHandle:  # of a node that another thread destroys meanwhile
            raise
        except Exception:  # the answer is sent, so there is nobody else to tell
            if self._node.context.ok():
                self._log.error(traceback.format_exc(), throttle_duration_sec=WARNING_INTERVAL)

    def _note_sent(self, call: Call, status: StatusCode) -> None:
        call.endpoint.clients.note_reached(call.client)
        self._unconfirmed[call.client] += 1
        if len(self._unconfirmed) > MAX_UNCONFIRMED_CLIENTS:  # the departure of some clients goes unnoticed
            del self._unconfirmed[next(iter(self._unconfirmed))]
        self._counters.answers[status] += 1
        self._counters.latencies.append(time.perf_counter() - call.received)

    def _upkeep(self) -> None:
        self._forget_departed()
        self._warn_of_other_servers()
        self._work_after_sending()

    def _warn_of_other_servers(self) -> None:
        """Warn once about each service that another node serves, too."""
        for name in [name for name in self._unshared if self._node.count_services(name) > 1]:
            self._unshared.remove(name)
            self._log.warning(
                f"another node serves {name}, too, or was killed a moment ago: clients take the first answer"
            )

    def _forget_departed(self) -> None:
        for endpoint in self._endpoints.values():
            for client in endpoint.clients.take_departed():
                dropped, unconfirmed = self._jobs.drop(client), self._unconfirmed.pop(client, 0)
                at_risk = unconfirmed if unconfirmed > 1 else 0  # no client confirms its last answer
                self._counters.dropped += dropped
                self._counters.at_risk += at_risk
                if dropped or at_risk:
                    self._log.warning(
                        f"a client has left, or was silent for too long: {dropped} of its requests were "
                        f"dropped, and it is not known whether it received {at_risk} answers",
                        throttle_duration_sec=WARNING_INTERVAL,
                    )

    def _count_unreadable(self, error: Exception) -> None:
        self._counters.unreadable += 1
        self._log.warning(f"a request could not be read: {error!r}", throttle_duration_sec=WARNING_INTERVAL)


def _try_to_send(service: Service[Any, Any], response: Any, header: Any) -> bool:
    """Send a response; return whether the middleware accepted it in time (if not, rclpy may only warn)."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        try:
            service.send_response(response, header)
        except RCLError:
            return False
        except RuntimeError as error:  # what rosidl raises if an array of a message cannot be allocated
            raise (MemoryError if str(error).startswith("unable to create") else error) from None
        except SystemError as error:
            raise error_in_rclpy(error) from None
    return not caught
